"""The input perturbation that is worst for robust performance, ready to simulate."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import group_loops
from solver.model.errors import InvalidInputError
from solver.model.given import require_loops, require_weights
from solver.model.mixed_plant import MixedPlant
from solver.model.transfer_function import TransferFunction
from solver.robustness.curves import LoopAnalysis
from solver.robustness.worst_case import DiagonalPerturbation, RankOnePerturbation, worst_case
from solver.simulation.actuators import CoupledActuators, OwnActuators
from solver.stability.closed_loop import is_stable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance, Uncertainty
    from solver.robustness.worst_case import Entry, WorstCase
    from solver.simulation.actuators import Actuators
    from solver.simulation.experiment import Experiment

__all__ = ["with_worst_actuators", "worst_actuators"]

_ACTIVE = 5e-3  # relative distance from the highest mu up to which a frequency counts as worst
_UNSTABLE = "the loops are unstable without perturbation: there is no worst case"


def worst_actuators(
    plant: Plant, loops: Sequence[Controller], uncertainty: Uncertainty, performance: Performance
) -> Actuators | None:
    """Return actuators 1 + w_I delta with the worst delta within the uncertainty.

    mu may come as high at several frequencies: the fastest of them is taken, whose perturbation
    shows as oscillation; those of slow ones only change the gain.

    Parameters
    ----------
    plant : Plant
        n units.
    loops : sequence of Controller
        n loops, nominally stable together.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.

    Returns
    -------
    Actuators or None
        None where the order of w_I delta is beyond what a transfer function holds.

    Raises
    ------
    InvalidInputError
        Not one loop a unit, no `tau_p`, or loops that are unstable without perturbation.

    """
    loops = require_loops(plant, loops)
    require_weights(plant, uncertainty, performance)
    if uncertainty.outputs is not None:
        message = "the worst case is simulated for errors of the inputs: leave out those of outputs"
        raise InvalidInputError(message, "/uncertainty/outputs")
    if not is_stable(plant, loops):
        raise InvalidInputError(_UNSTABLE, "/loops")
    blocks, controllers = group_loops(plant, loops, uncertainty, performance.output_scale)
    analysis = LoopAnalysis(blocks, controllers, uncertainty, performance)
    mu = analysis.robust_performance(analysis.omega)
    omega = analysis.omega[[np.flatnonzero(mu >= (1 - _ACTIVE) * mu.max())[-1]]]
    worst = worst_case(
        blocks, controllers, uncertainty, performance, omega=omega, scales=analysis.scales(omega)
    )
    return _actuators(worst, plant.n, uncertainty)


def with_worst_actuators(
    experiment: Experiment, uncertainty: Uncertainty, performance: Performance
) -> Experiment:
    """Return an experiment with the worst actuators within `uncertainty` for its loops.

    Parameters
    ----------
    experiment : Experiment
        All loops closed, with integral action.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.

    Raises
    ------
    InvalidInputError
        A loop is open or without integral action, the loops are unstable without perturbation,
        or the perturbation has too high an order to be simulated.

    """
    loops = []
    for loop in experiment.loops:
        if loop is None or loop.integral_time is None:
            message = "the worst case needs all loops closed, with integral action"
            raise InvalidInputError(message, "/kind")
        loops.append(loop.controller)
    plant = experiment.plant
    if experiment.distribution is not None:
        each, shares = np.eye(plant.n).tolist(), experiment.distribution.tolist()
        plant = MixedPlant(plant, tuple(map(tuple, each)), tuple(map(tuple, shares)), shared=True)
    if not is_stable(plant, loops):
        raise InvalidInputError(_UNSTABLE, "/kind")
    actuators = worst_actuators(plant, loops, uncertainty, performance)
    if actuators is None:
        message = "the worst perturbation has too high an order to be simulated"
        raise InvalidInputError(message, "/uncertainty")
    return replace(experiment, actuators=actuators)


def _actuators(worst: WorstCase, n: int, uncertainty: Uncertainty) -> Actuators | None:
    match worst.uncertainty:
        case DiagonalPerturbation(entries, actuators):
            of = {
                unit: actuator
                for entry, actuator in zip(entries, actuators, strict=True)
                for unit in entry.units
                if actuator is not None
            }
            return OwnActuators(tuple(of[unit] for unit in range(n))) if len(of) == n else None
        case RankOnePerturbation(left, right):
            if uncertainty.unlike_inputs:
                return None
            # Only the magnitude of the weight is given, so its dead time may be left out.
            weight = uncertainty.weight_of(0)
            without_dead_time = TransferFunction(weight.num, weight.den)
            return CoupledActuators(without_dead_time, _spread(left, n), _spread(right, n))


def _spread(entries: Sequence[Entry], n: int) -> tuple[TransferFunction, ...]:
    """Return one transfer function a unit."""
    of = {unit: entry.transfer for entry in entries for unit in entry.units}
    return tuple(of[unit] for unit in range(n))
