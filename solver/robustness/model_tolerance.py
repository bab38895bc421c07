"""How wrong each physical parameter of the model may be, alone, before demand or stability is lost.

A guarantee covers the uncertainty that it was asked for, around the plant as it was given. Here one
parameter of that plant at a time is wrong by a relative error d, everything else and the actuators
being exact: the demand sigma_max(w_P S) <= 1 is lost at some d, nominal stability at another.
Stability is followed from the given plant by continuity: it is lost when det(I + G C), on the
frequency axis, first passes through 0.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from solver.model.blocks import group_loops
from solver.model.deviations import (
    change_dead_time,
    change_gain,
    change_time_constant,
    coupled,
    depends_on,
)
from solver.model.plants import MatrixPlant, ParallelPlant
from solver.model.transfer_function import TransferFunction
from solver.mu.structure import sigma_max
from solver.robustness.proven_demand import ProvenDemand

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance

__all__ = ["ModelTolerance", "model_tolerances", "parameters"]

SMALLEST_ERROR = 0.0096  # the errors tried: from about a per cent, doubling (never just -1),
LARGEST_ERROR = 4.0  # up to five times the value, or to minus three times where signs may change,
SMALLER_TIMES = (0.8, 0.9, 0.97, 0.99)  # or of times down to a hundredth of them,
NO_DEAD_TIME = (0.8, 1.0)  # or of dead time to none at all
SIGNED = {"gain", "interaction"}
CLOSER, LEAST_ERROR = 4.0, 1e-9  # where already the first is too large, down to the last
HALVINGS = 6  # of the last doubling: to a hundredth of the error, or 1.5e-4 of the value
LOWER = 1e-4  # of the grid's low end: a direction near singular is slower than anything else
PER_DECADE = 8
# Loops of a matrix plant whose elements are looked at one by one, in all or by their gains alone;
# what is left changes in all elements together.
MAX_FULLY, MAX_BY_GAIN = 3, 5

_Limits = tuple[float | None, float | None]
_Change: TypeAlias = "Callable[[TransferFunction, float], TransferFunction]"


@dataclass(frozen=True)
class ModelTolerance:
    """Relative errors of one parameter, down and up, at which something is lost.

    Attributes
    ----------
    parameter : str
        "gain", "time_constant" (all of an element's, in proportion), "dead_time", or "interaction"
        (the gain from a unit to its neighbours).
    element : tuple of int or None
        Row and column of a matrix plant's element; None: the parameter of all of them together.
    demand : tuple of float or None, or None
        Where sigma_max(w_P S) passes 1; None for a side on which it does not, up to a value five
        times as large, or down to minus three times of gains and interaction, a hundredth of time
        constants, no dead time. None in all where the demand is not met by the plant as given.
    stability : tuple of float or None
        Where nominal stability is lost, likewise.

    Both are proven to hold at the errors told, over all frequencies, and are tried at errors that
    double from one to the next. Where the plant as given is beyond the proof they are computed on
    a grid.

    """

    parameter: str
    element: tuple[int, int] | None
    demand: _Limits | None
    stability: _Limits


def model_tolerances(
    plant: Plant,
    performance: Performance,
    loops: Sequence[Controller],
    omega: NDArray[np.float64],
) -> tuple[ModelTolerance, ...]:
    """Return the tolerance of each parameter.

    Parameters
    ----------
    plant : Plant
        The plant as given.
    performance : Performance
        The demand, with its `tau_p`.
    loops : sequence of Controller
        One a unit, stable together.
    omega : (k,) rad per time unit
        Ascending frequencies that resolve the loop.

    """
    decades = int(PER_DECADE * -np.log10(LOWER))
    grid = np.concatenate([np.geomspace(LOWER * omega[0], omega[0], decades)[:-1], omega[::2]])
    curve = _FixedLoops(loops, performance, grid)
    given = curve.at(plant)
    met = given.peak <= 1
    proof = ProvenDemand(performance, tuple(loops), float(omega[0]), float(omega[-1]))
    provable = proof.holds(plant) == (True, met)
    found = []
    for name, element, changed in parameters(plant):

        def lost(error: float, changed: Callable[[float], Plant] = changed) -> tuple[bool, bool]:
            wrong = changed(1 + error)
            if provable:
                stable, kept = proof.holds(wrong)
                return not kept, not stable
            here = curve.at(wrong)
            unstable = here.differs(given)
            return unstable or here.peak > 1, unstable

        sides = [_first(lost, _tried(name, sign)) for sign in (-1, 1)]
        found.append(
            ModelTolerance(
                name, element,
                (sides[0][0], sides[1][0]) if met else None,
                (sides[0][1], sides[1][1]),
            )
        )  # fmt: skip
    return tuple(found)


@dataclass(frozen=True)
class _Point:
    """A loop with some plant: det(I + G C) of each block by its direction, and max |w_P S|."""

    directions: NDArray[np.complex128]
    peak: float

    def differs(self, other: _Point) -> bool:
        """Whether det(I + G C) winds otherwise, or has another sign at low frequency."""
        start = np.angle(self.directions[0] * other.directions[0].conj())
        turned = np.abs(self._turn() - other._turn())
        return bool((np.abs(start) > np.pi / 2).any() or (turned > np.pi).any())

    def _turn(self) -> NDArray[np.float64]:
        steps = self.directions[1:] * self.directions[:-1].conj()
        return np.asarray(np.angle(steps).sum(axis=0))


@dataclass(frozen=True)
class _FixedLoops:
    """Controllers, demand and frequencies (k,)."""

    loops: Sequence[Controller]
    performance: Performance
    omega: NDArray[np.float64]

    def at(self, plant: Plant) -> _Point:
        """Return what the loop does with this plant."""
        blocks, controllers = group_loops(
            plant, self.loops, output_scale=self.performance.output_scale
        )
        c = np.stack([controller.response(self.omega) for controller in controllers], axis=-1)
        w_P = np.abs(self.performance.weight.response(self.omega))
        directions, peak = [], 0.0
        for block, G in zip(blocks.blocks, blocks.response(self.omega), strict=True):
            E = np.asarray(np.eye(block.size) + G * c[:, None, list(block.channels)], dtype=complex)
            directions.append(np.linalg.slogdet(E)[0])
            if np.abs(directions[-1]).min() == 0:  # singular at a frequency: S has no bound
                peak = np.inf
                continue
            peak = max(peak, float(np.max(w_P * sigma_max(np.asarray(np.linalg.inv(E))))))
        return _Point(np.stack(directions, axis=-1), peak)


def _tried(name: str, sign: int) -> list[float]:
    """Return the errors of a parameter that are tried, one after the other."""
    doublings = math.floor(math.log2(LARGEST_ERROR / SMALLEST_ERROR))
    errors = [SMALLEST_ERROR * 2.0**k for k in range(doublings + 1)]
    if sign > 0 or name in SIGNED:
        return [sign * error for error in (*errors, LARGEST_ERROR)]
    rest = NO_DEAD_TIME if name == "dead_time" else SMALLER_TIMES
    return [-error for error in (*(each for each in errors if each < rest[0]), *rest)]


def _first(
    lost: Callable[[float], tuple[bool, bool]], errors: Sequence[float]
) -> list[float | None]:
    """Return the errors at which the demand and stability are first lost on one side."""
    limits: list[float | None] = [None, None]
    inside = 0.0
    for error in errors:
        for which, gone in enumerate(lost(error)):
            if gone and limits[which] is None:
                limits[which] = _between(lost, which, inside, error)
        if limits[1] is not None:
            break
        inside = error
    return limits


def _between(
    lost: Callable[[float], tuple[bool, bool]], which: int, inside: float, outside: float
) -> float:
    """Return the last error found not to lose it."""
    while not inside and abs(outside) > LEAST_ERROR:  # a first error may be a thousand too large
        smaller = outside / CLOSER
        if lost(smaller)[which]:
            outside = smaller
        else:
            inside = smaller
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        if lost(middle)[which]:
            outside = middle
        else:
            inside = middle
    return inside


def parameters(
    plant: Plant,
) -> Iterator[tuple[str, tuple[int, int] | None, Callable[[float], Plant]]]:
    """Yield each parameter, and the plant with that parameter times a factor."""
    changes = (
        ("gain", change_gain),
        ("time_constant", change_time_constant),
        ("dead_time", change_dead_time),
    )
    alone = 0
    if not plant.interchangeable:
        alone = 3 if plant.n <= MAX_FULLY else int(plant.n <= MAX_BY_GAIN)
        units = range(plant.n)
        for place in itertools.product(units, units):
            for name, change in changes[:alone]:
                if depends_on(name, plant.element(*place)):
                    yield name, place, partial(_replaced, plant, place, change)
    for name, change in changes[alone:]:
        if any(depends_on(name, element) for element in plant.elements):
            yield name, None, partial(_mapped, plant, change)
    if isinstance(plant, ParallelPlant) and plant.n > 1 and not plant.interaction.is_zero:
        yield "interaction", None, partial(coupled, plant)


def _mapped(plant: Plant, change: _Change, factor: float) -> Plant:
    return plant.mapped(lambda element: change(element, factor))


def _replaced(plant: Plant, place: tuple[int, int], change: _Change, factor: float) -> MatrixPlant:
    rows = [list(elements) for elements in plant.rows]
    row, column = place
    rows[row][column] = change(rows[row][column], factor)
    return MatrixPlant(rows)
