"""What a task asks that no search serves, found before there is one.

All of it is told in milliseconds and without compiled code, so that whoever takes tasks for later
refuses them at once, by the field that is at fault.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.measured import MeasuredPlant
from solver.model.neighbours import NeighbourPlant
from solver.model.open_loop import require_supported
from solver.model.weights import Structure
from solver.stability.on_data import at_rest
from solver.tuning.demands import IntegrityDemand
from solver.tuning.groupings import groupings
from solver.tuning.pairings import require_ranked
from solver.tuning.scenarios import sets_in_service
from solver.tuning.specification import Signs, Specification

if TYPE_CHECKING:
    from solver.tuning.groupings import Groups
    from solver.tuning.scenarios import Case

__all__ = ["fits", "require_tunable"]


def require_tunable(specification: Specification) -> None:
    """Refuse a task that no search serves.

    Raises
    ------
    InvalidInputError
        Too many different controllers, or cases; settings or errors that do not repeat around a
        long ring; a pairing that is to be found where nothing ranks pairings.
    UnsupportedPlantError
        An open-loop unstable plant, or data that do not serve what is asked.

    """
    require_supported(specification.plant)
    _require_one_form(specification)
    if isinstance(specification.plant, MeasuredPlant):
        _require_data(specification)
        specification.arranged(None)  # refuses combinations of their inputs
        return
    if isinstance(specification.pairing, str):
        require_ranked(specification.plant)
        return
    task = specification.arranged(None)
    _require_cases(task, groupings(task)[0])


def fits(task: Specification, groups: Groups) -> bool:
    """Whether the cases that a task comes down to under these groups can be searched."""
    try:
        _require_cases(task, groups)
    except InvalidInputError:
        return False
    return True


def _require_one_form(specification: Specification) -> None:
    """Refuse frequency responses beside transfer functions."""
    measured = isinstance(specification.plant, MeasuredPlant)
    for index, scenario in enumerate(specification.scenarios):
        own = scenario.plant
        if own is None or isinstance(own, MeasuredPlant) is measured:
            continue
        message = "beside a plant given as frequency response, give this one so too"
        if not measured:
            message = (
                "beside a plant of transfer functions a frequency response is no scenario: "
                "fit some, or give all plants as frequency responses"
            )
        raise UnsupportedPlantError(message, f"/scenarios/{index}/plant")


def _require_data(specification: Specification) -> None:
    """Refuse what frequency responses do not serve, and data that do not tell of stability."""
    if isinstance(specification.pairing, str):
        message = "name the pairing: candidates are judged on transfer functions"
        raise UnsupportedPlantError(message, "/pairing")
    if specification.optimality_gap:
        message = "a plant given as frequency response does not serve a proof of optimality"
        raise UnsupportedPlantError(message, "/search/optimality_gap")
    if specification.signs is Signs.ANY:
        message = "on a frequency response the signs of the gains are those of its static gain"
        raise UnsupportedPlantError(message, "/controller/signs")
    plants = [(specification.plant, "")]
    plants += [
        (scenario.plant, f"/scenarios/{index}")
        for index, scenario in enumerate(specification.scenarios)
        if scenario.plant is not None
    ]
    for plant, where in plants:
        assert isinstance(plant, MeasuredPlant)  # noqa: S101 - for the type checker: all are
        try:
            at_rest(plant)
        except UnsupportedPlantError as error:
            raise error.within(where) from None


def _require_cases(task: Specification, groups: Groups) -> None:
    """Refuse more cases than are searched, and rings that settings or errors do not repeat in."""
    cases = task.cases(groups)
    for case in cases:
        if isinstance(case.plant, NeighbourPlant):
            _require_blocks(task, case)
    if task.demands.integrity is not IntegrityDemand.NONE:
        sets_in_service(cases[0], groups)


def _require_blocks(task: Specification, case: Case) -> None:
    """Refuse a long ring or row that does not split, by what keeps it from splitting."""
    try:
        case.blocks()
    except InvalidInputError as error:
        where = "/controller/arrangement"
        if case.uncertainty.structure is Structure.FULL:
            where = "/uncertainty/structure"
        elif case.uncertainty.unlike_units:
            where = "/uncertainty"
        elif case.performance.unlike_outputs:
            where = "/performance/output_scale"
        elif task.groups is not None:
            where = "/controller/groups"
        elif task.group_sizes is not None:
            where = "/controller/group_sizes"
        raise InvalidInputError(error.message, where) from None
