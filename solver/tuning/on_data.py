"""Tuning on frequency-response data: the best settings at the frequencies of the data.

The same minimax problem as for a plant with transfer functions, on one fixed grid. Nothing is said
of what lies between its points: no peak is refined, nothing is proven, and the guarantee says so.
Stability is decided by the turns of det(I + G C) on the data (`solver.stability.on_data`).
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.measured import MeasuredPlant
from solver.model.transfer_function import LARGEST
from solver.robustness.on_data import data_analysis, demand_unseen, on_data, peaks_of
from solver.stability.on_data import at_rest
from solver.tuning.advice import advice
from solver.tuning.as_found_on_data import as_found_on_data
from solver.tuning.beside import PriceOfResolution
from solver.tuning.clock import Clock, OutOfTimeError
from solver.tuning.data_search import DataSearch
from solver.tuning.demand_checks import outcomes
from solver.tuning.feasibility import ELSE, impossibility_at_rest
from solver.tuning.groupings import identical_groups, named_partition
from solver.tuning.lattice import Lattice
from solver.tuning.nearby import moves
from solver.tuning.phases import EXACT
from solver.tuning.plain_advice import plain_advice
from solver.tuning.record import (
    Comparison,
    LocalOptimum,
    ScenarioOutcome,
    SearchSummary,
    Status,
    Tuning,
)
from solver.tuning.scenario_outcomes import binding, overall
from solver.tuning.scenarios import AS_GIVEN
from solver.tuning.settle import SPREAD_ROUNDS, WORSE
from solver.tuning.specification import Arrangement, Objective, Specification
from solver.tuning.spread import SPREAD

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.weights import Performance
    from solver.robustness.record import Curves, Peaks
    from solver.tuning.demands import DemandOutcome
    from solver.tuning.phases import Phases
    from solver.tuning.record import Progress

__all__ = ["tune_on_data"]

ROUNDING = 1e-9  # relative addition to tau_P that keeps mu <= 1 under rounding
LARGEST_S = math.log(LARGEST)  # of tau_P, or mu^2, that is no number to be told any more
TO_ROUND = 1.0  # seconds after the end, in which the best so far is made what can be typed in
WORTH_IT = 1.0  # per cent that unlike settings must gain before 'best' prefers them


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
    return _Run(specification, plant, at_rest(plant), progress).result()


@dataclass(frozen=True)
class _End:
    """Settings of a search, and the s that all of its cases have with them."""

    search: DataSearch
    theta: NDArray[np.float64]
    loops: tuple[Controller, ...]
    value: float


class _Run:
    """One tuning."""

    def __init__(
        self,
        task: Specification,
        plant: MeasuredPlant,
        gain: NDArray[np.float64],
        progress: Callable[[Progress], bool | None] | None,
    ) -> None:
        self.task, self.plant, self.gain = task, plant, gain
        self.clock = Clock(task.time_limit, progress, self._as_objective)
        self.late = False

    def result(self) -> Tuning:
        """Search, choose, report."""
        task, n = self.task, self.plant.n
        best_sought = task.arrangement is Arrangement.BEST
        groups = tuple((unit,) for unit in range(n)) if best_sought else named_partition(task)
        one: _End | None = None
        alike = identical_groups(self.plant)
        one_sign = len({float(np.sign(self.gain[u, u])) for u in range(n)}) == 1
        if len(groups) > 1 and one_sign and task.start is None:
            one = self._ended(DataSearch(task, alike, self.gain, self.clock))
        beside = None if one is None else np.tile(one.theta, len(groups))
        search = DataSearch(task, groups, self.gain, self.clock, beside)
        end = self._ended(search)
        if one is not None and (end is None or end.value >= one.value):
            end = one if best_sought else _spread_out(one, search)
        comparison = self._comparison(one, end)
        if best_sought and comparison is not None and comparison.gain_percent < WORTH_IT:
            end = one
        if end is None:
            return self._without(search, *self._why(search))
        price = None
        if task.resolution is not None:
            exact = end
            try:
                typed = self._typed(exact)
            except OutOfTimeError:
                self.late = True
                typed = self._typed_late(exact)
            if typed is None and self.late:
                reason = "the time limit came before numbers that the controllers accept were found"
                return self._without(search, reason, None)
            if typed is None:
                value = self._as_objective(exact.value)
                reason = (
                    "no numbers that the resolution permits were found that keep the demand; with "
                    f"exact ones {task.objective.value} = {value:.6g}"
                )
                return self._without(search, reason, None)
            end, price = typed, self._price(exact, typed)
        return self._report(end, price, comparison)

    def _as_objective(self, s: float) -> float:
        return math.exp(s if self.task.objective is Objective.TAU_P else s / 2)

    def _ended(self, search: DataSearch) -> _End | None:
        best = search.run()
        self.late = self.late or search.late
        if best is None:
            return None
        value = max([*search.of_all(best.theta), -math.inf])
        if not value <= LARGEST_S:
            return None
        loops = search.objective.controllers(best.theta)
        return _End(search, best.theta, _expanded(search, loops), value)

    def _comparison(self, one: _End | None, end: _End | None) -> Comparison | None:
        """Return what unlike settings gain over identical ones."""
        if one is None or end is None:
            return None
        identical = self._as_objective(one.value)
        gain = 100 * (1 - self._as_objective(end.value) / identical)
        return Comparison(identical, one.loops[0], gain)

    def _typed_late(self, end: _End) -> _End | None:
        """Return such numbers near the best settings; None: none in the time that this may take."""
        self.clock.grant(TO_ROUND)
        with suppress(OutOfTimeError):
            return self._typed(end, hurried=True)
        return None

    def _typed(self, end: _End, *, hurried: bool = False) -> _End | None:
        """Return the best settings among the numbers that the controllers accept."""
        search = end.search
        best: _End | None = None
        for _ in range(len(search.cases) + SPREAD_ROUNDS):
            best = self._on_lattice(end, hurried=hurried)
            if best is None:
                return None
            worst = search.over_spread(best.theta)
            if worst is None or worst[0] <= best.value + WORSE:
                return best
            search.include(worst[1])
        return None

    def _on_lattice(self, end: _End, *, hurried: bool) -> _End | None:
        search, resolution = end.search, self.task.resolution
        assert resolution is not None  # noqa: S101 - for the type checker
        objective = search.exact

        def descend(phases: Phases, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
            here = objective.evaluate(phases.box.clip(theta))
            if not math.isfinite(here.merit):
                return None
            polished = phases.best(objective, here, EXACT)
            return polished.theta if math.isfinite(polished.value) else None

        lattice = Lattice(resolution, objective, search.phases, descend, self.clock.tick)
        best: _End | None = None
        others = [optimum.theta for optimum in search.optima[1:4]]
        found = lattice.hurried(end.theta) if hurried else lattice.best([end.theta, *others])
        for seen, point in found:
            if best is not None and seen >= best.value:
                break
            typed = point if hurried else lattice.polished(point)
            theta = lattice.theta(typed)
            loops = _expanded(search, lattice.controllers(typed))
            value = max(search.of_all(theta))
            if not math.isfinite(value) or not all(each.met for each in self._demands(loops)):
                continue
            if best is None or value < best.value:
                best = _End(search, theta, loops, value)
        return best

    def _demands(self, loops: tuple[Controller, ...]) -> tuple[DemandOutcome, ...]:
        return outcomes(self.task.demands, self.task.plants, loops, self.task.uncertainties)

    def _performance(self, end: _End) -> Performance:
        """Return the demand with the tau_P that the settings need."""
        if self.task.objective is Objective.MU:
            return self.task.performance
        return self.task.performance.with_tau_p(math.exp(end.value) * (1 + ROUNDING))

    def _curves(self, end: _End) -> list[Curves]:
        """Return the curves of mu of each case."""
        performance = self._performance(end)
        found = []
        for case in end.search.cases:
            assert isinstance(case.plant, MeasuredPlant)  # noqa: S101 - for the type checker
            own = replace(case.performance, tau_p=performance.tau_p)
            analysis = data_analysis(case.plant, case.uncertainty, own, case.loops(end.loops))
            found.append(analysis.curves(case.plant.omega))
        return found

    def _price(self, exact: _End, typed: _End) -> PriceOfResolution:
        taus = [self._performance(end).tau_p for end in (exact, typed)]
        tops = [
            max(float(each.robust_performance.max()) for each in self._curves(end))
            for end in (exact, typed)
        ]
        assert taus[0] is not None  # noqa: S101 - for the type checker
        assert taus[1] is not None  # noqa: S101 - for the type checker
        return PriceOfResolution(taus[0], taus[1], *tops)

    def _report(
        self, end: _End, price: PriceOfResolution | None, comparison: Comparison | None
    ) -> Tuning:
        """Return the result, every number of it computed anew from the settings."""
        task, search = self.task, end.search
        demands = self._demands(end.loops)
        unmet = [each.name for each in demands if not each.met]
        if unmet:
            return self._without(search, f"none were found that keep {unmet[0]} on the data", None)
        performance = self._performance(end)
        curves = self._curves(end)
        peaks = [peaks_of(each) for each in curves]
        tops = [each.robust_performance.value for each in peaks]
        deciding = next(i for i, top in enumerate(tops) if top >= max(tops) * (1 - WORSE))
        scenarios = self._scenarios(end, curves, peaks)
        status = Status.OPTIMAL if task.start is None else Status.LOCAL
        given = [on_data(case.plant, own) for case, own in zip(search.cases, peaks, strict=True)]  # type: ignore[arg-type]
        tolerance = None
        if not task.brief:
            tolerance = moves(
                task.objective, search.exact, search.exact, end.theta,
                performance=performance, peak=max(tops),
            )  # fmt: skip
        result = Tuning(
            status=Status.TIME_LIMIT if self.late else status,
            objective=task.objective.value,
            tau_p=performance.tau_p,
            peaks=peaks[0],
            loops=end.loops,
            groups=search.groups,
            nominally_stable=True,
            search=self._summary(search),
            curves=curves[0],
            guarantee=overall(given),
            demands=demands,
            scenarios=scenarios,
            active=binding(scenarios),
            spread=search.spread,
            comparison=comparison if len(search.groups) > 1 else None,
            resolution=price,
            settings_tolerance=tolerance,
            as_found=as_found_on_data(task, performance, self.gain),
            advice=advice(task, performance, end.loops, max(tops)),
            warnings=tuple(
                filter(
                    None,
                    [
                        demand_unseen(self.plant, performance),
                        *search.on_bounds(end.theta),
                        *task.absent_from_spread,
                    ],
                )
            ),
        )
        if task.brief:
            return result
        sentences = plain_advice(
            task, result, search.cases[deciding], peaks[deciding].robust_performance.omega
        )
        return replace(result, advice=(*result.advice, *sentences))

    def _scenarios(
        self, end: _End, curves: list[Curves], peaks: list[Peaks]
    ) -> tuple[ScenarioOutcome, ...]:
        """Return what the settings make of each scenario, the task's own plant first."""
        task, search = self.task, end.search
        if not task.scenarios and task.spread is None:
            return ()
        names = [AS_GIVEN, *(scenario.name for scenario in task.scenarios)]
        names += [] if task.spread is None else [SPREAD]
        values = search.of_all(end.theta)
        found = []
        for number, name in enumerate(names):
            mine = [i for i, case in enumerate(search.cases) if number in case.scenarios]
            if not mine:  # nothing spreads
                continue
            worst = max(mine, key=lambda i: peaks[i].robust_performance.value)
            case = search.cases[worst]
            assert isinstance(case.plant, MeasuredPlant)  # noqa: S101 - for the type checker
            tau_p = None
            if task.objective is Objective.TAU_P:
                tau_p = math.exp(max(values[i] for i in mine))
            found.append(
                ScenarioOutcome(
                    name, case.units, len(mine), tau_p, peaks[worst], curves[worst],
                    on_data(case.plant, peaks[worst]),
                )
            )  # fmt: skip
        return tuple(found)

    def _why(self, search: DataSearch) -> tuple[str, float | None]:
        """Say why no settings were found."""
        if self.late:
            return "no feasible settings were found within the time limit", None
        if search.closest is None:
            forbidden = impossibility_at_rest(_first_gain(self.task))
            if forbidden is not None:
                # Other signs than those of the static gain are not tried on data.
                return f"by the data {forbidden.reason.removesuffix(ELSE)}", None
            return "at the frequencies of the data none were found that are stable", None
        slow, case = search.slowest(search.closest[1])
        if not math.isfinite(slow) or slow <= 1:
            return "at the frequencies of the data none were found that meet every demand", None
        reason = (
            "at the frequencies of the data none were found that meet mu <= 1 at any tau_P: for "
            f"the nearest ones even an infinitely slow demand peaks at mu = {slow:.6g}"
        )
        if len(search.cases) > 1:
            reason += f", in scenario {self.task.name_of(case)!r}"
        return reason, None

    def _without(self, search: DataSearch, reason: str, omega: float | None) -> Tuning:
        return Tuning(
            status=Status.TIME_LIMIT if self.late else Status.INFEASIBLE,
            objective=self.task.objective.value,
            tau_p=None,
            peaks=None,
            loops=(),
            groups=search.groups,
            nominally_stable=False,
            search=self._summary(search),
            curves=None,
            as_found=as_found_on_data(self.task, None, self.gain),
            reason=reason,
            omega=omega,
        )

    def _summary(self, search: DataSearch) -> SearchSummary:
        found = tuple(
            LocalOptimum(
                self._as_objective(each.value),
                each.count,
                _expanded(search, search.objective.controllers(each.theta)),
            )
            for each in search.optima
            if math.isfinite(each.value) and abs(each.value) <= LARGEST_S
        )
        return SearchSummary(self.clock.done, found, self.task.seed, self.clock.elapsed)


def _expanded(search: DataSearch, controllers: tuple[Controller, ...]) -> tuple[Controller, ...]:
    """Return one controller a unit from one a group."""
    owner = {unit: index for index, group in enumerate(search.groups) for unit in group}
    return tuple(controllers[owner[unit]] for unit in range(len(owner)))


def _spread_out(one: _End, search: DataSearch) -> _End:
    """Return identical settings as those of a search with more freedom."""
    theta = np.tile(one.theta, len(search.groups))
    for case in one.search.cases[len(search.cases) :]:  # plants of a spread that were met
        search.include(case)
    return _End(search, theta, one.loops, one.value)


def _first_gain(task: Specification) -> NDArray[np.float64]:
    """Return the gain (n, n) at the first frequency, which the plant takes for its static one."""
    plant = task.plant
    assert isinstance(plant, MeasuredPlant)  # noqa: S101 - for the type checker: who calls knows
    return np.asarray(plant.response(plant.omega[:1])[0].real)
