"""What a loop in manual costs: the rest of the controller on the rest of the plant.

A unit in manual holds its input, and its output is no longer the controller's business: its row
and column leave plant and controller, as they do for single loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.limits.ending import EnoughError
from solver.model.blocks import group_loops
from solver.model.mode_controller import ModeController
from solver.model.plants import MAX_MATRIX_SIZE
from solver.model.state_space import StateSpace
from solver.model.subsystems import interchangeable, subsystem
from solver.robustness.centralised import analyse_centralised
from solver.robustness.curves import LoopAnalysis
from solver.stability.closed_loop import unstable_poles

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty

__all__ = ["OneInManual", "controller_in_manual", "loops_in_manual"]


@dataclass(frozen=True)
class OneInManual:
    """The worst unit to be put in manual.

    Attributes
    ----------
    unit : int
        Which one, from 0.
    stable : bool
        Whether the others stay stable.
    peak : float or None
        Peak of mu of the others, at the same demand; None where they are unstable.

    """

    unit: int
    stable: bool
    peak: float | None


def loops_in_manual(
    plant: Plant, uncertainty: Uncertainty, performance: Performance, loops: Sequence[Controller]
) -> OneInManual | None:
    """Return the worst unit of single loops; None for one loop."""
    if plant.n < 2:
        return None
    found = []
    for group in interchangeable(plant, loops, None, performance.output_scale):
        unit = group[0]
        units = [each for each in range(plant.n) if each != unit]
        rest, others = subsystem(plant, loops, units)
        if unstable_poles(rest, others):
            found.append(OneInManual(unit, stable=False, peak=None))
            continue
        left = performance.of_units(units)
        blocks, controllers = group_loops(rest, others, uncertainty, left.output_scale)
        analysis = LoopAnalysis(blocks, controllers, uncertainty, left)
        peaks = analysis.peaks(analysis.curves(analysis.omega))
        found.append(OneInManual(unit, stable=True, peak=peaks.robust_performance.value))
    return _worst(found)


def controller_in_manual(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    controller: StateSpace | ModeController,
    tick: Callable[[], None] = lambda: None,
) -> OneInManual | None:
    """Return the worst unit of a full controller; None for one unit, or too many of them.

    `tick` is called before each unit; where it raises `EnoughError`, the worst is not known: None.
    """
    n = plant.n
    if n < 2 or (isinstance(controller, StateSpace) and n > MAX_MATRIX_SIZE + 1):
        return None
    found = []
    units = range(1) if isinstance(controller, ModeController) else range(n)
    for unit in units:
        others = [each for each in range(n) if each != unit]
        try:
            tick()
        except EnoughError:
            return None
        result = analyse_centralised(
            plant.part(others),
            uncertainty,
            performance.of_units(others),
            _without(controller, others, n),
            proof=False,
        )
        peak = None if result.peaks is None else result.peaks.robust_performance.value
        found.append(OneInManual(unit, stable=result.nominally_stable, peak=peak))
    return _worst(found)


def _without(
    controller: StateSpace | ModeController, others: list[int], n: int
) -> StateSpace | ModeController:
    if isinstance(controller, ModeController):
        # c_d I + (c_s - c_d)/n 1 1^T, on n - 1 units.
        total = controller.total.times((n - 1) / n).beside(controller.difference.times(1 / n))
        return ModeController(total, controller.difference)
    return StateSpace(
        controller.A,
        controller.B[:, others],
        controller.C[others],
        controller.D[np.ix_(others, others)],
    )


def _worst(found: Sequence[OneInManual]) -> OneInManual:
    return max(found, key=lambda each: (not each.stable, each.peak or 0.0))
