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

from solver.model.frequencies import corners, grid, resonances
from solver.model.given import require_loops
from solver.model.peaks import highest, slices
from solver.model.plants import ParallelPlant
from solver.model.subsystems import interchangeable, subsystem
from solver.robustness.bandwidth import HALF_POWER
from solver.robustness.gain_factor import stable_gain_factor
from solver.robustness.slow_modes import slow_end
from solver.robustness.subsets import Subsets
from solver.robustness.turning import turning_points
from solver.stability.closed_loop import unstable_poles

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.peaks import Peak
    from solver.model.plants import Plant

    Response = Callable[[NDArray[np.float64]], NDArray[np.complex128]]
    # Several loops, each at frequencies of its own.
    Responses = Callable[[list[NDArray[np.float64]]], list[NDArray[np.complex128]]]

__all__ = [
    "LoopMargins",
    "Margins",
    "loop_frequencies",
    "loop_margins",
    "loop_transfer",
    "margins",
]

BELOW, ABOVE = 1e-6, 1e6  # S and T are at their limits to 1e-11 so far from the bends
NEGLIGIBLE = 1e-3  # |L| below which a phase crossing is no gain margin worth a name
POINTS_A_DECADE = 40
LARGEST_TURN = 0.2  # rad of phase between neighbouring grid points, of L and of 1 + L
MAX_POINTS = 20_000
MOST_REDUCED = 4  # different loops whose gain is reduced in turn: some ten counts of poles each
CLOSEST = 1e-12  # relative: what is narrower than that, rounding hides
SECTIONS = 16  # of an interval a round
ROOT_ROUNDS = 4  # to 2e-5 of a grid step; the chord's error there is the square of that


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
        never does, zero where it starts above. Of a loop with others closed it is what this one
        sees, not how fast the plant is: see `bandwidths`.
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
    controller's output. None where that arrangement is unstable; then `alone_factor` and
    `together_factor` tell to which factor the gain of these loops, the others as they are, has to
    be reduced, and below: None where none was found.
    """

    units: tuple[int, ...]
    alone: Margins | None
    together: Margins | None
    alone_factor: float | None = None
    together_factor: float | None = None


def loop_margins(
    plant: Plant, loops: Sequence[Controller], *, stable: bool | None = None
) -> tuple[LoopMargins, ...]:
    """Return the margins of every loop of a plant, alone and with all loops closed.

    Parameters
    ----------
    plant : Plant
        Open-loop stable, or integrating.
    loops : sequence of Controller
        One a unit. Units of a parallel plant with equal settings are answered once.
    stable : bool or None
        Whether all loops together are stable, where that is known.

    Raises
    ------
    UnsupportedPlantError
        An open-loop unstable plant.

    """
    loops = require_loops(plant, loops)
    if stable is None:
        stable = unstable_poles(plant, loops) == 0
    groups = interchangeable(plant, loops)
    units = [group[0] for group in groups]
    single = Subsets(plant, tuple(loops[unit] for unit in units), np.eye(len(units)))
    sound = [unit for unit, poles in zip(units, single.unstable_poles(), strict=True) if not poles]
    closed = units if stable and plant.n > 1 else []
    shared = loop_frequencies(plant, loops)

    def transfers(omega: list[NDArray[np.float64]]) -> list[NDArray[np.complex128]]:
        alone = [
            loops[unit].response(at) * plant.entry(unit, unit).response(at)
            for unit, at in zip(sound, omega, strict=False)
        ]
        return alone + _together(plant, loops, closed, omega[len(sound) :])

    grids = [loop_frequencies(*subsystem(plant, loops, (unit,))) for unit in sound]
    # 1 + L = det(I + P C)/det(I + P_rr C_r): what either of them does, L shows.
    for unit in closed:
        others = subsystem(plant, loops, [other for other in range(plant.n) if other != unit])
        grids.append(np.union1d(shared, turning_points(*others, shared[0], shared[-1])))
    found = _margins(transfers, grids)
    alone = dict(zip(sound, found, strict=False))
    together = dict(zip(closed, found[len(sound) :], strict=True)) if plant.n > 1 else alone
    alone_factor = {
        unit: stable_gain_factor(*subsystem(plant, loops, (unit,)))
        for unit in units
        if unit not in alone
    }
    together_factor = alone_factor
    if plant.n > 1:
        few = not stable and len(groups) <= MOST_REDUCED
        together_factor = {
            group[0]: stable_gain_factor(plant, loops, group) for group in groups if few
        }
    return tuple(
        LoopMargins(
            group,
            alone.get(group[0]),
            together.get(group[0]),
            alone_factor.get(group[0]),
            together_factor.get(group[0]),
        )
        for group in groups
    )


def loop_transfer(plant: Plant, loops: Sequence[Controller], unit: int) -> Response:
    """Return L of one unit with all other loops closed, as a function of frequencies (k,)."""
    return lambda omega: _together(plant, loops, [unit], [omega])[0]


def _together(
    plant: Plant,
    loops: Sequence[Controller],
    units: Sequence[int],
    omega: Sequence[NDArray[np.float64]],
) -> list[NDArray[np.complex128]]:
    """Return L of each of the `units`, all other loops closed, at frequencies of its own."""
    if not units:
        return []
    at = np.concatenate(omega)
    c = {loop: loop.response(at) for loop in dict.fromkeys(loops)}
    parts = slices(omega)
    if not isinstance(plant, ParallelPlant):
        P, C = plant.response(at), np.stack([c[loop] for loop in loops], axis=1)
        return [
            C[part, unit] * _seen(P[part], C[part], unit)
            for unit, part in zip(units, parts, strict=True)
        ]
    # P = (g - i) I + i 1 1^T, so by the Sherman-Morrison formula the unit sees
    # g - i + i / (1 + sum of i c_j / (1 + (g - i) c_j) over the others),
    # at a cost that grows with the different settings only.
    interaction = plant.interaction.response(at)
    difference = plant.process.response(at) - interaction
    loads = {loop: interaction * own / (1 + difference * own) for loop, own in c.items()}
    found = []
    for unit, part in zip(units, parts, strict=True):
        others = Counter(loops)
        others[loops[unit]] -= 1
        load = 1 + sum(count * loads[loop][part] for loop, count in others.items() if count)
        found.append(c[loops[unit]][part] * (difference[part] + interaction[part] / load))
    return found


def _seen(
    P: NDArray[np.complex128], C: NDArray[np.complex128], unit: int
) -> NDArray[np.complex128]:
    """Return what one loop of a matrix plant sees, (k,), from P (k, n, n) and C (k, n)."""
    others = [index for index in range(C.shape[1]) if index != unit]
    seen: NDArray[np.complex128] = P[:, unit, unit]
    if others:
        inner = np.eye(len(others)) + C[:, others, None] * P[:, others][:, :, others]
        column = (C[:, others] * P[:, others, unit])[:, :, None]
        row = P[:, [unit]][:, :, others]
        seen = seen - (row @ np.linalg.solve(inner, column))[:, 0, 0]
    return seen


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
    return _margins(lambda parts: [loop(part) for part in parts], [omega])[0]


def _margins(loops: Responses, grids: Sequence[NDArray[np.float64]]) -> list[Margins]:
    """Return the margins of several loops, each on its grid; see `margins`."""
    if not grids:
        return []
    omegas, curves = _refined(loops, grids)
    roots = _roots(loops, omegas, curves)
    on_axis = loops([row[0] for row in roots])
    at_one = loops([row[1] for row in roots])

    def side_by_side(parts: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        pairs = list(zip(parts[::2], parts[1::2], strict=True))
        values = []
        for (first, _), L in zip(pairs, loops([np.concatenate(p) for p in pairs]), strict=True):
            S = 1 / (1 + L)
            values += [np.abs(S[: first.size]), np.abs(1 - S[first.size :])]
        return values

    on_grid = []
    for omega, L in zip(omegas, curves, strict=True):
        S = 1 / (1 + L)
        on_grid += [(omega, np.abs(S)), (omega, np.abs(1 - S))]
    peaks = iter(highest(side_by_side, on_grid))
    found = []
    for L, (_, crossings, below), axis, one in zip(curves, roots, on_axis, at_one, strict=True):
        increase, decrease = _gain_margins(axis, L[-1])
        lag = np.mod(np.angle(one) + math.pi, 2 * math.pi)
        phase_margin = delay_margin = math.inf
        if crossings.size:
            phase_margin = math.degrees(float(np.min(np.minimum(lag, 2 * math.pi - lag))))
            delay_margin = float(np.min(lag / crossings))
        if abs(L[-1]) >= 1:
            delay_margin = 0.0  # gain above one at all high frequencies: any dead time is too much
        found.append(
            Margins(
                gain_increase=increase,
                gain_decrease=decrease,
                phase_margin=phase_margin,
                delay_margin=delay_margin,
                sensitivity=next(peaks),
                complementary_sensitivity=next(peaks),
                bandwidth=_first(below) if abs(1 + L[0]) * HALF_POWER > 1 else 0.0,
                crossover=float(crossings[-1]) if crossings.size else 0.0,
            )
        )
    return found


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


FUNCTIONS = (_sine, _gain, _inverse_sensitivity)


def _roots(
    loops: Responses,
    omegas: Sequence[NDArray[np.float64]],
    curves: Sequence[NDArray[np.complex128]],
) -> list[list[NDArray[np.float64]]]:
    """Return the ascending frequencies where each of `FUNCTIONS` of each L changes its sign."""
    brackets = [_sign_changes(omega, L) for omega, L in zip(omegas, curves, strict=True)]
    parts = slices([bracket[0] for bracket in brackets])
    which, low, high, at_low, at_high = np.concatenate(brackets, axis=1)
    column = np.arange(which.size)
    for _ in range(ROOT_ROUNDS if which.size else 0):
        points = np.linspace(low, high, SECTIONS + 1)
        omega = np.exp(points[1:-1])
        L = loops([omega[:, part].ravel() for part in parts])
        values = np.concatenate([each.reshape(SECTIONS - 1, -1) for each in L], axis=1)
        inside = np.vstack([at_low, np.zeros(values.shape), at_high])
        for index, function in enumerate(FUNCTIONS):
            mine = which == index
            inside[1:-1, mine] = function(values[:, mine])
        inside = np.where(np.isnan(inside), at_low, inside)
        first = np.argmax(np.signbit(inside) != np.signbit(at_low), axis=0)
        low, high = points[first - 1, column], points[first, column]
        at_low, at_high = inside[first - 1, column], inside[first, column]
    roots = np.exp(low + (high - low) * at_low / (at_low - at_high))
    return [
        [roots[part][which[part] == index] for index in range(len(FUNCTIONS))] for part in parts
    ]


def _sign_changes(omega: NDArray[np.float64], L: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return (5, changes): which function, ends of the bracket (log omega), and values there."""
    on_grid = np.stack([function(L) for function in FUNCTIONS])
    negative, known = np.signbit(on_grid), ~np.isnan(on_grid)
    which, change = np.nonzero((negative[:, :-1] != negative[:, 1:]) & known[:, :-1] & known[:, 1:])
    ends = np.log(omega[change]), np.log(omega[change + 1])
    return np.stack([which, *ends, on_grid[which, change], on_grid[which, change + 1]])


