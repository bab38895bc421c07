"""A level of mu proven on the whole axis for every plant of a box around a given one.

Boxes of frequencies and parameters together are halved until F of each is positive definite
(`solver.robustness.box_loop`) with the D-scales of its middle. With F > 0, det(I + G C) does not
vanish on the axis either, infinity included: all plants of the box are stable if one of them is.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.model.blocks import group_loops
from solver.model.deviations import Parameter, coupled
from solver.model.measured import MeasuredPlant
from solver.model.mixed_plant import MixedPlant, shares_inputs
from solver.model.plants import MatrixPlant
from solver.robustness.box_loop import Boxes, BoxLoop
from solver.robustness.curves import LoopAnalysis

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty

__all__ = ["BoxProof", "OpenBox", "keeps_stable", "proven_box"]

MOST_ROWS = 6  # of the widest block: the work grows with the cube
FIRST_STEP = 0.7  # log(ratio) of the frequencies of the first boxes
WORK = 75_000  # boxes of two rows and two parameters, some ten seconds; fewer where one costs more
AT_ONCE = 1024
MARGIN = 1e-9  # of F = I: more than the rounding of its eigenvalues
SMALLEST = 1e-7  # of a share or log(ratio): what is not proven there will not be
ANY_LEVEL = 1e3  # of mu: high enough for loops that are merely stable
FAR = 0.5  # of F from I in the middle: T was of no use


class OpenBox(NamedTuple):
    """What was not proven, all of it in one box; where mu exceeds the level, around that place.

    Attributes
    ----------
    omega : (float, float)
        Frequencies, rad per time unit; the upper one may be infinite.
    deviations : tuple of (float, float)
        Relative deviations of each parameter.

    """

    omega: tuple[float, float]
    deviations: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class BoxProof:
    """How far a level is proven.

    Attributes
    ----------
    level : float
        Of mu of robust performance.
    boxes : int
        That were looked at.
    open : OpenBox or None
        None where all is proven.
    count : int
        Boxes that were left.
    exceeded : bool
        Whether mu exceeds the level in what is left.
    reason : str or None
        Why there is no proof at all.

    """

    level: float
    boxes: int
    open: OpenBox | None
    count: int
    exceeded: bool = False
    reason: str | None = None

    @property
    def proven(self) -> bool:
        """Whether the level is proven for all plants of the box at all frequencies."""
        return self.open is None and self.reason is None


def proven_box(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    parameters: Sequence[Parameter],
    *,
    levels: Sequence[float],
    work: float = 1.0,
    known_delay: float = 0.0,
    interrupt: Callable[[], object] = lambda: None,
) -> BoxProof:
    """Prove that mu stays at or below a level for every plant within the deviations of one.

    Parameters
    ----------
    plant, uncertainty, performance, loops
        A nominally stable loop.
    parameters : sequence of Parameter
        What deviates, and how far; nothing: the level is that of the plant itself.
    levels : sequence of float
        Ascending; the next one is tried where there was not enough work for one.
    work : float
        Share of the work that may be spent.
    known_delay : float
        Part of every dead time that does not deviate.
    interrupt : callable
        Called between the steps; may raise.

    """
    top = levels[-1]
    reason = _beyond(plant, uncertainty)
    if reason is not None:
        return BoxProof(top, 0, None, 0, reason=reason)
    apart = any(parameter.unit is not None for parameter in parameters)
    if apart and not isinstance(plant, MixedPlant):
        plant = MatrixPlant(plant.rows)
    blocks, controllers = group_loops(plant, loops, uncertainty, performance.output_scale)
    rows = max(block.size for block in blocks.blocks)
    if rows > MOST_ROWS:
        return BoxProof(top, 0, None, 0, reason=f"more than {MOST_ROWS} loops differ")
    loop = BoxLoop(blocks, controllers, uncertainty, performance, tuple(parameters), known_delay)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    left = _first_boxes(analysis.omega, len(parameters))
    share = len(blocks.blocks) * (rows / 2) ** 3 * (2 + len(parameters)) / 4
    seen = 0
    above: Boxes | None = None
    for number, level in enumerate(levels, start=1):
        # Of two levels the first one gets two thirds.
        part = 1 - (len(levels) - number) / (len(levels) + 1)
        most = math.ceil(part * work * WORK / share)
        left, above, looked = _searched(loop, left, level, most - seen, interrupt)
        seen += looked
        if above is None and not left.number:
            return BoxProof(level, seen, None, 0)
        if above is not None:
            break
    around = _around(left if above is None else above, parameters)
    return BoxProof(top, seen, around, left.number, exceeded=above is not None)


def keeps_stable(
    plant: Plant, uncertainty: Uncertainty, performance: Performance, loops: Sequence[Controller]
) -> bool:
    """Whether no pole crosses the axis while the effect of the units on each other grows from 0.

    Parameters as of `proven_box`. F > 0 for any level keeps det(I + G C) from 0.
    """
    half = coupled(plant, 0.5)
    growing = [Parameter("interaction", 1.0, None)]
    return proven_box(
        half, uncertainty, performance, loops, growing, levels=(ANY_LEVEL,)
    ).proven  # fmt: skip


def _beyond(plant: Plant, uncertainty: Uncertainty) -> str | None:
    """Return why a plant is beyond this proof."""
    if isinstance(plant, MeasuredPlant):
        return "measured responses are not proven"
    if uncertainty.outputs is not None:
        return "where outputs err it is not proven"
    if shares_inputs(plant):
        return "where loops move combinations of inputs it is not proven"
    if any(e.feedthrough != 0 and e.dead_time > 0 for e in plant.elements if not e.is_zero):
        return "what dead time feeds through is not proven"
    return None


def _first_boxes(omega: NDArray[np.float64], parameters: int) -> Boxes:
    """Return boxes that cover the whole axis, each with all plants."""
    low, high = float(omega[0]), float(omega[-1])
    count = max(1, math.ceil(math.log(high / low) / FIRST_STEP))
    ends = np.geomspace(low, high, count + 1)
    ends[0], ends[-1] = low, high
    lows, highs = np.append([0.0], ends), np.append(ends, [math.inf])
    side = np.ones((lows.size, parameters))
    return Boxes(np.column_stack([lows, -side]), np.column_stack([highs, side]))


def _searched(
    loop: BoxLoop, left: Boxes, level: float, most: int, interrupt: Callable[[], object]
) -> tuple[Boxes, Boxes | None, int]:
    """Search the boxes that are left.

    Returns
    -------
    left : Boxes
        In which the level is not proven.
    above : Boxes or None
        In whose middle mu exceeds it; the search ends there.
    seen : int
        How many boxes were looked at.

    """
    seen, stuck = 0, left.part(slice(0))
    above: Boxes | None = None
    while left.number and seen < most and above is None:
        interrupt()
        take, left = left.part(slice(-AT_ONCE, None)), left.part(slice(None, -AT_ONCE))
        seen += take.number
        for tail in (False, True):
            some = take.part(take.tails == tail)
            if not some.number:
                continue
            holds, split = _judged(loop, some, level)
            lost = ~holds & (split < 0)
            if lost.any():
                closer = some.part(lost)
                below = _judged(loop, closer.middles(), level)[0]
                if not below.all():
                    above = closer.part(~below)
                wide = closer.spans() > SMALLEST
                stuck = _joined([stuck, closer.part(~wide | ~below)])
                again = closer.part(wide & below)
                left = _joined([left, _halved(again, np.zeros(again.number, dtype=np.intp))])
            left = _joined([left, _halved(some.part(~holds & ~lost), split[~holds & ~lost])])
    return _joined([left, stuck]), above, seen


def _judged(
    loop: BoxLoop, boxes: Boxes, level: float
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Whether F is positive definite in each box, else the variable to halve, -1 for none."""
    count, variables = boxes.low.shape
    holds = np.ones(count, dtype=bool)
    worth = np.zeros((count, variables))
    dead = np.zeros(count, dtype=bool)
    for coefficients, radius in loop.forms(boxes, loop.scales(boxes), level):
        sound = np.asarray(np.isfinite(coefficients).all(axis=(0, 2, 3)))
        P = np.where(sound[:, None, None], coefficients, 0.0)
        rest = np.where(sound, radius.sum(axis=2).max(axis=1), np.inf)
        linear, square = P[1 : variables + 1], P[variables + 1 :]
        dead |= ~sound | (np.abs(P[0] - np.eye(P.shape[-1])).max(axis=(1, 2)) > FAR)
        least = np.full(count, np.inf)
        for signs in itertools.product((-1.0, 1.0), repeat=variables):
            corner = P[0] + np.einsum("v,vkij->kij", np.array(signs), linear)
            least = np.minimum(least, np.linalg.eigvalsh(corner)[:, 0])
        for number, (i, j) in enumerate(
            itertools.combinations_with_replacement(range(variables), 2)
        ):
            values = np.linalg.eigvalsh(square[number])
            if i == j:  # times 0..1
                loss = np.maximum(0.0, -values[:, 0])
                worth[:, i] += np.abs(values).max(axis=1)
            else:  # times -1..1
                loss = np.abs(values).max(axis=1)
                worth[:, i] += loss / 2
                worth[:, j] += loss / 2
            least -= loss
        for i in range(variables):
            worth[:, i] += np.minimum(np.linalg.norm(linear[i], axis=(1, 2)), 1e100) ** 2
        holds &= (least - rest) > MARGIN
    worth[:, 0] = np.where(boxes.spans() > SMALLEST, worth[:, 0], 0.0)
    sides = boxes.high[:, 1:] - boxes.low[:, 1:]
    worth[:, 1:] = np.where(sides > SMALLEST, worth[:, 1:], 0.0)
    split = np.where(dead | (worth.max(axis=1) <= 0), -1, worth.argmax(axis=1))
    return holds, split


