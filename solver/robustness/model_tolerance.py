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
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from solver.model.blocks import group_loops
from solver.model.deviations import (
    change_dead_time,
    change_gain,
    change_time_constant,
    coupled,
    depends_on,
    varied,
)
from solver.model.errors import MutuneError
from solver.model.mixed_plant import MixedPlant
from solver.model.plants import MatrixPlant, ParallelPlant
from solver.model.transfer_function import TransferFunction
from solver.mu.structure import sigma_max
from solver.robustness.proven_demand import ProvenDemand
from solver.stability.closed_loop import is_stable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import WeightedElement
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance

__all__ = ["ModelTolerance", "model_tolerances", "parameters", "tolerance_remark"]

SMALLEST_ERROR = 0.0096  # the errors tried: from about a per cent, doubling (never just -1),
LARGE_ERROR, PER_DOUBLING = 0.1536, 4  # and in smaller steps from here: what is lost may come back
LARGEST_ERROR = 4.0  # up to five times the value, or to minus three times where signs may change,
SMALLER_TIMES = (0.8, 0.9, 0.97, 0.99)  # or of times down to a hundredth of them,
NO_DEAD_TIME = (0.8, 1.0)  # or of dead time to none at all
SIGNED = {"gain", "interaction"}
CLOSER, LEAST_ERROR = 4.0, 1e-9  # where already the first is too large, down to the last
STEPS_BACK = 6  # where a peak between the grid's points loses the demand sooner: by hundredths
HALVINGS = 6  # of the last step: to a hundredth of the error, or 1.5e-4 of the value
LOWER = 1e-4  # of the grid's low end: a direction near singular is slower than anything else
PER_DECADE = 8
WORK = 100_000  # steps of the proof of stability, for the plant as given times the parameters
THINNED = 2  # of the grid, where a proof confirms what it finds,
DOUBTFUL = 0.98  # and where a peak on it is higher: a peak between its points may exceed 1
# Loops of a matrix plant whose elements are looked at one by one, in all or by their gains alone;
# what is left changes in all elements together.
MAX_FULLY, MAX_BY_GAIN = 3, 5

