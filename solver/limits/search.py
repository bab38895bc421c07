"""Least mu, or least tau_P, over all controllers: convex steps on a grid that follows the peaks.

The value is a local one: mu is not jointly convex in the controller and the scales. For a parallel
plant the controller is parallel too (docs/limits.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.limits.basis import Basis
from solver.limits.ending import EnoughError
from solver.limits.programs import AffineBlock, convex_step
from solver.limits.youla import youla_blocks
from solver.model.frequencies import corners, grid, resonances_of
from solver.model.peaks import local_peaks
from solver.model.transfer_function import LARGEST
from solver.robustness.centralised_curves import central_blocks
from solver.robustness.shared_scales import best_scales

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty

__all__ = [
    "BETWEEN",
    "SLOWEST_TRIED",
    "Found",
    "LimitSearch",
    "bandwidth_of",
    "checking_grid",
    "least_tau_p",
]

SETTLED = 2e-4  # relative gain of a step below which the next ones gain less
REFINED = 5e-3  # relative gain of a richer basis below which the value has settled
BETWEEN = 5e-4  # relative excess of mu between the grid's points that is let pass
TARGET = 1 - 2 * BETWEEN  # of mu on the grid where tau_P is sought, so that 1 holds between
# What is built keeps this much of mu in hand for the reduction of its order, and ends earlier.
MARGINS = (0.993, 0.98, 0.95, 0.88)
BUILT_HIGH = 30.0  # fastest pole of its basis over the bandwidth, of a matrix plant
BUILT_DELAYED = 14.0  # the same over the inverse of the longest dead time: what Pade quotients hold
BUILT_END = 3.0  # where its functions begin to fall, over its fastest pole
# Of its poles, as `POLES_PER_DECADE`: of one attempt after another.
BUILT_POLES, BUILT_MATRIX_POLES = (4.0, 6.0), (3.0, 4.5)
# The same of a first controller, and the relative gain below which its steps end.
FIRST_TARGET, FIRST_SETTLED, FIRST_END = 0.8, 0.15, 1.0
MAX_STEPS = 60
MAX_EXCHANGES = 6  # after which peaks between the points are let pass that a larger tau_P lowers
LAST_EXCHANGE = 18  # of those that no tau_P lowers: with the densest of grids few are left
SLOWER = 4.0  # by which tau_P grows while no controller is found that meets it
SLOWEST_TRIED = 1e6  # times the inverse bandwidth: w_P has then ended before any loop begins
POINTS_PER_DECADE = 12.0
MATRIX_POINTS = 7.0  # the same for a matrix plant, whose program is a hundred times as large
REFINED_SIZE = 3  # units of the largest matrix plant whose basis is refined
EARLY_SIZE = 3  # units of the smallest matrix plant of which something is built early
DENSER = 5  # points of the checking grid for each one of the program's
# Of the basis, each pole twice: of one refinement after another, of plants whose steps cost
# milliseconds, and of others.
POLES_PER_DECADE = (1.5, 3.0, 6.0)
MATRIX_POLES = (1.5, 2.5, 4.0)
# Fastest pole of a refined basis over the range's end: T falls slowly there, as |w_I| allows.
FURTHER = 5.0
DIFFERENCE = 1e-4  # of a tau_P: for a slope that is needed to a few digits
DIGITS = 1e-9  # of a tau_P: the last ones that a peak on a grid can have a use for
BISECTED = 1e-7  # the same within the search, whose steps end at gains a thousand times as large
TINY = 1e-300  # a peak beyond which a logarithm says nothing
SLOWEST, FASTEST = 1e-9, 1e9  # of tau_P over the time of the bandwidth


@dataclass(frozen=True)
class Found:
    """A controller as a function of frequency.

    Attributes
    ----------
    X : list of (j, m, m)
        Coefficients of each block in `basis`.
    basis : Basis
        The functions.
    v : (k, scales)
        d^-2 on the search's grid.
    mu : float
        Peak on the checking grid.
    tau_p : float
        Time constant for which that is so.

    """

    X: list[NDArray[np.float64]]
    basis: Basis
    mu: float
    tau_p: float
    omega: NDArray[np.float64]
    v: NDArray[np.float64]


def least_tau_p(
    curve: Callable[[float, NDArray[np.intp]], NDArray[np.float64]],
    count: int,
    start: float,
    level: float = 1.0,
    *,
    digits: float = DIGITS,
) -> float:
    """Least tau_P at which a falling curve is at most `level`; infinite without one.

    Parameters
    ----------
    curve : callable
        mu at a time constant and at these of the frequencies, (k,); falls as the former grows.
    count : int
        Number of frequencies.
    start : float
        Where to begin.
    level : float
        What the peak may reach.
    digits : float
        Relative width of the bracket that is left.

    """
    left = np.arange(count)

    def peak(tau_p: float) -> float:
        nonlocal left
        values = curve(tau_p, left)
        if (values > level).any():
            # mu falls with tau_P at every frequency: what is met here is met from here on.
            left = left[values > level]
        return float(values.max())

    low = high = start
    above = below = _excess(peak(start), level)
    if above <= 0:
        while low > SLOWEST * start and above <= 0:
            high, below = low, above
            low /= 2
            above = _excess(peak(low), level)
    else:
        while high < min(FASTEST * start, LARGEST) and below > 0:
            low, above = high, below
            high = min(high * 2, LARGEST)
            below = _excess(peak(high), level)
        if below > 0:
            return math.inf
    halve = False
    while high / low > 1 + digits and above > 0:
        width = math.log(high / low)
        # The secant, as far inside as the digits ask for; every other time the middle.
        share = 0.5 if halve else above / (above - below)
        inside = min(digits / (3 * width), 0.5)
        middle = low * math.exp(width * min(max(share, inside), 1 - inside))
        value = _excess(peak(middle), level)
        if value <= 0:
            high, below = middle, value
        else:
            low, above = middle, value
        halve = math.log(high / low) > width / 2
    return high


def _excess(peak: float, level: float) -> float:
    """Logarithm of a peak over its level; finite, as a secant needs it."""
    return math.log(min(max(peak / level, TINY), 1 / TINY))


class LimitSearch:
    """The search for one plant and its weights.

    Parameters
    ----------
    plant : Plant
        Stable or integrating.
    uncertainty, performance : Uncertainty, Performance
        The weights; with a `tau_p` the objective is mu, without one it is tau_P.
    tick : callable
        Called before and within each convex step. `EnoughError` ends the search with what it has;
        `ended` then says so.

    """

    def __init__(
        self,
        plant: Plant,
        uncertainty: Uncertainty,
        performance: Performance,
        tick: Callable[[], None] = lambda: None,
    ) -> None:
        self.plant, self.uncertainty, self.performance = plant, uncertainty, performance
        self.tick = tick
        self.ended = False
        self._met: list[tuple[list[NDArray[np.float64]], float]] = []  # in this basis
        self.target = TARGET
        self.allowed = 0.0  # of mu between the points, where that is more than the target
        self.settled = SETTLED
        self.blocks = central_blocks(plant, uncertainty)
        bends = corners(plant, uncertainty)
        self.bandwidth = bandwidth_of(plant, uncertainty, bends)
        low = min(max(bends.min() / 3, 1e-4 * self.bandwidth), self.bandwidth / 30)
        high = max(min(15 * bends.max(), 300 * self.bandwidth), 30 * self.bandwidth)
        self.youla = youla_blocks(self.blocks, fast=10 * high)
        # The weak directions of a plant can be held only after the strong ones have settled.
        low = min(low, 0.1 * self.bandwidth / math.sqrt(self._spread()))
        self.range = low, high
        extra = [resonances_of((*plant.elements, *uncertainty.weights)), bends]
        density = POINTS_PER_DECADE if self.scalar else MATRIX_POINTS
        self.omega = self._grid = grid(low / 200, 30 * high, density, extra)

    def _spread(self) -> float:
        """Greatest gain of the plant at low frequency over its least one, whatever the units."""
        inverses = [block.inverse for block in self.youla]
        if not self.plant.interchangeable:
            # Its rows belong to inputs, each with a unit of its own (and that of time, where it
            # integrates). Equal rows come within sqrt(n) of the least spread (van der Sluis 1969).
            inverses = [P / np.linalg.norm(P, axis=1, keepdims=True) for P in inverses]
        sizes = np.concatenate([np.linalg.svd(P, compute_uv=False) for P in inverses])
        return float(sizes.max() / sizes.min())

    @property
    def sought(self) -> bool:
        """Whether tau_P is sought."""
        return self.performance.tau_p is None

    @property
    def scalar(self) -> bool:
        """Whether all blocks have one channel: then a step costs milliseconds."""
        return all(block.size == 1 for block in self.blocks.blocks)

    def run(self, first: Found | None = None) -> Found | None:
        """Return the best controller, from a first one; None if mu exceeds 1 for every tau_P."""
        best = first
        if self.ended:
            return best
        end = self.range[1]
        if self.scalar:
            bases = [(density, FURTHER * end) for density in POLES_PER_DECADE]
            bases[0] = POLES_PER_DECADE[0], end
        else:
            few = len(MATRIX_POLES) if self.plant.n <= REFINED_SIZE else 1
            bases = [(density, end) for density in MATRIX_POLES[:few]]
        for density, high in bases:
            found = self._with_basis(self._basis(density, high, 10 * end), best)
            if found is None and best is None and not self.ended:
                continue  # a richer basis may hold what this one does not
            if found is None:
                break
            value, before = self._value(found), self._value(best) if best else math.inf
            if value < before:
                best = found
            if value > before * (1 - REFINED) or self.ended:
                break
        return best

    @property
    def costly(self) -> bool:
        """Whether many seconds go by before the best controller is there."""
        return not self.scalar and self.plant.n > REFINED_SIZE

    def first(self) -> Found | None:
        """Return a controller that is there early, where many seconds go by before the best one.

        It keeps so much of mu in hand that few peaks between the points exceed what is allowed,
        and that little more is needed to build it.
        """
        if not self.sought or self.scalar or self.plant.n < EARLY_SIZE:
            return None
        self.target, self.allowed, self.settled = FIRST_TARGET, TARGET, FIRST_SETTLED
        found = self._with_basis(self._built_basis(MATRIX_POLES[0], FIRST_END), None)
        self.target, self.allowed, self.settled = TARGET, 0.0, SETTLED
        return found

    def ask(self) -> None:
        """Call `tick` until it has ended the search: what is left then is short."""
        if not self.ended:
            self.tick()

    def ask_between(self) -> None:
        """Call it where mu on one grid takes more than milliseconds."""
        if not self.scalar:
            self.ask()

    def enough(self) -> bool:
        """Whether the search is to end with what it has."""
        try:
            self.tick()
        except EnoughError:
            self.ended = True
        return self.ended

    @property
    def built_densities(self) -> tuple[float, ...]:
        """Of the poles of what is built, each richer than the one before and nearer to the best."""
        if self.scalar:
            return BUILT_POLES
        return BUILT_MATRIX_POLES if self.plant.n <= REFINED_SIZE else BUILT_MATRIX_POLES[:1]

    def buildable(self, best: Found, density: float) -> Iterator[Found]:
        """Yield controllers with a margin for their realisation, the fastest one first."""
        basis = self._built_basis(density)
        # T = I at rest, where mu is |w_I| whatever the controller: half of what that leaves.
        most = (1 + abs(complex(self.uncertainty.weight_of(0)(0.0)))) / 2
        margins = dict.fromkeys(max(margin, most) for margin in MARGINS)
        for margin in margins if self.sought else (1.0,):
            if self.enough():
                return
            self.target = margin
            found = self._with_basis(basis, best)
            if found is not None:
                yield found

    def _value(self, found: Found) -> float:
        return found.tau_p if self.sought else found.mu

    def _built_basis(self, density: float, end: float = BUILT_END) -> Basis:
        own = self.range[1]
        high = FURTHER * own if self.scalar else min(own, BUILT_HIGH * self.bandwidth)
        if self.plant.longest_dead_time > 0:
            high = min(high, BUILT_DELAYED / self.plant.longest_dead_time)
        return self._basis(density, high, end * high)

    def _basis(self, density: float, high: float, end: float) -> Basis:
        low = self.range[0]
        count = max(2, round(density * math.log10(high / low)))
        poles = np.repeat(np.geomspace(low, high, count), 2)
        return Basis.over(self.omega, self.bandwidth, poles, end)

    def _with_basis(self, basis: Basis, before: Found | None) -> Found | None:
        """Best controller in one basis, its grid following the peaks."""
        self._met = []
        try:
            return self._followed(basis, before)
        except EnoughError:
            self.ended = True
        # Of a large plant, a look between the points of the grid takes seconds.
        return None if self.costly and before is not None else self._last(basis)

    def _followed(self, basis: Basis, before: Found | None) -> Found | None:
        self._grid = self.omega if before is None else before.omega
        state = _State(self, basis, self._grid)
        if before is None:
            start = [np.zeros((basis.size, block.size, block.size)) for block in self.youla]
            tau_p = self.performance.tau_p or 10 / self.bandwidth
        else:
            start, tau_p = state.fitted(before), before.tau_p
        mu, v, tau_p = self._slower(state, start, tau_p)
        for exchange in range(LAST_EXCHANGE):
            result = self._descend(state, start, v, mu, tau_p)
            if result is None:
                return None
            X, v, mu, tau_p = result
            start = X
            checked = self._checked(state, X, v, tau_p)
            if checked is None or isinstance(checked, Found):
                return checked
            self._grid = np.union1d(state.omega, checked)
            state = _State(self, basis, self._grid)
            mu, v, tau_p = self._slower(state, X, tau_p)
            if exchange + 1 >= MAX_EXCHANGES:
                found = self._found(state, X, v, tau_p)
                if found is not None:
                    return found
        return None

    def _last(self, basis: Basis) -> Found | None:
        """Return the last controller met that keeps its mu between the points of the grid too."""
        state = _State(self, basis, self._grid)
        back = 1
        while back <= len(self._met):
            X, tau_p = self._met[-back]
            found = self._found(state, X, state.measure(X, tau_p)[1], tau_p)
            if found is not None:
                return found
            back *= 2
        return None

    def _slower(
        self, state: _State, X: list[NDArray[np.float64]], tau_p: float
    ) -> tuple[float, NDArray[np.float64], float]:
        """Return mu, v and the least tau_P of given coefficients; `tau_p` where none meets mu."""
        if self.sought:
            least = state.least_tau_p(X, tau_p, self.target)
            tau_p = least if math.isfinite(least) else tau_p
        return *state.measure(X, tau_p), tau_p

    def _descend(
        self,
        state: _State,
        X: list[NDArray[np.float64]],
        v: NDArray[np.float64],
        mu: float,
        tau_p: float,
    ) -> tuple[list[NDArray[np.float64]], NDArray[np.float64], float, float] | None:
        """Take steps until they gain no more."""
        for _ in range(MAX_STEPS):
            self.ask()
            faster = self.sought and mu <= self.target * (1 + BETWEEN)
            trial = state.step(X, v, mu, tau_p, faster=faster)
            trial_mu, _ = state.measure(trial, tau_p)
            gain = 0.0
            if trial_mu < mu:
                gain, before, X = 1 - trial_mu / mu, tau_p, trial
                mu, v, tau_p = self._slower(state, X, tau_p)
                gain = max(gain, 1 - tau_p / before)
                self._met.append((X, tau_p))
            if gain < self.settled:
                if not (
                    self.sought
                    and mu > self.target * (1 + BETWEEN)
                    and tau_p < SLOWEST_TRIED / self.bandwidth
                ):
                    break
                tau_p *= SLOWER
                mu, v = state.measure(X, tau_p)
        # The peak of a tau_P found is the target, to the digits that the bisection leaves.
        missed = self.sought and mu > self.target * (1 + BETWEEN)
        return None if missed else (X, v, mu, tau_p)

    def _checked(
        self, state: _State, X: list[NDArray[np.float64]], v: NDArray[np.float64], tau_p: float
    ) -> Found | NDArray[np.float64] | None:
        """Return the controller if no peak between the points matters, else the peaks to add."""
        dense = checking_grid(state.omega)

        def curve(omega: NDArray[np.float64]) -> NDArray[np.float64]:
            self.ask_between()
            return _State(self, state.basis, omega).curve(X, tau_p)[0]

        values = curve(dense)
        level = max(curve(state.omega).max(), self.allowed)
        where, heights = local_peaks(curve, dense, values, rounds=1)
        over = heights > level * (1 + BETWEEN)
        return where[over] if over.any() else self._found(state, X, v, tau_p)

    def _found(
        self, state: _State, X: list[NDArray[np.float64]], v: NDArray[np.float64], tau_p: float
    ) -> Found | None:
        dense = checking_grid(state.omega)
        checking = _State(self, state.basis, dense)
        if self.sought:
            slowest = SLOWEST_TRIED / self.bandwidth
            if checking.curve(X, max(tau_p, slowest))[0].max() > 1:
                return None
            level = max(self.target, self.allowed) * (1 + 2 * BETWEEN)
            tau_p = checking.least_tau_p(X, tau_p, min(1.0, level))
            if math.isinf(tau_p):
                return None
        mu = float(checking.curve(X, tau_p)[0].max())
        return Found(X, state.basis, mu, tau_p, state.omega, v)


class _State:
    """The problem on one grid and in one basis."""

    def __init__(
        self,
        search: LimitSearch,
        basis: Basis,
        omega: NDArray[np.float64],
    ) -> None:
        self.search, self.basis, self.omega = search, basis, omega
        s = np.asarray(1j * omega, dtype=np.complex128)
        first, rest = basis(s)
        self.affine = []
        for block, own, G in zip(
            search.blocks.blocks, search.youla, search.blocks.response(omega), strict=True
        ):
            self.affine.append(AffineBlock(G, own.prefilter(s), first, rest, block.scales))
        self.w_I = search.uncertainty.magnitude(omega)

    def w_P(self, tau_p: float) -> NDArray[np.float64]:  # noqa: N802 - the weight's name
        """|w_P| (k,) at the time constant `tau_p`."""
        return self.search.performance.with_tau_p(tau_p).magnitude(self.omega)

    def curve(
        self, X: list[NDArray[np.float64]], tau_p: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return mu (k,) and v (k, scales) for the coefficients X at the time constant `tau_p`."""
        rows = [(block, *self._columns(block, x)) for block, x in zip(self.affine, X, strict=True)]
        return self._curve(rows, tau_p)

    def measure(
        self, X: list[NDArray[np.float64]], tau_p: float
    ) -> tuple[float, NDArray[np.float64]]:
        """Peak of mu on the grid, and v (k, scales)."""
        mu, v = self.curve(X, tau_p)
        return float(mu.max()), v

    def fitted(self, found: Found) -> list[NDArray[np.float64]]:
        """Coefficients in this basis that come near to a controller found in another one."""
        s = np.asarray(1j * self.omega, dtype=np.complex128)
        first, rest = found.basis(s)
        own_first, own = self.basis(s)
        # What an error of Y does to N, in directions that the plant passes on by its static gain.
        weight = (self.w_I + self.w_P(found.tau_p))[:, None]
        solution: list[NDArray[np.float64]] = []
        for X in found.X:
            Y = rest @ X.reshape(len(X), -1)
            Y += (first - own_first)[:, None] * np.eye(X.shape[1]).ravel()
            left, right = (np.vstack([part.real, part.imag]) for part in (weight * own, weight * Y))
            fit = np.asarray(np.linalg.lstsq(left, right, rcond=None)[0])
            solution.append(fit.reshape(-1, *X.shape[1:]))
        return solution

    def step(
        self,
        X: list[NDArray[np.float64]],
        v: NDArray[np.float64],
        mu: float,
        tau_p: float,
        *,
        faster: bool,
    ) -> list[NDArray[np.float64]]:
        """Coefficients after a convex step from the peak `mu` at the scales v.

        `faster`: towards a smaller tau_P rather than a smaller mu.
        """
        weights = self.w_I, self.w_P(tau_p)
        if not faster:
            return convex_step(self.affine, X, v, level=mu, weights=weights, tick=self.search.tick)
        shorter = self.w_P(tau_p * (1 - DIFFERENCE))
        rise = np.log(shorter / weights[1]) / -math.log1p(-DIFFERENCE)
        rise = np.clip(rise, 0.0, 1.0)
        return convex_step(
            self.affine, X, v, level=mu, weights=weights, rise=rise, tick=self.search.tick
        )

    def least_tau_p(self, X: list[NDArray[np.float64]], start: float, level: float) -> float:
        """Least tau_P at which the coefficients keep mu at `level` or below on the grid."""
        rows = [(block, *self._columns(block, x)) for block, x in zip(self.affine, X, strict=True)]

        def curve(tau_p: float, among: NDArray[np.intp]) -> NDArray[np.float64]:
            self.search.ask_between()
            return self._curve(rows, tau_p, among)[0]

        return least_tau_p(curve, self.omega.size, start, level, digits=BISECTED)

    def _columns(
        self, block: AffineBlock, x: NDArray[np.float64]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        Q = block.parameter(x)
        return Q, np.eye(Q.shape[1]) - block.G @ Q

    def _curve(
        self,
        rows: list[tuple[AffineBlock, NDArray[np.complex128], NDArray[np.complex128]]],
        tau_p: float,
        among: NDArray[np.intp] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        at = slice(None) if among is None else among
        w_I, w_P = self.w_I[at, None, None], self.w_P(tau_p)[at, None, None]
        matrices = []
        for block, Q_everywhere, S_everywhere in rows:
            G, Q, S = block.G[at], Q_everywhere[at], S_everywhere[at]
            matrices.append(np.block([[w_I * Q @ G, w_I * Q], [w_P * S @ G, w_P * S]]))
        mu, x = best_scales(self.search.blocks, matrices)
        return mu, 1 / x


def checking_grid(omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frequencies between those of a search's grid `omega` (k,), and these."""
    return grid(float(omega[0]), float(omega[-1]), DENSER * POINTS_PER_DECADE, [omega])


def bandwidth_of(plant: Plant, uncertainty: Uncertainty, bends: NDArray[np.float64]) -> float:
    """Where |w_I| passes 1 or the dead time ends any loop; else the fastest bend."""
    omega = grid(1e-3 * float(bends.min()), 1e3 * float(bends.max()), 20)
    over = np.flatnonzero(uncertainty.magnitude(omega) >= 1)
    limits = [float(omega[over[0]])] if over.size and over[0] > 0 else [float(bends.max())]
    limits += [1 / element.dead_time for element in plant.elements if element.dead_time > 0]
    return min(limits)
