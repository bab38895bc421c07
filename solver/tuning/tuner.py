"""From a specification to the best settings: groupings, signs, proven value, checked result."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from solver.model.measured import MeasuredPlant
from solver.model.validation import instance
from solver.robustness.scan import scan_remark
from solver.tuning.admission import fits, require_tunable
from solver.tuning.bounds import gain_signs
from solver.tuning.clock import Clock, OutOfTimeError
from solver.tuning.feasibility import (
    Impossibility,
    contrary_signs,
    impossibility,
    needs_usual_signs,
    other_signs,
)
from solver.tuning.given_start import given_groups, signs_of
from solver.tuning.groupings import groupings, neighbours
from solver.tuning.on_data import tune_on_data
from solver.tuning.pairings import pairings
from solver.tuning.record import Status
from solver.tuning.relaxing import LEAST_TIME, with_the_demands_named
from solver.tuning.report import infeasible, report
from solver.tuning.search import Freedom
from solver.tuning.solutions import Solution, Solutions
from solver.tuning.specification import Arrangement, Objective, Signs, Specification
from solver.tuning.spread import SPREAD
from solver.tuning.times_apart import times_remark

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from solver.model.controllers import Controller
    from solver.tuning.groupings import Groups
    from solver.tuning.record import Progress, Tuning

__all__ = ["tune"]

GRACE = 2.0  # seconds after the end, in which the best so far is made exact
WORTH_IT = 1.0  # per cent that asymmetry must gain before 'best' prefers it
FINER_WORTH_IT = 0.01  # per cent that one more group must gain, more than two optima may differ by


def tune(
    specification: Specification, progress: Callable[[Progress], bool | None] | None = None
) -> Tuning:
    """Find the best settings for a specification.

    Parameters
    ----------
    specification : Specification
        The task.
    progress : callable or None
        Called about ten times a second with a `Progress`; what it raises stops the tuning and
        passes through. If it returns True, the tuning ends with the best so far, as if the time
        limit had passed.

    Returns
    -------
    Tuning
        Read its `status` first. The same specification gives the same digits, unless the time
        limit cuts it short.

    Raises
    ------
    UnsupportedPlantError
        The plant is open-loop unstable.
    InvalidInputError
        Too many different controllers; or the best tau_P is too large a number.

    """
    instance(specification, Specification, "/specification")
    require_tunable(specification)
    if isinstance(specification.plant, MeasuredPlant):
        return _on_data(specification, progress)
    if specification.pairing is None:
        return _told(specification, _tune(specification.arranged(None), progress))
    return _told(specification, _best_pairing(specification, progress))


def _on_data(
    specification: Specification, progress: Callable[[Progress], bool | None] | None
) -> Tuning:
    pairing, task = specification.pairing, specification.arranged(None)
    assert not isinstance(pairing, str)  # noqa: S101 - for the type checker: refused before
    found = tune_on_data(task, progress)
    if found.status is Status.INFEASIBLE and task.demands.names:
        found = _with_the_demand_named(task, found)
    return replace(found, pairing=pairing)


def _tune(
    specification: Specification, progress: Callable[[Progress], bool | None] | None
) -> Tuning:
    found = _Run(specification, progress).result()
    if found.status is Status.INFEASIBLE and specification.demands.names:
        return _with_the_demand_named(specification, found)
    return found


def _best_pairing(
    specification: Specification, progress: Callable[[Progress], bool | None] | None
) -> Tuning:
    """Tune each pairing in an equal share of the time, and return the best result."""
    candidates = pairings(specification)
    found: list[Tuning] = []
    for index, pairing in enumerate(candidates):
        task, spent = specification.arranged(pairing), sum(t.search.elapsed_seconds for t in found)
        if task.time_limit is not None:
            left = max(task.time_limit - spent, LEAST_TIME) / (len(candidates) - index)
            task = replace(task, time_limit=left)

        def share(here: Progress, done: int = index) -> bool | None:
            assert progress is not None  # noqa: S101 - for the type checker
            fraction = (done + here.fraction) / len(candidates)
            return progress(replace(here, fraction=fraction))

        found.append(replace(_tune(task, share if progress else None), pairing=pairing))
    best = min(found, key=_worth)
    if len(found) == 1:
        return best
    spent = sum(each.search.elapsed_seconds for each in found)
    outcome = "; ".join(f"{_from_one(t.pairing)} {_reached(t)}" for t in found)
    said = f"Pairings tried, the input of outputs 1, 2, ...: {outcome}."
    cut = any(each.status is Status.TIME_LIMIT for each in found)
    return replace(
        best,
        status=Status.TIME_LIMIT if cut else best.status,
        search=replace(best.search, elapsed_seconds=spent),
        advice=(*best.advice, said),
    )


def _worth(tuning: Tuning) -> tuple[bool, float, float]:
    """Order results: with settings first, then by tau_P, then by the peak of mu."""
    if tuning.peaks is None or tuning.tau_p is None:
        return True, math.inf, math.inf
    return False, tuning.tau_p, tuning.peaks.robust_performance.value


def _from_one(pairing: Sequence[int] | None) -> str:
    """Return the input of each output, counted from 1: ``2, 1``."""
    return ", ".join(str(unit + 1) for unit in pairing or ())


def _reached(tuning: Tuning) -> str:
    if tuning.peaks is None or tuning.tau_p is None:
        return "without settings"
    if tuning.objective == Objective.MU.value:
        return f"mu = {tuning.peaks.robust_performance.value:.4g}"
    return f"tau_P = {tuning.tau_p:.4g}"


def _told(specification: Specification, found: Tuning) -> Tuning:
    """Return the result with a warning where times do not fit, or the scan is slow."""
    said = [times_remark(specification)]
    if specification.scan_time != 0 and found.loops:
        plant = specification.arranged(found.pairing).plant
        said.append(scan_remark(plant, found.loops, specification.scan_time))
    return replace(found, warnings=(*found.warnings, *filter(None, said)))


def _with_the_demand_named(specification: Specification, found: Tuning) -> Tuning:
    """Return an infeasible outcome with the demands that forbid settings, and how far to relax."""

    def again(task: Specification) -> Tuning:
        on_data = isinstance(task.plant, MeasuredPlant)
        return tune_on_data(task) if on_data else _Run(task, None).result()

    return with_the_demands_named(specification, found, again)


def _forbidden(specification: Specification) -> Impossibility | None:
    """Return what forbids every setting for one of the plants, or None."""
    found = impossibility(specification)
    for case in specification.cases(groupings(specification)[0]):
        if found is not None or case.scenarios[0] == 0:
            continue
        alone = Specification(case.plant, case.uncertainty, replace(case.performance, tau_p=None))
        own = impossibility(alone)
        if own is not None:
            number = case.scenarios[0] - 1
            listed = specification.scenarios
            name = listed[number].name if number < len(listed) else SPREAD
            found = replace(own, reason=f"scenario {name!r}: {own.reason}")
    return found


class _Run:
    """One tuning."""

    def __init__(
        self, specification: Specification, progress: Callable[[Progress], bool | None] | None
    ) -> None:
        self.specification = specification
        every = groupings(specification)
        # Of those that are sought, finer ones may come down to more cases than are searched.
        self.partitions = [*every[:1], *(each for each in every[1:] if fits(specification, each))]
        self.clock = Clock(specification.time_limit, progress, self.as_objective)
        self.solutions = Solutions(specification, self.clock)
        self.status = Status.OPTIMAL
        self.found: list[Solution] = []

    def as_objective(self, s: float) -> float:
        """Return tau_P, or mu, of the value s."""
        return math.exp(s if self.specification.objective is Objective.TAU_P else s / 2)

    @property
    def any_signs(self) -> bool:
        """Whether other signs of the gains than the usual ones may be tried."""
        free = self.specification.signs is Signs.ANY
        return free and not needs_usual_signs(self.specification)

    def result(self) -> Tuning:
        """Search, choose, report."""
        forbidden = _forbidden(self.specification)
        if forbidden is not None and (forbidden.whatever_signs or not self.any_signs):
            return infeasible(
                self.specification, self.partitions[0], self.clock, forbidden.reason,
                forbidden.omega,
            )  # fmt: skip
        try:
            if self.specification.start is not None:
                self._from_start(self.specification.start)
            else:
                self._everywhere(usual=forbidden is None)
        except OutOfTimeError:
            self.status = Status.TIME_LIMIT
            self.clock.grant(GRACE)
            with suppress(OutOfTimeError):
                self._keep_what_there_is()
            self.clock.end()
        chosen = self._chosen()
        if chosen is None:
            return self._nothing_found()
        return report(self.specification, self.solutions, self.clock, chosen, self.status)

    def _from_start(self, start: Sequence[Controller]) -> None:
        groups = given_groups(self.specification, self.partitions[0])
        loops = [start[group[0]] for group in groups]
        self.status = Status.LOCAL
        self.partitions = [groups]
        freedom = Freedom(groups, self.specification.kind, signs_of(loops))
        solution = self.solutions.from_settings(freedom, loops)
        if solution.candidate is not None:
            self.found.append(solution)

    def _everywhere(self, *, usual: bool) -> None:
        plant = self.specification.plant
        if usual:
            self._search_all(lambda groups: [gain_signs(plant, groups)])
        if self.any_signs and self._chosen() is None:
            self._search_all(lambda groups: list(other_signs(self.specification, groups)))

    def _search_all(self, patterns: Callable[[Groups], list[tuple[float, ...]]]) -> None:
        """Solve the groupings of the task, with each pattern of signs of the gains."""
        kind = self.specification.kind
        self.solutions.plan(
            Freedom(groups, kind, signs) for groups in self.partitions for signs in patterns(groups)
        )
        for groups in self.partitions:
            self._solve(groups, patterns(groups))
        if self.specification.arrangement is not Arrangement.BEST:
            return
        if not self.specification.interchangeable:
            return
        # Beside the best partition, or the one that comes nearest to the demand, as long as that
        # finds a better one.
        here = self._foremost()
        while here is not None:
            around = [
                groups
                for groups in neighbours(here)
                if groups not in self.partitions and fits(self.specification, groups)
            ]
            for groups in around:
                self.partitions.append(groups)
                self._solve(groups, patterns(groups))
            before, here = here, self._foremost()
            if not around or here == before:
                break

    def _foremost(self) -> Groups | None:
        """Return the partition of the best settings; where there are none, of the nearest ones."""
        best = self._chosen(worth=FINER_WORTH_IT)
        nearest = self.solutions.nearest()
        if best is not None:
            return best.search.groups
        return None if nearest is None else nearest.groups

    def _solve(self, groups: Groups, patterns: list[tuple[float, ...]]) -> None:
        for signs in patterns:
            freedom = Freedom(groups, self.specification.kind, signs)
            solution = self.solutions.solve(freedom)
            if solution.candidate is not None:
                self.found.append(solution)

    def _keep_what_there_is(self) -> None:
        """Keep the best of each search; of those with fewer freedoms, what is better than these."""
        kind = self.specification.kind
        others = []
        for search in list(self.solutions.searches):
            if search.freedom.kind is not kind or search.groups not in self.partitions:
                others.append(search)
                continue
            kept = self.solutions.kept(search)
            if kept.candidate is not None:
                self.found.append(kept)
        for search in sorted(others, key=lambda each: each.lowest):
            values = [found.candidate.value for found in self.found if found.candidate]
            if not search.lowest < min(values, default=math.inf):
                break
            of = self.solutions.kept if search.freedom.kind is kind else self.solutions.kept_of_less
            kept = of(search)
            if kept.candidate is not None:
                self.found.append(kept)

    def _chosen(self, worth: float = WORTH_IT) -> Solution | None:
        """Return the best solution; of nearly equal ones that with the fewest groups.

        `worth`: per cent that unlike settings must gain over like ones.
        """
        best: Solution | None = None
        best_value = math.inf
        for solution in sorted(self.found, key=lambda each: len(each.search.groups)):
            assert solution.candidate is not None  # noqa: S101 - for the type checker
            value = self.as_objective(solution.candidate.value)
            needed = 0.0
            if best is not None and len(solution.search.groups) > len(best.search.groups):
                needed = FINER_WORTH_IT
                if len(best.search.groups) == 1:
                    needed = worth
            if value < best_value * (1 - needed / 100):
                best, best_value = solution, value
        return best

    def _nothing_found(self) -> Tuning:
        groups = self.partitions[0]
        if self.status is Status.TIME_LIMIT:
            reason = "no feasible settings were found within the time limit"
            return infeasible(
                self.specification, groups, self.clock, reason, None, status=Status.TIME_LIMIT
            )
        nearest = self.solutions.nearest_on_the_axis()
        contrary = contrary_signs(self.specification, groups)
        why = "" if contrary is None else f"; {contrary}"
        if nearest is None:
            reason = "none were found that stabilise the loops within the parameter bounds" + why
            twice = any(each.integrators > 1 for each in self.specification.plant.elements)
            if twice and "derivative_time" not in self.specification.kind.parameters:
                reason += "; a plant that integrates twice needs a derivative: ask for PID"
            return infeasible(self.specification, groups, self.clock, reason, None)
        search, closest, slow, case = nearest
        if slow.value <= 1:
            reason = (
                "none were found that are stable and meet every demand: settings that keep mu <= 1 "
                f"where the search looks fail elsewhere{why}"
            )
            return infeasible(self.specification, groups, self.clock, reason, None)
        reason = (
            f"none were found that meet mu <= 1 at any tau_P: for the nearest ones even an "
            f"infinitely slow demand peaks at mu = {slow.value:.6g} near omega = {slow.omega:.4g} "
            "rad per time unit"
        )
        if len(search.cases) > 1:
            reason += f", in scenario {self.specification.name_of(case)!r}"
        reason += why
        on_bound = search.on_given_bounds(closest.theta)
        if on_bound:
            reason += f"; they lie on the bounds given for {', '.join(on_bound)}"
        return infeasible(self.specification, groups, self.clock, reason, slow.omega)