_Limits = tuple[float | None, float | None]
DEMAND, STABILITY = 0, 1
_IsLost: TypeAlias = "Callable[[float, int], bool]"  # of an error, the demand or stability
_Seen: TypeAlias = "Callable[[float], tuple[bool, float]]"  # whether stability is lost, and a peak
_Entries: TypeAlias = "tuple[tuple[tuple[WeightedElement, ...], ...], ...]"
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

    Both are proven to hold at the errors told, over all frequencies. They are sought on a grid of
    frequencies, at errors that double from one to the next, and from 15 per cent on grow by a
    fifth: what is lost and regained between two of them is not seen. Where the proof denies what
    that finds, they are sought at such errors by proof. Where the plant as given is beyond the
    proof, or so near the edge of stability that its proof takes too many steps, the grid decides,
    and up to three loops, whose resonances may move between its points, a count of the poles beside
    it.

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
    sampled = _SampledLoop.of(plant, performance, loops, grid)
    given = sampled.at(None, 1.0)
    met = given.peak <= 1
    proof = ProvenDemand(performance, tuple(loops), float(omega[0]), float(omega[-1]))
    every = tuple(parameters(plant))
    provable = proof.holds(plant, WORK // max(len(every), 1)) == (True, met)
    if provable:  # the grid need only tell where to prove
        sampled = _SampledLoop.of(plant, performance, loops, grid[::THINNED])
        given = sampled.at(None, 1.0)
    found = []
    for parameter in every:

        @cache
        def seen(error: float, parameter: Parameter = parameter) -> tuple[bool, float]:
            here = sampled.at(parameter, 1 + error)
            return here.differs(given), here.peak

        def seems(error: float, which: int, seen: _Seen = seen) -> bool:
            differs, peak = seen(error)
            return differs or (which == DEMAND and peak > 1)

        def doubted(error: float, seen: _Seen = seen) -> bool:
            return provable and seen(error)[1] > DOUBTFUL

        @cache
        def proven(error: float, which: int, parameter: Parameter = parameter) -> bool:
            wrong = parameter.changed(1 + error)
            return not (proof.holds(wrong)[1] if which == DEMAND else proof.stable(wrong))

        def counted(
            error: float, which: int, parameter: Parameter = parameter, seems: _IsLost = seems
        ) -> bool:
            try:
                stable = is_stable(parameter.changed(1 + error), loops)
            except MutuneError:  # its poles cannot be told
                return True
            return not stable or (which == DEMAND and seems(error, which))

        checked = proven if provable else counted if plant.n <= MAX_FULLY else None
        sides = [
            _limits(seems, checked, doubted, _tried(parameter.name, sign), met=met)
            for sign in (-1, 1)
        ]
        found.append(
            ModelTolerance(
                parameter.name, parameter.element,
                (sides[0][0], sides[1][0]) if met else None,
                (sides[0][1], sides[1][1]),
            )
        )  # fmt: skip
    return tuple(found)


@dataclass(frozen=True)
class Parameter:
    """A parameter of the plant.

    Attributes
    ----------
    name, element
        As those of `ModelTolerance`.
    changed : callable
        From a factor to the plant with the parameter times it.

    """

    name: str
    element: tuple[int, int] | None
    changed: Callable[[float], Plant]

    def concerns(self, row: int, column: int, term: int) -> bool:
        """Whether it is one of a term of an entry of `LoopBlocks.terms`."""
        if self.name == "interaction":  # the first term of what is on the diagonal is a unit's own
            return row != column or term > 0
        return self.element in {None, (row, column)}


@dataclass(frozen=True)
class _Point:
    """A loop with some plant.

    Parameters
    ----------
    returns : tuple of (k, m, m)
        I + G C of each block.
    demand : (k,)
        Magnitude of w_P.

    """

    returns: tuple[NDArray[np.complex128], ...]
    demand: NDArray[np.float64]

    @cached_property
    def directions(self) -> NDArray[np.complex128]:
        """det(I + G C) of each block by its direction, (k, blocks)."""
        return np.stack([np.linalg.slogdet(E)[0] for E in self.returns], axis=-1)

    @cached_property
    def peak(self) -> float:
        """Highest value of sigma_max(w_P S); infinite where the loop is singular."""
        if np.abs(self.directions).min() == 0:
            return math.inf
        return max(
            float(np.max(self.demand * sigma_max(np.asarray(np.linalg.inv(E), dtype=complex))))
            for E in self.returns
        )

    def differs(self, other: _Point) -> bool:
        """Whether det(I + G C) winds otherwise, or has another sign at low frequency."""
        start = np.angle(self.directions[0] * other.directions[0].conj())
        turned = np.abs(self._turn - other._turn)
        return bool((np.abs(start) > np.pi / 2).any() or (turned > np.pi).any())

    @cached_property
    def _turn(self) -> NDArray[np.float64]:
        steps = self.directions[1:] * self.directions[:-1].conj()
        return np.asarray(np.angle(steps).sum(axis=0))


@dataclass(frozen=True)
class _SampledLoop:
    """A loop at some frequencies.

    Parameters
    ----------
    s : (k,)
        Points on the imaginary axis.
    terms : tuple
        Entries of each block, as `LoopBlocks.terms` returns them.
    plant : Plant
        What they are of.
    controllers : tuple of (k, m)
        Those of each block's inputs.
    demand : (k,)
        Magnitude of w_P.

    """

    s: NDArray[np.complex128]
    terms: tuple[_Entries, ...]
    plant: Plant
    controllers: tuple[NDArray[np.complex128], ...]
    demand: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        plant: Plant,
        performance: Performance,
        loops: Sequence[Controller],
        omega: NDArray[np.float64],
    ) -> _SampledLoop:
        """Return the loop with the plant as given, at `omega` (k,) rad per time unit."""
        blocks, controllers = group_loops(plant, loops, output_scale=performance.output_scale)
        c = np.stack([controller.response(omega) for controller in controllers], axis=-1)
        return cls(
            np.asarray(1j * omega, dtype=complex),
            tuple(blocks.terms(index) for index in range(len(blocks.blocks))),
            plant,
            tuple(c[:, list(block.channels)] for block in blocks.blocks),
            np.abs(performance.weight.response(omega)),
        )

    def at(self, parameter: Parameter | None, factor: float) -> _Point:
        """Return what the loop does with a parameter times `factor`."""
        kind = "gain" if parameter is None or parameter.name == "interaction" else parameter.name
        values: dict[tuple[TransferFunction, bool], NDArray[np.complex128]] = {}

        def value(element: TransferFunction, *, changed: bool) -> NDArray[np.complex128]:
            if (element, changed) not in values:
                values[element, changed] = varied(kind, element, factor if changed else 1.0, self.s)
            return values[element, changed]

        returns = []
        for rows, c in zip(self.terms, self.controllers, strict=True):
            E = np.empty((self.s.size, len(rows), len(rows)), dtype=complex)
            for r, row in enumerate(rows):
                for k, entry in enumerate(row):
                    total = sum(
                        part.factor
                        * value(
                            part.element,
                            changed=parameter is not None
                            and parameter.concerns(*self._place(r, k, term)),
                        )
                        for term, part in enumerate(entry)
                    )
                    E[:, r, k] = (r == k) + c[:, k] * total
            returns.append(E)
        return _Point(tuple(returns), self.demand)

    def _place(self, row: int, column: int, term: int) -> tuple[int, int, int]:
        """Return of which entry, and which term of it, a term is."""
        if isinstance(self.plant, MixedPlant):
            return *self.plant.acting(row, column)[term], 0
        return row, column, term


