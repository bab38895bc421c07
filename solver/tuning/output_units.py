"""Whether the demand on a matrix plant hangs on the units of its outputs.

sigma_max(w_P S) < 1 compares errors of all outputs as they come: one output in hundredths of its
unit counts a hundredfold. What does not depend on the units of inputs is how much more one output
moves than another under the same input.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import corners_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.plants import Plant
    from solver.model.weights import Performance

__all__ = ["UNLIKE", "output_units_warning", "relative_output_sizes"]

UNLIKE = 10.0  # ratio of sizes from which two outputs are hardly meant to be alike


def relative_output_sizes(plant: Plant) -> NDArray[np.float64]:
    """Return how far each output moves, as a geometric mean over the inputs, (n,).

    At the middle of the plant's corner frequencies, so that integrators do not matter; only the
    ratios mean anything. An output that no input shared with others moves has nan.
    """
    bends = corners_of(plant.elements)
    omega = np.array([np.sqrt(bends[0] * bends[-1])])
    gain = np.abs(plant.response(omega)[0])
    with np.errstate(divide="ignore"):
        logs = np.log(gain)
    n = plant.n
    # Least squares of log |g_rc| = row + column over the elements that are not zero: the ratio of
    # two rows is then free of the inputs' units.
    rows, columns = np.nonzero(gain)
    equations = np.zeros((rows.size, 2 * n))
    equations[np.arange(rows.size), rows] = 1
    equations[np.arange(rows.size), n + columns] = 1
    solution = np.linalg.lstsq(equations, logs[rows, columns], rcond=None)[0]
    linked = _linked(gain > 0)
    sizes = np.where(linked, solution[:n], np.nan)
    return np.asarray(np.exp(sizes - np.nanmin(sizes)), dtype=np.float64)


def output_units_warning(plant: Plant, performance: Performance) -> str | None:
    """Return a warning where the outputs of a matrix plant are hardly comparable; else None.

    None too where the demand tells the permitted errors of the outputs.
    """
    # Units alike have outputs alike.
    if plant.interchangeable or performance.output_scale is not None:
        return None
    sizes = relative_output_sizes(plant)
    ratio = float(np.nanmax(sizes) / np.nanmin(sizes))
    if not ratio > UNLIKE * (1 + 1e-9):  # rounding of the least squares
        return None
    largest, smallest = int(np.nanargmax(sizes)) + 1, int(np.nanargmin(sizes)) + 1
    return (
        f"The demand compares outputs as they come, and output {largest} moves {ratio:.3g} times "
        f"as far as output {smallest}: tau_p depends on their units. Give the error that each "
        "output may have as output_scale."
    )


def _linked(present: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which outputs share inputs, at any remove, with the first of the largest such set."""
    n = len(present)
    reach = np.eye(n, dtype=bool) | (present.astype(int) @ present.T.astype(int) > 0)
    for _ in range(n):
        reach = reach.astype(int) @ reach.astype(int) > 0
    return np.asarray(reach[int(np.argmax(reach.sum(axis=1)))])
