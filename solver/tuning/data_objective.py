"""Levels of one case on frequency-response data, and stability as the data decide it.

The same minimax problem as for a plant with transfer functions, on the fixed grid of the data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import UnsupportedPlantError
from solver.model.measured import MeasuredPlant
from solver.robustness.sets_on_data import every_set
from solver.stability.on_data import at_rest, unstable_poles_on_data
from solver.tuning.alone import LoopsAlone, least_level
from solver.tuning.demands import IntegrityDemand
from solver.tuning.loop_samples import Samples
from solver.tuning.objective import LoopObjective
from solver.tuning.service_sets import ServiceSets, in_sight

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.tuning.goals import Goal
    from solver.tuning.scenarios import Case
    from solver.tuning.specification import Specification

__all__ = ["DataObjective", "DataSet", "data_objective"]


@dataclass(frozen=True)
class DataSet:
    """A plant of some loops in service, its static gain (n, n) and each loop's controller."""

    plant: MeasuredPlant
    gain: NDArray[np.float64]
    owners: tuple[int, ...]

    @classmethod
    def of(cls, case: Case) -> DataSet:
        """Return that of a case.

        Raises
        ------
        UnsupportedPlantError
            Its stability cannot be decided on the data: not at rest at the first frequency, or
            singular there.

        """
        plant = case.plant
        if not isinstance(plant, MeasuredPlant):
            message = "beside a plant given as frequency response, give this one so too"
            raise UnsupportedPlantError(message, "/plant")
        return cls(plant, at_rest(plant), case.owners)

    def stable(self, controllers: Sequence[Controller]) -> bool:
        """Whether the data tell that the loop is stable."""
        loops = [controllers[owner] for owner in self.owners]
        return unstable_poles_on_data(self.plant, self.gain, loops) == 0


@dataclass(frozen=True, eq=False)
class DataObjective(LoopObjective):
    """Levels at the frequencies of the data; all of `sets` are to be stable."""

    sets: tuple[DataSet, ...] = ()

    def _samples(self, omega: NDArray[np.float64]) -> Samples:
        """Return the samples at frequencies of the data, which are no sums of functions."""
        return Samples(
            omega,
            self.blocks.packed(omega),
            self.blocks.squared(self.uncertainty, omega) / self.goal.target**2,
            np.abs(self.goal.weight.response(omega)) ** 2,
            self.goal.saturation(self.penalty) - np.log(omega),
        )

    def _is_stable(self, theta: NDArray[np.float64], *, winds: bool, rests: bool) -> bool:
        del winds, rests
        controllers = self.controllers(theta)
        return all(each.stable(controllers) for each in self.sets)


def data_objective(
    task: Specification, case: Case, goal: Goal, signs: NDArray[np.float64], nu: float
) -> DataObjective:
    """Return what one case of a task asks of the settings.

    Raises
    ------
    UnsupportedPlantError
        Stability of the case, or of a set of its loops in service that the demands speak of,
        cannot be decided on the data.

    """
    own = DataSet.of(case)
    n = own.plant.n
    omega = own.plant.omega.copy()  # compiled code would be another for what is closed for writing
    sets, alone, service = [own], None, None
    # Of the same plant with loops in manual the sets of loops in service are among these.
    whole = case.scenarios[0] == 0 or n == task.plant.n
    most = task.demands.max_sensitivity_alone
    if most is not None and whole:
        g = np.diagonal(own.plant.values, axis1=1, axis2=2)
        alone = LoopsAlone(
            omega, g, np.array(case.owners), least_level(most), tells_stability=False
        )
        parts = [_part(case, (unit,)) for unit in range(n)]
        sets += _named(parts, "max_sensitivity_alone")
    integrity = task.demands.integrity
    if integrity is not IntegrityDemand.NONE and whole:
        parts = in_sight([_part(case, units) for units in every_set(n)])
        sets += _named(parts, "integrity")
        robust = integrity is IntegrityDemand.ROBUSTLY_STABLE
        service = ServiceSets.at(omega, parts, robust=robust, tells_stability=False)
    return DataObjective(
        blocks=case.blocks(),
        uncertainty=case.uncertainty,
        goal=goal,
        kind=task.kind,
        signs=signs,
        omega=omega,
        nu=nu,
        alone=alone,
        service=service,
        sets=tuple(sets),
    )


def _part(case: Case, units: tuple[int, ...]) -> Case:
    """Return a case with some of its loops in service; `units` are places in the case."""
    return replace(
        case,
        plant=case.plant.part(units),
        uncertainty=case.uncertainty.of_units(units),
        performance=case.performance.of_units(units),
        units=tuple(case.units[unit] for unit in units),
        owners=tuple(case.owners[unit] for unit in units),
    )


def _named(parts: Sequence[Case], demand: str) -> list[DataSet]:
    """Return the sets, the demand being named where the data do not decide on one."""
    found = []
    for part in parts:
        try:
            found.append(DataSet.of(part))
        except UnsupportedPlantError as error:
            loops = ", ".join(str(unit + 1) for unit in part.units)
            message = f"loops {loops} in service: {error.message}"
            raise UnsupportedPlantError(message, f"/demands/{demand}") from None
    return found
