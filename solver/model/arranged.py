"""A plant as its loops see it: which input serves which output, and the delay of digital control.

Pairing: loop i controls output i by input p_i, so its plant has the columns in the order p.

Scan time: a controller that runs once every T reads, computes, and writes its output, which then
stands still until the next scan. A sample is T/2 old on average when it acts through the hold,
whose response (1 - exp(-s T))/(s T) is exp(-s T/2) to second order in s T; an output that is
written at the end of the scan comes T later. Together that is a dead time of 3 T/2 (Astrom and
Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, section 3.4, for the hold). It stands in
every element of the plant: the loop, and so stability, mu and the responses to set points, cannot
tell where in the loop a delay is that all loops share.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError
from solver.model.measured import MeasuredPlant
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant
from solver.model.transfer_function import LARGEST, TransferFunction
from solver.model.validation import integers, real

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.plants import Plant

__all__ = ["SCAN_DELAY", "check_pairing", "paired", "sampled"]

SCAN_DELAY = 1.5  # scans between what is read and the middle of what it does


def paired(plant: Plant, pairing: Sequence[int]) -> Plant:
    """Return the plant whose input i is input `pairing[i]` of the given one.

    Parameters
    ----------
    plant : Plant
        Any; at most `MAX_MATRIX_SIZE` units unless the pairing changes nothing.
    pairing : sequence of int
        Input of each output, from 0.

    Raises
    ------
    InvalidInputError
        Not each input once, or too many units.

    """
    order = check_pairing(pairing, plant.n)
    if order == tuple(range(plant.n)):
        return plant
    if isinstance(plant, MeasuredPlant):
        return plant.paired(order)
    if plant.n > MAX_MATRIX_SIZE:
        message = f"other pairings than one's own are for plants of up to {MAX_MATRIX_SIZE} units"
        raise InvalidInputError(message, "/pairing")
    return MatrixPlant([[row[column] for column in order] for row in plant.rows])


def check_pairing(pairing: Sequence[int], n: int) -> tuple[int, ...]:
    """Return a pairing of n loops.

    Raises
    ------
    InvalidInputError
        Not each input from 0 to n - 1 once.

    """
    order = integers(pairing, "/pairing")
    if len(order) != n:
        message = f"{len(order)} inputs paired, the plant has {n}"
        raise InvalidInputError(message, "/pairing")
    for index, unit in enumerate(order):
        if not 0 <= unit < n:
            message = f"the plant has {n} inputs"
            raise InvalidInputError(message, f"/pairing/{index}")
        if unit in order[:index]:
            message = f"this input is paired already, with output {order.index(unit) + 1}"
            raise InvalidInputError(message, f"/pairing/{index}")
    return order


def sampled(plant: Plant, scan_time: float) -> Plant:
    """Return the plant under digital controllers.

    Parameters
    ----------
    plant : Plant
        Any.
    scan_time : float
        Time between two scans, time unit of the plant, >= 0.

    Raises
    ------
    InvalidInputError
        A scan time out of range.

    """
    scan_time = real(scan_time, "/scan_time")
    if not 0 <= scan_time <= LARGEST:
        message = f"the scan time must lie in 0..{LARGEST:g}"
        raise InvalidInputError(message, "/scan_time")
    if scan_time == 0:
        return plant

    if isinstance(plant, MeasuredPlant):
        return plant.delayed(SCAN_DELAY * scan_time)

    def late(element: TransferFunction) -> TransferFunction:
        if element.is_zero:
            return element
        dead_time = element.dead_time + SCAN_DELAY * scan_time
        if dead_time > LARGEST:
            message = f"makes a dead time of more than {LARGEST:g}"
            raise InvalidInputError(message, "/scan_time")
        return TransferFunction(element.num, element.den, dead_time)

    return plant.mapped(late)
