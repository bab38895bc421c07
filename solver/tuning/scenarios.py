"""Scenarios: further plants that the same settings must serve, and the cases they come down to.

A scenario may have a plant and an uncertainty of its own (another operating point), and some of the
loops in service only, the others being in manual: rows and columns of those drop out, since an
input in manual is constant. "Any k of n in service" stands for all sets of k loops; those that
symmetry makes equal are one case.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from solver.model.blocks import LoopBlocks, marks, reduce
from solver.model.errors import InvalidInputError
from solver.model.given import require_fit
from solver.model.open_loop import require_supported
from solver.model.plants import MAX_MATRIX_SIZE, Plant
from solver.model.validation import instance, integers, settle
from solver.model.weights import Performance, Uncertainty

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator, Sequence

    from solver.model.controllers import Controller
    from solver.tuning.spread import Deviation, Spread

__all__ = [
    "AS_GIVEN",
    "MAX_CASES",
    "Case",
    "Scenario",
    "cases_of",
    "check_scenarios",
    "sets_in_service",
]

AS_GIVEN = "as given"  # name of the plant of the request itself, all loops in service
MAX_CASES = 300
MAX_SETS = 10**4  # of loops in service that are looked through for different cases
MAX_SCENARIOS = 50
LONGEST_NAME = 100


@dataclass(frozen=True)
class Scenario:
    """A plant that the settings must serve beside the one of the task.

    Parameters
    ----------
    name : str
        Told in the result; another one for each scenario.
    plant : Plant or None
        The plant with all its loops; None: that of the task.
    uncertainty : Uncertainty or None
        None: that of the task.
    in_service : tuple of int or None
        Units whose loops are in service, the others being in manual; None: all.
    any_in_service : tuple of int or None
        Numbers of loops in service: every set of so many. Not together with `in_service`.

    """

    name: str
    plant: Plant | None = None
    uncertainty: Uncertainty | None = None
    in_service: tuple[int, ...] | None = None
    any_in_service: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not 0 < len(self.name) <= LONGEST_NAME:
            message = f"a scenario has a name of 1 to {LONGEST_NAME} characters"
            raise InvalidInputError(message, "/name")
        if self.name == AS_GIVEN:
            message = f"{AS_GIVEN!r} is the plant of the request itself: take another name"
            raise InvalidInputError(message, "/name")
        if self.plant is not None:
            instance(self.plant, Plant, "/plant")
        if self.uncertainty is not None:
            instance(self.uncertainty, Uncertainty, "/uncertainty")
        for name in ("in_service", "any_in_service"):
            if getattr(self, name) is not None:
                values = integers(getattr(self, name), "/in_service")
                if not values:
                    message = "no loop is in service"
                    raise InvalidInputError(message, "/in_service")
                if len(set(values)) < len(values):
                    message = "an entry stands there twice"
                    raise InvalidInputError(message, "/in_service")
                settle(self, **{name: tuple(sorted(values))})
        if self.in_service is not None and self.any_in_service is not None:
            message = "name the units in service or their number, not both"
            raise InvalidInputError(message, "/in_service")


@dataclass(frozen=True)
class Case:
    """One plant that the settings must serve, the loops in service alone.

    Parameters
    ----------
    plant : Plant
        Of the units in service.
    uncertainty, performance : Uncertainty, Performance
        Of those units.
    units : tuple of int
        Which they are, ascending.
    owners : tuple of int
        Group of each of them.
    scenarios : tuple of int
        Which scenarios ask for it; 0 is the plant of the task itself.

    """

    plant: Plant
    uncertainty: Uncertainty
    performance: Performance
    units: tuple[int, ...]
    owners: tuple[int, ...]
    scenarios: tuple[int, ...] = (0,)

    @property
    def key(self) -> Hashable:
        """What makes two cases the same computation."""
        scales = self.performance.output_scale if self.performance.unlike_outputs else None
        return self.plant, self.uncertainty, scales, self.owners

    def blocks(self) -> LoopBlocks:
        """Return the plant in blocks whose channels are numbered by the groups of the task."""
        used = sorted(set(self.owners))
        groups: list[list[int]] = [[] for _ in range(max(used) + 1)]
        for unit, owner in enumerate(self.owners):
            groups[owner].append(unit)
        groups = [groups[owner] for owner in used]
        blocks = reduce(self.plant, groups, self.uncertainty, self.performance.output_scale)
        if used == list(range(len(used))):
            return blocks
        return blocks.renumbered(used)

    def deviating(self, spread: Spread, deviation: Deviation, number: int) -> Case:
        """Return the case of another plant in the box, as one of scenario `number`."""
        return replace(self, plant=spread.plant_at(self.plant, deviation), scenarios=(number,))

    def loops(self, loops: Sequence[Controller]) -> tuple[Controller, ...]:
        """Return the loops in service of all loops of the task."""
        return tuple(map(loops.__getitem__, self.units))


def check_scenarios(
    scenarios: Sequence[Scenario], plant: Plant, uncertainty: Uncertainty, performance: Performance
) -> None:
    """Refuse scenarios that do not fit the task.

    Raises
    ------
    InvalidInputError
        Another number of units than the task's, units that there are not, a name that stands there
        twice, too many scenarios.
    UnsupportedPlantError
        An open-loop unstable plant.

    """
    if len(scenarios) > MAX_SCENARIOS:
        message = f"{len(scenarios)} scenarios, at most {MAX_SCENARIOS}"
        raise InvalidInputError(message, "/scenarios")
    for index, scenario in enumerate(scenarios):
        field = f"/scenarios/{index}"
        if scenario.name in {other.name for other in scenarios[:index]}:
            message = f"there is a scenario {scenario.name!r} already"
            raise InvalidInputError(message, f"{field}/name")
        own = scenario.plant or plant
        if own.n != plant.n:
            message = (
                f"a plant of {own.n} units, the settings are for {plant.n}: name those out of "
                "service by in_service"
            )
            raise InvalidInputError(message, f"{field}/plant")
        try:
            require_supported(own)
            require_fit(own, scenario.uncertainty or uncertainty, performance)
        except InvalidInputError as error:
            raise error.within(field) from None
        for units in scenario.in_service or ():
            if not 0 <= units < plant.n:
                message = f"the plant has {plant.n} loops"
                raise InvalidInputError(message, f"{field}/in_service")
        for count in scenario.any_in_service or ():
            if not 0 < count <= plant.n:
                message = f"{count} loops in service are none of 1..{plant.n}"
                raise InvalidInputError(message, f"{field}/in_service")


def cases_of(
    scenarios: Sequence[Scenario],
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    groups: Sequence[Sequence[int]],
) -> tuple[Case, ...]:
    """Return every case once, that of the task itself first.

    Raises
    ------
    InvalidInputError
        More than `MAX_CASES`.

    """
    owner = {unit: index for index, group in enumerate(groups) for unit in group}
    found: dict[Hashable, Case] = {}
    whole = tuple(range(plant.n))
    wanted: list[tuple[int, Scenario]] = [(0, Scenario("all"))]
    wanted += [(index + 1, scenario) for index, scenario in enumerate(scenarios)]
    for index, scenario in wanted:
        own, error = scenario.plant or plant, scenario.uncertainty or uncertainty
        where = f"/scenarios/{index - 1}"
        for units in _sets(scenario, own, error, performance, owner, where=where):
            in_all = units == whole
            try:
                part = own if in_all else own.part(units)
            except InvalidInputError as error_found:
                raise error_found.within(where) from None
            case = Case(
                part,
                error if in_all else own.errors_of(error, units),
                performance if in_all else performance.of_units(units),
                units,
                tuple(owner[unit] for unit in units),
                (index,),
            )
            known = found.setdefault(case.key, case)
            if index not in known.scenarios:
                found[case.key] = Case(
                    known.plant, known.uncertainty, known.performance, known.units, known.owners,
                    (*known.scenarios, index),
                )  # fmt: skip
            if len(found) > MAX_CASES:
                message = (
                    f"with these groups the scenarios come down to more than {MAX_CASES} different "
                    "cases: give more loops equal settings, or name fewer sets"
                )
                raise InvalidInputError(message, f"{where}/in_service")
    return tuple(found.values())


def sets_in_service(case: Case, groups: Sequence[Sequence[int]]) -> tuple[Case, ...]:
    """Return a case for each kind of sets of its loops in service, for the demand on integrity.

    Raises
    ------
    InvalidInputError
        More than `MAX_CASES`, or a set of more loops than a matrix plant has.

    """
    plant, where = case.plant, "/demands/integrity"
    every = Scenario("every set", any_in_service=tuple(range(1, plant.n + 1)))
    if not plant.interchangeable and plant.n > MAX_MATRIX_SIZE:
        message = (
            f"of more than {MAX_MATRIX_SIZE} units that may not change places the sets of loops "
            "in service are too many to look at"
        )
        raise InvalidInputError(message, where)
    try:
        return cases_of([every], plant, case.uncertainty, case.performance, groups)
    except InvalidInputError:
        message = (
            f"with these groups there are more than {MAX_CASES} kinds of sets of loops in service: "
            "give more loops equal settings"
        )
        raise InvalidInputError(message, where) from None


def _sets(
    scenario: Scenario,
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    owner: dict[int, int],
    *,
    where: str,
) -> Iterator[tuple[int, ...]]:
    """Yield one set of units in service of each kind; `where` is the pointer of the scenario."""
    units = tuple(range(plant.n))
    if scenario.in_service is not None:
        yield scenario.in_service
        return
    if scenario.any_in_service is None:
        yield units
        return
    alike: dict[Hashable, list[int]] = {}
    mark = marks(uncertainty, performance.output_scale)
    for unit in units:
        key = (owner[unit], mark(unit)) if plant.interchangeable else unit
        alike.setdefault(key, []).append(unit)
    kinds = list(alike.values())
    for count in scenario.any_in_service:
        sizes = [len(kind) for kind in kinds]
        if _count_of_shares(count, sizes) > MAX_SETS:
            message = (
                f"any {count} of {plant.n} loops are more than {MAX_SETS} sets: "
                "name those that occur"
            )
            raise InvalidInputError(message, f"{where}/in_service")
        for taken in _shares(count, sizes):
            chosen = (u for kind, take in zip(kinds, taken, strict=True) for u in kind[:take])
            yield tuple(sorted(chosen))


def _count_of_shares(count: int, sizes: Sequence[int]) -> int:
    """Return how many ways there are to take `count` of things of which there are `sizes`."""
    ways = [1] + [0] * count
    for size in sizes:  # the coefficients of 1 + x + ... + x^size, multiplied
        ways = [sum(ways[max(k - size, 0) : k + 1]) for k in range(count + 1)]
    return ways[count]


def _shares(count: int, sizes: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Yield all ways to take `count` of things of which there are `sizes`."""
    if not sizes:
        if count == 0:
            yield ()
        return
    rest = sum(sizes[1:])
    for take in range(max(count - rest, 0), min(count, sizes[0]) + 1):
        for others in _shares(count - take, sizes[1:]):
            yield (take, *others)
