"""From a specification to the best settings: groupings, starts, exact value, checked result."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np

from solver.certificate.search import prove
from solver.model.errors import InvalidInputError
from solver.model.open_loop import require_supported
from solver.model.plants import ParallelPlant
from solver.model.remarks import plant_remarks
from solver.model.transfer_function import LARGEST
from solver.model.validation import instance
from solver.robustness.curves import LoopAnalysis
from solver.robustness.integrity import in_one_line
from solver.stability.closed_loop import unstable_poles
from solver.tuning.bounds import parameter_names
from solver.tuning.feasibility import obstacle
from solver.tuning.groupings import groupings, identical_groups
from solver.tuning.output_units import output_units_warning
from solver.tuning.record import Comparison, LocalOptimum, Progress, SearchSummary, Status, Tuning
from solver.tuning.search import Candidate, GroupingSearch
from solver.tuning.specification import Arrangement, Objective, Specification

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.certificate import Certificate
    from solver.model.controllers import Controller
    from solver.model.weights import Performance
    from solver.optimality.record import Optimality
    from solver.tuning.groupings import Groups

__all__ = ["tune"]

WORTH_IT = 1.0  # per cent that asymmetry must gain before 'best' prefers it
PROGRESS_INTERVAL = 0.1  # seconds
MARGIN = 2e-4  # of mu, where a proof for all frequencies is wanted; costs about 0.1 % of tau_P
ROUNDING = 1e-9  # relative addition to tau_P that keeps mu <= 1 under rounding


class _OutOfTimeError(Exception):
    """The time limit has passed."""


class _Clock:
    """Calls the user's progress function now and then, and watches the time limit."""

    def __init__(self, limit: float | None, progress: Callable[[Progress], None] | None) -> None:
        self.started = time.monotonic()
        self.limit = limit
        self.progress = progress
        self.best = math.inf
        self.done = 0
        self.total = 1
        self._last = -math.inf

    @property
    def elapsed(self) -> float:
        return time.monotonic() - self.started

    def tick(self, value: float = math.inf, *, as_objective: Callable[[float], float]) -> None:
        now = self.elapsed
        if math.isfinite(value):
            self.best = min(self.best, as_objective(value))
        if self.limit is not None and now > self.limit:
            raise _OutOfTimeError
        if self.progress is not None and now - self._last > PROGRESS_INTERVAL:
            self._last = now
            best = self.best if math.isfinite(self.best) else None
            fraction = min(self.done / self.total, 1.0)
            self.progress(Progress(fraction, best, self.done, self.total))


