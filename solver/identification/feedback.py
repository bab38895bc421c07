"""Inputs that answer the outputs: a record made under control.

An input that a controller moves is told by the readings before it beyond what its own past tells
(Granger, Econometrica 37 (1969) 424); the reading of the same instant counts as before, since an
input acts from its sample on. A fit that takes such inputs as given is biased by every disturbance
that the controller answers (Soderstrom and Stoica, System Identification, 1989, chapter 10).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.identification.record import Record

__all__ = ["followed"]

PAST = 4  # samples looked back
# A controller moves its input at nearly every sample; an operator or a test does not.
MOVING = 0.3
# An open-loop staircase or random input is told by no reading; chance tells a hundredth of it.
SHARE = 0.1
CHANCE = 1e-6
MOST = 20_000  # samples used; more tell no more


def followed(record: Record) -> dict[str, float]:
    """Return the inputs that answer the outputs, each with the share of its moves so explained.

    Parameters
    ----------
    record : Record
        Of any sampling; a sample counts for as much time as any other.

    """
    inputs = np.array(list(record.inputs.values()))[:, :MOST]
    outputs = np.array(list(record.outputs.values()))[:, :MOST]
    seen = np.all(record.observed[:, :MOST], axis=0)
    inputs, outputs = inputs[:, seen], outputs[:, seen]
    count = inputs.shape[1]
    if count < 10 * PAST * (len(outputs) + 2):
        return {}
    read = _past(outputs, 0)
    found = {}
    for name, values in zip(record.inputs, inputs, strict=True):
        moved = np.diff(values, prepend=values[0])
        if np.count_nonzero(moved) < MOVING * count:
            continue
        own = np.hstack([np.ones((count - PAST, 1)), _past(moved[None], 1), _past(values[None], 1)])
        target = moved[PAST:]
        alone, together = _left(own, target), _left(np.hstack([own, read]), target)
        freedom = count - PAST - own.shape[1] - read.shape[1]
        if freedom < 1 or not alone > 0:
            continue
        share = 1 - together / alone
        statistic = share / read.shape[1] / max((1 - share) / freedom, 1e-300)
        if share > SHARE and fdtrc(read.shape[1], freedom, statistic) < CHANCE:
            found[name] = share
    return found


def _past(signals: NDArray[np.float64], first: int) -> NDArray[np.float64]:
    """Return each signal at `first`..PAST samples before, (k - PAST, signals x lags)."""
    size = signals.shape[1]
    lags = range(first, PAST + 1)
    table = np.stack([one[PAST - lag : size - lag] for one in signals for lag in lags], axis=1)
    return np.asarray(table - table.mean(axis=0))


def _left(columns: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    size = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(size > 0, size, 1.0)
    share = np.linalg.lstsq(columns, target, rcond=1e-10)[0]
    return float(np.sum((target - columns @ share) ** 2))
