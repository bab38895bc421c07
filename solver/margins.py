"""Stability margins of each loop: alone, and with all other loops closed.

A loop is broken at its controller's output. What it then sees with the others closed is the
scalar  P_kk - P_kr C_r (I + P_rr C_r)^-1 P_rk  (r: the other loops), so the classical margins
hold without approximation: 1 + L_k = det(I + P C) / det(I + P_rr C_r). Crossings and peaks are
refined to rounding error, dead time is exact.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.frequencies import corners, grid, resonances
from solver.peaks import highest
from solver.plants import ParallelPlant
from solver.stability import unstable_poles
from solver.subsystems import interchangeable, subsystem

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.controllers import Controller
    from solver.plants import Plant
    from solver.results import Peak

    Response = Callable[[NDArray[np.float64]], NDArray[np.complex128]]

__all__ = ["LoopMargins", "Margins", "loop_margins", "loop_transfer", "margins"]

BELOW, ABOVE = 1e-6, 1e6  # S and T are at their limits to 1e-11 so far from the bends
NEGLIGIBLE = 1e-3  # |L| below which a phase crossing is no gain margin worth a name
POINTS_A_DECADE = 40
LARGEST_TURN = 0.2  # rad of phase between neighbouring grid points, of L and of 1 + L
MAX_POINTS = 20_000
SECTIONS = 32  # of an interval a round
ROOT_ROUNDS = 4  # to 1e-6 of a grid step; the chord's error there is the square of that
HALF_POWER = 1 / math.sqrt(2)


@dataclass(frozen=True)
class Margins:
    """Margins of one stable loop.

    Attributes
    ----------
    gain_increase, gain_decrease : float
        Factors above and below one on the loop's gain at which it becomes unstable. Infinite
        where no factor up to 1 / `NEGLIGIBLE` does; zero where no decrease does, as in every
        loop that is not conditionally stable.
    phase_margin : float
        Smallest turn of the phase, to either side, that takes the curve to -1, in degrees;
        infinite where |L| never crosses one.
    delay_margin : float
        Smallest additional dead time that makes the loop unstable, in time units.
    sensitivity, complementary_sensitivity : Peak
        Ms, the peak of |1/(1+L)|, and Mt, that of |L/(1+L)|.
    bandwidth : float
        Where |1/(1+L)| first reaches 0.707 from below, rad per time unit; infinite where it
        never does, zero where it starts above.
    crossover : float
        Highest frequency with |L| = 1, or zero.

    """

    gain_increase: float
    gain_decrease: float
    phase_margin: float
    delay_margin: float
    sensitivity: Peak
    complementary_sensitivity: Peak
    bandwidth: float
    crossover: float


@dataclass(frozen=True)
class LoopMargins:
    """Margins of the loops of `units`, which share settings and surroundings.

    `alone`: all other loops open. `together`: all others closed, this one broken at its
    controller's output. None where that arrangement is unstable.
    """

    units: tuple[int, ...]
    alone: Margins | None
    together: Margins | None


def loop_margins(plant: Plant, loops: Sequence[Controller]) -> tuple[LoopMargins, ...]:
    """Return the margins of every loop of a plant, alone and with all loops closed.

    Parameters
    ----------
    plant : Plant
        Open-loop stable, or integrating.
    loops : sequence of Controller
        One a unit. Units of a parallel plant with equal settings are answered once.

    Raises
    ------
    UnsupportedPlantError
        An open-loop unstable plant.

    """
    stable = unstable_poles(plant, loops) == 0
    rows = []
    for units in interchangeable(plant, loops):
        unit = units[0]
        single, controller = subsystem(plant, loops, (unit,))
        alone = None
        if unstable_poles(single, controller) == 0:
            alone = margins(loop_transfer(single, controller, 0), _frequencies(single, controller))
        together = alone
        if plant.n > 1:
            together = None
            if stable:
                together = margins(loop_transfer(plant, loops, unit), _frequencies(plant, loops))
        rows.append(LoopMargins(units, alone, together))
    return tuple(rows)


def loop_transfer(plant: Plant, loops: Sequence[Controller], unit: int) -> Response:
    """Return L of one unit with all other loops closed, as a function of frequencies (k,)."""
    if isinstance(plant, ParallelPlant):
        return _parallel_transfer(plant, loops, unit)
    others = [index for index in range(plant.n) if index != unit]

    def transfer(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        P = plant.response(omega)
        seen = P[:, unit, unit]
        if others:
            C = np.stack([loops[index].response(omega) for index in others], axis=1)
            inner = np.eye(len(others)) + C[:, :, None] * P[:, others][:, :, others]
            column = (C * P[:, others, unit])[:, :, None]
            row = P[:, [unit]][:, :, others]
            seen = seen - (row @ np.linalg.solve(inner, column))[:, 0, 0]
        return loops[unit].response(omega) * seen

    return transfer


def _parallel_transfer(plant: ParallelPlant, loops: Sequence[Controller], unit: int) -> Response:
    """Return the same in closed form, at a cost that grows with the different settings only.

    P = (g - i) I + i 1 1^T, so by the Sherman-Morrison formula the unit sees
    g - i + i / (1 + sum of i c_j / (1 + (g - i) c_j) over the others).
    """
    others = Counter(loop for index, loop in enumerate(loops) if index != unit)

    def transfer(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        interaction = plant.interaction.response(omega)
        difference = plant.process.response(omega) - interaction
        load = np.ones_like(interaction)
        for loop, count in others.items():
            c = loop.response(omega)
            load = load + count * interaction * c / (1 + difference * c)
        return loops[unit].response(omega) * (difference + interaction / load)

    return transfer


def margins(loop: Response, omega: NDArray[np.float64]) -> Margins:
    """Return the margins of a stable loop.

    Parameters
    ----------
    loop : callable
        L(j omega) of frequencies (k,); the closed loop 1/(1 + L) is stable.
    omega : (k,) rad per time unit
        Ascending frequencies, refined where the loop turns quickly. They hold all the dynamics
        of L: its values at the ends stand for those at 0 and infinity.

    """
    omega, L = _refined(loop, omega)
    on_axis, crossings, below = _roots(loop, omega, L, (_sine, _gain, _inverse_sensitivity))
    increase, decrease = _gain_margins(loop(on_axis), L[-1])
    lag = np.mod(np.angle(loop(crossings)) + math.pi, 2 * math.pi)
    phase_margin = delay_margin = math.inf
    if crossings.size:
        phase_margin = math.degrees(float(np.min(np.minimum(lag, 2 * math.pi - lag))))
        delay_margin = float(np.min(lag / crossings))
    if abs(L[-1]) >= 1:
        delay_margin = 0.0  # gain above one at all high frequencies: any dead time is too much

    def sensitivity(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.abs(1 / (1 + loop(at)))

    def complementary(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.abs(1 - 1 / (1 + loop(at)))

    return Margins(
        gain_increase=increase,
        gain_decrease=decrease,
        phase_margin=phase_margin,
        delay_margin=delay_margin,
        sensitivity=highest(sensitivity, omega, np.abs(1 / (1 + L))),
        complementary_sensitivity=highest(complementary, omega, np.abs(1 - 1 / (1 + L))),
        bandwidth=_first(below) if abs(1 + L[0]) * HALF_POWER > 1 else 0.0,
        crossover=float(crossings[-1]) if crossings.size else 0.0,
    )


def _first(roots: NDArray[np.float64]) -> float:
    return float(roots[0]) if roots.size else math.inf


def _gain_margins(values: NDArray[np.complex128], end: complex) -> tuple[float, float]:
    """Factors that take the curve's points on the real axis to -1; `end` is its last point."""
    real = values.real
    # The curve may end on the negative real axis: a biproper loop.
    if abs(end.imag) < 1e-6 * abs(end):
        real = np.append(real, end.real)
    factors = -1 / real[real < -NEGLIGIBLE]
    return (
        float(np.min(factors[factors >= 1], initial=math.inf)),
        float(np.max(factors[factors < 1], initial=0.0)),
    )


