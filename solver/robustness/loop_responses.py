"""What each loop sees: its process with the other loops open, and with them closed.

With the other loops O under controllers C_O, input i acts on output i by the Schur complement

    g_cl = p_ii - p_iO C_O (I + P_OO C_O)^-1 p_Oi

(Astrom and Hagglund, Advanced PID Control (2006), Example 11.1, in general). Without dead time it
is computed as a transfer function too, in rational arithmetic, so that what cancels is gone.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq_poly

from solver.interaction.loop_effect import rational_controller
from solver.interaction.rational_matrix import Rational, determinant_of, roots_of, to_float
from solver.model.controllers import Controller
from solver.model.equality import ByValue
from solver.model.errors import InvalidInputError
from solver.model.frequencies import corners
from solver.model.plants import Plant
from solver.model.validation import instance
from solver.robustness.bandwidth import singular_sensitivities
from solver.robustness.loop_responses_query import LoopResponsesQuery
from solver.robustness.margins import loop_transfer
from solver.stability.closed_loop import is_stable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["LoopResponses", "RationalFunction", "SeenLoop", "loop_responses"]

MAX_SHOWN = 20  # different loops: each has five curves
_POINTS = 300
_BESIDE = 100.0  # factor in frequency beyond the corners
# Rational arithmetic: loops and order up to which a transfer function is worth its length.
_MAX_LOOPS, _MAX_ORDER = 4, 30


@dataclass(frozen=True)
class RationalFunction:
    """num/den without common factors, descending powers of s, the leading one of den 1."""

    num: tuple[float, ...]
    den: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class SeenLoop(ByValue):
    """What the loops of `units`, which are alike, see.

    Attributes
    ----------
    units : tuple of int
        The units, from 0.
    static_open, static_closed : float
        Static gain of the process with the other loops open, and with them closed; infinite where
        it integrates, NaN where the other loops have none.
    function_open, function_closed : RationalFunction or None
        The same as transfer functions; None with dead time, or where they would be too long.
    process_open, process_closed : (k,) complex
        Frequency responses. `process_closed` is formal where the other loops are unstable.
    others_stable : bool
        Whether the other loops are stable by themselves: else `process_closed` is nothing that an
        experiment would find.
    controller : (k,) complex or None
        The loop's own controller; None: open.
    sensitivity : (k,) float or None
        |1/(1 + p_ii c)|, the loop alone; None where it is open, or unstable alone.
    poles : (p,) complex or None
        Closed-loop poles of the loop alone; None where it is open, or has dead time.
    damping : float or None
        The least damping -Re s/|s| of these poles.

    """

    units: tuple[int, ...]
    static_open: float
    static_closed: float
    function_open: RationalFunction | None
    function_closed: RationalFunction | None
    process_open: NDArray[np.complex128]
    process_closed: NDArray[np.complex128]
    others_stable: bool
    controller: NDArray[np.complex128] | None
    sensitivity: NDArray[np.float64] | None
    poles: NDArray[np.complex128] | None
    damping: float | None


@dataclass(frozen=True, eq=False)
class LoopResponses(ByValue):
    """What the loops of a plant see.

    Attributes
    ----------
    omega : (k,)
        Frequencies, rad per time unit.
    loops : tuple of SeenLoop
        An entry for each different loop.
    stable : bool
        Whether all closed loops together are stable.
    sensitivity : (k,) float or None
        Largest singular value of (I + G C)^-1 of the loops that are closed; None where they are
        unstable, or all are open.

    """

    omega: NDArray[np.float64]
    loops: tuple[SeenLoop, ...]
    stable: bool
    sensitivity: NDArray[np.float64] | None


def loop_responses(query: LoopResponsesQuery) -> LoopResponses:
    """Return what each loop sees with the others open, and closed.

    Raises
    ------
    UnsupportedPlantError
        An open-loop unstable plant.
    InvalidInputError
        More than `MAX_SHOWN` different loops.

    """
    instance(query, LoopResponsesQuery, "")
    plant, loops = query.plant, query.loops
    groups = _groups(plant, loops)
    if len(groups) > MAX_SHOWN:
        message = f"{len(groups)} different loops; at most {MAX_SHOWN} can be shown"
        raise InvalidInputError(message, "/loops")
    closed = [unit for unit, loop in enumerate(loops) if loop is not None]
    omega = _frequencies(query, closed)
    stable, sensitivity = True, None
    if closed:
        part, controllers = _closed(plant, loops, closed)
        stable = is_stable(part, controllers)
        if stable:
            sensitivity = singular_sensitivities(part, controllers, omega)[:, 0]
    return LoopResponses(
        omega=omega,
        loops=tuple(_seen(plant, loops, group, omega) for group in groups),
        stable=stable,
        sensitivity=sensitivity,
    )


def _groups(plant: Plant, loops: Sequence[Controller | None]) -> list[tuple[int, ...]]:
    """Return the units in groups of those that see the same."""
    if not plant.interchangeable:
        return [(unit,) for unit in range(plant.n)]
    groups: dict[Controller | None, list[int]] = {}
    for unit, loop in enumerate(loops):
        groups.setdefault(loop, []).append(unit)
    return [tuple(units) for units in groups.values()]


def _frequencies(query: LoopResponsesQuery, closed: Sequence[int]) -> NDArray[np.float64]:
    if query.omega is not None:
        return query.omega
    bends = corners(query.plant, loops=_given(query.loops, closed))
    return np.geomspace(bends[0] / _BESIDE, bends[-1] * _BESIDE, _POINTS)


def _given(loops: Sequence[Controller | None], units: Sequence[int]) -> tuple[Controller, ...]:
    given = (loops[unit] for unit in units)
    return tuple(loop for loop in given if loop is not None)


def _closed(
    plant: Plant, loops: Sequence[Controller | None], units: Sequence[int]
) -> tuple[Plant, tuple[Controller, ...]]:
    return plant.part(units), _given(loops, units)


def _seen(
    plant: Plant,
    loops: Sequence[Controller | None],
    units: tuple[int, ...],
    omega: NDArray[np.float64],
) -> SeenLoop:
    unit, own = units[0], loops[units[0]]
    others = [each for each, loop in enumerate(loops) if each != unit and loop is not None]
    element = plant.element(unit, unit)
    process = element.response(omega)
    closed, others_stable = process, True
    if others:
        around = plant.part([unit, *others])
        # With a controller of 1 in the loop that is looked at, its transfer is the process.
        closed = loop_transfer(around, (Controller(1.0, None), *_given(loops, others)), 0)(omega)
        others_stable = is_stable(*_closed(plant, loops, others))
    exact = Rational.from_transfer_function(element)
    seen = _exact(plant, loops, unit, others) if others else exact
    sensitivity = None
    if own is not None and is_stable(plant.part([unit]), (own,)):
        sensitivity = np.abs(1 / (1 + process * own.response(omega)))
    poles = None if own is None or element.dead_time else _poles(exact, own)
    dead = any(
        plant.element(row, column).dead_time
        for row, column in itertools.product([unit, *others], repeat=2)
    )
    return SeenLoop(
        units=units,
        static_open=_at_zero(exact),
        static_closed=_static(plant, loops, unit, others) if seen is None else _at_zero(seen),
        function_open=_function(exact) if not element.dead_time else None,
        function_closed=_function(seen) if not dead else None,
        process_open=process,
        process_closed=closed,
        others_stable=others_stable,
        controller=None if own is None else own.response(omega),
        sensitivity=sensitivity,
        poles=poles,
        damping=None if poles is None else float(np.min(-poles.real / np.abs(poles))),
    )


def _poles(process: Rational, controller: Controller) -> NDArray[np.complex128]:
    """Return the roots of 1 + p c = 0, those that p and c cancel included."""
    c = rational_controller(controller)
    roots = roots_of(process.den * c.den + process.num * c.num)
    return np.array([root.value for root in roots for _ in range(root.multiplicity)], dtype=complex)


def _exact(
    plant: Plant, loops: Sequence[Controller | None], unit: int, others: Sequence[int]
) -> Rational | None:
    """Return what the loop sees without dead times, which at s = 0 do not matter; None: too long.

    det [p_ii, p_iO C; p_Oi, I + P_OO C] / det(I + P_OO C), the Schur complement.
    """
    units = [unit, *others]
    order = sum(len(plant.element(r, c).den) - 1 for r in units for c in units)
    if len(units) > _MAX_LOOPS or order > _MAX_ORDER:
        return None
    zero, one = Rational(fmpq_poly(), fmpq_poly([1])), Rational(fmpq_poly([1]), fmpq_poly([1]))
    rows = []
    for row in units:
        entries = [Rational.from_transfer_function(plant.element(row, unit))]
        for other in others:
            gain = Rational.from_transfer_function(plant.element(row, other))
            entries.append(
                gain * rational_controller(loops[other]) + (one if row == other else zero)
            )
        rows.append(entries)
    top, bottom = determinant_of(rows), determinant_of([row[1:] for row in rows[1:]])
    if bottom.is_zero:
        return None
    return Rational.reduced(top.num * bottom.den, top.den * bottom.num)


def _at_zero(function: Rational) -> float:
    value, pole = function.num[0], function.den[0]
    if pole != 0:
        return to_float(value / pole)
    return math.copysign(math.inf, value) if value != 0 else math.nan


def _static(
    plant: Plant, loops: Sequence[Controller | None], unit: int, others: Sequence[int]
) -> float:
    """Return the static gain among many loops: at a frequency far below all dynamics."""
    around = plant.part([unit, *others])
    controllers = _given(loops, others)
    low = np.array([float(corners(around, loops=controllers)[0]) * 1e-6])
    transfer = loop_transfer(around, (Controller(1.0, None), *controllers), 0)
    return float(transfer(low)[0].real)


def _function(function: Rational | None) -> RationalFunction | None:
    if function is None:
        return None
    num = [to_float(value) for value in reversed(function.num.coeffs())] or [0.0]
    return RationalFunction(
        tuple(num), tuple(to_float(value) for value in reversed(function.den.coeffs()))
    )
