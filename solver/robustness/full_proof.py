"""Peak of mu under a full controller over all frequencies, 0 and infinity included: proven.

Counterexample-guided search, as `solver.robustness.axis` makes it for single loops: intervals of
which mu <= m (1 + `BRACKET`) is not proven are halved, and m rises where their middles show a
higher value. Each interval has D-scales of its own. On each, det(J + G C J) is proven to turn by
less than a quarter of a full turn from its middle, so that its turns over the axis are known: they
count the closed-loop poles in the right half plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.model.frequencies import corners
from solver.model.peaks import Peak, zoom
from solver.robustness.axis import BRACKET
from solver.robustness.full_models import FullLoop, UnprovenError, Variable
from solver.robustness.matrix_models import OUTWARD, Models, sigma_max_bound
from solver.robustness.record import Guarantee, GuaranteeStatus
from solver.robustness.shared_scales import best_scales

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.robustness.centralised_curves import CentralisedAnalysis

__all__ = ["prove"]

PER_DECADE = 16  # intervals at first
MOST_INTERVALS = 50_000  # in all: a few seconds for two channels
AT_ONCE = 4096  # intervals whose models are held at once
SHORTEST = 1e-11  # log(ratio): frequencies of 16 digits have few points left in it
TAIL_FACTOR = 8.0  # by which an end of the axis is drawn out
FURTHEST = 1e25  # of the grid's ends
QUARTER = 0.45 * math.pi  # largest turn of a determinant from the middle of its interval
NEAR_REST = 0.3  # of the lowest bend: below it the plant, its integrators apart, is its static gain
WHOLE = 1e-6  # how near to a whole number of half turns their sum must be
SECTIONS, ROUNDS = 32, 4  # of a refinement, as on the axis of single loops


@dataclass(frozen=True)
class _Cells:
    """Intervals low..high (c,), rad per time unit."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def __getitem__(self, chosen: NDArray[np.bool_] | slice) -> _Cells:
        return _Cells(self.low[chosen], self.high[chosen])

    def __len__(self) -> int:
        return self.low.size

    def halved(self) -> _Cells:
        """Return both parts of each; those of an end of the axis are most unlike."""
        with np.errstate(invalid="ignore"):
            between = np.sqrt(self.low) * np.sqrt(self.high)
        between = np.where(self.low == 0, self.high / TAIL_FACTOR, between)
        between = np.where(np.isinf(self.high), self.low * TAIL_FACTOR, between)
        return _Cells(np.concatenate([self.low, between]), np.concatenate([between, self.high]))

    def too_short(self, first: float, last: float) -> NDArray[np.bool_]:
        """Whether no part of an interval can be told from the whole; ends of the grid first..last.

        The axis is not drawn out without end either.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            short = np.log(self.high / self.low) < SHORTEST
        return np.asarray(short | (self.high < first / FURTHEST) | (self.low > last * FURTHEST))


@dataclass(frozen=True)
class _Seen:
    """What the models of some intervals show, the last two block by block."""

    bound: NDArray[np.float64]  # of mu over the interval, with D-scales of its own
    turn: NDArray[np.float64]  # (c, blocks): largest turn of the determinant from the middle
    direction: NDArray[np.complex128]  # (c, blocks): the determinant's there


def prove(
    analysis: CentralisedAnalysis, peak: Peak, tick: Callable[[], None] = lambda: None
) -> tuple[Peak, Guarantee]:
    """Return the peak of robust performance, raised where it was too low, and what is proven.

    Parameters
    ----------
    analysis : CentralisedAnalysis
        Of a loop that is nominally stable by another count.
    peak : Peak
        The highest value found so far.
    tick : callable
        Called often; what it raises passes through.

    """
    try:
        return _Proof(analysis, peak, tick).run()
    except UnprovenError as reason:
        return peak, _open(peak, str(reason))


def _open(peak: Peak, reason: str) -> Guarantee:
    return Guarantee(GuaranteeStatus.OPEN, (1 + BRACKET) * peak.value, reason)


class _Proof:
    def __init__(self, analysis: CentralisedAnalysis, peak: Peak, tick: Callable[[], None]) -> None:
        self.analysis, self.peak, self.tick = analysis, peak, tick
        self.loops = [
            FullLoop(analysis.blocks, index, controller, analysis.uncertainty, analysis.performance)
            for index, controller in enumerate(analysis.controllers)
        ]
        bends = corners(analysis.blocks.plant, analysis.uncertainty)
        self.corner = 2.0 ** math.ceil(math.log2(float(bends.max())))
        self.ends = float(analysis.omega[0]), float(analysis.omega[-1])
        mixed = any(loop.deficit for loop in self.loops)
        self.rest = NEAR_REST * float(bends.min()) if mixed else 0.0

    def run(self) -> tuple[Peak, Guarantee]:
        low, high = self.ends
        count = max(2, math.ceil(PER_DECADE * math.log10(high / low)))
        between = np.geomspace(low, high, count)
        open_cells = _Cells(np.append(0.0, between), np.append(between, np.inf))
        proven: list[tuple[_Cells, _Seen]] = []
        work = 0
        while len(open_cells):
            work += len(open_cells)
            if work > MOST_INTERVALS:
                return self.peak, _open(self.peak, self._where(open_cells, "too quickly"))
            seen = self._seen(open_cells)
            over = seen.bound > (1 + BRACKET) * self.peak.value
            if over.any():
                self._look(open_cells[over])
            level = (1 + BRACKET) * self.peak.value
            done = (seen.bound <= level) & (seen.turn < QUARTER).all(axis=1)
            proven.append((open_cells[done], _chosen(seen, done)))
            left = open_cells[~done]
            lost = left.too_short(*self.ends)
            if lost.any():
                return self.peak, _open(self.peak, self._where(left[lost], "without a limit"))
            open_cells = left.halved()
        unstable = self._unstable(proven)
        if unstable:
            reason = "the poles counted by the proof are not those of another count"
            return self.peak, _open(self.peak, reason)
        return self.peak, Guarantee(GuaranteeStatus.PROVEN, (1 + BRACKET) * self.peak.value)

    @staticmethod
    def _where(cells: _Cells, how: str) -> str:
        first = cells[slice(0, 1)]
        if first.low[0] == 0:
            return "no proof towards the frequency zero"
        if math.isinf(first.high[0]):
            return "no proof towards the frequency infinity"
        omega = f"{first.low[0]:.6g} rad per time unit"
        return f"no proof near omega = {omega}: the curve varies {how} there"

    def _seen(self, cells: _Cells) -> _Seen:
        parts, order = [], []
        far, near = np.isinf(cells.high), cells.high <= self.rest
        for group, block in ((~far & ~near, _block), (near, _block_at_rest), (far, _block)):
            each = np.flatnonzero(group)
            for first in range(0, each.size, AT_ONCE):
                self.tick()
                chosen = each[first : first + AT_ONCE]
                variable = Variable.over(cells.low[chosen], cells.high[chosen], self.corner)
                parts.append(self._seen_alike(variable, block))
                order.append(chosen)
        back = np.argsort(np.concatenate(order))
        return _Seen(
            *(
                np.concatenate([getattr(part, name) for part in parts])[back]
                for name in ("bound", "turn", "direction")
            )
        )

    def _seen_alike(
        self, variable: Variable, block: Callable[[FullLoop, Variable], _Models]
    ) -> _Seen:
        count = variable.middle.size
        sound = np.ones(count, dtype=bool)
        matrices, turns, directions = [], [], []
        for loop in self.loops:
            found = block(loop, variable)
            turn, direction = _turn(found.E, found.sound)
            if loop.deficit and block is _block:
                more, phase = _surplus(loop, variable)
                turn, direction = turn + more, direction / phase
            matrices.append(found.N)
            turns.append(np.where(found.sound, turn, np.inf))
            directions.append(direction)
            sound &= found.sound & np.isfinite(found.N.P).all(axis=(0, 2, 3))
        x = np.ones((count, self.analysis.blocks.n_scales))
        if sound.any():
            # Where any phase stands for a dead time, the middle shows nothing of what it delays.
            typical = [N.P[0][sound] + N.radius[sound] for N in matrices]
            x[sound] = best_scales(self.analysis.blocks, typical)[1]
        usable = sound & np.isfinite(x).all(axis=1) & (x > 0).all(axis=1)
        d = np.sqrt(np.where(usable[:, None], x, 1.0))
        bound = np.zeros(count)
        for N, loop in zip(matrices, self.loops, strict=True):
            own = d[:, list(loop.block.scales)]
            size = loop.block.size
            left = np.concatenate([own, np.ones((count, size))], axis=1)
            scaled = N.times(left[:, :, None] / left[:, None, :])
            bound = np.maximum(bound, sigma_max_bound(scaled))
        bound = np.where(usable & np.isfinite(bound), bound, np.inf)
        return _Seen(bound, np.stack(turns, axis=1), np.stack(directions, axis=1))

    def _look(self, cells: _Cells) -> None:
        """Raise the peak where the middle of an interval shows a higher value."""
        middle = np.where(np.isinf(cells.high), 2 * cells.low, 0.5 * (cells.low + cells.high))
        values = self.analysis.robust_performance(middle)
        values = np.where(np.isfinite(values), values, 0.0)
        best = int(np.argmax(values))
        if values[best] <= self.peak.value:
            return
        low, high = float(cells.low[best]), float(cells.high[best])
        low = low or middle[best] / TAIL_FACTOR
        high = middle[best] * TAIL_FACTOR if math.isinf(high) else high

        def curve(_: NDArray[np.intp], points: NDArray[np.float64]) -> NDArray[np.float64]:
            found = self.analysis.robust_performance(points.ravel())
            return np.where(np.isfinite(found), found, 0.0).reshape(points.shape)

        omega, found = zoom(
            curve, np.log([low]), np.log([high]), middle[[best]], values[[best]],
            sections=SECTIONS, rounds=ROUNDS,
        )  # fmt: skip
        self.peak = Peak(float(found[0]), float(omega[0]))

    def _unstable(self, proven: list[tuple[_Cells, _Seen]]) -> int:
        """Closed-loop poles in the right half plane, by the turns of the determinants."""
        low = np.concatenate([cells.low for cells, _ in proven])
        direction = np.concatenate([seen.direction for _, seen in proven])[np.argsort(low)]
        total = 0
        for index, loop in enumerate(self.loops):
            z = direction[:, index]
            # Both ends of the axis have real determinants.
            turned = np.angle(z[1:] / z[:-1]).sum()
            turned += np.angle(z[0] if z[0].real > 0 else -z[0])
            turned -= np.angle(z[-1] if z[-1].real > 0 else -z[-1])
            half_turns = -turned / math.pi
            poles = round(half_turns)
            if abs(half_turns - poles) > WHOLE:
                message = "the turns of the determinant add up to no whole number"
                raise UnprovenError(message)
            total += loop.block.multiplicity * (loop.unstable + poles)
        return total


def _chosen(seen: _Seen, chosen: NDArray[np.bool_]) -> _Seen:
    return _Seen(seen.bound[chosen], seen.turn[chosen], seen.direction[chosen])


class _Models(NamedTuple):
    """N of a block, the matrix whose determinant turns, and where all is known."""

    N: Models
    E: Models
    sound: NDArray[np.bool_]


def _block(loop: FullLoop, variable: Variable) -> _Models:
    """By S = J (J + G C J)^-1."""
    G, sound = loop.plant(variable)
    C, known = loop.compensator(variable)
    J, w_I, w_P, also = loop.rises(variable)
    E = Models.constant(np.eye(loop.block.size, dtype=complex), variable.middle.size) @ J + G @ C
    S, regular = E.inverse()
    uncertain = w_I @ (C @ S)
    performing = w_P @ S
    N = _quarters([[uncertain @ G, uncertain], [performing @ G, performing]])
    return _Models(N, E, sound & known & also & regular)


def _block_at_rest(loop: FullLoop, variable: Variable) -> _Models:
    """By S = G K (F K + F C G K)^-1 F K (G K)^-1, near s = 0."""
    G, sound = loop.plant(variable)
    C, known = loop.compensator_at_rest(variable)
    rise, left, w_I, w_P, also = loop.rises_at_rest(variable)
    E = rise + C @ G
    R, regular = E.inverse()
    back, invertible = G.inverse()
    uncertain = w_I @ (R @ C)
    performing = w_P @ (G @ R @ left)
    N = _quarters([[uncertain @ G, uncertain], [performing, performing @ back]])
    return _Models(N, E, sound & known & also & regular & invertible)


def _quarters(parts: list[list[Models]]) -> Models:
    return Models(
        np.concatenate([np.concatenate([m.P for m in row], axis=-1) for row in parts], axis=-2),
        np.concatenate(
            [np.concatenate([m.radius for m in row], axis=-1) for row in parts], axis=-2
        ),
    )


def _turn(
    E: Models, sound: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """How far the determinant of E may turn from the middle, and its direction there."""
    size = E.radius.shape[-1]
    # E = E_0 (I + R): its eigenvalues turn by no more than arcsin |R| each.
    moved = Models(E.P.copy(), E.radius)
    moved.P[0] = 0
    start = np.where(sound[:, None, None], E.P[0], np.eye(size))
    inverse = np.linalg.inv(start)
    rest = np.minimum(np.abs(inverse) @ (moved.size + moved.radius) * OUTWARD, 1.0)
    share = np.where(sound, np.linalg.norm(rest, axis=(1, 2)), 1.0)
    turn = size * np.arcsin(np.minimum(share, 1.0))
    return turn, np.linalg.slogdet(start)[0]


def _surplus(
    loop: FullLoop, variable: Variable
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Turn and direction of the powers of s/(1 + s/f) that `_block_at_rest` has not."""
    middle, half = np.abs(variable.middle), np.abs(variable.half)
    # The phase of s/(1 + s/f) is pi/2 - arctan(omega/f), and arctan(f/omega).
    ratio = 1 / (variable.corner * middle) if variable.inverse else middle / variable.corner
    step = half * variable.corner if variable.inverse else half / variable.corner
    # The slope is greatest where the argument is least.
    turn = loop.deficit * step / (1 + np.maximum(ratio - step, 0) ** 2) * OUTWARD
    return turn, np.exp(1j * loop.deficit * (math.pi / 2 - np.arctan(ratio)))
