"""The searches of one tuning: each starts from the optima of those with fewer freedoms.

Settings that fewer loops share, or that have a filter time of their own, contain those that more
loops share, or whose filter is tied. So the freer search starts from their optima and never ends
with a worse one.
"""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.controllers import DERIVATIVE_FILTER
from solver.model.frequencies import corners
from solver.robustness.turning import turning_points
from solver.tuning.bounds import gain_signs
from solver.tuning.clock import OutOfTimeError
from solver.tuning.demands import Demands
from solver.tuning.exact import TRIFLE
from solver.tuning.groupings import by_errors, coarser, merged
from solver.tuning.phases import EXACT
from solver.tuning.search import Freedom, GroupingSearch

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.peaks import Peak
    from solver.tuning.clock import Clock
    from solver.tuning.exact import Candidate
    from solver.tuning.groupings import Groups
    from solver.tuning.objective import Evaluation
    from solver.tuning.scenarios import Case
    from solver.tuning.specification import Specification

__all__ = ["Solution", "Solutions"]

NEARLY = 3e-5  # of s: as close to the optimum as a rough search comes
PASSED_ON = 6  # optima with fewer demands that one with more starts from
STARTS_PER_PARAMETER = 3
STARTS_BEFORE_HOPS = 2  # a parameter, where the search goes on from the best optimum
STARTS_WITH_LEADS = 5  # as before, where fast and slow derivatives have optima far apart
MANY = 4  # groups, from which those merged into two in all ways have most of the optima:
STARTS_BESIDE_TIED = 3  # then, a group
STARTS_OF_OTHER_SIGNS = 6  # times as many: most of them are unstable at any gain
NEAREST = 3  # searches whose way towards the demand is gone to its end, where none meets it
MATTERS = 10.0  # times the shortest time of the starts
FARTHER = 1e3  # corners of the loop over which the grid is extended where it missed an instability
EXTENSIONS = 3
LOWER_GAINS = (0.98, 0.95, 0.9, 0.8, 0.6, 0.3)  # of settings on the verge of stability


@dataclass(frozen=True)
class Solution:
    """A search that has ended, and its best settings; None: it found none."""

    search: GroupingSearch
    candidate: Candidate | None