def _halved(boxes: Boxes, split: NDArray[np.intp]) -> Boxes:
    """Return both halves of each box; frequencies by their logarithms, ends by a factor."""
    low, high = boxes.low, boxes.high
    index = np.arange(len(low))
    with np.errstate(invalid="ignore"):
        middle = 0.5 * (low[index, split] + high[index, split])
    frequency = split == 0
    a, b = low[:, 0], high[:, 0]
    with np.errstate(invalid="ignore", over="ignore"):
        own = np.where(np.isinf(b), 4 * a, np.where(a == 0, b / 4, np.sqrt(a) * np.sqrt(b)))
    middle = np.where(frequency, own, middle)
    lower, upper = high.copy(), low.copy()
    lower[index, split] = middle
    upper[index, split] = middle
    return Boxes(np.concatenate([low, upper]), np.concatenate([lower, high]))


def _joined(parts: Sequence[Boxes]) -> Boxes:
    return Boxes(
        np.concatenate([part.low for part in parts]), np.concatenate([part.high for part in parts])
    )


def _around(left: Boxes, parameters: Sequence[Parameter]) -> OpenBox:
    """Return the box around those that are left."""
    low, high = left.low.min(axis=0), left.high.max(axis=0)
    return OpenBox(
        (float(low[0]), float(high[0])),
        tuple(
            (float(a) * p.width, float(b) * p.width)
            for a, b, p in zip(low[1:], high[1:], parameters, strict=True)
        ),
    )
