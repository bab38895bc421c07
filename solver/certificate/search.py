"""Making a certificate: intervals as wide as can be proven, each with D-scales optimal inside it.

What this module chooses needs no trust: `solver.certificate.verify` proves it again.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.certificate.enclosed_loop import ExactLoop
from solver.certificate.enclosures import Interval
from solver.certificate.proof import Gap, Turns, examine, proven_unstable_poles
from solver.certificate.record import Certificate, Claim, ProvenInterval
from solver.certificate.reduction import MAX_SETTINGS, width_of
from solver.certificate.taylor_models import PRECISION
from solver.model.blocks import group_loops
from solver.model.neighbours import NeighbourPlant
from solver.model.precision import working_precision
from solver.mu.kernel import FINE
from solver.mu.scaling import sweep

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty

__all__ = ["BEFORE", "PROVEN_ABOVE", "CertificateFailure", "Obstacle", "certify", "prove"]

PROVEN_ABOVE = 1 + 2e-4  # level of a certificate over the peak; a touch cannot be proven
MAX_ATTEMPTS = 5_000  # about ten seconds for two loops
BESIDE_A_RESULT = 40_000  # attempts times settings squared: about five seconds
NARROWEST = 1e-9  # log(ratio of the ends) below which only a touch of the level can be left
FARTHEST = 1e15  # ratio of the ends of the axis to its middle; no process spans more
BEFORE = 0.3  # of the beginning of an interval to the end of the axis: where its scales may lie
WIDER, NARROWER = 1.15, 0.7  # change of log(ratio) after an interval was proven, or not


class Obstacle(StrEnum):
    """Why there is no certificate, and what to try.

    EXCEEDED: the upper bound of mu is above the level at `omega`; ask for a higher level.
    UNSTABLE: the loops are nominally unstable; mu has no meaning for them.
    EXHAUSTED: it took more intervals than were allowed; `certify` without a limit goes on.
    UNRESOLVED: the intervals became too narrow near `omega`: (a) mu touches the level
    there: ask for a higher one, (b) a closed-loop pole lies on the imaginary axis, at s = 0 if the
    plant's static gain is singular, (c) the plant passes its input on at once and with dead time.
    PROPORTIONAL: a loop lacks integral action and no offset is permitted, so that no D-scales serve
    from omega = 0 on.
    TOO_LARGE: more than `MAX_SETTINGS` loops differ, half as many where outputs err; give some of
    them equal settings.
    """

    EXCEEDED = "exceeded"
    UNSTABLE = "unstable"
    EXHAUSTED = "more intervals than were allowed"
    UNRESOLVED = "unresolved"
    PROPORTIONAL = "a loop without integral action"
    TOO_LARGE = "too large"


@dataclass(frozen=True)
class CertificateFailure:
    """There is no certificate: why, and at which frequency (rad per time unit) if at one.

    `mu` is the upper bound at `omega`; `unstable_poles` counts the closed-loop poles with
    Re s >= 0 where the obstacle is UNSTABLE.
    """

    obstacle: Obstacle
    omega: float | None = None
    mu: float | None = None
    unstable_poles: int = 0


def certify(
    claim: Claim,
    interrupt: Callable[[], object] = lambda: None,
    attempts: int = MAX_ATTEMPTS,
    ends: Sequence[float] = (),
) -> Certificate | CertificateFailure:
    """Return a certificate of the claim, or why none was found.

    One is found, rounding apart, whenever the loops are stable, the upper bound of mu is below
    the level at all frequencies, and no part of the plant with dead time passes its input on at
    once.

    Parameters
    ----------
    claim : Claim
        What is to be proven.
    interrupt : callable
        Called every few milliseconds; whatever it raises ends the work.
    attempts : int
        Intervals that may be tried.
    ends : sequence of float
        Where to try to end the intervals, ascending, rad per time unit: as a proof in doubles found
        them (`solver.robustness.axis`). Empty: they are sought.

    Raises
    ------
    UnsupportedPlantError
        The plant is unstable in open loop.
    InvalidInputError
        The performance weight has no time constant.

    """
    if isinstance(claim.plant, NeighbourPlant):
        return CertificateFailure(Obstacle.TOO_LARGE)
    width = width_of(claim.plant, claim.loops, claim.uncertainty, claim.performance.output_scale)
    if width > MAX_SETTINGS:
        return CertificateFailure(Obstacle.TOO_LARGE)
    if _leaves_powers(claim):
        return CertificateFailure(Obstacle.PROPORTIONAL)
    with working_precision(PRECISION):
        search = _CertificateSearch(claim, interrupt, attempts)
        try:
            search.cover_all_frequencies(ends)
        except _ObstacleMetError as met:
            return met.failure
        poles = proven_unstable_poles(search.loop, search.turns)
    if poles != 0:
        # None cannot be: each interval's ball of angles is far smaller than a half turn.
        return CertificateFailure(Obstacle.UNSTABLE, unstable_poles=poles or 0)
    in_order = sorted(search.proven, key=lambda proven: proven.interval.low)
    return Certificate(claim, tuple(in_order))


class _ObstacleMetError(Exception):
    def __init__(self, obstacle: Obstacle, omega: float, mu: float) -> None:
        super().__init__(obstacle)
        self.failure = CertificateFailure(obstacle, omega, mu)


def _leaves_powers(claim: Claim) -> bool:
    """Whether the plant alone integrates what the demand wants without an offset."""
    without = any(loop.integral_time is None for loop in claim.loops)
    return without and claim.performance.offset == 0


class _CertificateSearch:
    """Keeps what has been proven."""

    def __init__(self, claim: Claim, interrupt: Callable[[], object], attempts: int) -> None:
        self.claim = claim
        self.loop = ExactLoop.of(claim)
        self.blocks, self.controllers = group_loops(
            claim.plant, claim.loops, claim.uncertainty, claim.performance.output_scale
        )
        self.interrupt = interrupt
        self.attempts = attempts
        self.proven: list[ProvenInterval] = []
        self.turns: list[Turns] = []

    def cover_all_frequencies(self, ends: Sequence[float]) -> None:
        """Prove an interval at either end, then march from one to the other."""
        middle = math.exp(-np.mean([math.log(c.integral_time or 1.0) for c in self.controllers]))
        low = high = middle
        if len(ends) > 1:
            low, high = ends[0], ends[-1]
        while not self._prove_end(Interval(0, low), low / 2, low / BEFORE):
            low /= 4
            self._require(low > middle / FARTHEST, low)
        while not self._prove_end(Interval(high, math.inf), 2 * high, BEFORE * high):
            high *= 4
            self._require(high < middle * FARTHEST, high)
        told = [low, *ends[1:-1], high]
        intervals = [Interval(*pair) for pair in itertools.pairwise(told)]
        insides = [math.sqrt(interval.low * interval.high) for interval in intervals]
        for interval, inside, best in zip(
            intervals, insides, self._optimal_scales(insides), strict=True
        ):
            if len(ends) < 2 or not self._prove(interval, inside, *best):
                self._march(interval.low, interval.high)

    def _march(self, low: float, high: float) -> None:
        """Prove what lies between two frequencies."""
        log_ratio = min(math.log(2), NARROWER * math.log(high / low)) if low < high else 0.0
        while low < high:
            self._require(log_ratio > NARROWEST, low)
            end = low * math.exp(log_ratio)
            # A rest much shorter than its neighbours would be wasted work.
            if end * math.exp(0.2 * log_ratio) >= high:
                end = high
            if self._prove_at(Interval(low, end), math.sqrt(low * end)):
                low = end
                log_ratio *= WIDER
            else:
                log_ratio = NARROWER * math.log(end / low)

    def _prove_end(self, interval: Interval, inside: float, before: float) -> bool:
        """Whether an interval to an end of the axis is proven by the scales at one of two places.

        Where outputs, or shared inputs, err the best scales may move without bound towards the
        ends: those of before the interval serve all of it, those within it do not.
        """
        if self._prove_at(interval, inside):
            return True
        return self.blocks.is_wider and self._prove_at(interval, before)

    def _prove_at(self, interval: Interval, inside: float) -> bool:
        """Whether the interval is proven by the D-scales optimal at the frequency `inside`."""
        return self._prove(interval, inside, *self._optimal_scales([inside])[0])

    def _prove(
        self, interval: Interval, inside: float, mu: float, scales: tuple[float, ...]
    ) -> bool:
        """Whether the interval is proven by D-scales, optimal at `inside`, where they give `mu`."""
        self.interrupt()
        self.attempts -= 1
        if not mu <= self.claim.gamma:
            raise _ObstacleMetError(Obstacle.EXCEEDED, inside, mu)
        if self.attempts <= 0:
            raise _ObstacleMetError(Obstacle.EXHAUSTED, inside, mu)
        found = examine(self.loop, interval, scales)
        if isinstance(found, Gap):
            return False
        self.proven.append(ProvenInterval(interval, scales))
        self.turns.append(found)
        return True

    def _require(self, hope: bool, omega: float) -> None:  # noqa: FBT001 - a guard
        if not hope:
            ((mu, _),) = self._optimal_scales([omega])
            raise _ObstacleMetError(Obstacle.UNRESOLVED, omega, mu)

    def _optimal_scales(self, omega: Sequence[float]) -> list[tuple[float, tuple[float, ...]]]:
        """Return the upper bound of mu at each frequency and its D-scales."""
        y = np.zeros((len(omega), self.blocks.n_scales))
        t, _, _ = sweep(
            self.blocks.packed(omega),
            np.stack([c.response(omega) for c in self.controllers], axis=-1),
            self.blocks.squared(self.claim.uncertainty, omega),
            self.claim.performance.magnitude(omega) ** 2,
            self.blocks.layout,
            all_free=True,
            nu=FINE,
            cold=True,
            y=y,
        )
        scales = map(tuple, np.exp(y / 2).tolist())
        return list(zip(np.exp(-t / 2).tolist(), scales, strict=True))


def prove(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    level: float,
    *,
    interrupt: Callable[[], object] = lambda: None,
    ends: Sequence[float] = (),
) -> tuple[Certificate | None, list[str]]:
    """Return the certificate that mu <= `level` and no warning, or none and the reason.

    What takes much longer than the result that it goes with is given up: `certify` goes on. `ends`
    is for it.
    """
    claim = Claim(plant, uncertainty, performance, tuple(loops), level)
    size = width_of(plant, claim.loops, uncertainty, performance.output_scale)
    most = min(MAX_ATTEMPTS, BESIDE_A_RESULT // size**2)
    outcome = certify(claim, interrupt, most, ends)
    if isinstance(outcome, Certificate):
        return outcome, []
    if outcome.obstacle is Obstacle.EXHAUSTED:
        reason = (
            f"no certificate: the document for a second program would need more than {most} "
            "intervals, longer than a result may take; what the guarantee says holds without it. "
            "mutune.certify in Python makes it, with more attempts (docs/certificate.md)"
        )
        return None, [reason]
    where = "" if outcome.omega is None else f" near omega = {outcome.omega:.4g} rad per time unit"
    return None, [f"no certificate: {outcome.obstacle.value}{where}"]
