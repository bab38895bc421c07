"""Peaks of mu over all frequencies, 0 and infinity included: proven, not sampled.

Counterexample-guided search. With the highest value m found so far, march along the axis and prove
mu <= m (1 + `BRACKET`) interval by interval (`solver.robustness.march`). Where no interval can be
proven, look there for a higher value; a proof made for a lower level holds for the higher one, so
the march goes on from where it stood. What comes out is a bracket [m, m (1 + `BRACKET`)] of the
upper bound of mu on the whole axis, or the reason why there is none. The ends of the axis are
where the proof reaches 0 and infinity: the loop's own, not those of the plant's corners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.certificate.enclosed_loop import ExactLoop
from solver.certificate.record import Claim
from solver.certificate.reduction import width_of
from solver.certificate.search import BEFORE
from solver.model.blocks import group_loops
from solver.model.errors import InvalidInputError
from solver.model.mixed_plant import shares_inputs
from solver.model.neighbours import NeighbourPlant
from solver.model.peaks import Peak, greatest, tops, zoom
from solver.model.plants import MatrixPlant
from solver.mu.recomputed import NOMINAL, ROBUST, STABILITY
from solver.robustness.box_proof import keeps_stable, proven_box
from solver.robustness.curves import LoopAnalysis
from solver.robustness.followed import followed_count
from solver.robustness.march import march
from solver.robustness.record import Curves, Guarantee, GuaranteeStatus, Peaks
from solver.robustness.tables import Scratch, Tables, scratch, tables
from solver.robustness.worst_phase import any_phase, bound_beyond, far_phases, phases_beside
from solver.stability.closed_loop import unstable_poles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty

__all__ = [
    "BRACKET",
    "AxisPeaks",
    "kept",
    "proven_count",
    "proven_peaks",
    "require_bounded",
]

MOST_PROVEN = 60  # different settings: half a minute; the work grows with the fourth power
MOST = 100  # different settings: a minute or two without a proof
BRACKET = 1e-4  # relative width of what is proven; a touch of the level cannot be
FIRST_STEP = 0.7  # log(ratio) of the ends of the first interval
SHORT = 0.01  # log(ratio) at which the curve is looked at before shorter intervals are tried,
SHORTER = 0.05  # each time so much shorter,
SHORTEST = 1e-11  # down to this one: frequencies of 16 digits have few points left in it
LOOKS = 24  # points of a look
AHEAD = 20  # intervals that it reaches ahead
MAX_STEPS = 60_000  # of a march: a second or two for two loops,
STEPS_BY_SIZE = 100_000_000  # over the cube of unlike loops: some ten seconds for any number
NO_TRAIL = np.empty(0)
CLOSER = (1.0, 0.03)  # of the distance of two phases far out
MAX_LOOKS = 400
MAX_TRAIL = 5_000  # intervals: those of a certificate
FAR, LAST = 1e12, 1e150  # over the grid's end: what is not fed through has died away; and at most
TAIL_STEP, TAIL_STEPS = 4.0, 30  # ends of the axis that are tried: up to 1e18 beyond the grid
LIMITS = np.array([1e1, 1e2, 1e4, 1e6])  # beyond the ends, where the limits show
SECTIONS, ROUNDS = 32, 4  # of a refinement: 16^4, a peak right to 1e-9 of its drop over the bracket
NEAR = 30 * BRACKET  # maxima so far below the highest may be the highest once refined
PER_DECADE = 12.0  # points that carry D-scales beyond the grid
MAX_POLISHED = 60
CLEAR = 0.98  # of a level: sampled peaks below it are proven to be below the level, not sought
FURTHER = 1e4  # below the grid, where |w_P S| is level or grows in inverse proportion
NAMED = 5  # loops in a message
NONE = np.empty(0)
RESOLVING, BEND, MAX_SAMPLES = 12, 0.02, 20_000  # rounds, in log of the curve, in all


@dataclass(frozen=True)
class AxisPeaks:
    """Peaks of the three curves over all frequencies, and what is proven of them.

    Attributes
    ----------
    peaks : Peaks
        The highest values found, each attained at its frequency.
    guarantee : Guarantee
        Of robust performance.
    proven : tuple of bool
        Whether no frequency exceeds the peak by more than `BRACKET`: for robust performance, robust
        stability, nominal performance.
    curves : Curves
        The curves on the grid that resolves the loop.
    unstable : int or None
        Closed-loop poles with Re s >= 0, counted by proof; None where the proof was not found.

    """

    peaks: Peaks
    guarantee: Guarantee
    proven: tuple[bool, bool, bool]
    curves: Curves
    unstable: int | None
    _robust: _CurveSearch = field(repr=False, compare=False)

    def ends(self, level: float) -> list[float]:
        """Return where intervals end on each of which robust performance is below `level` by proof.

        The first begins at 0 and the last ends at infinity; empty where no proof is found.
        """
        return self._robust.ends(level)


def proven_peaks(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
) -> AxisPeaks:
    """Return the peaks of robust performance, robust stability and nominal performance.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    loops : sequence of Controller
        One a unit, nominally stable together.

    Raises
    ------
    InvalidInputError
        No offset is permitted, but the loops leave one; or more than `MOST` loops differ.

    """
    blocks, controllers = group_loops(plant, loops, uncertainty, performance.output_scale)
    if len(controllers) > MOST:
        message = (
            f"mu is computed for at most {MOST} different settings, not for {len(controllers)}; "
            "give some loops equal ones: any number of those costs nothing"
        )
        raise InvalidInputError(message, "/loops")
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    require_bounded(analysis, loops)
    compiled = _compiled(plant, uncertainty, performance, loops)
    known, known_compiled = analysis, compiled
    if blocks.is_wider:  # nominal performance and stability are as without errors
        known = _known(plant, uncertainty, performance, loops)
        known_compiled = _compiled(plant, known.uncertainty, performance, loops, known=True)
    omega = analysis.omega
    sampled = analysis.sampled((ROBUST, STABILITY, NOMINAL), omega)
    curves = Curves(omega, *(values for values, _ in sampled))
    searches = [
        _CurveSearch(
            known if kind == NOMINAL else analysis,
            known_compiled if kind == NOMINAL else compiled,
            kind, greatest(*found), refined=found[0],
        )
        for kind, found in zip((ROBUST, STABILITY, NOMINAL), analysis.maxima(curves), strict=True)
    ]  # fmt: skip
    for search, (values, d) in zip(searches, sampled, strict=True):
        # Those of nominal performance are all one.
        ones = np.ones((omega.size, search.analysis.blocks.n_scales))
        search.take(omega, values, ones if search.curve == NOMINAL else d)
        search.close()
    unstable = None if known_compiled is None else _count(*known_compiled.loop, known)
    if isinstance(plant, NeighbourPlant) and _stable_without_neighbours(plant, known, loops):
        unstable = 0 if keeps_stable(plant, known.uncertainty, performance, loops) else None
    reason = searches[0].reason
    if reason is None and unstable is None:
        reason = "nominal stability was counted, not proven"
    level = (1 + BRACKET) * searches[0].peak.value
    return AxisPeaks(
        Peaks(*(search.peak for search in searches)),
        Guarantee(GuaranteeStatus.OPEN if reason else GuaranteeStatus.PROVEN, level, reason),
        (searches[0].reason is None, searches[1].reason is None, searches[2].reason is None),
        curves,
        unstable,
        searches[0],
    )


def kept(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    level: float,
) -> tuple[bool, bool, bool]:
    """Whether loops are stable, and mu of robust stability and performance at or below a level.

    Parameters, errors: as for `proven_peaks`. Where that needs no peak, none is sought: a sample
    above the level is enough to deny it, a proof far above all samples to affirm it.
    """
    blocks, controllers = group_loops(plant, loops, uncertainty, performance.output_scale)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    compiled = _compiled(plant, uncertainty, performance, loops)
    unstable = None
    if compiled is not None and not blocks.is_wider:
        unstable = _count(*compiled.loop, analysis)
    if unstable is None:
        unstable = unstable_poles(plant, loops)
    if unstable:
        return False, False, False
    require_bounded(analysis, loops)
    omega = analysis.omega
    verdicts = []
    for curve in (ROBUST, STABILITY):
        values, d = analysis.sampled((curve,), omega)[0]
        top = int(np.argmax(values))
        if values[top] <= level:
            start = level / (1 + BRACKET) if values[top] < CLEAR * level else float(values[top])
            search = _CurveSearch(analysis, compiled, curve, Peak(start, float(omega[top])))
            search.take(omega, values, d)
            search.close()
            verdicts.append(search.peak.value <= level)
        else:
            verdicts.append(False)
        if verdicts[-1]:  # what keeps robust performance keeps robust stability
            break
    return True, verdicts[-1], verdicts[0]


def require_bounded(analysis: LoopAnalysis, loops: Sequence[Controller]) -> None:
    """Refuse loops that leave an offset where none is permitted: mu grows without bound then.

    S(0) is not zero unless each direction is integrated, by the controllers or by the plant.

    Raises
    ------
    InvalidInputError
        Such loops.

    """
    without = [unit for unit, loop in enumerate(loops) if loop.integral_time is None]
    if analysis.performance.offset > 0 or not without:
        return
    end = analysis.omega[0]
    at_end, far = analysis.level(NOMINAL, np.array([end, end / FURTHER]))[0]
    if far > math.sqrt(FURTHER) * at_end:
        which = "loop" if len(without) == 1 else "loops"
        names = ", ".join(str(unit + 1) for unit in without[:NAMED])
        names += ", ..." if len(without) > NAMED else ""
        message = (
            f"no offset is permitted, but without integral action in {which} {names} one remains: "
            "mu grows without bound towards the frequency zero; permit an offset above 0, or give "
            "an integral time"
        )
        raise InvalidInputError(message, "/performance/offset")


def proven_count(plant: Plant, loops: Sequence[Controller], analysis: LoopAnalysis) -> int | None:
    """Count the closed-loop poles with Re s >= 0 by proof; None where none was found."""
    known = replace(analysis.uncertainty, outputs=None)  # poles are those without errors
    compiled = _compiled(plant, known, analysis.performance, loops, known=True)
    return None if compiled is None else _count(*compiled.loop, analysis)


class _Compiled(NamedTuple):
    """The loop for the compiled enclosures, and as it is taken on intervals that begin at 0."""

    loop: tuple[Tables, Scratch]
    from_zero: tuple[Tables, Scratch]


def _known(
    plant: Plant, uncertainty: Uncertainty, performance: Performance, loops: Sequence[Controller]
) -> LoopAnalysis:
    """Return the loop without the channels that errors of outputs, or shared inputs, add."""
    without, scale = replace(uncertainty, outputs=None), performance.output_scale
    of_loops = None if shares_inputs(plant) else without
    return LoopAnalysis(*group_loops(plant, loops, of_loops, scale), without, performance)


def _compiled(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    *,
    known: bool = False,
) -> _Compiled | None:
    """Return the loop for the compiled enclosures; None where it has too many settings.

    `known`: without the errors of shared inputs.
    """
    if isinstance(plant, NeighbourPlant):
        return None  # the cosines of its modes are no rational numbers
    if width_of(plant, loops, uncertainty, performance.output_scale) > MOST_PROVEN:
        return None
    level = 1.0  # each march brings its own
    claim = Claim(plant, uncertainty, performance, tuple(loops), level)
    loop = ExactLoop.of(claim, MOST_PROVEN, known=known)
    T = tables(loop)
    compiled = T, scratch(T)
    if performance.offset > 0 or all(each.integral_time is not None for each in loops):
        return _Compiled(compiled, compiled)
    by_columns = tables(loop, by_columns=True)
    return _Compiled(compiled, (by_columns, scratch(by_columns)))


def _count(T: Tables, S: Scratch, analysis: LoopAnalysis) -> int | None:
    return followed_count(T, S, float(analysis.omega[0]), float(analysis.omega[-1]))


def _stable_without_neighbours(
    plant: NeighbourPlant, analysis: LoopAnalysis, loops: Sequence[Controller]
) -> bool:
    """Whether each loop is proven stable beside neighbours without effect."""
    alone = MatrixPlant([[plant.process]])
    known = replace(analysis.uncertainty, weight=analysis.uncertainty.weight_of(0), outputs=None)
    return all(
        proven_count(
            alone, [loop],
            LoopAnalysis(*group_loops(alone, [loop], known), known, replace(
                analysis.performance, output_scale=None
            )),
        ) == 0
        for loop in dict.fromkeys(loops)
    )  # fmt: skip


class _CurveSearch:
    """One curve: its samples, its highest value, and why it is not proven, if it is not."""

    def __init__(
        self,
        analysis: LoopAnalysis,
        compiled: _Compiled | None,
        curve: int,
        peak: Peak,
        *,
        refined: NDArray[np.float64] = NONE,
    ) -> None:
        self.analysis = analysis
        self.compiled = compiled
        self.curve = curve
        self.peak = peak
        self.refined = refined
        self.reason: str | None = None
        self.omega: NDArray[np.float64] = np.empty(0)
        self.values: NDArray[np.float64] = np.empty(0)
        self.y: NDArray[np.float64] = np.empty((0, analysis.blocks.n_scales))

    def close(self) -> None:
        """Prove the peak, raising it on the way where it was too low."""
        far = far_phases(self.analysis.blocks.plant, self.analysis.omega[-1])
        if far.size:
            self._look(far)
            # Of phases as far out a logarithm has few digits: closer looks go by omega itself.
            for closer in CLOSER:
                at = int(np.searchsorted(self.omega, far[0]))
                best = self.omega[at + int(np.argmax(self.values[at:]))]
                self._look(phases_beside(self.analysis.blocks.plant, float(best), closer))
            # A peak there is narrow where the loop gain is near one: the samples may miss its top.
            start = int(np.searchsorted(self.omega, far[0]))
            self._refine(np.array([start + int(np.argmax(self.values[start:]))]))
        if self.compiled is None:
            most = MOST_PROVEN // 2 if self.analysis.blocks.is_wider else MOST_PROVEN
            self.reason = (
                f"more than {most} loops differ, beyond the proof; the peak is the highest of the "
                "samples; settings that several loops share count once"
            )
            self._resolve()
            if isinstance(self.analysis.blocks.plant, NeighbourPlant):
                self.reason = "of rings and rows the peak of robust performance alone is proven"
                if self.curve == ROBUST:
                    self._prove_by_boxes()
            return
        self._prove(self.compiled)
        self._polish()

    def _prove(self, compiled: _Compiled) -> None:
        T, S = compiled.loop
        high = self._end(compiled, upper=True)
        if high is None and any_phase(self.analysis.blocks.plant):
            self._resolve()  # the supremum may be out there, where few phases were looked at
            high = self._end(compiled, upper=True)
        low = self._end(compiled, upper=False)
        if low is None or high is None:
            self.reason = "no proof towards the frequency zero"
            if high is None:
                self.reason = "no proof towards the frequency infinity"
                if any_phase(self.analysis.blocks.plant):
                    self.reason += ": what dead time feeds through has any phase there"
                    far = FAR * float(self.analysis.omega[-1])
                    bound = self._any_phase_bound(min(far, LAST))
                    self.reason += f", mu is at most {bound:.6g}" if bound < math.inf else ""
            self._resolve()
            return
        steps = min(MAX_STEPS, STEPS_BY_SIZE // T.controllers**3)
        shortest, log_ratio = SHORT, FIRST_STEP
        for _ in range(MAX_LOOKS):
            level2 = ((1 + BRACKET) * self.peak.value) ** 2
            reached, log_ratio, steps = march(
                T, S, np.log(self.omega), self.y, low, high, log_ratio, shortest, steps, level2,
                self.curve, np.zeros(T.multiplicity.size), NO_TRAIL,
            )  # fmt: skip
            if reached >= high:
                return
            if steps <= 0 or (reached <= low and shortest < SHORTEST):
                break
            shortest = SHORTER * shortest if reached <= low * (1 + AHEAD * shortest) else SHORT
            low = reached
            self._look(low * np.exp(np.linspace(-1, AHEAD, LOOKS) * log_ratio))
            log_ratio = min(AHEAD * log_ratio, FIRST_STEP)
        self.reason = f"no proof near omega = {low:.6g} rad per time unit: "
        self.reason += (
            "the curve varies too quickly there" if steps > 0 else "it takes too many steps"
        )
        self._resolve()

    def ends(self, level: float) -> list[float]:
        """Return the ends of intervals on each of which a level is proven; none without proof."""
        if self.compiled is None:
            return []
        T, S = self.compiled.loop
        low = high = math.sqrt(float(self.omega[0] * self.omega[-1]))
        steps = min(MAX_STEPS, STEPS_BY_SIZE // T.controllers**3)
        for _ in range(TAIL_STEPS):
            if self._holds_beyond(self.compiled, low, self._y_at(low / 2), level, upper=False):
                break
            low /= TAIL_STEP
        for _ in range(TAIL_STEPS):
            if self._holds_beyond(self.compiled, high, self._y_at(2 * high), level, upper=True):
                break
            high *= TAIL_STEP
        trail = np.zeros(MAX_TRAIL)
        reached, _, _ = march(
            T, S, np.log(self.omega), self.y, low, high, FIRST_STEP, SHORT, steps, level**2,
            self.curve, np.zeros(T.multiplicity.size), trail,
        )  # fmt: skip
        return [low, *trail[trail > 0].tolist()] if reached >= high else []

    def _y_at(self, omega: float) -> NDArray[np.float64]:
        at = np.log(self.omega)
        return np.array([np.interp(math.log(omega), at, column) for column in self.y.T])

    def _prove_by_boxes(self) -> None:
        """Prove the peak of a ring or row: its modes are no rational numbers, as others' are."""
        analysis = self.analysis
        loops = analysis.blocks.expand(analysis.controllers)
        for _ in range(ROUNDS):
            proof = proven_box(
                analysis.blocks.plant, analysis.uncertainty, analysis.performance, loops, (),
                levels=((1 + BRACKET) * self.peak.value,),
            )  # fmt: skip
            self.reason = proof.reason
            if proof.open is None:
                return
            low, high = proof.open.omega
            self.reason = f"no proof for omega from {low:.6g} to {high:.6g}"
            if not proof.exceeded:
                return
            low, high = max(low, high / FURTHER), min(high, FURTHER * low)
            self._look(np.geomspace(low, high, LOOKS))

    def _end(self, compiled: _Compiled, *, upper: bool) -> float | None:
        """Return a frequency from which the curve is proven to the end of the axis."""
        factor = TAIL_STEP if upper else 1 / TAIL_STEP
        start = float(self.analysis.omega[-1 if upper else 0])
        ends = (start * factor ** np.arange(TAIL_STEPS)).astype(np.float64)
        ends = ends[(ends < 1e200) & (ends > 1e-200)]
        place = -1 if upper else 0
        if self._holds_beyond(compiled, start, self.y[place], self.peak.value, upper=upper):
            return self._lowered(start) if upper else start
        # Inside the interval, where one set of scales serves best; where outputs err they move
        # without bound in it, and those of before it serve.
        err = self.analysis.blocks.is_wider
        shift = BEFORE if err and self.curve == ROBUST else 2.0
        inside = ends * shift if upper else ends / shift
        for first in range(0, ends.size, 3):
            part = slice(first, first + 3)
            values, d = self.analysis.level(self.curve, inside[part])
            sound = np.isfinite(values) & np.isfinite(d).all(axis=1)
            sound &= self.analysis.resolved(inside[part])
            self.take(inside[part][sound], values[sound], d[sound])
            for end, y in zip(ends[part][sound].tolist(), 2 * np.log(d[sound]), strict=True):
                bracket = (1 + BRACKET) * self.peak.value
                if not self._holds_beyond(compiled, end, y, bracket, upper=upper):
                    continue
                limits = end * LIMITS if upper else end / LIMITS
                decades = abs(math.log10(end / start))
                between = np.geomspace(start, end, int(PER_DECADE * decades) + 2)
                self._look(np.concatenate([limits, between]))
                return self._lowered(end) if upper else float(end)
        return None

    def _lowered(self, end: float) -> float:
        """Return how far below `end` a bound of all phases holds too: it costs less than a march.

        Dead time that feeds through turns the phase many times up there, step by step.
        """
        level = (1 + BRACKET) * self.peak.value
        if any_phase(self.analysis.blocks.plant):
            while end > self.analysis.omega[0] and self._any_phase_bound(end / 2) <= level:
                end /= 2
        return end

    def _any_phase_bound(self, end: float) -> float:
        """Return a bound of the curve over all omega >= `end`, whatever the phases.

        Infinite where outputs, or inputs that loops share, err: none is known.
        """
        analysis = self.analysis
        if analysis.blocks.is_wider:
            return math.inf
        loops = analysis.blocks.expand(analysis.controllers)
        return bound_beyond(
            analysis.blocks.plant, analysis.uncertainty, analysis.performance, loops,
            curve=self.curve, end=end,
        )  # fmt: skip

    def _holds_beyond(
        self,
        compiled: _Compiled,
        end: float,
        y: NDArray[np.float64],
        level: float,
        *,
        upper: bool,
    ) -> bool:
        """Whether the curve is proven below a level from `end` to infinity, or down to 0."""
        if upper and any_phase(self.analysis.blocks.plant) and self._any_phase_bound(end) <= level:
            return True
        low, high = (end, math.inf) if upper else (0.0, end)
        T, S = compiled.loop if upper else compiled.from_zero
        if T.lifted.any():  # a squared D-scale as it is in the middle, where sigma is this one
            sigma = 0.5 * math.frexp(end)[0]
            y = y + 2 * math.log(sigma) * T.lifted[: y.size]
        reached, _, _ = march(
            T, S, np.array([0.0, 1.0]), np.tile(y, (2, 1)), low, high, 1.0, 0.0, 1,
            level**2, self.curve, np.zeros(T.multiplicity.size), NO_TRAIL,
        )  # fmt: skip
        return bool(reached >= high)

    def _resolve(self) -> None:
        """Halve the grid's intervals where the curve turns, where no proof tells where to look."""
        # One look costs as many solves as the grid had: with many loops there is time for few.
        for _ in range(RESOLVING if self.compiled is not None else 1):
            values = np.log(np.maximum(self.values, np.finfo(float).tiny))
            bend = np.abs(np.diff(values, 2))
            turning = np.flatnonzero(bend > BEND)
            where = np.unique(np.concatenate([turning, turning + 1]))
            if not where.size or self.omega.size > MAX_SAMPLES:
                return
            self._look(np.sqrt(self.omega[where] * self.omega[where + 1]))

    def _look(self, omega: NDArray[np.float64]) -> None:
        values, d = self.analysis.level(self.curve, omega)
        sound = np.isfinite(values) & np.isfinite(d).all(axis=1)
        beyond = (omega < self.analysis.omega[0]) | (omega > self.analysis.omega[-1])
        sound[beyond] &= self.analysis.resolved(omega[beyond])
        self.take(omega[sound], values[sound], d[sound])

    def take(
        self, omega: NDArray[np.float64], values: NDArray[np.float64], d: NDArray[np.float64]
    ) -> None:
        """Keep samples; where one exceeds the peak, refine it."""
        both = np.concatenate([self.omega, omega])
        _, index = np.unique(both, return_index=True)
        self.omega = both[index]
        self.values = np.concatenate([self.values, values])[index]
        self.y = np.concatenate([self.y, 2 * np.log(d)])[index]
        if values.size and values.max() > self.peak.value:
            self._refine(np.array([int(np.argmax(self.values))]))

    def _refine(self, samples: NDArray[np.intp]) -> None:
        """Zoom in on the samples with these indices; the peak rises with what is found."""
        low = np.log(self.omega[np.maximum(samples - 1, 0)])
        high = np.log(self.omega[np.minimum(samples + 1, self.omega.size - 1)])

        def curve(_: NDArray[np.intp], points: NDArray[np.float64]) -> NDArray[np.float64]:
            values = self.analysis.level(self.curve, points.ravel())[0]
            return np.where(np.isfinite(values), values, 0.0).reshape(points.shape)

        omega, values = zoom(
            curve, low, high, self.omega[samples], self.values[samples],
            sections=SECTIONS, rounds=ROUNDS,
        )  # fmt: skip
        best = int(np.argmax(values))
        if values[best] > self.peak.value:
            self.peak = Peak(float(values[best]), float(omega[best]))

    def _polish(self) -> None:
        """Refine the maxima that may be the highest: the bracket says no more than 1e-4."""
        near = self.values >= (1 - NEAR) * self.peak.value
        highest = np.flatnonzero(tops(self.values) & near)
        # Those between whose neighbours a refined one lies are known.
        low = self.omega[np.maximum(highest - 1, 0)]
        high = self.omega[np.minimum(highest + 1, self.omega.size - 1)]
        known = (self.refined >= low[:, None]) & (self.refined <= high[:, None])
        highest = highest[~known.any(axis=1)]
        if highest.size:
            self._refine(highest[np.argsort(-self.values[highest])][:MAX_POLISHED])
