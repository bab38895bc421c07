"""The overshoot of a single loop without dead time, from the poles of the closed loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.transfer_function import TransferFunction

__all__ = ["exact_overshoot"]

LOG_TIMES, TIMES = 400, 400  # in equal ratios over `SPAN`, and in equal steps
SPAN = 1e-8  # of the longest time: no set-point step is over sooner
ROUNDS, SECTIONS = 3, 16  # of the look for the highest point between the samples
ROUNDING = 1e-7  # of 1, by which the sum of all modes may miss the response at time 0


def exact_overshoot(process: TransferFunction, loop: Controller, longest: float) -> float | None:
    """Return by how much y exceeds a set-point step of 1 by the time `longest`.

    Parameters
    ----------
    process : TransferFunction
        Stable under the loop or not.
    loop : Controller
        Its controller, of the error.
    longest : float
        Time unit of the process.

    Returns
    -------
    float or None
        0 where y does not exceed it. None where the process has dead time, where modes are so
        nearly equal that their sum loses its digits, or where it exceeds all numbers.

    """
    if process.dead_time:
        return None
    above, below = loop.polynomials
    num = np.polymul(process.num, above)
    den = np.polyadd(np.polymul(process.den, below), num)
    poles = np.roots(den)
    slope = np.polyder(den)
    with np.errstate(all="ignore"):  # what is no number is none below
        poles = poles - np.polyval(den, poles) / np.polyval(slope, poles)
        # y = T(0) + sum of N(p)/(p A'(p)) e^(p t) over the poles p of T = N/A.
        shares = np.polyval(num, poles) / (poles * np.polyval(slope, poles))
        rest = num[-1] / den[-1]
        at_once = num[0] / den[0] if num.size == den.size else 0.0
        missed = abs(rest + shares.sum() - at_once)
    if not missed <= ROUNDING or not np.abs(shares).max(initial=0.0) * np.finfo(float).eps < (
        ROUNDING
    ):
        return None

    def response(time: NDArray[np.float64]) -> NDArray[np.float64]:
        with np.errstate(all="ignore"):  # of an unstable loop
            return np.asarray(rest + (np.exp(time[:, None] * poles) @ shares).real)

    time = np.unique(
        np.concatenate(
            [[0.0], longest * np.geomspace(SPAN, 1, LOG_TIMES), np.linspace(0, longest, TIMES)]
        )
    )
    y = response(time)
    for _ in range(ROUNDS):
        top = int(y.argmax())
        low, high = time[max(top - 1, 0)], time[min(top + 1, time.size - 1)]
        time = np.linspace(low, high, SECTIONS + 1)
        y = response(time)
    highest = float(y.max())
    return max(0.0, highest - 1) if np.isfinite(highest) else None
