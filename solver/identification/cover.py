"""The smallest weight above given errors at every frequency.

The errors are numbers on a grid; a weight of order m has the squared magnitude B(x)/A(x),
x = omega^2. For a bound t on |w|^2 over the squared error the conditions

    e^2 A <= B <= t e^2 A,   A >= 0,   B >= 0

are linear in the coefficients, so the weight with the least t is found by bisection: the
logarithmic Chebyshev fit from above (as `fitmagfrd` in MATLAB's `ucover`). Stable and minimum phase
by spectral factorisation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linprog

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import TransferFunction
from solver.model.validation import flag, frequencies, integer, real, real_array

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["cover", "cover_by_error", "covers"]

# Errors below this part of the largest one are raised to it: a weight need not follow them down.
FLOOR = 1e-2
MAX_ORDER = 2
ROUNDS = 40
TIGHT = 1e-3  # of t: a thousandth of the weight is no difference to any design
# Corners of the weight ring no more than the grid can see: a damping ratio of 0.1.
DAMPED = 0.98
LOOSE = 4.0  # of the squared ratio
# The weight is raised by so much that rounding cannot put it below an error.
ABOVE = 1e-9


def cover(
    omega: NDArray[np.float64],
    error: NDArray[np.float64],
    order: int,
    *,
    tight_below: float = np.inf,
    hold_first: bool = False,
) -> TransferFunction:
    """Return the weight of given order that is above `error` and least in the worst ratio to it.

    Parameters
    ----------
    omega : (k,) ndarray
        rad per time unit, increasing, > 0.
    error : (k,) ndarray
        Not negative, not all zero. Beyond the grid the weight goes on as it likes; a grid to both
        plateaus leaves nothing beyond.
    order : int
        0, 1 or 2.
    tight_below : float
        Where the error is larger, the ratio may be `LOOSE` to the power of 1/2 times as large.
    hold_first : bool
        Whether the weight has the error itself at the first frequency: at steady state it decides
        whether there may be integral action.

    Raises
    ------
    InvalidInputError
        No error at all, one that is negative or not finite, frequencies that do not increase.

    """
    omega, error = _curve(omega, error)
    order = integer(order, "/order")
    if not 0 <= order <= MAX_ORDER:
        message = f"must lie in 0..{MAX_ORDER}"
        raise InvalidInputError(message, "/order")
    tight_below, hold_first = real(tight_below, "/tight_below"), flag(hold_first, "/hold_first")
    if not tight_below > 0:
        message = "must be positive"
        raise InvalidInputError(message, "/tight_below")
    raised = np.maximum(error, FLOOR * min(float(np.max(error)), tight_below))
    if order == 0:
        return TransferFunction((float(np.max(raised)) * (1 + ABOVE),), (1.0,))
    centre = float(np.sqrt(omega[0] * omega[-1]))
    x = (omega / centre) ** 2
    low, high = 1.0, float(np.max(raised) / np.min(raised)) ** 2 * (1 + TIGHT)
    slack = np.where(raised <= max(tight_below, float(np.min(raised))), 1.0, LOOSE)
    if hold_first:
        slack[0] = 0.0
    best: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    for _ in range(ROUNDS):
        middle = float(np.sqrt(low * high)) if best is not None else high
        found = _coefficients(x, raised**2, middle, order=order, slack=slack, before=best)
        if found is None:
            low = middle
            if best is None:
                break
        else:
            best, high = found, middle
        if high / low < 1 + TIGHT:
            break
    if best is None:
        return cover(omega, error, 0)
    B, A = best
    num, den = _factor(B), _factor(A)
    weight = _scaled(num, den, centre, 1.0)
    lift = float(np.max(error / np.abs(weight.response(omega)))) * (1 + ABOVE)
    return _scaled(num, den, centre, lift)


def cover_by_error(
    omega: NDArray[np.float64], error: NDArray[np.float64]
) -> tuple[float, float] | None:
    """Return the smallest (epsilon, theta) whose weight is above `error`, or None.

    w = (theta s + epsilon)/(theta/2 s + 1) ends at 2, so larger errors have no such cover. Among
    the pairs that cover, the one with the least mean of log |w| over the grid.

    Parameters
    ----------
    omega, error : (k,) ndarray
        As for `cover`.

    Raises
    ------
    InvalidInputError
        As for `cover`.

    """
    omega, error = _curve(omega, error)
    largest = float(np.max(error))
    if not 0 < largest < 2:
        return None
    best = None
    low = max(float(error[0]), FLOOR * largest)
    for epsilon in np.geomspace(low, max(largest, low * (1 + 1e-9)), 60) * (1 + ABOVE):
        # |w| >= e: (theta omega)^2 (1 - e^2/4) >= e^2 - epsilon^2.
        needed = np.maximum(error**2 - epsilon**2, 0.0) / (1 - error**2 / 4) / omega**2
        theta = float(np.sqrt(np.max(needed))) * (1 + ABOVE)
        size = (theta**2 * omega**2 + epsilon**2) / (theta**2 * omega**2 / 4 + 1)
        score = float(np.mean(np.log(size)))
        if best is None or score < best[0]:
            best = (score, float(epsilon), theta)
    return None if best is None else (best[1], best[2])


def _curve(
    omega: NDArray[np.float64], error: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    omega, error = frequencies(omega), real_array(error, "/error", ndim=1)
    if not omega.size or np.any(np.diff(omega) <= 0):
        message = "frequencies must increase, and be one at least"
        raise InvalidInputError(message, "/omega")
    if error.size != omega.size:
        message = f"{error.size} errors at {omega.size} frequencies"
        raise InvalidInputError(message, "/error")
    if not (np.all(np.isfinite(error) & (error >= 0)) and np.any(error > 0)):
        message = "the errors must be finite, not negative and not all zero"
        raise InvalidInputError(message, "/error")
    return omega, error


def covers(
    weight: TransferFunction, omega: NDArray[np.float64], error: NDArray[np.float64]
) -> bool:
    """Whether |weight| is nowhere below the error."""
    return bool(np.all(np.abs(weight.response(omega)) >= error))


def _coefficients(
    x: NDArray[np.float64],
    squared: NDArray[np.float64],
    ratio: float,
    *,
    order: int,
    slack: NDArray[np.float64],
    before: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return B and A, constant first, with A(0) = 1, or None."""
    powers = x[:, None] ** np.arange(order + 1)
    # Rows are scaled to the size of A there as far as it is known, columns are of the powers of a
    # centred frequency: what the solver tolerates is then a part of the weight everywhere.
    size = (powers.sum(axis=1) if before is None else powers @ before[1])[:, None]
    P = powers / size
    e = squared[:, None]
    above = np.hstack([-P / e, P])  # e^2 A - B <= 0
    most = np.maximum(ratio * slack, 1 + TIGHT)[:, None]
    below = np.hstack([P / (most * e), -P])  # B - t e^2 A <= 0
    rows = np.vstack([above, below])
    # A and B are positive on the grid as it stands; the first and last coefficient everywhere.
    middle = [(None, None)] * (order - 1)
    bounds = [(0.0, None), *middle, (0.0, None)] * 2
    rows_eq = np.zeros((1, 2 * (order + 1)))
    rows_eq[0, order + 1 :] = 1.0
    found = linprog(
        np.zeros(rows.shape[1]), A_ub=rows, b_ub=np.zeros(len(rows)), A_eq=rows_eq, b_eq=[1.0],
        bounds=bounds, method="highs", options={"primal_feasibility_tolerance": 1e-10},
    )  # fmt: skip
    if not found.success:
        return None
    solution = np.asarray(found.x)
    B, A = solution[: order + 1], solution[order + 1 :]
    # A pole at infinity or at zero is no stable, proper weight; the first and last must be there.
    for values in (A, B):
        values[[0, -1]] = np.maximum(values[[0, -1]], 1e-12 * float(values.max()))
    # A dip between two grid points would be a resonance that no error asks for.
    for values in (A, B):
        if order > 1 and values[1] < -2 * DAMPED * np.sqrt(values[0] * values[2]):
            return None
    return B, A


def _factor(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return p, highest power first, with |p(j omega)|^2 = coefficients(omega^2), roots left."""
    roots = np.sqrt(np.roots(coefficients[::-1] * (-1.0) ** np.arange(len(coefficients))[::-1])
                    .astype(complex))  # fmt: skip
    left = np.where(roots.real > 0, -roots, roots)
    return np.asarray(np.sqrt(coefficients[-1]) * np.real(np.poly(left)))


def _scaled(
    num: NDArray[np.float64], den: NDArray[np.float64], centre: float, lift: float
) -> TransferFunction:
    powers = centre ** -np.arange(len(den) - 1.0, -1, -1)
    below = den * powers
    return TransferFunction(
        [float(v) for v in lift * num * powers / below[-1]], [float(v) for v in below / below[-1]]
    )
