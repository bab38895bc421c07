"""Multi-start search for the best settings of one grouping.

Every start descends in two phases. While no tau_P at all can be had, mu at an infinitely slow
loop is made smaller (its peak below 1 means that some tau_P exists); from there the objective
itself. The grid then receives the refined peaks of the best optima until the reported peak no
longer moves. There is no guarantee that the best optimum found is the global one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import corners, grid, resonances
from solver.model.peaks import Peak
from solver.model.transfer_function import LARGEST
from solver.model.weights import Performance
from solver.mu.kernel import FINE
from solver.optimality.record import SettingsProblem
from solver.stability.closed_loop import unstable_poles
from solver.tuning.alone import LoopsAlone
from solver.tuning.bounds import gain_signs, search_region
from solver.tuning.demand_checks import outcomes, planes
from solver.tuning.demands import IntegrityDemand
from solver.tuning.exact import WEAKEST, Candidate, ExactDescent
from solver.tuning.goals import MuGoal, TauGoal
from solver.tuning.objective import Evaluation, LoopObjective
from solver.tuning.phases import Phases
from solver.tuning.scenarios import sets_in_service
from solver.tuning.service_sets import ServiceSets
from solver.tuning.specification import ControllerKind, Objective, Specification
from solver.tuning.spread import SpreadOutcome, lattice, refined
from solver.tuning.together import Together

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.tuning.goals import Goal
    from solver.tuning.groupings import Groups
    from solver.tuning.scenarios import Case
    from solver.tuning.spread import Deviation

__all__ = ["FoundOptimum", "Freedom", "GroupingSearch"]

POINTS_PER_DECADE = 11
FAR = 1e6  # over the end of the grid: there what is not fed through has died away
PHASES = 64  # of a dead time at infinity
TURNING = 3.0  # radians by the crossover from which phases are sampled,
PHASES_BELOW = 120  # at so many frequencies
SAME_VALUE = 5e-3  # difference of s below which two optima may be one
SAME_PLACE = 0.05  # and of the log parameters
FLAT = 1e-4  # difference of s between optima that are one to the count of optima
OFTEN = 5  # starts that end in the best optimum, after which
FEWER = 3  # a third of those planned is enough
ROUGH = 1e-5  # tolerance in s of a start's descent
ROUGH_NU = 1e-4  # and its barrier parameter
CLOSE = 1e-4  # tolerance in s of the way from known settings on the grid
POLISHED = 3  # optima whose exact values are found
HOP = 1.0  # in log time
NEARLY_SINGULAR = 1e-5  # gain of the weakest direction over the strongest one's
UNSEEN = 5e-3  # of s between the grid's points, from which optima of the grid may be none
REFINEMENTS = 3
NEARER = 5  # descents to settings that nearly meet the demand
SWAPPED = 2  # optima whose times are swapped
GAIN_STEP = 0.3  # an unstable start is tried again with this share of its gains
GAIN_STEPS = 12
MOST_AT_FIRST = 8  # cases kept in sight from the start; others join where they are broken


@dataclass(frozen=True)
class FoundOptimum:
    """A local optimum and how many starts ended there; of the grid, or exact."""

    theta: NDArray[np.float64]
    value: float
    count: int


_Found = FoundOptimum | Candidate


def _of_grid(found: Evaluation) -> FoundOptimum:
    # A trifle that is missing far above the bandwidth would stand for any value.
    return FoundOptimum(found.theta, found.merit, 0)


@dataclass(frozen=True)
class Freedom:
    """What a search may choose: which units share settings, which parameters, with which signs.

    `signs` are those of the groups' gains.
    """

    groups: Groups
    kind: ControllerKind
    signs: tuple[float, ...]

    @classmethod
    def usual(cls, specification: Specification, groups: Groups) -> Freedom:
        """Return that of a task for one grouping, with the usual signs."""
        return cls(groups, specification.kind, gain_signs(specification.plant, groups))


class GroupingSearch:
    """The search for one grouping.

    Parameters
    ----------
    specification : Specification
        The task.
    freedom : Freedom
        What may be chosen; the kind is the task's, or one contained in it.
    checkpoint : callable
        Called often; may raise to stop.

    """

    def __init__(
        self,
        specification: Specification,
        freedom: Freedom,
        checkpoint: Callable[[], None],
    ) -> None:
        self.freedom = freedom
        bounds = specification.bounds
        for name in set(specification.kind.parameters) - set(freedom.kind.parameters):
            bounds = replace(bounds, **{name: None})
        specification = replace(specification, kind=freedom.kind, bounds=bounds)
        self.specification = specification
        self.groups = groups = freedom.groups
        self.cases = specification.cases(groups)
        self.active = _first_active(self.cases)
        self.region = search_region(specification, groups)
        self.box = self.region.box
        demands = specification.demands
        rows, limits = planes(demands, freedom.kind, groups)
        if rows.size:
            self.box = replace(self.box, rows=rows, limits=limits)
        performance = specification.performance
        self.goal: Goal
        if specification.objective is Objective.TAU_P:
            self.goal = TauGoal(performance)
        else:
            self.goal = MuGoal(performance)
        self.objective = self._together(tuple(self._part(self.cases[i]) for i in self.active))
        self.blocks = self.objective.parts[0].blocks
        slow = Performance(performance.max_peak, performance.offset)
        feasibility = self.objective.having(goal=MuGoal(slow))
        self.phases = Phases(feasibility, self.box, checkpoint)
        self.exact = ExactDescent(self.objective, self.phases)
        self.optima: list[FoundOptimum] = []
        self.closest: Evaluation | None = None

    def _part(self, case: Case) -> LoopObjective:
        """Return the levels of one case on a grid of its own."""
        task, plant, blocks = self.specification, case.plant, case.blocks()
        bends = corners(plant, case.uncertainty)
        extra = [resonances(plant), self._turning(plant)]
        end = 30 * max(bends[-1], self.region.fastest)
        omega = grid(1e-2 * bends[0], end, POINTS_PER_DECADE, extra)
        omega = np.concatenate([self._below(blocks, omega[0]), omega, _far(plant, omega[-1])])
        alone, most = None, task.demands.max_sensitivity_alone
        # Of the same plant with loops in manual each loop alone is the same.
        if most is not None and (case.scenarios[0] == 0 or case.plant.n == task.plant.n):
            alone = LoopsAlone.of(plant, blocks.groups, most)
        service, integrity = None, task.demands.integrity
        if integrity is not IntegrityDemand.NONE and (
            case.scenarios[0] == 0 or (case.plant.n == task.plant.n and case.plant in task.plants)
        ):
            robust = integrity is IntegrityDemand.ROBUSTLY_STABLE
            service = ServiceSets.of(sets_in_service(case, self.groups), robust=robust)
        return LoopObjective(
            blocks,
            case.uncertainty,
            self.goal,
            self.freedom.kind,
            np.array(self.freedom.signs),
            omega,
            ROUGH_NU,
            alone=alone,
            service=service,
        )

    def _together(self, parts: tuple[LoopObjective, ...]) -> Together:
        """Return the levels of all parts; controllers change places where no level tells them."""
        one_by_one = any(part.alone is not None or part.service is not None for part in parts)
        if one_by_one or not self._like_pairs:
            return Together(parts)
        return Together(parts, np.array(self._like_pairs))

    def worst_of_spread(self, candidate: Candidate) -> tuple[Case, SpreadOutcome, float] | None:
        """Return the worst plant found in the boxes of the cases in sight, and its exact s.

        None where nothing spreads.
        """
        task = self.specification
        if task.spread is None:
            return None
        number, theta, tried = len(task.scenarios) + 1, candidate.theta, 0
        worst: tuple[float, Case, dict[str, float]] | None = None
        for index, part in zip(self.active, self.objective.parts, strict=True):
            case = self.cases[index]
            axes = task.spread.axes(case.plant)
            if number in case.scenarios or not axes:
                continue
            omega = np.unique(np.concatenate([part.omega, *candidate.peaks]))
            fixed = replace(
                part, omega=omega, followed=np.empty(0), nu=FINE, alone=None, service=None
            )

            def value(
                deviation: Deviation, case: Case = case, fixed: LoopObjective = fixed
            ) -> float:
                assert task.spread is not None  # noqa: S101 - for the type checker
                beside = case.deviating(task.spread, deviation, number)
                here = replace(fixed, blocks=beside.blocks()).evaluate(theta)
                return here.s if math.isfinite(here.merit) else math.inf

            points = lattice(len(axes))
            values = [value(point) for point in points]
            deviation, _, more = refined(value, points, values)
            tried += len(points) + more
            beside = case.deviating(task.spread, deviation, number)
            alone = replace(self.exact, objective=Together((self._part(beside),)))
            s = alone.measure(theta, candidate.value).value
            if worst is None or s > worst[0]:
                errors = {
                    axis.title: share * axis.width
                    for axis, share in zip(axes, deviation, strict=True)
                }
                worst = s, beside, errors
        if worst is None:
            return None
        s, beside, errors = worst
        tau_p = None
        if task.objective is Objective.TAU_P and math.isfinite(s):
            tau_p = math.exp(s)
        return beside, SpreadOutcome(tried, tuple(errors.items()), tau_p), s

    def include(self, case: Case) -> None:
        """Take a further case among those that the settings must serve, and keep it in sight."""
        self.cases = (*self.cases, case)
        self.activate(len(self.cases) - 1)

    def activate(self, index: int) -> int:
        """Take a case among those that the search keeps in sight; return its part."""
        if index not in self.active:
            self.active.append(index)
            part = replace(self._part(self.cases[index]), penalty=self.objective.penalty)
            self._having((*self.objective.parts, part))
        return self.active.index(index)

    def _below(self, blocks: LoopBlocks, bend: float) -> NDArray[np.float64]:
        """Frequencies down to the limit for omega -> 0, for its value and slope.

        The limit is reached as omega^2, by a weak direction of the plant at lower frequencies.
        """
        gains = blocks.known(np.array([1j * bend]))
        singular = np.concatenate([np.linalg.svd(G[0], compute_uv=False) for G in gains])
        weakest = max(singular.min() / singular.max(), WEAKEST)
        # An integral time far above the plant's own bends the curves down there.
        low = min(1e-2 * bend * weakest, 1e-2 * math.exp(-self._longest))
        between = np.geomspace(low, bend, 2 * math.ceil(math.log10(bend / low)) + 1)[1:-1]
        return np.concatenate([[low, 2 * low], between])

    def _turning(self, plant: Plant) -> NDArray[np.float64]:
        """Frequencies up to the crossover, where a long dead time turns the phase many times.

        So many that some are near the worst phase; which, the last descents find out.
        """
        longest = max(element.dead_time for element in plant.elements)
        if longest * self.region.crossover < TURNING:
            return np.empty(0)
        return np.geomspace(1 / longest, 10 * self.region.crossover, PHASES_BELOW)

    @property
    def nearly_singular(self) -> bool:
        """Whether the plant has a direction far weaker than its strongest one, at low frequency."""
        for part in self.objective.parts:
            gains = part.blocks.known(np.array([1j * part.omega[0]]))
            singular = np.concatenate([np.linalg.svd(G[0], compute_uv=False) for G in gains])
            if singular.min() < NEARLY_SINGULAR * singular.max():
                return True
        return False

    @property
    def _longest(self) -> float:
        """Logarithm of the longest integral time that starts are drawn from."""
        return float(self.region.starts.high[1 :: len(self.specification.kind.parameters)].max())

    @property
    def problem(self) -> SettingsProblem:
        """What is asked for, as a proof of optimality takes it."""
        objective = self.objective.parts[0]
        return SettingsProblem(
            self.blocks, objective.uncertainty, self.specification.performance, objective.signs,
            self.box.low, self.box.high, objective.omega,
        )  # fmt: skip

    @property
    def settled(self) -> bool:
        """Whether the starts made so far let one expect no further optimum.

        The Bayesian rule of Boender and Rinnooy Kan (1987): with equally likely unknown optima, w
        found by N starts, there are w (N - 1)/(N - w - 2) of them to be expected.
        """
        found = [optimum for optimum in self.optima if optimum.count > 0]
        values = [optimum.value for optimum in found]
        # Places along a flat valley, or permuted ones of nearly equal settings, are one optimum.
        w = len(found) - sum(b - a < FLAT for a, b in pairwise(values))
        N = sum(optimum.count for optimum in found)
        return w > 0 and w * (N - 1) < (w + 0.5) * (N - w - 2)

    @property
    def lowest(self) -> float:
        """The least value so far; infinite before the first."""
        return self.optima[0].value if self.optima else math.inf

    def confirmed(self, planned: int) -> bool:
        """Whether the best optimum was met so often that few of the `planned` starts are enough."""
        if not self.optima:
            return False
        best = self.optima[0].value
        met = sum(optimum.count for optimum in self.optima if optimum.value < best + FLAT)
        made = sum(optimum.count for optimum in self.optima)
        return met >= OFTEN and made >= planned / FEWER

    def starts(self, count: int) -> NDArray[np.float64]:
        """Return starting points (count, m), well spread over their region, that the seed fixes.

        Multiples of powers of the generalised golden ratio, modulo 1 (Roberts 2018).
        """
        size = self.box.low.size
        ratio = 1.0
        for _ in range(60):
            ratio = (1 + ratio) ** (1 / (size + 1))
        first = np.random.default_rng(self.specification.seed).random(size)
        steps = np.arange(1, count + 1)[:, None] * ratio ** -np.arange(1.0, size + 1)
        low, high = self.region.starts.low, self.region.starts.high
        return np.asarray(low + (first + steps) % 1 * (high - low))

    def descend(self, theta: NDArray[np.float64], count: int = 1) -> None:
        """Remember the local optimum below one start, if it leads to feasible settings.

        It counts as `count` starts: 0 where the point was not drawn.
        """
        here = self._stable(theta)
        if here is None:
            return
        if self.objective.goal.skewed:
            feasible = self.phases.feasible(here)
            if self.closest is None or feasible.value < self.closest.value:
                self.closest = feasible
            if feasible.value >= 0:
                return
            here = self.objective.evaluate(feasible.theta)
        found = self.phases.best(self.objective, here, ROUGH, self._is_known)
        if math.isfinite(found.merit):
            self._remember(_of_grid(found), count)

    def beside(self, here: Evaluation, tolerance: float) -> Candidate | None:
        """Return the optimum on the whole axis beside one point, and remember it as its start's.

        None: the point is too far from the demand. By way of the grid, whose evaluations are
        cheaper: where that ends the same peaks are active, as a rule.
        """
        theta = here.theta
        if math.isfinite(here.value):
            theta = self.phases.best(self.objective, here, CLOSE).theta
        found = self.exact.descend(theta, tolerance=tolerance)
        if found is not None:
            self._remember(found, 1)
        return found

    def _is_known(self, here: Evaluation) -> bool:
        return self._known(_of_grid(here)) is not None

    def swap(self) -> None:
        """Descend from the best optima with tau_I and tau_D in each other's place.

        The cascade form is nearly symmetric in the two, so optima come in pairs; what stays the
        same is the gain at low frequencies, k/tau_I.
        """
        per = self.objective.per_controller
        if "derivative_time" not in self.specification.kind.parameters:
            return
        for best in [optimum.theta for optimum in self.optima[:SWAPPED]]:
            rows = [[place] for place in self._unlike(best)]
            if len(self.groups) > 1:
                rows.append(list(range(len(self.groups))))
            for chosen in rows:
                theta = best.reshape(-1, per).copy()
                theta[chosen, 0] += theta[chosen, 2] - theta[chosen, 1]
                theta[chosen, 1:3] = theta[chosen, 2:0:-1]
                self.descend(self.box.clip(theta.ravel()), count=0)

    def exchange(self) -> None:
        """Descend from the best optimum with the settings of two groups in each other's place.

        Which groups of like units integrate fast, and which near the plant's own time constant, is
        settled by their sizes alone: the optima of one choice and of the other are far apart.
        """
        if not self.specification.interchangeable or not self.optima:
            return
        best = self.optima[0].theta
        for pair in combinations(range(len(self.groups)), 2):
            if pair in self._like_pairs:
                continue
            theta = best.reshape(len(self.groups), -1).copy()
            theta[list(pair)] = theta[list(pair[::-1])]
            self.descend(self.box.clip(theta.ravel()), count=0)

    def hop(self) -> None:
        """Descend from beside the best optimum, until none better is found.

        Optima of unlike controllers lie in rows, one integral or derivative time after the other
        shorter than the last (monotonic basin hopping, Leary 2000).
        """
        if len(self.groups) == 1:
            return
        left = self._hops()
        while left:
            best = self.optima[0]
            self.descend(self.box.clip(best.theta + left.pop()), count=0)
            if self.optima[0].value < best.value - ROUGH:
                left = self._hops()

    def _hops(self) -> list[NDArray[np.float64]]:
        """Return steps from the best optimum along each time; of unlike units along gain and tau_I.

        There a loop has optima with fast and with slow integral action whose k/tau_I is much alike.
        """
        if not self.optima:
            return []
        per, steps = self.objective.per_controller, np.eye(self.box.low.size)
        ways = [[time] for time in range(1, per)]
        if not self.specification.interchangeable:
            ways.append([0, 1])
        return [
            sign * HOP * steps[[place * per + parameter for parameter in way]].sum(axis=0)
            for place in self._unlike(self.optima[0].theta)
            for way in ways
            for sign in (-1, 1)
        ]

    def refine(self) -> bool:
        """Put the peaks of the best optimum into the grid where it saw too little of them.

        A long dead time turns the phase between its points, and what looks best on them need not
        be. Returns whether the best optimum now is another one, whose neighbours are not known.
        """
        if len(self.groups) == 1 and len(self.optima) <= POLISHED:
            return False  # its neighbours were not looked at, and all optima are made exact
        before = self.optima[0].theta if self.optima else None
        for _ in range(REFINEMENTS):
            if not self.optima:
                break
            here = self.objective.evaluate(self.optima[0].theta)
            if not math.isfinite(here.value):
                break
            exact = self.exact.measure(here.theta, here.s)
            if exact.value < here.s + UNSEEN:
                break
            for index, peaks in enumerate(exact.peaks):
                self.look_at(peaks, index)
            # On more frequencies values only rise: what is above stays above.
            refined = [
                self._again(optimum) if optimum.value < exact.value else optimum
                for optimum in self.optima
            ]
            self.optima = []
            for optimum in refined:
                if math.isfinite(optimum.value):
                    self._remember(optimum, optimum.count)
        return bool(self.optima) and self.optima[0].theta is not before

    def nearly_feasible(self, theta: NDArray[np.float64]) -> Evaluation:
        """Return settings near `theta` with the least peak of mu under an infinitely slow demand.

        On the whole axis. Where the demand limits no integral time the valley there is long and
        flat, with a bend along it: a descent that ends in it is begun again.
        """
        feasibility = self.phases.feasibility
        exact = replace(self.exact, objective=feasibility)
        best: Candidate | None = None
        for _ in range(NEARER):
            found = exact.descend(theta if best is None else best.theta)
            if found is None or (best is not None and found.value > best.value - ROUGH):
                break
            best = found
        return feasibility.evaluate(theta if best is None else best.theta)

    def slowest_demand(self, here: Evaluation) -> tuple[Peak, Case]:
        """Return the peak of mu under an infinitely slow demand, and the case that has it.

        Between the grid's points too.
        """
        exact = replace(self.exact, objective=self.phases.feasibility)
        found = exact.measure(here.theta, here.s)
        mu = np.concatenate(
            [exact.attained(found.theta, peaks, part) for part, peaks in enumerate(found.peaks)]
        )
        omega = np.concatenate(found.peaks)
        worst = int(mu.argmax())
        part = int(np.searchsorted(np.cumsum([p.size for p in found.peaks]), worst, side="right"))
        peak = Peak(math.exp(float(mu.max()) / 2), float(omega[worst]))
        return peak, self.cases[self.active[part]]

    def on_given_bounds(self, theta: NDArray[np.float64]) -> list[str]:
        """Return the names of the parameters that lie on bounds that the user gave."""
        names = self.objective.kind.parameters
        on = np.stack([theta <= self.box.low, theta >= self.box.high], axis=1) & self.region.given
        return sorted({names[index % len(names)] for index in np.flatnonzero(on.any(axis=1))})

    def look_at(self, omega: NDArray[np.float64], part: int | None = None) -> None:
        """Add frequencies (rad per time unit), where a proof found more, to the grid of a part."""
        self._having(
            tuple(
                replace(own, omega=np.union1d(own.omega, omega)) if part in {None, index} else own
                for index, own in enumerate(self.objective.parts)
            )
        )

    def widen(self, theta: NDArray[np.float64], index: int, factor: float) -> float:
        """Move the bound of one parameter that `theta` is on outwards, and return it."""
        low, high = self.box.low.copy(), self.box.high.copy()
        lower = theta[index] - low[index] < high[index] - theta[index]
        if lower:
            low[index] -= math.log(factor)
        else:
            high[index] = min(high[index] + math.log(factor), math.log(LARGEST))
        self.box = replace(self.box, low=low, high=high)
        self._having(self.objective.parts)
        return float((low if lower else high)[index])

    def within(self, low: NDArray[np.float64]) -> ExactDescent:
        """Return the last descent, with other lower bounds of the parameters."""
        phases = replace(self.phases, box=replace(self.box, low=low))
        return replace(self.exact, phases=phases)

    def _having(self, parts: tuple[LoopObjective, ...]) -> None:
        self.objective = self._together(parts)
        feasibility = self.objective.having(goal=self.phases.feasibility.goal)
        self.phases = replace(self.phases, feasibility=feasibility, box=self.box)
        self.exact = replace(self.exact, objective=self.objective, phases=self.phases)

    def polish(self, beaten: float) -> list[Candidate]:
        """Replace the best optima of the grid by exact ones, and return those.

        Of those that do not come below the value `beaten` no more than this is found out. The grid
        sees less than the whole axis, so an optimum whose value on it is already above an exact one
        stays as it is. The others are sought again on a grid that has the exact one's peaks: as a
        rule they are no other optima then.
        """
        left, self.optima = self.optima, []
        found: list[Candidate] = []
        best = beaten
        try:
            for _ in range(POLISHED):
                if not left or left[0].value > best - ROUGH:
                    break
                candidate = self.exact.descend(left[0].theta, best)
                if candidate is not None:
                    found.append(candidate)
                    best = min(best, candidate.value)
                    self._remember(candidate, left[0].count)
                left = left[1:]
                if candidate is not None and left and left[0].value <= best - ROUGH:
                    for index, peaks in enumerate(candidate.peaks):
                        self.look_at(peaks, index)
                    left = sorted(map(self._again, left), key=lambda optimum: optimum.value)
        finally:  # where time runs out they are still the best there is
            for optimum in left:
                self._remember(optimum, optimum.count)
        return found

    def _again(self, optimum: FoundOptimum) -> FoundOptimum:
        """Return what becomes of an optimum on a finer grid."""
        here = self.objective.evaluate(optimum.theta)
        if not math.isfinite(here.merit):
            return replace(optimum, value=math.inf)
        found = self.phases.best(self.objective, here, ROUGH, self._is_known)
        return replace(_of_grid(found), count=optimum.count)

    def accepts(self, theta: NDArray[np.float64]) -> bool:
        """Whether the loops are stable in every case and meet every demand beside that on mu."""
        loops = self.loops(theta)
        if self.unstable(theta) is not None:
            return False
        return all(
            each.met
            for each in outcomes(
                self.specification.demands,
                self.specification.plants,
                loops,
                self.specification.uncertainties,
            )
        )

    def loops(self, theta: NDArray[np.float64]) -> tuple[Controller, ...]:
        """Return the settings, one a unit of the task."""
        return self.blocks.expand(self.objective.controllers(theta))

    def unstable(self, theta: NDArray[np.float64]) -> int | None:
        """Return a case that is nominally unstable, one that is not kept in sight if any is."""
        loops = self.loops(theta)
        order = sorted(range(len(self.cases)), key=lambda index: index in self.active)
        for index in order:
            case = self.cases[index]
            if unstable_poles(case.plant, case.loops(loops)):
                return index
        return None

    def canonical(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the permuted copy that stands for all: groups alike by descending gain."""
        if not self._alike:
            return theta
        rows = theta.reshape(len(self.groups), -1)
        values, result = rows.tolist(), rows.copy()
        for places in self._alike:
            order = sorted(places, key=lambda i: values[i], reverse=True)
            result[places] = rows[order]
        return result.ravel()

    @cached_property
    def _alike(self) -> list[list[int]]:
        """Groups that may change places, more than one each."""
        if not self.specification.interchangeable:
            return []
        kinds: dict[tuple[int, float], list[int]] = {}
        for place, group in enumerate(self.groups):
            kinds.setdefault((len(group), self.freedom.signs[place]), []).append(place)
        return [places for places in kinds.values() if len(places) > 1]

    @cached_property
    def _like_pairs(self) -> list[tuple[int, int]]:
        """Pairs of groups that may change places, the earlier one first."""
        return [pair for places in self._alike for pair in combinations(places, 2)]

    def _unlike(self, theta: NDArray[np.float64]) -> list[int]:
        """Return the groups of which none may change places with one as good as equal before it.

        A step of either leads to the same settings, units renamed.
        """
        rows = theta.reshape(len(self.groups), -1)
        found: list[int] = []
        for place, row in enumerate(rows):
            alike = (other for other in found if (other, place) in self._like_pairs)
            if not any(np.abs(rows[other] - row).max() < SAME_PLACE for other in alike):
                found.append(place)
        return found

    def _stable(self, theta: NDArray[np.float64]) -> Evaluation | None:
        """Evaluate a start, its gains lowered until the loop is stable.

        Where the plant integrates, integral action that stays as fast is unstable at any low gain.
        """
        objective = self.phases.feasibility if self.objective.goal.skewed else self.objective
        slower = np.zeros_like(theta)
        slower[:: self.objective.per_controller] = math.log(GAIN_STEP)
        if any(element.integrators for element in self.specification.plant.elements):
            slower[1 :: self.objective.per_controller] = -math.log(GAIN_STEP)
        for _ in range(GAIN_STEPS):
            here = objective.evaluate(self.box.clip(theta))
            if math.isfinite(here.value):
                return here
            theta = theta + slower
        return None

    def _known(self, found: _Found) -> int | None:
        """Index of the optimum that these settings stand for; None: none yet."""
        near = [
            index
            for index, optimum in enumerate(self.optima)
            if abs(optimum.value - found.value) < SAME_VALUE
        ]
        if not near:
            return None
        here = self.canonical(found.theta)
        for index in near:
            if np.abs(self.canonical(self.optima[index].theta) - here).max() < SAME_PLACE:
                return index
        return None

    def _remember(self, found: _Found, count: int) -> None:
        index = self._known(found)
        if index is None:
            self.optima.append(FoundOptimum(found.theta, found.value, count))
        else:
            known = self.optima[index]
            better = found if found.value < known.value else known
            self.optima[index] = FoundOptimum(better.theta, better.value, known.count + count)
        self.optima.sort(key=lambda optimum: optimum.value)


def _first_active(cases: Sequence[Case]) -> list[int]:
    """Return the cases to begin with: all, or of many the first and the last of each scenario."""
    if len(cases) <= MOST_AT_FIRST:
        return list(range(len(cases)))
    ends: dict[int, list[int]] = {}
    for index, case in enumerate(cases):
        for scenario in case.scenarios:
            ends.setdefault(scenario, []).append(index)
    return sorted({index for own in ends.values() for index in (own[0], own[-1])})


def _far(plant: Plant, end: float) -> NDArray[np.float64]:
    """Frequencies that stand for infinity, where what is fed through directly does not die away.

    With dead time it has any phase there: then they spread over one turn of the shortest dead time
    that feeds through.
    """
    through = [element for element in plant.elements if element.feedthrough]
    if not through:
        return np.empty(0)
    dead_times = [element.dead_time for element in through if element.dead_time > 0]
    if not dead_times:
        return np.array([FAR * end])
    start = FAR * max(end, 1 / min(dead_times))
    return np.asarray(start + 2 * math.pi * np.arange(PHASES) / PHASES / min(dead_times))
