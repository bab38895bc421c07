"""Tuning on frequency-response data: the best settings at the frequencies of the data.

The same minimax problem as for a plant with transfer functions, on one fixed grid. Nothing is said
of what lies between its points: no peak is refined, nothing is proven, and the guarantee says so.
Stability is decided by the turns of det(I + G C) on the data (`solver.stability.on_data`).
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import reduce
from solver.model.errors import UnsupportedPlantError
from solver.model.measured import MeasuredPlant
from solver.model.transfer_function import LARGEST
from solver.model.weights import Performance
from solver.mu.kernel import FINE
from solver.robustness.on_data import data_analysis, demand_unseen, on_data, peaks_of
from solver.stability.on_data import Undecided, at_rest, unstable_poles_on_data
from solver.tuning.as_found_on_data import as_found_on_data
from solver.tuning.clock import Clock, OutOfTimeError
from solver.tuning.demand_checks import outcomes, planes
from solver.tuning.demands import IntegrityDemand
from solver.tuning.goals import MuGoal, TauGoal
from solver.tuning.groupings import named_partition
from solver.tuning.minimax import Box
from solver.tuning.objective import LoopObjective
from solver.tuning.phases import EXACT, Phases
from solver.tuning.record import LocalOptimum, SearchSummary, Status, Tuning
from solver.tuning.specification import Arrangement, Objective, Signs, Specification
from solver.tuning.together import Together

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.tuning.objective import Evaluation
    from solver.tuning.record import Progress

__all__ = ["tune_on_data"]

ROUGH, ROUGH_NU = 1e-5, 1e-4  # tolerance in s of a start's descent, and its barrier parameter
STARTS_PER_PARAMETER = 4
SAME = 5e-3  # difference of s below which optima may be one,
SAME_PLACE = 0.05  # and of the log parameters
POLISHED = 3
GAIN_STEP, GAIN_STEPS = 0.3, 12  # an unstable start is tried again with this share of its gains
BEYOND = 1e3  # how much wider the box is than the region of the starts
ROUNDING = 1e-9  # relative addition to tau_P that keeps mu <= 1 under rounding
LEAD = math.pi / 2  # phase that a derivative can add
HALF_POWER = math.sqrt(0.5)
AT_BOUND = 1e-6  # in log
GRACE = 2.0  # seconds after the end, in which the best so far is made exact

# What the data cannot answer, or nobody needs of them; with the field that asks for it.
_NOT_OFFERED = (
    ("scenarios", "/scenarios", "scenarios"),
    ("spread", "/spread", "a spread of parameters"),
    ("resolution", "/controller/resolution", "a resolution of the settings"),
    ("optimality_gap", "/search/optimality_gap", "a proof of optimality"),
)


def tune_on_data(
    specification: Specification, progress: Callable[[Progress], bool | None] | None = None
) -> Tuning:
    """Find the best settings at the frequencies of a `MeasuredPlant`.

    Parameters
    ----------
    specification : Specification
        The task, as the loops see it: inputs paired, scan time in the data.
    progress : callable or None
        As for `solver.tuning.tuner.tune`.

    Raises
    ------
    UnsupportedPlantError
        What is asked needs transfer functions, or stability cannot be decided on the data.

    """
    plant = specification.plant
    assert isinstance(plant, MeasuredPlant)  # noqa: S101 - for the type checker: who calls knows
    _refuse_what_data_lack(specification)
    return _Run(specification, plant, at_rest(plant), progress).result()


def _refuse_what_data_lack(specification: Specification) -> None:
    for name, where, words in _NOT_OFFERED:
        if getattr(specification, name):
            message = f"a plant given as frequency response does not serve {words}"
            raise UnsupportedPlantError(message, where)
    demands = specification.demands
    if demands.integrity is not IntegrityDemand.NONE:
        message = "integrity is not decided on a frequency response: give transfer functions"
        raise UnsupportedPlantError(message, "/demands/integrity")
    if demands.max_sensitivity_alone is not None:
        message = "the sensitivity between the frequencies of the data is not known: give "
        message += "transfer functions"
        raise UnsupportedPlantError(message, "/demands/max_sensitivity_alone")
    if specification.arrangement is Arrangement.BEST:
        message = "on a frequency response, name the arrangement: identical, independent, grouped"
        raise UnsupportedPlantError(message, "/controller/arrangement")
    if specification.signs is Signs.ANY:
        message = "on a frequency response the signs of the gains are those of its static gain"
        raise UnsupportedPlantError(message, "/controller/signs")


@dataclass(frozen=True, eq=False)
class _DataObjective(LoopObjective):
    """Levels at the frequencies of the data; stability as the data decide it."""

    static_gain: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    def _is_stable(self, theta: NDArray[np.float64], det: NDArray[np.complex128]) -> bool:
        del det
        loops = self.blocks.expand(self.controllers(theta))
        plant = self.blocks.plant
        assert isinstance(plant, MeasuredPlant)  # noqa: S101 - for the type checker
        return unstable_poles_on_data(plant, self.static_gain, loops) == 0


class _Run:
    """One tuning."""

    def __init__(
        self,
        specification: Specification,
        plant: MeasuredPlant,
        gain: NDArray[np.float64],
        progress: Callable[[Progress], bool | None] | None,
    ) -> None:
        self.specification, self.plant, self.gain = specification, plant, gain
        self.groups = named_partition(specification)
        self.signs = np.array([-1.0 if gain[g[0], g[0]] < 0 else 1.0 for g in self.groups])
        self._require_one_sign()
        self.clock = Clock(specification.time_limit, progress, self._as_objective)
        performance, uncertainty = specification.performance, specification.uncertainty
        tau = specification.objective is Objective.TAU_P
        part = _DataObjective(
            blocks=reduce(plant, self.groups, uncertainty, performance.output_scale),
            uncertainty=uncertainty,
            goal=TauGoal(performance) if tau else MuGoal(performance),
            kind=specification.kind,
            signs=self.signs,
            omega=plant.omega,
            nu=ROUGH_NU,
            static_gain=gain,
        )
        self.objective = Together((part,))
        slow = Performance(performance.max_peak, performance.offset)
        self.box, self.region = self._boxes()
        feasibility = self.objective.having(goal=MuGoal(slow))
        self.phases = Phases(feasibility, self.box, self.clock.tick)
        self.optima: list[_Optimum] = []

    def result(self) -> Tuning:
        """Search, choose, report."""
        status = Status.OPTIMAL if self.specification.start is None else Status.LOCAL
        starts = self._starts()
        self.clock.total = len(starts)
        try:
            for theta in starts:
                self._descend(theta)
                self.clock.done += 1
                self.clock.tick()
            best = self._polished()
        except OutOfTimeError:
            status = Status.TIME_LIMIT
            self.clock.grant(GRACE)
            best = None
            with suppress(OutOfTimeError):
                best = self._polished()
        return self._report(best, status)

    def _as_objective(self, s: float) -> float:
        return math.exp(s if self.specification.objective is Objective.TAU_P else s / 2)

    def _require_one_sign(self) -> None:
        for index, (group, sign) in enumerate(zip(self.groups, self.signs, strict=True)):
            for unit in group:
                if self.gain[unit, unit] * sign <= 0:
                    message = (
                        f"loops {group[0] + 1} and {unit + 1} have static gains of opposite signs, "
                        "or none: they cannot share one controller gain"
                    )
                    raise UnsupportedPlantError(message, f"/controller/groups/{index}")

    def _boxes(self) -> tuple[Box, Box]:
        """Return the box of the log parameters, and that of the starts.

        As `solver.tuning.bounds` has them for transfer functions, from what the data show. No time
        is longer than the slowest period of the data tells.
        """
        plant, task = self.plant, self.specification
        omega, names = plant.omega, task.kind.parameters
        ends: tuple[list[float], ...] = ([], [], [], [])
        for group in self.groups:
            own = [self._crossover(unit) for unit in group]
            crossover = max(own)
            there = int(np.searchsorted(omega, crossover, side="right")) - 1
            unit = group[own.index(crossover)]
            size = np.abs(plant.values[:, unit, unit])
            gain = max(float(size[there]), 1e-6 * float(size.max()))
            strongest = float(np.linalg.norm(plant.values[: there + 1], 2, axis=(1, 2)).max())
            bent = omega[size < HALF_POWER * size[0]]
            slowest = min(float(bent[0]) if bent.size else crossover, crossover)
            times = 0.01 / crossover, 10 / slowest
            for name in names:
                usual = times
                if name == "gain":
                    usual = 0.1 / max(strongest, gain), 30 / gain
                elif name == "filter_time":
                    usual = 0.1 * times[0], times[1]
                given = getattr(task.bounds, name)
                widest = usual[1] * BEYOND
                if name == "integral_time":
                    widest = max(1 / float(omega[0]), usual[0] * BEYOND)
                outer = given or (usual[0] / BEYOND, min(widest, LARGEST))
                inner = max(usual[0], outer[0]), min(usual[1], outer[1])
                if not inner[0] < inner[1]:  # the user wants it elsewhere
                    inner = outer
                for end, value in zip(ends, (*outer, *inner), strict=True):
                    end.append(math.log(value))
        rows, limits = planes(task.demands, task.kind, len(self.groups))
        inside = 1e-12  # so that exponentials do not pass the bounds by rounding
        low, high, *starts = map(np.array, ends)
        box = Box(low + inside, high - inside)
        if rows.size:
            box = replace(box, rows=rows, limits=limits)
        return box, Box(*starts)

    def _crossover(self, unit: int) -> float:
        """Return where a unit's own loop can cross over at most, rad per time unit."""
        omega = self.plant.omega
        weight = np.abs(self.specification.uncertainty.weight_of(unit).response(omega))
        own = self.plant.values[:, unit, unit] * np.sign(self.gain[unit, unit])
        phase = np.unwrap(np.angle(own))
        room = math.pi + (LEAD if "derivative_time" in self.specification.kind.parameters else 0.0)
        over = (weight >= 1) | (phase < -room)
        return float(omega[over][0]) if over.any() else float(omega[-1])

    def _starts(self) -> list[NDArray[np.float64]]:
        """Return starts, well spread over their region (Roberts 2018), that the seed fixes."""
        task, size = self.specification, self.region.low.size
        if task.start is not None:
            return [self._theta_of([task.start[group[0]] for group in self.groups])]
        count = task.starts or STARTS_PER_PARAMETER * size
        ratio = 1.0
        for _ in range(60):
            ratio = (1 + ratio) ** (1 / (size + 1))
        first = np.random.default_rng(task.seed).random(size)
        steps = np.arange(1, count + 1)[:, None] * ratio ** -np.arange(1.0, size + 1)
        low, high = self.region.low, self.region.high
        return list(low + (first + steps) % 1 * (high - low))

    def _theta_of(self, loops: list[Controller]) -> NDArray[np.float64]:
        theta = self.region.low.reshape(len(loops), -1).copy()
        for row, loop in zip(theta, loops, strict=True):
            for place, name in enumerate(self.specification.kind.parameters):
                value = loop.lag_time if name == "filter_time" else getattr(loop, name)
                if value:
                    row[place] = math.log(abs(value))
        return theta.ravel()

    def _descend(self, theta: NDArray[np.float64]) -> None:
        """Remember the local optimum below one start, if it leads to feasible settings."""
        objective = self.phases.feasibility if self.objective.goal.skewed else self.objective
        lower = np.zeros_like(theta)
        lower[:: objective.per_controller] = math.log(GAIN_STEP)
        for _ in range(GAIN_STEPS):
            here = objective.evaluate(self.box.clip(theta))
            if math.isfinite(here.value):
                break
            theta = theta + lower
        else:
            return
        if self.objective.goal.skewed:
            here = self.objective.evaluate(self.phases.feasible(here).theta)
        found = self.phases.best(self.objective, here, ROUGH)
        if math.isfinite(found.merit):
            self._remember(found.theta, found.merit)

    def _remember(self, theta: NDArray[np.float64], value: float) -> None:
        for index, known in enumerate(self.optima):
            near = np.abs(known.theta - theta).max() < SAME_PLACE
            if near and abs(known.value - value) < SAME:
                better = theta if value < known.value else known.theta
                self.optima[index] = _Optimum(better, min(value, known.value), known.count + 1)
                break
        else:
            self.optima.append(_Optimum(theta, value, 1))
        self.optima.sort(key=lambda each: each.value)

    def _polished(self) -> Evaluation | None:
        """Return the best of the best optima, to all digits."""
        exact, best = self.objective.having(nu=FINE), None
        for known in self.optima[:POLISHED]:
            found = self.phases.best(exact, exact.evaluate(known.theta), EXACT)
            if math.isfinite(found.value) and (best is None or found.value < best.value):
                best = found
        return best

    def _report(self, best: Evaluation | None, status: Status) -> Tuning:
        """Return the result, every number of it computed anew from the settings."""
        task = self.specification
        if best is None:
            return self._without(status, "at the frequencies of the data none were found")
        controllers = self.objective.controllers(best.theta)
        loops = self.objective.parts[0].blocks.expand(controllers)
        performance = task.performance
        if task.objective is Objective.TAU_P:
            value = math.exp(best.value) * (1 + ROUNDING)
            if value > LARGEST:
                return self._without(status, "tau_P would be too large a number")
            performance = performance.with_tau_p(value)
        unstable = unstable_poles_on_data(self.plant, self.gain, loops)
        if unstable != 0:
            reason = unstable if isinstance(unstable, Undecided) else "the loops are unstable"
            return self._without(status, reason)
        curves = data_analysis(self.plant, task.uncertainty, performance, loops).curves(
            self.plant.omega
        )
        peaks = peaks_of(curves)
        bound = [
            f"the {name.replace('_', ' ')} of group {index + 1} lies on its bound"
            for index, row in enumerate(best.theta.reshape(len(self.groups), -1))
            for name, value, low, high in zip(
                task.kind.parameters,
                row,
                self.box.low.reshape(len(self.groups), -1)[index],
                self.box.high.reshape(len(self.groups), -1)[index],
                strict=True,
            )
            if min(value - low, high - value) < AT_BOUND
        ]
        return Tuning(
            status=status,
            objective=task.objective.value,
            tau_p=performance.tau_p,
            peaks=peaks,
            loops=loops,
            groups=self.groups,
            nominally_stable=True,
            search=self._summary(),
            curves=curves,
            guarantee=on_data(self.plant, peaks),
            demands=outcomes(task.demands, (), loops),
            as_found=as_found_on_data(task, performance, self.gain),
            warnings=tuple(filter(None, [demand_unseen(self.plant, performance), *bound])),
        )

    def _without(self, status: Status, reason: str) -> Tuning:
        timed = status is Status.TIME_LIMIT
        return Tuning(
            status=status if timed else Status.INFEASIBLE,
            objective=self.specification.objective.value,
            tau_p=None,
            peaks=None,
            loops=(),
            groups=self.groups,
            nominally_stable=False,
            search=self._summary(),
            curves=None,
            as_found=as_found_on_data(self.specification, None, self.gain),
            reason="no feasible settings were found within the time limit" if timed else reason,
        )

    def _summary(self) -> SearchSummary:
        found = tuple(
            LocalOptimum(
                self._as_objective(each.value),
                each.count,
                self.objective.parts[0].blocks.expand(self.objective.controllers(each.theta)),
            )
            for each in self.optima
        )
        task = self.specification
        return SearchSummary(self.clock.done, found, task.seed, self.clock.elapsed)


@dataclass(frozen=True)
class _Optimum:
    """A local optimum, and how many starts ended there."""

    theta: NDArray[np.float64]
    value: float
    count: int
