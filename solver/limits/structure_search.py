"""Best settings of a structure: a minimax over frequency, by nonlinear programs.

The least tau_P with mu(omega; settings, tau_P) <= 1 at all frequencies of a grid, or the least
greatest mu, by sequential quadratic programming (SLSQP) from several starts; each value of mu is
the exact upper bound at its best scales. The grid takes up the peaks that a dense one shows.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq, minimize

from solver.limits.ending import EnoughError
from solver.limits.search import bandwidth_of
from solver.limits.structures import structures
from solver.limits.youla import youla_blocks
from solver.model.frequencies import corners, grid, resonances
from solver.model.one_scale import of_one_scale
from solver.model.peaks import local_peaks
from solver.model.plants import MAX_MATRIX_SIZE
from solver.robustness.centralised import analyse_blocks, centralised_poles
from solver.robustness.centralised_curves import CentralisedAnalysis, central_blocks
from solver.robustness.shared_scales import best_scales

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.limits.structures import Structure, StructureKind
    from solver.model.controllers import Controller
    from solver.model.mode_controller import ModeController
    from solver.model.one_scale import OneScale
    from solver.model.plants import Plant
    from solver.model.state_space import StateSpace
    from solver.model.weights import Performance, Uncertainty
    from solver.robustness.centralised import Centralised

__all__ = ["StructuredController", "StructuresFound", "structured_controllers"]

POINTS_PER_DECADE = 12.0
MATRIX_POINTS = 8.0  # a scale for each channel: mu costs a hundred times as much
SPAN = 1e3  # of the grid beyond the lowest and the highest bend
STARTS = 2  # best of the coarse grid that a search is started from
STEP = 1e-5  # of differences in logarithms: mu is known to 1e-10
WIDEST = 7.0  # in logarithms: how far a setting may go from its start
SETTLED = 1e-9  # of a value's logarithm
# The same where a step is one of many that follow one another: the last one is of the digits above.
SETTLED_ON_THE_WAY = 1e-3
RANKED = 1e-2  # of a value's logarithm, and
THINNED = 3  # frequencies of which one is looked at: enough to tell the best starts
RESTARTS = 3  # of SLSQP, whose model of the curvature may have gone astray
DIGITS = 1e-8  # of a value's logarithm
BRACKET = 0.7  # of log tau_P
FASTEST_TRIED = 20.0  # below the first tau_P, in logarithms
MAX_ITERATIONS = 80
MAX_RATIOS = 20
PRECISE = 1e-4  # of log tau_P: near enough for both to be sought at once
SLOWER = 10.0  # by which tau_P grows while no settings are found that meet it
EXCHANGES = 8
MISSED = 1e-7  # of mu above its level at a frequency that the grid lacked
SLOWEST_TRIED = 1e4  # times the inverse bandwidth: the integral action alone is left of the demand
ROOM = 1e-6  # relative addition to tau_P for peaks between the points of the dense grid
ATTEMPTS = 6


@dataclass(frozen=True)
class StructuredController:
    """The best settings found of one structure.

    Attributes
    ----------
    kind : StructureKind
        Which structure.
    value : float
        Its tau_P (time units) or mu.
    tau_p : float
        Time constant that it reaches, or for which mu was made small.
    settings : tuple of (str, float, float or None)
        What each scalar controller acts on, its gain and integral time; None: see the kind.
    mixing : tuple of (m, m)
        W of each block of the plant.
    controller : StateSpace, ModeController or None
        The whole controller, u = C e; None where it is too large to be written down.
    robustness : Centralised
        Peaks and curves.

    """

    kind: StructureKind
    value: float
    tau_p: float
    settings: tuple[tuple[str, float, float | None], ...]
    mixing: tuple[NDArray[np.float64], ...]
    controller: StateSpace | ModeController | None
    robustness: Centralised


@dataclass(frozen=True)
class StructuresFound:
    """What was found of the structures that a plant can have.

    Attributes
    ----------
    found : tuple of StructuredController
        The best controller of each structure, the best one first.
    none : tuple of StructureKind
        Structures of which no settings were found that meet the demand.
    ended : tuple of StructureKind
        Structures whose search was ended before it found any.

    """

    found: tuple[StructuredController, ...]
    none: tuple[StructureKind, ...] = ()
    ended: tuple[StructureKind, ...] = ()


def structured_controllers(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    *,
    identical: Controller | None = None,
    tick: Callable[[], None] = lambda: None,
) -> StructuresFound:
    """Return the best controller of each structure that this plant can have.

    Parameters
    ----------
    plant : Plant
        Stable or integrating. Units whose permitted errors differ are no parallel ones.
    uncertainty, performance : Uncertainty, Performance
        The weights; without a `tau_p` the least one is sought, with one the least mu.
    identical : Controller or None
        Known settings of identical PI loops, to begin with where a structure holds them.
    tick : callable
        Called at each evaluation. `EnoughError` ends the search with what it has; what else it
        raises passes through.

    """
    scaled = of_one_scale(plant, performance, MAX_MATRIX_SIZE, "structures are found for")
    plant, performance = scaled.plant, scaled.performance
    bends = corners(plant, uncertainty)
    bandwidth = bandwidth_of(plant, uncertainty, bends)
    youla = youla_blocks(central_blocks(plant, uncertainty), SPAN * float(bends.max()))
    best: dict[StructureKind, StructuredController] = {}
    left = structures(plant, uncertainty, youla, bandwidth, identical)
    kinds = tuple(dict.fromkeys(structure.kind for structure in left))
    with contextlib.suppress(EnoughError):
        while left:
            structure = left[0]
            found = _StructureSearch(structure, uncertainty, performance, tick).run()
            left = left[1:]
            before = best.get(structure.kind)
            if found is not None and (before is None or found.value < before.value):
                best[structure.kind] = _given_back(found, scaled)
    unsought = {structure.kind for structure in left}
    missing = [kind for kind in kinds if kind not in best]
    return StructuresFound(
        tuple(sorted(best.values(), key=lambda each: each.value)),
        none=tuple(kind for kind in missing if kind not in unsought),
        ended=tuple(kind for kind in missing if kind in unsought),
    )


def _given_back(found: StructuredController, scaled: OneScale) -> StructuredController:
    """Return what it is on the plant as given: C = W diag(c_i) E^-1 = W E^-1 diag(c_i)."""
    if (scaled.errors == 1).all():
        return found
    mixing = tuple(W / scaled.errors for W in found.mixing)
    controller = found.controller and scaled.given_back(found.controller)
    return replace(found, mixing=mixing, controller=controller)


class _StructureSearch:
    """The search for the best settings of one structure.

    Parameters
    ----------
    structure : Structure
        What is sought.
    uncertainty, performance, tick
        As for `structured_controllers`.

    """

    def __init__(
        self,
        structure: Structure,
        uncertainty: Uncertainty,
        performance: Performance,
        tick: Callable[[], None] = lambda: None,
    ) -> None:
        plant = structure.blocks.plant
        bandwidth = bandwidth_of(plant, uncertainty, corners(plant, uncertainty))
        self.structure, self.uncertainty, self.performance = structure, uncertainty, performance
        self.tick = tick
        self.tau_p = performance.tau_p
        self.first_tau_p = performance.tau_p or 10 / bandwidth
        self.slowest = SLOWEST_TRIED / bandwidth
        bends = corners(plant, uncertainty)
        density = POINTS_PER_DECADE if plant.interchangeable else MATRIX_POINTS
        low, high = float(bends.min()) / SPAN, float(bends.max()) * SPAN
        self._on(grid(low, high, density, [bends, resonances(plant)]))

    @property
    def sought(self) -> bool:
        """Whether tau_P is sought, rather than mu at a given one."""
        return self.performance.tau_p is None

    def run(self) -> StructuredController | None:
        """Return the best settings; None where none were found that meet the demand."""
        starts = self.structure.starts
        ranked = sorted((self._rough(start), number) for number, start in enumerate(starts))
        finite = [number for value, number in ranked if math.isfinite(value)][:STARTS]
        best: tuple[float, NDArray[np.float64]] | None = None
        for number in finite:
            found = self._from(starts[number])
            if found is not None and (best is None or found[0] < best[0]):
                best = found
        return None if best is None else self._checked(best[1])

    def _on(self, omega: NDArray[np.float64]) -> None:
        self.omega = omega
        self._levels: dict[tuple[bytes, float | None], tuple[float, float]] = {}  # on this grid
        self.w_I = self.uncertainty.magnitude(omega)[:, None, None]
        self.G = self.structure.blocks.response(omega)

    def _parts(self, theta: NDArray[np.float64]) -> list[NDArray[np.complex128]]:
        """N of each block (k, 2 m, 2 m) with w_P = 1."""
        found = []
        for G, C in zip(self.G, self.structure.responses(theta, self.omega), strict=True):
            S = np.linalg.inv(np.eye(G.shape[1]) + G @ C)
            R = self.w_I * (C @ S)
            found.append(np.block([[R @ G, R], [S @ G, S]]))
        return found

    def _mu(
        self,
        rows: list[tuple[list[NDArray[np.complex128]], float]],
        among: NDArray[np.intp] | None = None,
    ) -> NDArray[np.float64]:
        """Mu (rows, k) of matrices with w_P = 1, each at a tau_P of its own.

        `among` (k,): numbers of their frequencies; None: all of the grid.
        """
        omega = self.omega if among is None else self.omega[among]
        weighted = []
        weights = {
            tau_p: self.performance.with_tau_p(tau_p).magnitude(omega)[:, None, None]
            for tau_p in {tau_p for _, tau_p in rows}
        }
        for parts, tau_p in rows:
            w_P = weights[tau_p]
            scaled = []
            for part in parts:
                N = part.copy()
                N[:, N.shape[1] // 2 :] *= w_P
                scaled.append(N)
            weighted.append(scaled)
        stacked = [np.concatenate(block) for block in zip(*weighted, strict=True)]
        self.tick()
        return best_scales(self.structure.blocks, stacked)[0].reshape(len(rows), -1)

    def _from(self, start: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]] | None:
        """Best value and settings beside a start, on a grid that holds their peaks."""
        improved = self._improved(start)
        if improved is None:
            return None
        theta = improved
        for _ in range(EXCHANGES):
            missing = self._missing(theta)
            if not missing.size:
                break
            self._on(np.union1d(self.omega, missing))
            if math.isinf(self._level(theta, self.tau_p)):
                improved = self._improved(theta)
                if improved is None:
                    return None
                theta = improved
            else:
                theta = self._descend(theta, self.tau_p)
        level = self._level(theta, self.tau_p)
        return None if math.isinf(level) else (level, theta)

    def _improved(self, theta: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return settings of least mu, or where tau_P is sought, those of the least one.

        Least mu at a tau_P, least tau_P of these settings, and so on: Dinkelbach's (1967) way to a
        least ratio, with log mu nearer to linear in the settings than log tau_P is.
        """
        if not self.sought:
            return self._descend(theta, self.first_tau_p)
        level = self._level(theta, None)
        if math.isinf(level) and math.isinf(self._level(self._descend(theta, self.slowest), None)):
            return None  # what cannot be met by the slowest loops is met by none
        tau_p = self.first_tau_p
        while math.isinf(level):
            theta = self._descend(theta, tau_p)
            level = self._level(theta, None)
            if math.isinf(level) and tau_p >= self.slowest:
                return None
            tau_p *= SLOWER
        for _ in range(MAX_RATIOS):
            theta = self._descend(theta, math.exp(level), on_the_way=True)
            before, level = level, self._level(theta, None, level, digits=PRECISE / 10)
            if before - level < PRECISE:
                break
        return self._descend(theta, None)

    def _rough(self, theta: NDArray[np.float64]) -> float:
        """Return the logarithm of the value of a start; infinite where it is unstable."""
        if centralised_poles(self.structure.blocks, self.structure.controllers(theta)):
            return math.inf
        among = np.arange(0, self.omega.size, THINNED)
        if not self.sought:
            return self._level_on(among, theta, self.first_tau_p)
        level = self._level_on(among, theta, None, digits=RANKED)
        if math.isfinite(level):
            return level
        # Those that no tau_P satisfies rank behind the others, by their peak.
        return math.log(self.slowest) + self._level_on(among, theta, self.slowest)

    def _level(
        self,
        theta: NDArray[np.float64],
        tau_p: float | None,
        near: float | None = None,
        *,
        digits: float = DIGITS,
    ) -> float:
        """Log of the peak of mu at `tau_p`, or, where that is None, of the least tau_P."""
        key = theta.tobytes(), tau_p
        known, level = self._levels.get(key, (math.inf, 0.0))
        if known > digits:
            level = self._level_on(np.arange(self.omega.size), theta, tau_p, near, digits)
            self._levels[key] = digits, level
        return level

    def _level_on(
        self,
        among: NDArray[np.intp],
        theta: NDArray[np.float64],
        tau_p: float | None,
        near: float | None = None,
        digits: float = DIGITS,
    ) -> float:
        """Return the same on some frequencies of the grid."""
        parts = [part[among] for part in self._parts(theta)]

        def peak(level: float) -> float:
            nonlocal among, parts
            log_mu = np.log(self._mu([(parts, math.exp(level))], among))[0]
            over = log_mu > 0
            if tau_p is None and over.any():
                # mu falls with tau_P at every frequency: what is met here is met from here on.
                among, parts = among[over], [part[over] for part in parts]
            return float(log_mu.max())

        if tau_p is not None:
            return peak(math.log(tau_p))
        first, slowest = math.log(self.first_tau_p), math.log(self.slowest)
        high = low = first if near is None else near
        if peak(high) <= 0:
            while peak(low := high - BRACKET) <= 0:
                high = low
                if high < first - FASTEST_TRIED:
                    return high
        else:
            while peak(high := min(low + BRACKET, slowest)) > 0:
                low = high
                if low >= slowest:
                    return math.inf
        return float(brentq(peak, low, high, xtol=digits))

    def _descend(
        self, start: NDArray[np.float64], tau_p: float | None, *, on_the_way: bool = False
    ) -> NDArray[np.float64]:
        """Return settings of the least level beside a start, see `_level`; or better ones."""
        restarts, settled = (1, SETTLED_ON_THE_WAY) if on_the_way else (RESTARTS, SETTLED)
        size = start.size
        theta, level = start, self._level(start, tau_p)
        low, high = np.append(start, level) - WIDEST, np.append(start, level) + WIDEST

        def log_mu(points: list[NDArray[np.float64]]) -> NDArray[np.float64]:
            # SLSQP's line search may step outside of its bounds.
            inside = [np.clip(point, low, high) for point in points]
            rows = [
                (self._parts(point[:size]), math.exp(point[size]) if tau_p is None else tau_p)
                for point in inside
            ]
            return np.asarray(np.log(np.maximum(self._mu(rows), np.finfo(float).tiny)))

        def room(x: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.asarray((0.0 if tau_p is None else x[size]) - log_mu([x])[0])

        def slopes(x: NDArray[np.float64]) -> NDArray[np.float64]:
            free = size + (tau_p is None)
            values = log_mu([x, *(x + STEP * np.eye(free, size + 1))])
            by_x = ((values[0] - values[1:]) / STEP).T
            return by_x if tau_p is None else np.hstack([by_x, np.ones((self.omega.size, 1))])

        end = np.zeros(size + 1)
        end[size] = 1.0
        constraints: list[dict[str, Any]] = [{"type": "ineq", "fun": room, "jac": slopes}]
        for _ in range(restarts):
            found = minimize(
                lambda x: x[size], np.append(theta, level), jac=lambda _: end, method="SLSQP",
                bounds=list(zip(low, high, strict=True)),
                constraints=constraints,
                options={"maxiter": MAX_ITERATIONS, "ftol": settled},  # type: ignore[call-overload]
            )  # fmt: skip
            if not np.isfinite(found.x).all():
                break
            trial = np.clip(found.x, low, high)[:size]
            reached = self._level(trial, tau_p, level if tau_p is None else None)
            if not reached < level - SETTLED or centralised_poles(
                self.structure.blocks, self.structure.controllers(trial)
            ):
                break
            theta, level = trial, reached
        return theta

    def _analysis(self, theta: NDArray[np.float64], tau_p: float) -> CentralisedAnalysis:
        return CentralisedAnalysis(
            self.structure.blocks,
            self.structure.controllers(theta),
            self.uncertainty,
            self.performance.with_tau_p(tau_p),
        )

    def _missing(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the peaks that the grid lacks.

        The least tau_P is steep where the uncertainty's end of the curve is at its limit: a peak
        missed by 1e-4 may cost a third of it.
        """
        level = self._level(theta, self.tau_p)
        tau_p, top = (math.exp(level), 1.0) if self.tau_p is None else (self.tau_p, math.exp(level))
        analysis = self._analysis(theta, tau_p)
        dense = np.union1d(analysis.omega, self.omega)
        values = analysis.robust_performance(dense)
        where, heights = local_peaks(analysis.robust_performance, dense, values, rounds=3)
        return where[heights > top * (1 + MISSED)]

    def _checked(self, theta: NDArray[np.float64]) -> StructuredController | None:
        """Return the settings with the value that the analysis of the whole axis confirms."""
        structure, tau_p = self.structure, self.first_tau_p
        for attempt in range(ATTEMPTS):
            if self.sought:
                level = self._level(theta, None)
                if math.isinf(level):
                    return None
                tau_p = math.exp(level) * (1 + ROOM * 4**attempt)
                if not attempt:
                    self._on(self._analysis(theta, tau_p).omega)
                    continue
            found = analyse_blocks(
                structure.blocks, structure.controllers(theta), self.uncertainty,
                self.performance.with_tau_p(tau_p),
            )  # fmt: skip
            if found.peaks is None:
                return None
            peak = found.peaks.robust_performance
            if not self.sought or peak.value <= 1:
                settings = tuple(
                    (words, *pair)
                    for words, pair in zip(
                        structure.acts_on, structure.settings(theta), strict=True
                    )
                )
                return StructuredController(
                    structure.kind, tau_p if self.sought else peak.value, tau_p, settings,
                    structure.mixing, structure.full(theta), found,
                )  # fmt: skip
            self._on(np.union1d(self.omega, [peak.omega]))
        return None