class Solutions:
    """All searches of one tuning, each made once.

    Parameters
    ----------
    specification : Specification
        The task.
    clock : Clock
        Progress and time limit.

    """

    def __init__(self, specification: Specification, clock: Clock) -> None:
        self.specification = specification
        self.clock = clock
        self.searches: list[GroupingSearch] = []
        self._known: dict[Freedom, Solution] = {}
        self._rough: dict[Freedom, GroupingSearch] = {}
        self._planned: set[Freedom] = set()

    def solve(self, freedom: Freedom) -> Solution:
        """Return the solution of one search."""
        if freedom not in self._known:
            self._known[freedom] = self._solved(freedom)
        return self._known[freedom]

    def plan(self, freedoms: Iterable[Freedom]) -> None:
        """Count the starts of these searches, and of those that they start from, as to be made."""
        for freedom in freedoms:
            if freedom in self._planned:
                continue
            self._planned.add(freedom)
            self.clock.total += self._starts(freedom)
            self.plan(tied for tied, _ in self._tied(freedom))
            self.plan(replace(freedom, kind=kind) for kind in freedom.kind.contained)

    def _starts(self, freedom: Freedom) -> int:
        """Most starts of a search: the more parameters, the more optima."""
        if self.specification.starts is not None:
            return self.specification.starts
        groups = len(freedom.groups)
        if groups >= MANY and len(list(self._tied(freedom))) > 1:
            return STARTS_BESIDE_TIED * groups
        lead = "derivative_time" in freedom.kind.parameters
        each = STARTS_PER_PARAMETER
        if groups > 1:
            each = STARTS_WITH_LEADS if lead else STARTS_BEFORE_HOPS
        if freedom.signs != gain_signs(self.specification.plant, freedom.groups):
            each *= STARTS_OF_OTHER_SIGNS
        return each * groups * len(freedom.kind.parameters)

    def identical(self) -> Solution | None:
        """Return the best solution with identical settings, of the task's kind."""
        best: Solution | None = None
        lowest = math.inf
        for freedom, solution in self._known.items():
            if len(freedom.groups) == 1 and freedom.kind is self.specification.kind:
                value = math.inf if solution.candidate is None else solution.candidate.value
                if value < lowest:
                    best, lowest = solution, value
        return best

    def nearest(self) -> GroupingSearch | None:
        """Return the search whose first phase came nearest to settings that meet the demand."""
        return next((search for search, _ in self._by_closeness()), None)

    def nearest_on_the_axis(self) -> tuple[GroupingSearch, Evaluation, Peak, Case] | None:
        """Return the search whose first phase comes nearest on the whole axis, as far as it goes.

        With it the settings, their peak of mu under an infinitely slow demand, and its case.
        """
        found = []
        for search, closest in self._by_closeness()[:NEAREST]:
            here = closest
            with suppress(OutOfTimeError):
                here = search.nearly_feasible(closest.theta)
            found.append((search, here, *search.slowest_demand(here)))
        return min(found, key=lambda each: each[2].value, default=None)

    def _by_closeness(self) -> list[tuple[GroupingSearch, Evaluation]]:
        """Return the searches, the nearest first, and where the first phase of each ended."""
        began = [(search, search.closest) for search in self.searches if search.closest is not None]
        return sorted(began, key=lambda each: each[1].value)

    def kept(self, search: GroupingSearch) -> Solution:
        """Return the best stable settings of a search that was cut short."""
        best: Candidate | None = None
        with suppress(OutOfTimeError):
            for optimum in search.optima[:1]:
                found = search.exact.measure(optimum.theta, optimum.value)
                if math.isfinite(found.value) and search.accepts(found.theta):
                    best = found
                # Between the frequencies of the grid the demand may cost much more.
                if found.value > optimum.value + TRIFLE:
                    exact = search.exact.descend(optimum.theta)
                    if exact is not None and self._is_better(search, exact, best):
                        best = exact
        return Solution(search, best)

    def kept_of_less(self, lesser: GroupingSearch) -> Solution:
        """Return what was kept of a search of a lesser kind as settings of the task's kind."""
        solution = self.kept(lesser)
        search = self._search(replace(lesser.freedom, kind=self.specification.kind))
        if solution.candidate is None:
            return Solution(search, None)
        theta = search.box.clip(self._as_kind(solution.candidate.theta, lesser, search)[0])
        candidate = search.exact.measure(theta, solution.candidate.value)
        kept = math.isfinite(candidate.value) and search.accepts(candidate.theta)
        return Solution(search, candidate if kept else None)

    def from_settings(self, freedom: Freedom, loops: Sequence[Controller]) -> Solution:
        """Return the local optimum beside given settings, one a group.

        It is never worse than these are where they keep what is asked.
        """
        search = self._search(freedom)
        self.clock.total = 1
        here = search.objective.evaluate(search.box.clip(self._theta_of(search, loops)))
        self.clock.done += 1
        found = search.beside(here, NEARLY if self.specification.rough else EXACT)
        if found is None:  # too far from the demand: by way of its own phase
            search.descend(here.theta)
            best = self._best(search, [])
        else:
            best = self._stabilised(search, found)
        return Solution(search, self._or_start(search, here, best))

    def _or_start(
        self, search: GroupingSearch, here: Evaluation, best: Candidate | None
    ) -> Candidate | None:
        """Return the best settings found, or those begun with where they are better."""
        # What some frequencies permit is no more than what all do.
        if not math.isfinite(here.value) or (best is not None and best.value <= here.value):
            return best
        start = search.exact.measure(here.theta, here.s)
        if math.isfinite(start.value) and self._is_better(search, start, best):
            return start
        return best

    def _search(self, freedom: Freedom) -> GroupingSearch:
        search = GroupingSearch(self.specification, freedom, self.clock.tick)
        self.searches.append(search)
        return search

    def _solved(self, freedom: Freedom) -> Solution:
        self.plan([freedom])
        search = self._search(freedom)
        inherited = self._inherited(search)
        self._explore(search, inherited)
        search.swap()
        search.exchange()
        search.hop()
        if search.refine():
            search.hop()
        best = self._best(search, inherited)
        if best is not None:
            self.clock.tick(best.value)
        return Solution(search, best)

    def _roughly(self, freedom: Freedom) -> tuple[GroupingSearch, NDArray[np.float64] | None]:
        """Return a search as another one's start needs it, and its best settings on the grid.

        None: it found none.
        """
        if freedom not in self._rough:
            self.plan([freedom])
            search = self._rough[freedom] = self._search(freedom)
            tied = [
                theta.reshape(len(groups.groups), -1)[list(owner)].ravel()
                for groups, owner in self._tied(freedom)
                if (theta := self._roughly(groups)[1]) is not None
            ]
            self._explore(search, [*tied, *self._contained(search, exact=False)])
            search.hop()
        search = self._rough[freedom]
        if search.optima:
            return search, search.optima[0].theta
        return search, None if search.closest is None else search.closest.theta

    def _explore(self, search: GroupingSearch, inherited: list[NDArray[np.float64]]) -> None:
        """Descend from what is known, and from starts until few more optima are to be expected."""
        freedom = search.freedom
        for theta in [*inherited, *self._less_demanding(freedom, self.specification.demands.names)]:
            search.descend(search.box.clip(theta), count=0)
        self._offer(search)
        count = self._starts(freedom)
        for left, theta in zip(range(count, 0, -1), search.starts(count), strict=True):
            if self.specification.starts is None and (search.settled or search.confirmed(count)):
                self.clock.total -= left
                break
            before = search.lowest
            search.descend(theta)
            self.clock.done += 1
            if search.lowest < before:
                self._offer(search)

    def _offer(self, search: GroupingSearch) -> None:
        """Have the exact value of a search's best optimum told: what is kept if it stops here."""
        if not search.optima:
            return
        optimum = search.optima[0]

        def value() -> float:
            exact = search.exact.measure(optimum.theta, optimum.value)
            found: Candidate | None = exact if math.isfinite(exact.value) else None
            if found is None and math.isinf(self.clock.best):
                # Between the grid's points it meets no demand, but others beside it do.
                found = search.exact.descend(optimum.theta)
            return found.value if found is not None and search.accepts(found.theta) else math.inf

        self.clock.offer(value)

    def _inherited(self, search: GroupingSearch) -> list[NDArray[np.float64]]:
        """Return the best settings with fewer freedoms, as parameters of this search."""
        found = []
        for tied, owner in self._tied(search.freedom):
            best = self.solve(tied).candidate
            if best is not None:
                found.append(best.theta.reshape(len(tied.groups), -1)[list(owner)].ravel())
        return [*found, *self._contained(search, exact=True)]

    def _contained(self, search: GroupingSearch, *, exact: bool) -> list[NDArray[np.float64]]:
        """Return the best settings of each kind contained as those of this search.

        Exact ones are what this search may end with, where the time that they lack only harms:
        in its logarithm the way to zero is flat long before the value is that of zero.
        """
        found = []
        for kind in search.freedom.kind.contained:
            lesser, theta = self._roughly(replace(search.freedom, kind=kind))
            if theta is None:
                continue
            best = lesser.exact.descend(theta) if exact else None
            found += self._as_kind(theta if best is None else best.theta, lesser, search)
        return found

    def _less_demanding(
        self, freedom: Freedom, names: tuple[str, ...]
    ) -> list[NDArray[np.float64]]:
        """Return the optima with one of the demands `names` left out, whichever it is.

        Of starts drawn at random few find their way within several demands. From the optima
        without any, one demand after the other, in every order, is a way that leads there.
        """
        found = []
        for kept in itertools.combinations(names, max(len(names) - 1, 0)) if names else ():
            demands = Demands(**{name: getattr(self.specification.demands, name) for name in kept})
            task = replace(self.specification, demands=demands)
            search = GroupingSearch(task, freedom, self.clock.tick)
            for theta in self._less_demanding(freedom, kept):
                search.descend(search.box.clip(theta), count=0)
            if not kept:
                for theta in search.starts(self._starts(freedom)):
                    if search.settled:
                        break
                    search.descend(theta)
            found += [optimum.theta for optimum in search.optima[:PASSED_ON]]
        return found

    def _tied(self, freedom: Freedom) -> Iterator[tuple[Freedom, tuple[int, ...]]]:
        """Yield searches in which more loops share settings, and which group each group is in."""
        for groups, owner in self._coarser(freedom.groups):
            signs = tuple(freedom.signs[owner.index(part)] for part in range(len(groups)))
            if all(signs[part] == sign for part, sign in zip(owner, freedom.signs, strict=True)):
                yield replace(freedom, groups=groups, signs=signs), owner

    def _coarser(self, groups: Groups) -> Iterable[tuple[Groups, tuple[int, ...]]]:
        if self.specification.interchangeable:
            return coarser(groups)
        if not self.specification.plant.interchangeable:
            return ()
        # Units that differ in their errors alone: all alike, and those with equal errors.
        wider = [(tuple(range(self.specification.plant.n)),), by_errors(self.specification)]
        pairs = [(into, merged(groups, into)) for into in dict.fromkeys(wider) if into != groups]
        return [(into, owner) for into, owner in pairs if owner and len(into) < len(groups)]

    @staticmethod
    def _as_kind(
        theta: NDArray[np.float64], lesser: GroupingSearch, search: GroupingSearch
    ) -> list[NDArray[np.float64]]:
        """Return settings of a search of a lesser kind as those of another, or nearly so.

        The time that they lack is a filter tied to the derivative, or so short that it changes
        nothing; then also one that matters.
        """
        names, have = search.freedom.kind.parameters, lesser.freedom.kind.parameters
        none = search.box.low.reshape(-1, len(names))
        short = search.region.starts.low.reshape(-1, len(names))
        found = [theta.reshape(len(lesser.groups), -1)]
        for place, name in enumerate(names):
            if name in have:
                continue
            if name == "filter_time" and "derivative_time" in names:
                found = [
                    np.insert(rows, place, rows[:, 2] + math.log(DERIVATIVE_FILTER), axis=1)
                    for rows in found
                ]
                continue
            times = none[:, place], short[:, place] + math.log(MATTERS)
            found = [np.insert(rows, place, time, axis=1) for rows in found for time in times]
        return [rows.ravel() for rows in found]

    def _theta_of(self, search: GroupingSearch, loops: Sequence[Controller]) -> NDArray[np.float64]:
        """Return the parameters of given settings; a time that they lack becomes a short one."""
        names = search.objective.kind.parameters
        theta = search.region.starts.low.reshape(len(loops), -1).copy()
        for row, loop in zip(theta, loops, strict=True):
            for place, name in enumerate(names):
                value = loop.lag_time if name == "filter_time" else getattr(loop, name)
                if value:
                    row[place] = math.log(abs(value))
        return theta.ravel()

    def _best(
        self, search: GroupingSearch, inherited: list[NDArray[np.float64]]
    ) -> Candidate | None:
        """Return the best stable settings with their exact value."""
        best: Candidate | None = None
        for theta in inherited:
            if (theta == search.box.clip(theta)).all():
                candidate = search.exact.measure(theta, search.objective.evaluate(theta).s)
                if math.isfinite(candidate.value) and self._is_better(search, candidate, best):
                    best = candidate
        polished = search.polish(math.inf if best is None else best.value)
        if best is not None and all(best.value < found.value for found in polished):
            # A last descent from there: what the freedom costs in rounding it gives back.
            polished += filter(None, [search.exact.descend(best.theta)])
        for found in sorted(polished, key=lambda each: each.value):
            if best is not None and best.value <= found.value:
                break
            stable = self._stabilised(search, found)
            if stable is not None and (best is None or stable.value < best.value):
                best = stable
        if best is None and search.closest is not None:  # what the first phase found is not lost
            candidate = search.exact.measure(search.closest.theta, search.closest.s)
            if math.isfinite(candidate.value) and search.accepts(candidate.theta):
                best = candidate
        return best

    def _is_better(
        self, search: GroupingSearch, candidate: Candidate, best: Candidate | None
    ) -> bool:
        return (best is None or candidate.value < best.value) and search.accepts(candidate.theta)

    def _stabilised(self, search: GroupingSearch, candidate: Candidate) -> Candidate | None:
        """Return the candidate, or one on a longer axis where its grid missed an instability."""
        for _ in range(EXTENSIONS):
            if search.accepts(candidate.theta):
                return candidate
            unstable = search.unstable(candidate.theta)
            if unstable is None or unstable in search.active:
                self._extend(search, candidate)
            else:
                search.activate(unstable)
            found = search.exact.descend(candidate.theta)
            if found is None:
                return self._turned_down(search, candidate)
            candidate = found
        return self._turned_down(search, candidate)

    def _turned_down(self, search: GroupingSearch, candidate: Candidate) -> Candidate | None:
        """Return settings with gains below those of a candidate on the verge of stability.

        The optimum may lie so near to it that the grid saw nothing of a narrow peak: what turns
        there joins the grid, and the search goes on from the first gains that keep it stable.
        """
        best: Candidate | None = None
        for gain in LOWER_GAINS:
            theta = candidate.theta.copy()
            theta[:: search.objective.per_controller] += math.log(gain)
            theta = search.box.clip(theta)
            if not search.accepts(theta):
                continue
            here = search.exact.measure(theta, search.objective.evaluate(theta).s)
            for _ in range(EXTENSIONS):
                if math.isfinite(here.value) and self._is_better(search, here, best):
                    best = here
                self._resolve(search, here)
                found = search.exact.descend(theta)
                if found is None:
                    break
                here = found
        for _ in range(EXTENSIONS if best is not None else 0):
            assert best is not None  # noqa: S101 - for the type checker
            self._resolve(search, best)
            found = search.exact.descend(best.theta)
            if found is None or not self._is_better(search, found, best):
                break
            best = found
        return best

    def _resolve(self, search: GroupingSearch, candidate: Candidate) -> None:
        """Put the frequencies into the grid where a candidate's loops turn, stable or not."""
        ends = [part.omega[[0, -1]] for part in search.objective.parts]
        loops = search.loops(candidate.theta)
        low, high = float(np.min(ends)), float(np.max(ends))
        search.look_at(turning_points(self.specification.plant, loops, low, high))

    def _extend(self, search: GroupingSearch, candidate: Candidate) -> None:
        bends = corners(
            self.specification.plant, self.specification.uncertainty,
            search.objective.controllers(candidate.theta),
        )  # fmt: skip
        end = max(float(part.omega[-1]) for part in search.objective.parts)
        longest = max(FARTHER * end, FARTHER * float(bends[-1]))
        search.look_at(np.geomspace(end, longest, 11 * round(math.log10(longest / end)) + 1))