def tune(
    specification: Specification, progress: Callable[[Progress], None] | None = None
) -> Tuning:
    """Find the best settings for a specification.

    Parameters
    ----------
    specification : Specification
        The task.
    progress : callable or None
        Called about ten times a second with a `Progress`; what it raises stops the tuning and
        passes through.

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
    require_supported(specification.plant)
    partitions = groupings(specification)
    clock = _Clock(specification.time_limit, progress)
    forbidden = obstacle(specification)
    if forbidden is not None:
        return _infeasible(specification, partitions[0], clock, forbidden.reason, forbidden.omega)
    return _Run(specification, partitions, clock).result()


class _Run:
    """One tuning: the searches of all its groupings."""

    def __init__(
        self, specification: Specification, partitions: tuple[Groups, ...], clock: _Clock
    ) -> None:
        self.specification = specification
        self.partitions = partitions
        self.clock = clock
        self.target = 1 - MARGIN if specification.certificate else 1.0
        self.searches: list[GroupingSearch] = []
        self.found: list[tuple[GroupingSearch, Candidate]] = []
        self.identical: Candidate | None = None
        self.identical_search: GroupingSearch | None = None
        self.status = Status.OPTIMAL

    def as_objective(self, s: float) -> float:
        """Return tau_P, or mu, of the value s."""
        return math.exp(s if self.specification.objective is Objective.TAU_P else s / 2)

    def result(self) -> Tuning:
        specification = self.specification
        one = identical_groups(specification.plant)
        order = list(self.partitions)
        # Identical settings are cheap and a start for every other grouping, so none is worse.
        comparable = isinstance(specification.plant, ParallelPlant) or one in order
        if comparable and one not in order:
            order.insert(0, one)
        self.searches = [
            GroupingSearch(specification, groups, self.target, self._tick) for groups in order
        ]
        counts = [specification.starts or search.default_starts for search in self.searches]
        self.clock.total = sum(counts)
        try:
            for search, count in zip(self.searches, counts, strict=True):
                self._search(search, count, keep=search.groups in self.partitions)
        except _OutOfTimeError:
            self.status = Status.TIME_LIMIT
            self._keep_what_there_is()
        return self._report()

    def _tick(self, value: float) -> None:
        self.clock.tick(value, as_objective=self.as_objective)

    def _search(self, search: GroupingSearch, count: int, *, keep: bool) -> None:
        before = self.clock.best
        if not keep:
            self.clock.best = math.inf
        if self.identical is not None:
            search.descend(np.tile(self.identical.theta, len(search.groups)), count=0)
        for left, theta in zip(range(count, 0, -1), search.starts(count), strict=True):
            if self.specification.starts is None and search.settled:
                self.clock.total -= left
                break
            search.descend(theta)
            self.clock.done += 1
            self._tick(math.inf)
        search.hop()
        best = self._exact_best(search)
        if best is not None and len(search.groups) == 1:
            self.identical, self.identical_search = best, search
        if not keep:
            self.clock.best = before
        elif best is not None:
            self.found.append((search, best))

    def _exact_best(self, search: GroupingSearch) -> Candidate | None:
        best: Candidate | None = None
        if self.identical is not None:
            theta = np.tile(self.identical.theta, len(search.groups))
            best = search.measure(theta, self.identical.value)
        for candidate in search.polish():
            if best is not None and candidate.value >= best.value:
                continue
            loops = search.blocks.expand(search.objective.controllers(candidate.theta))
            if unstable_poles(self.specification.plant, loops) == 0:
                best = candidate
        return best

    def _keep_what_there_is(self) -> None:
        for search in self.searches:
            if search.groups in self.partitions and search.optima:
                optimum = search.optima[0]
                theta = optimum.theta
                loops = search.blocks.expand(search.objective.controllers(theta))
                if unstable_poles(self.specification.plant, loops) == 0:
                    self.found.append((search, search.measure(theta, optimum.value)))

    def _report(self) -> Tuning:
        specification = self.specification
        chosen = self._chosen()
        if chosen is None:
            return self._nothing_found()
        search, candidate = chosen
        theta = search.canonical(candidate.theta)
        controllers = search.objective.controllers(theta)
        loops = search.blocks.expand(controllers)
        value = self.as_objective(candidate.value)
        if specification.objective is Objective.TAU_P:
            value *= 1 + ROUNDING
            if value > LARGEST:
                message = f"tau_P would be {value:.3g}: take a longer unit of time"
                raise InvalidInputError(message, "/plant")
            performance = specification.performance.with_tau_p(value)
        else:
            performance = specification.performance
        analysis = LoopAnalysis(search.blocks, controllers, specification.uncertainty, performance)
        curves = analysis.curves(analysis.omega)
        peaks = analysis.peaks(curves)
        warnings = [
            *plant_remarks(specification.plant),
            *filter(None, [output_units_warning(specification.plant)]),
            *self._warnings(search, theta),
        ]
        certificate = None
        if specification.certificate:
            level = 1.0
            if specification.objective is Objective.MU:
                level = peaks.robust_performance.value * (1 + MARGIN)
            certificate, warning = self._prove(performance, loops, level)
            warnings += warning
        return Tuning(
            status=self.status,
            objective=specification.objective.value,
            tau_p=performance.tau_p,
            peaks=peaks,
            loops=loops,
            groups=search.groups,
            nominally_stable=True,
            search=self._summary(search),
            curves=curves,
            comparison=self._comparison(search, candidate),
            certificate=certificate,
            optimality=self._optimality(candidate, value),
            integrity=in_one_line(
                specification.plant, specification.uncertainty, performance, loops
            ),
            warnings=tuple(warnings),
        )

    def _prove(
        self, performance: Performance, loops: tuple[Controller, ...], level: float
    ) -> tuple[Certificate | None, list[str]]:
        plant, uncertainty = self.specification.plant, self.specification.uncertainty
        try:
            return prove(
                plant, uncertainty, performance, loops, level,
                interrupt=lambda: self._tick(math.inf),
            )  # fmt: skip
        except _OutOfTimeError:
            self.status = Status.TIME_LIMIT
            return None, ["no certificate: the time limit came first"]

    def _optimality(self, candidate: Candidate, tau_p: float) -> Optimality | None:
        if not self.specification.optimality_gap:
            return None
        from solver.optimality.bound import BranchAndBound  # noqa: PLC0415 - few tunings ask for it

        # The grouping that permits most; 'best' may have kept identical settings.
        search = self.searches[-1]
        bound = BranchAndBound(search.problem, peaks=candidate.peaks, tau_p=tau_p)
        try:
            return bound.run(lambda: self._tick(math.inf))
        except _OutOfTimeError:  # the search was not cut short: what is proven is enough
            return bound.result()

    def _chosen(self) -> tuple[GroupingSearch, Candidate] | None:
        if not self.found:
            return None
        best = min(self.found, key=lambda pair: pair[1].value)
        if self.specification.arrangement is Arrangement.BEST:
            for search, candidate in self.found:
                if len(search.groups) == 1:
                    gain = 1 - self.as_objective(best[1].value) / self.as_objective(candidate.value)
                    if 100 * gain < WORTH_IT:
                        return search, candidate
        return best

    def _comparison(self, search: GroupingSearch, candidate: Candidate) -> Comparison | None:
        if self.identical is None or self.identical_search is None or len(search.groups) == 1:
            return None
        identical = self.as_objective(self.identical.value)
        loop = self.identical_search.objective.controllers(self.identical.theta)[0]
        return Comparison(
            identical, loop, 100 * (1 - self.as_objective(candidate.value) / identical)
        )

    def _summary(self, search: GroupingSearch) -> SearchSummary:
        def loops(theta: np.ndarray) -> tuple[Controller, ...]:
            controllers = search.objective.controllers(search.canonical(theta))
            return search.blocks.expand(controllers)

        return SearchSummary(
            starts=self.clock.done,
            local_optima=tuple(
                LocalOptimum(
                    self.as_objective(optimum.value),
                    optimum.count,
                    loops(optimum.theta),
                )
                for optimum in search.optima
            ),
            seed=self.specification.seed,
            elapsed_seconds=self.clock.elapsed,
        )

    def _warnings(self, search: GroupingSearch, theta: np.ndarray) -> list[str]:
        names = parameter_names(self.specification.kind)
        warnings = []
        for index, (value, low, high) in enumerate(
            zip(theta, search.canonical(search.box.low), search.canonical(search.box.high),
                strict=True)
        ):  # fmt: skip
            group, name = divmod(index, len(names))
            if min(value - low, high - value) < 1e-6 * (high - low):
                edge = "lower" if value - low < high - value else "upper"
                warnings.append(
                    f"group {group}: {names[name]} is on its {edge} bound "
                    f"{math.exp(low if edge == 'lower' else high):.4g}; a wider bound may do better"
                )
        return warnings

    def _nothing_found(self) -> Tuning:
        search = next(s for s in self.searches if s.groups in self.partitions)
        if self.status is Status.TIME_LIMIT:
            reason = "no feasible settings were found within the time limit"
            return _infeasible(
                self.specification, search.groups, self.clock, reason, None,
                status=Status.TIME_LIMIT,
            )  # fmt: skip
        closest = [s.closest for s in self.searches if s.closest is not None]
        if not closest:
            reason = "no stabilising settings were found within the parameter bounds"
            return _infeasible(self.specification, search.groups, self.clock, reason, None)
        best = min(closest, key=lambda e: e.value)
        owner = next(s for s in self.searches if s.closest is best)
        worst = int(best.level.argmin())
        omega = float(owner.feasibility.omega[worst])
        reason = (
            f"no tau_P meets mu <= 1: even an infinitely slow demand peaks at "
            f"mu = {math.exp(best.value / 2):.4g} near omega = {omega:.4g}"
        )
        return _infeasible(self.specification, search.groups, self.clock, reason, omega)


def _infeasible(
    specification: Specification,
    groups: Groups,
    clock: _Clock,
    reason: str,
    omega: float | None,
    *,
    status: Status = Status.INFEASIBLE,
) -> Tuning:
    return Tuning(
        status=status,
        objective=specification.objective.value,
        tau_p=None,
        peaks=None,
        loops=(),
        groups=groups,
        nominally_stable=False,
        search=SearchSummary(clock.done, (), specification.seed, clock.elapsed),
        curves=None,
        reason=reason,
        omega=omega,
    )
