"""A controller that can be built, from one that the search found as a function of frequency.

Its order is reduced in the search's natural units. What is claimed of it is found anew on the plant
as given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.limits.ending import EnoughError
from solver.limits.realisation import reducible
from solver.limits.record import Realised
from solver.limits.search import BETWEEN, SLOWEST_TRIED, checking_grid, least_tau_p
from solver.model.mode_controller import ModeController
from solver.model.peaks import Peak
from solver.robustness.centralised import analyse_blocks, centralised_poles
from solver.robustness.centralised_curves import CentralisedAnalysis, central_blocks
from solver.robustness.shared_scales import best_scales

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from solver.limits.natural_units import NaturalUnits
    from solver.limits.realisation import Reducible
    from solver.limits.search import Found, LimitSearch
    from solver.model.blocks import LoopBlocks
    from solver.model.plants import Plant
    from solver.model.state_space import StateSpace
    from solver.model.weights import Performance, Uncertainty

__all__ = ["Building"]

BUILT_MU = (1.01, 1.05)  # of the least mu of its basis: what a reduction of the order may cost
ROOM = 1e-6  # relative addition to tau_P for peaks between the points of the dense grid
ATTEMPTS = 4
FEW_STATES = 4  # to begin with,
GROWTH = 1.4  # and so many times more until they are enough; then bisected


@dataclass(frozen=True, eq=False)
class Building:
    """What a controller is built for.

    Parameters
    ----------
    plant, uncertainty, performance : Plant, Uncertainty, Performance
        As given.
    units : NaturalUnits
        The same in the search's units.
    search : LimitSearch
        The search.

    """

    plant: Plant
    uncertainty: Uncertainty
    performance: Performance
    units: NaturalUnits
    search: LimitSearch

    @cached_property
    def _blocks(self) -> LoopBlocks:
        return central_blocks(self.plant, self.uncertainty)

    def first_of(self, found: Iterable[Found]) -> Realised | None:
        """Return the first controller that keeps what the search found; None if it is ended."""
        try:
            for each in found:
                parts = reducible(self.search, each)
                for cost in (None,) if self.search.sought else BUILT_MU:
                    realised = self._built(each, parts, None if cost is None else cost * each.mu)
                    if realised is not None:
                        return realised
        except EnoughError:
            self.search.ended = True
        return None

    def _built(self, found: Found, parts: list[Reducible], most: float | None) -> Realised | None:
        """Return a controller with mu at most `most`, or, where tau_P is sought, with its tau_P."""
        omega = checking_grid(found.omega)
        for _ in range(ATTEMPTS):
            chosen = self._reduced(found, parts, most or 1.0, omega)
            outcome = None if chosen is None else self._analysed(found, chosen)
            if outcome is None:
                return None
            if isinstance(outcome, Peak):
                peak = outcome
            else:
                assert outcome.robustness.peaks is not None  # noqa: S101 - it is stable
                peak = outcome.robustness.peaks.robust_performance
                if most is None or peak.value <= most * (1 + BETWEEN):
                    return outcome
            # A controller of few states may have a peak where that of all states has none.
            omega = np.union1d(omega, [peak.omega * self.units.time])
        return None

    def _reduced(
        self, found: Found, parts: list[Reducible], allowed: float, omega: NDArray[np.float64]
    ) -> tuple[StateSpace, ...] | None:
        """Return the controllers of least order with mu at most `allowed` at `omega` (k,).

        More states are better but for details, so the order is bisected, and what is returned
        checked.
        """
        search = self.search
        performance = search.performance.with_tau_p(found.tau_p)
        thresholds = np.sort(np.concatenate([part.weights for part in parts]))[::-1]

        def kept(number: int) -> tuple[StateSpace, ...] | None:
            search.tick()
            controllers = tuple(part.truncated(thresholds[number]) for part in parts)
            analysis = CentralisedAnalysis(
                search.blocks, controllers, search.uncertainty, performance
            )
            if (
                analysis.robust_performance(omega).max() <= allowed
                and centralised_poles(search.blocks, controllers) == 0
            ):
                return controllers
            return None

        few, many, last = -1, FEW_STATES - 1, len(thresholds) - 1
        best = kept(min(many, last))
        while best is None and many < last:
            few, many = many, min(math.ceil(GROWTH * many), last)
            best = kept(many)
        while best is not None and many - few > 1:
            middle = (few + many) // 2
            trial = kept(middle)
            if trial is None:
                few = middle
            else:
                many, best = middle, trial
        return best

    def _analysed(self, found: Found, reduced: tuple[StateSpace, ...]) -> Realised | Peak | None:
        """Return the controller and the tau_P it reaches.

        A peak above 1 that no larger tau_P lowers is returned in its place. None: it is unstable.
        """
        sought, tick = self.search.sought, self.search.tick
        controllers = tuple(map(self.units.given_back, reduced))
        controller: StateSpace | ModeController = controllers[0]
        if self.plant.interchangeable:
            controller = ModeController(controllers[0], controllers[-1])
        tau_p = found.tau_p * self.units.time
        if sought:
            least = self._least_tau_p(controllers, tau_p)
            if isinstance(least, Peak):
                return least
            tau_p = least
        before, proof = math.inf, not sought
        for _ in range(2 * ATTEMPTS):
            tick()
            performance = self.performance.with_tau_p(tau_p)
            robustness = analyse_blocks(
                self._blocks, controllers, self.uncertainty, performance, proof=proof, tick=tick
            )
            if robustness.peaks is None:
                return None
            peak = robustness.peaks.robust_performance
            excess = peak.value - 1
            if not sought or excess <= 0:
                if proof:
                    states = sum(each.states for each in controllers)
                    return Realised(controller, states, tau_p, robustness)
                proof = True  # which may show a higher peak: only what else is right is worth it
                continue
            if excess > before / 2:
                break
            before = excess
            tau_p *= 1 + ROOM + 4 * excess  # |w_P| falls no faster than 1/tau_P
        return peak

    def _least_tau_p(self, controllers: tuple[StateSpace, ...], start: float) -> float | Peak:
        """Least tau_P that controllers reach on a dense grid; a peak that none lowers to 1."""
        performance = self.performance.with_tau_p(start)
        analysis = CentralisedAnalysis(self._blocks, controllers, self.uncertainty, performance)
        dense = analysis.omega
        matrices, weight = analysis.matrices(dense), performance.magnitude(dense)

        def curve(tau_p: float, among: NDArray[np.intp]) -> NDArray[np.float64]:
            self.search.tick()
            w_P = self.performance.with_tau_p(tau_p).magnitude(dense[among])
            ratio = (w_P / weight[among])[:, None]
            scaled = []
            for N in matrices:
                rows = np.ones((among.size, N.shape[1]))
                rows[:, N.shape[1] // 2 :] = ratio
                scaled.append(rows[:, :, None] * N[among])
            return best_scales(self._blocks, scaled)[0]

        tau_p = least_tau_p(curve, dense.size, start)
        if math.isfinite(tau_p):
            return tau_p
        values = curve(SLOWEST_TRIED * self.units.time, np.arange(dense.size))
        return Peak(float(values.max()), float(dense[values.argmax()]))
