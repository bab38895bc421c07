"""What is proven of a spread: the level of mu for every plant of the box, not for those tried."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from solver.robustness.axis import BRACKET
from solver.robustness.box_proof import BoxProof, proven_box
from solver.tuning.clock import OutOfTimeError
from solver.tuning.spread import SpreadOutcome, SpreadProof

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from solver.model.deviations import Parameter
    from solver.tuning.search import GroupingSearch
    from solver.tuning.settle import Settled

__all__ = ["proven_spread"]

COARSER = 1e-2  # above the highest peak: what is tried where the finer level takes too long
PERCENT = 100


def proven_spread(
    search: GroupingSearch, end: Settled, interrupt: Callable[[], object]
) -> SpreadOutcome | None:
    """Return what the settings make of the spread, with its proof; None where nothing spreads."""
    spread, outcome = search.specification.spread, end.spread
    if spread is None or outcome is None:
        return outcome
    number = len(search.specification.scenarios) + 1
    top = max(axis.peaks.robust_performance.value for axis in end.axes)
    levels = (top * (1 + BRACKET), top * (1 + COARSER))
    middles = [
        (case, axes)
        for case in search.cases
        if number not in case.scenarios and (axes := spread.axes(case.plant))
    ]
    boxes, level = 0, levels[0]
    for case, axes in middles:
        performance = replace(case.performance, tau_p=end.performance.tau_p)
        try:
            proof = proven_box(
                case.plant, case.uncertainty, performance, case.loops(end.loops), axes,
                levels=levels, work=1 / len(middles), known_delay=spread.known_delay,
                interrupt=interrupt,
            )  # fmt: skip
        except OutOfTimeError:
            reason = "the search was stopped or its time limit came first"
            proof = BoxProof(levels[-1], 0, None, 0, reason=reason)
        boxes, level = boxes + proof.boxes, max(level, proof.level)
        if not proof.proven:
            return replace(outcome, proof=_open(proof, boxes, axes))
    return replace(outcome, proof=SpreadProof(level, boxes, 0, None, (), None))


def _open(proof: BoxProof, boxes: int, axes: Sequence[Parameter]) -> SpreadProof:
    """Return what is left of a box."""
    if proof.open is None:
        return SpreadProof(proof.level, boxes, 0, None, (), proof.reason)
    low, high = proof.open.omega
    deviations = tuple(
        (axis.title, ends) for axis, ends in zip(axes, proof.open.deviations, strict=True)
    )
    where = f"omega from {low:.4g} to {high:.4g}" + "".join(
        f", {name} from {PERCENT * a:+.3g} to {PERCENT * b:+.3g} %" for name, (a, b) in deviations
    )
    reason = f"{proof.count} of {boxes} boxes were left, within {where}"
    if proof.exceeded:
        reason = f"mu exceeds {proof.level:.6g} within {where}"
    return SpreadProof(
        proof.level, boxes, proof.count, (low, None if high == float("inf") else high),
        deviations, reason,
    )  # fmt: skip