def _tried(name: str, sign: int) -> list[float]:
    """Return the errors of a parameter that are tried, one after the other."""
    doublings = round(math.log2(LARGE_ERROR / SMALLEST_ERROR))
    errors = [SMALLEST_ERROR * 2.0**k for k in range(doublings)]
    steps = math.ceil(PER_DOUBLING * math.log2(LARGEST_ERROR / LARGE_ERROR))
    errors += [LARGE_ERROR * 2.0 ** (k / PER_DOUBLING) for k in range(steps)]
    if sign > 0 or name in SIGNED:
        return [sign * error for error in (*errors, LARGEST_ERROR)]
    rest = NO_DEAD_TIME if name == "dead_time" else SMALLER_TIMES
    return [-error for error in (*(each for each in errors if each < rest[0]), *rest)]


class _End(NamedTuple):
    """The last error that is known to be kept, and the next one that is not; None: none tried."""

    kept: float
    lost: float | None


def _limits(
    seems: _IsLost,
    proven: _IsLost | None,
    doubted: Callable[[float], bool],
    errors: Sequence[float],
    *,
    met: bool,
) -> list[float | None]:
    """Return the errors at which the demand and stability are first lost on one side.

    What a grid of frequencies says is soon found. It is confirmed by proof, on both sides of where
    it ends: a grid may miss a peak, or a turn. Where the proof denies it, the demand is as a rule
    lost a little sooner; else the proof seeks for itself. So it does where it denies an error that
    is doubted, on the way there.
    """
    found = _first(seems, errors, met=met)
    on_the_way = [error for error in errors if met and abs(error) < abs(found[DEMAND].kept)]
    if proven is not None and any(doubted(e) and proven(e, DEMAND) for e in on_the_way):
        found = _first(proven, errors, met=met)
    elif proven is not None and not all(_confirmed(proven, found, met=met)):
        nearer = _stepped_back(proven, found, met=met)
        found = _first(proven, errors, met=met) if nearer is None else nearer
    return [None if end.lost is None else end.kept for end in found]


def _confirmed(proven: _IsLost, found: Sequence[_End], *, met: bool) -> Iterator[bool]:
    """Yield whether a proof says the same of the last errors found to be kept and to be lost."""
    kept = {end.kept: which for which, end in reversed(list(enumerate(found))) if met or which}
    for error, which in kept.items():  # what keeps the demand keeps stability
        yield not proven(error, which)
    for which, end in enumerate(found):
        if end.lost is not None and (met or which):
            yield proven(end.lost, which)


