"""The search for settings on frequency-response data, for one grouping of the loops.

Local descents from starts spread over a region that the data tell. Some cases are kept in sight;
one that the best settings break, a plant of a spread among them, is taken in, and the search goes
on from there.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import UnsupportedPlantError
from solver.model.measured import MeasuredPlant
from solver.model.transfer_function import LARGEST
from solver.model.weights import Performance
from solver.mu.kernel import FINE
from solver.tuning.clock import OutOfTimeError
from solver.tuning.data_objective import data_objective
from solver.tuning.demand_checks import planes
from solver.tuning.goals import MuGoal, TauGoal
from solver.tuning.minimax import Box
from solver.tuning.phases import EXACT, Phases
from solver.tuning.settle import SPREAD_ROUNDS, WORSE
from solver.tuning.specification import Objective
from solver.tuning.spread import SpreadOutcome, lattice, refined
from solver.tuning.together import Together

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.tuning.clock import Clock
    from solver.tuning.data_objective import DataObjective
    from solver.tuning.goals import Goal
    from solver.tuning.groupings import Groups
    from solver.tuning.objective import Evaluation
    from solver.tuning.scenarios import Case
    from solver.tuning.specification import Specification
    from solver.tuning.spread import Deviation

__all__ = ["DataSearch", "Optimum"]

ROUGH, ROUGH_NU = 1e-5, 1e-4  # tolerance in s of a start's descent, and its barrier parameter
STARTS_PER_PARAMETER = 4
SAME = 5e-3  # difference of s below which optima may be one,
SAME_PLACE = 0.05  # and of the log parameters
POLISHED = 3
GAIN_STEP, GAIN_STEPS = 0.3, 12  # an unstable start is tried again with this share of its gains
BEYOND = 1e3  # how much wider the box is than the region of the starts
LEAD = math.pi / 2  # phase that a derivative can add
HALF_POWER = math.sqrt(0.5)
AT_BOUND = 1e-6  # in log
GRACE = 2.0  # seconds after the end, in which the best so far is made exact
IN_SIGHT = 8  # cases that the descents look at, the task's own among them


@dataclass(frozen=True)
class Optimum:
    """A local optimum, and how many starts ended there."""

    theta: NDArray[np.float64]
    value: float
    count: int


class DataSearch:
    """One grouping.

    Parameters
    ----------
    task : Specification
        Of `MeasuredPlant`s, as the loops see them.
    groups : Groups
        Units that share settings.
    gain : (n, n)
        Static gain of the task's plant.
    clock : Clock
        Asked for time.
    beside : (m,) or None
        Log parameters of one more start.

    Raises
    ------
    UnsupportedPlantError
        Units of a group need gains of opposite signs; or stability of a case cannot be decided.

    """

    def __init__(
        self,
        task: Specification,
        groups: Groups,
        gain: NDArray[np.float64],
        clock: Clock,
        beside: NDArray[np.float64] | None = None,
    ) -> None:
        self.task, self.groups, self.gain, self.clock = task, groups, gain, clock
        self.beside = beside
        self.signs = np.array([-1.0 if gain[g[0], g[0]] < 0 else 1.0 for g in groups])
        self._require_one_sign()
        self.cases: list[Case] = list(task.cases(groups))
        self.sight: list[int] = []
        places = np.linspace(0, len(self.cases) - 1, min(len(self.cases), IN_SIGHT)).astype(int)
        tau = task.objective is Objective.TAU_P
        self.goal: Goal = TauGoal(task.performance) if tau else MuGoal(task.performance)
        self.box, self.region = self._boxes()
        self.optima: list[Optimum] = []
        self.closest: tuple[float, NDArray[np.float64]] | None = None
        self.spread: SpreadOutcome | None = None
        self.late = False
        self._see([self._part(index) for index in np.unique(places).tolist()], places.tolist())

    def run(self) -> Evaluation | None:
        """Return the best settings found; None where none keep what is asked."""
        starts = self._starts()
        self.clock.total += len(starts)
        try:
            for theta in starts:
                self._descend(theta)
                self.clock.done += 1
                self.clock.tick()
            return self._served(self._polished())
        except OutOfTimeError:
            self.late = True
            self.clock.grant(GRACE)
            best = None
            with suppress(OutOfTimeError):
                best = self._polished()
                best = self._served(best)
            return best

    @property
    def exact(self) -> Together:
        """Levels of the cases in sight, to all digits."""
        return self.objective.having(nu=FINE)

    def part_of(self, case: Case) -> DataObjective:
        """Return what one case asks of the settings, to all digits."""
        return data_objective(self.task, case, self.goal, self.signs, FINE)

    def of_all(self, theta: NDArray[np.float64]) -> list[float]:
        """Return the least s of each case."""
        return [self.part_of(case).evaluate(theta).value for case in self.cases]

    def over_spread(self, theta: NDArray[np.float64]) -> tuple[float, Case] | None:
        """Return the worst plant found in the boxes of the given plants; None: nothing spreads."""
        task = self.task
        if task.spread is None:
            return None
        number, tried, worst = len(task.scenarios) + 1, 0, None
        for case in [case for case in self.cases if number not in case.scenarios]:
            axes = task.spread.axes(case.plant)
            if not axes:
                continue

            def value(deviation: Deviation, case: Case = case) -> float:
                assert task.spread is not None  # noqa: S101 - for the type checker
                self.clock.tick()
                beside = case.deviating(task.spread, deviation, number)
                return self.part_of(beside).evaluate(theta).value

            points = lattice(len(axes))
            values = [value(point) for point in points]
            deviation, height, more = refined(value, points, values)
            tried += len(points) + more
            if worst is None or height > worst[0]:
                beside = case.deviating(task.spread, deviation, number)
                errors = tuple(
                    (a.title, share * a.width) for a, share in zip(axes, deviation, strict=True)
                )
                worst = height, beside, errors
        if worst is None:
            return None
        height, beside, errors = worst
        tau = task.objective is Objective.TAU_P and math.isfinite(height)
        self.spread = SpreadOutcome(tried, errors, math.exp(height) if tau else None)
        return height, beside

    def include(self, case: Case) -> None:
        """Take a further case among those that the settings must serve, and keep it in sight."""
        self.cases.append(case)
        self._keep(len(self.cases) - 1)

    def on_bounds(self, theta: NDArray[np.float64]) -> list[str]:
        """Say which settings lie on their bounds."""
        shape = len(self.groups), -1
        return [
            f"the {name.replace('_', ' ')} of group {index + 1} lies on its bound"
            for index, (row, low, high) in enumerate(
                zip(
                    theta.reshape(shape), self.box.low.reshape(shape), self.box.high.reshape(shape),
                    strict=True,
                )
            )
            for name, value, least, most in zip(
                self.task.kind.parameters, row, low, high, strict=True
            )
            if min(value - least, most - value) < AT_BOUND
        ]  # fmt: skip

    def slowest(self, theta: NDArray[np.float64]) -> tuple[float, Case]:
        """Return the peak of mu of an infinitely slow demand, and the case that has it."""
        found = []
        for case in self.cases:
            part = replace(self.part_of(case), goal=self._slow, alone=None, service=None)
            found.append((math.exp(part.evaluate(theta).value / 2), case))
        return max(found, key=lambda each: each[0])

    @property
    def _slow(self) -> MuGoal:
        performance = self.task.performance
        return MuGoal(Performance(performance.max_peak, performance.offset))

    def _part(self, index: int) -> DataObjective:
        case = self.cases[index]
        try:
            return data_objective(self.task, case, self.goal, self.signs, ROUGH_NU)
        except UnsupportedPlantError as error:
            number = case.scenarios[0]
            if not 0 < number <= len(self.task.scenarios):
                raise
            raise UnsupportedPlantError(
                error.message, f"/scenarios/{number - 1}{error.field.removeprefix('/plant')}"
            ) from None

    def _see(self, parts: Sequence[DataObjective], places: Sequence[int]) -> None:
        self.sight += places
        self.objective = Together(tuple(parts))
        self.phases = Phases(self.objective.having(goal=self._slow), self.box, self.clock.tick)

    def _keep(self, index: int) -> None:
        self._see([*self.objective.parts, self._part(index)], [index])  # type: ignore[list-item]

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
        task = self.task
        plant = task.plant
        assert isinstance(plant, MeasuredPlant)  # noqa: S101 - for the type checker
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
        rows, limits = planes(task.demands, task.kind, self.groups)
        inside = 1e-12  # so that exponentials do not pass the bounds by rounding
        low, high, *starts = map(np.array, ends)
        box = Box(low + inside, high - inside)
        if rows.size:
            box = replace(box, rows=rows, limits=limits)
        return box, Box(*starts)

    def _crossover(self, unit: int) -> float:
        """Return where a unit's own loop can cross over at most, rad per time unit."""
        plant = self.task.plant
        assert isinstance(plant, MeasuredPlant)  # noqa: S101 - for the type checker
        omega = plant.omega
        weight = np.abs(self.task.uncertainty.weight_of(unit).response(omega))
        own = plant.values[:, unit, unit] * np.sign(self.gain[unit, unit])
        phase = np.unwrap(np.angle(own))
        room = math.pi + (LEAD if "derivative_time" in self.task.kind.parameters else 0.0)
        over = (weight >= 1) | (phase < -room)
        return float(omega[over][0]) if over.any() else float(omega[-1])

    def _starts(self) -> list[NDArray[np.float64]]:
        """Return starts, well spread over their region (Roberts 2018), that the seed fixes."""
        task, size = self.task, self.region.low.size
        if task.start is not None:
            return [self._theta_of([task.start[group[0]] for group in self.groups])]
        count = task.starts or STARTS_PER_PARAMETER * size
        ratio = 1.0
        for _ in range(60):
            ratio = (1 + ratio) ** (1 / (size + 1))
        first = np.random.default_rng(task.seed).random(size)
        steps = np.arange(1, count + 1)[:, None] * ratio ** -np.arange(1.0, size + 1)
        low, high = self.region.low, self.region.high
        spread = list(low + (first + steps) % 1 * (high - low))
        return spread if self.beside is None else [self.beside, *spread]

    def _theta_of(self, loops: list[Controller]) -> NDArray[np.float64]:
        theta = self.region.low.reshape(len(loops), -1).copy()
        for row, loop in zip(theta, loops, strict=True):
            for place, name in enumerate(self.task.kind.parameters):
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
            near = self.phases.feasible(here)
            if math.isfinite(near.merit) and (self.closest is None or near.merit < self.closest[0]):
                self.closest = near.merit, near.theta
            here = self.objective.evaluate(near.theta)
        found = self.phases.best(self.objective, here, ROUGH)
        if math.isfinite(found.merit):
            self._remember(found.theta, found.merit)

    def _remember(self, theta: NDArray[np.float64], value: float) -> None:
        for index, known in enumerate(self.optima):
            near = np.abs(known.theta - theta).max() < SAME_PLACE
            if near and abs(known.value - value) < SAME:
                better = theta if value < known.value else known.theta
                self.optima[index] = Optimum(better, min(value, known.value), known.count + 1)
                break
        else:
            self.optima.append(Optimum(theta, value, 1))
        self.optima.sort(key=lambda each: each.value)

    def _polished(self) -> Evaluation | None:
        """Return the best of the best optima, to all digits."""
        exact, best = self.exact, None
        for known in self.optima[:POLISHED]:
            found = self.phases.best(exact, exact.evaluate(known.theta), EXACT)
            if math.isfinite(found.value) and (best is None or found.value < best.value):
                best = found
        return best

    def _served(self, best: Evaluation | None) -> Evaluation | None:
        """Return settings that serve the other cases and the spread as well."""
        for _ in range(len(self.cases) + SPREAD_ROUNDS):
            if best is None:
                return None
            others = [i for i in range(len(self.cases)) if i not in self.sight]
            values = [self.part_of(self.cases[i]).evaluate(best.theta).value for i in others]
            if values and max(values) > best.value + WORSE:
                self._keep(others[int(np.argmax(values))])
            else:
                worst = self.over_spread(best.theta)
                if worst is None or worst[0] <= best.value + WORSE:
                    return best
                self.include(worst[1])
            best = self._again(best)
        return best

    def _again(self, best: Evaluation) -> Evaluation | None:
        """Return the best settings beside known ones, with the cases now in sight."""
        exact = self.exact
        here = exact.evaluate(best.theta)
        if self.goal.skewed and not math.isfinite(here.value):
            here = exact.evaluate(
                self.phases.feasible(self.phases.feasibility.evaluate(best.theta)).theta
            )
        found = self.phases.best(exact, here, EXACT)
        return found if math.isfinite(found.value) else None
