"""What a fitted plant makes of records, those of the fit and those kept back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.job import Job
    from solver.identification.row_fit import RowFit

__all__ = ["Prediction", "predictions"]


@dataclass(frozen=True, eq=False)
class Prediction:
    """One output of one record against the plant.

    Attributes
    ----------
    record, output : str
        Names.
    kept_back : bool
        Whether the fit has not seen this record.
    normalised_fit : float
        100 (1 - |y - y_hat| / |y - mean y|) per cent, each record with an offset of its own.
    time, measured, predicted : (k,) ndarray
        Readings with their times.
    spikes : int
        Readings left out as spikes.

    """

    record: str
    output: str
    kept_back: bool
    normalised_fit: float
    time: NDArray[np.float64]
    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    spikes: int


def predictions(job: Job, fits: Sequence[RowFit], *, kept_back: bool) -> list[Prediction]:
    """Return each output of each of the job's records against the fits.

    An output that rests through a record is left out: there is nothing to explain.
    """
    outputs = tuple(job.records[0].outputs)
    found = []
    for fresh, fit in zip(job.rows(), fits, strict=True):
        row = fresh if kept_back else fit.row.plain()  # of the fit, without its spikes
        solved = replace(row.solve(fit.solved.kinds, fit.solved.shapes), gains=fit.solved.gains)
        own = row.own_parts(solved)
        for segment, block, part in zip(row.segments, solved.blocks, own, strict=True):
            predicted = block @ solved.gains + part
            seen = segment.weight > 0
            left = (segment.output - predicted)[seen]
            spread = segment.output[seen] - segment.output[seen].mean()
            if not np.ptp(segment.output[seen]) > 0:
                continue
            found.append(
                Prediction(
                    job.records[segment.record].name,
                    outputs[segment.unit],
                    kept_back,
                    100 * (1 - float(np.linalg.norm(left) / np.linalg.norm(spread))),
                    segment.time + job.records[segment.record].time[0],
                    segment.output,
                    predicted,
                    int(np.count_nonzero(~seen)),
                )
            )
    return found