def _stepped_back(proven: _IsLost, found: Sequence[_End], *, met: bool) -> list[_End] | None:
    """Return ends of which the demand's is nearer, until a proof confirms them; None if none does.

    By steps as long as what lay between its last error kept and its first one lost.
    """
    demand = found[DEMAND]
    if not met or demand.lost is None:
        return None
    step = demand.lost - demand.kept
    for _ in range(STEPS_BACK):
        demand = _End(demand.kept - step, demand.kept)
        if not demand.kept * step > 0:  # nothing is left
            return None
        if not proven(demand.kept, DEMAND):
            nearer = [demand, found[STABILITY]]
            return nearer if all(_confirmed(proven, nearer, met=met)) else None
    return None


def _first(lost: _IsLost, errors: Sequence[float], *, met: bool) -> list[_End]:
    """Return where the demand and stability are first lost on one side."""
    ends: list[_End | None] = [None, None]
    inside = 0.0
    for error in errors:
        if met and ends[DEMAND] is None:
            if not lost(error, DEMAND):  # nor is stability
                inside = error
                continue
            ends[DEMAND] = _between(lost, DEMAND, inside, error)
        if lost(error, STABILITY):
            ends[STABILITY] = _between(lost, STABILITY, inside, error)
            break
        inside = error
    return [_End(errors[-1], None) if end is None else end for end in ends]


def _between(lost: _IsLost, which: int, inside: float, outside: float) -> _End:
    """Return the last error found not to lose it, and the first found to do so."""
    while not inside and abs(outside) > LEAST_ERROR:  # a first error may be a thousand too large
        smaller = outside / CLOSER
        if lost(smaller, which):
            outside = smaller
        else:
            inside = smaller
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        if lost(middle, which):
            outside = middle
        else:
            inside = middle
    return _End(inside, outside)


def parameters(plant: Plant) -> Iterator[Parameter]:
    """Yield each parameter."""
    if isinstance(plant, MixedPlant):
        for own in parameters(plant.plant):
            yield replace(own, changed=partial(_mixed, plant, own.changed))
        return
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
                    yield Parameter(name, place, partial(_replaced, plant, place, change))
    for name, change in changes[alone:]:
        if any(depends_on(name, element) for element in plant.elements):
            yield Parameter(name, None, partial(_mapped, plant, change))
    if isinstance(plant, ParallelPlant) and plant.n > 1 and not plant.interaction.is_zero:
        yield Parameter("interaction", None, partial(coupled, plant))


def tolerance_remark(plant: Plant) -> str | None:
    """Say which parameters of a matrix plant are not looked at element by element, if any."""
    if isinstance(plant, MixedPlant):
        return tolerance_remark(plant.plant)
    if plant.interchangeable or plant.n <= MAX_FULLY:
        return None
    names = ("gain", "time_constant", "dead_time")[int(plant.n <= MAX_BY_GAIN) :]
    have = [
        f"{name.replace('_', ' ')}s"
        for name in names
        if any(depends_on(name, element) for element in plant.elements)
    ]
    if not have:
        return None
    return (
        f"model tolerance: of {plant.n} loops the {' and '.join(have)} of all elements are changed "
        "together, in proportion; one element alone may be allowed less"
    )


def _mixed(plant: MixedPlant, changed: Callable[[float], Plant], factor: float) -> MixedPlant:
    return replace(plant, plant=changed(factor))


def _mapped(plant: Plant, change: _Change, factor: float) -> Plant:
    return plant.mapped(lambda element: change(element, factor))


def _replaced(plant: Plant, place: tuple[int, int], change: _Change, factor: float) -> MatrixPlant:
    rows = [list(elements) for elements in plant.rows]
    row, column = place
    rows[row][column] = change(rows[row][column], factor)
    return MatrixPlant(rows)