def _refined(
    loops: Responses, grids: Sequence[NDArray[np.float64]]
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.complex128]]]:
    """Return frequencies between which each L and 1 + L turn little, and L there."""
    omegas = list(grids)
    curves = loops(omegas)
    while True:
        coarse = [_coarse(omega, L) for omega, L in zip(omegas, curves, strict=True)]
        if not any(where.size for where in coarse):
            return omegas, curves
        between = [
            np.sqrt(omega[where] * omega[where + 1])
            for omega, where in zip(omegas, coarse, strict=True)
        ]
        values = loops(between)
        omegas = [
            np.insert(*row) for row in zip(omegas, (w + 1 for w in coarse), between, strict=True)
        ]
        curves = [
            np.insert(*row) for row in zip(curves, (w + 1 for w in coarse), values, strict=True)
        ]


def _coarse(omega: NDArray[np.float64], L: NDArray[np.complex128]) -> NDArray[np.intp]:
    """Return the intervals over which L or 1 + L turns too much."""
    turn = np.maximum(
        np.abs(np.angle(L[1:] * L[:-1].conj())),
        np.abs(np.angle((1 + L[1:]) * (1 + L[:-1]).conj())),
    )
    return np.flatnonzero(
        (turn > LARGEST_TURN)
        & (np.maximum(np.abs(L[1:]), np.abs(L[:-1])) > NEGLIGIBLE)
        & (omega[1:] > omega[:-1] * (1 + CLOSEST))
        & (omega.size < MAX_POINTS)
    )


def loop_frequencies(plant: Plant, loops: Sequence[Controller]) -> NDArray[np.float64]:
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
    low = slow_end(plant, loops, BELOW * float(bends[0]))
    high = ABOVE * highest
    extra = [resonances(plant), turning_points(plant, loops, low, high)]
    return grid(low, high, POINTS_A_DECADE, extra)