def _sine(L: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the sine of the phase; where L is negligible, NaN.

    Dead time makes the curve cross the real axis for ever, but ever nearer to zero.
    """
    return np.where(np.abs(L) > NEGLIGIBLE, L.imag / _size(L), np.nan)


def _gain(L: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.log(_size(L))


def _inverse_sensitivity(L: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.log(_size(1 + L) * HALF_POWER)


def _size(L: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return |L|, kept off zero: a process may have zeros on the imaginary axis."""
    return np.maximum(np.abs(L), np.finfo(float).tiny)


def _roots(
    loop: Response,
    omega: NDArray[np.float64],
    L: NDArray[np.complex128],
    functions: Sequence[Callable[[NDArray[np.complex128]], NDArray[np.float64]]],
) -> list[NDArray[np.float64]]:
    """Return the ascending frequencies where each function of L changes its sign."""
    on_grid = np.stack([function(L) for function in functions])
    negative, known = np.signbit(on_grid), ~np.isnan(on_grid)
    which, change = np.nonzero((negative[:, :-1] != negative[:, 1:]) & known[:, :-1] & known[:, 1:])
    low, high = np.log(omega[change]), np.log(omega[change + 1])
    at_low, at_high = on_grid[which, change], on_grid[which, change + 1]
    column = np.arange(change.size)
    for _ in range(ROOT_ROUNDS if change.size else 0):
        points = np.linspace(low, high, SECTIONS + 1)
        values = loop(np.exp(points[1:-1].ravel())).reshape(SECTIONS - 1, change.size)
        inside = np.vstack([at_low, np.zeros(values.shape), at_high])
        for index, function in enumerate(functions):
            mine = which == index
            inside[1:-1, mine] = function(values[:, mine])
        inside = np.where(np.isnan(inside), at_low, inside)
        first = np.argmax(np.signbit(inside) != np.signbit(at_low), axis=0)
        low, high = points[first - 1, column], points[first, column]
        at_low, at_high = inside[first - 1, column], inside[first, column]
    roots = np.exp(low + (high - low) * at_low / (at_low - at_high))
    return [roots[which == index] for index in range(len(functions))]


def _refined(
    loop: Response, omega: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return frequencies between which L and 1 + L turn little, and L there."""
    L = loop(omega)
    while omega.size < MAX_POINTS:
        turn = np.maximum(
            np.abs(np.angle(L[1:] * L[:-1].conj())),
            np.abs(np.angle((1 + L[1:]) * (1 + L[:-1]).conj())),
        )
        coarse = np.flatnonzero(
            (turn > LARGEST_TURN)
            & (np.maximum(np.abs(L[1:]), np.abs(L[:-1])) > NEGLIGIBLE)
            & (omega[1:] > omega[:-1] * (1 + 1e-9))
        )
        if coarse.size == 0:
            break
        between = np.sqrt(omega[coarse] * omega[coarse + 1])
        omega = np.insert(omega, coarse + 1, between)
        L = np.insert(L, coarse + 1, loop(between))
    return omega, L


def _frequencies(plant: Plant, loops: Sequence[Controller]) -> NDArray[np.float64]:
    """Return frequencies from far below to far above all dynamics of plant and controllers."""
    bends = corners(plant, loops=loops)
    # Where the asymptotes of g c reach one: a fast loop's own rate.
    reach = [
        (abs(element.num[0] / element.den[0]) * max(abs(loop.gain) for loop in loops))
        ** (1 / max(element.relative_degree, 1))
        for element in plant.elements
        if not element.is_zero
    ]
    highest = max(float(bends[-1]), *reach)
    return grid(BELOW * float(bends[0]), ABOVE * highest, POINTS_A_DECADE, [resonances(plant)])
