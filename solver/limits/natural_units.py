"""A plant in its natural units: time by the bandwidth that it can have, inputs by their effect.

With s = s'/t and inputs u = U u' the plant is G(s'/t) U and the controller U^-1 C(s'/t). N_RP is
the same but for U, which commutes with independent errors of the inputs and goes with the D-scales.
A search in these units takes the same steps whatever the units of the plant as given.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.limits.search import bandwidth_of
from solver.model.frequencies import corners
from solver.model.plants import MatrixPlant, Plant
from solver.model.state_space import StateSpace
from solver.model.transfer_function import SMALLEST, TransferFunction
from solver.model.weights import Structure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.weights import Performance, Uncertainty

__all__ = ["NaturalUnits", "in_natural_units"]


@dataclass(frozen=True, eq=False)
class NaturalUnits:
    """A plant and its weights in natural units.

    Attributes
    ----------
    plant : Plant
        G(s'/t) U.
    uncertainty, performance : Uncertainty, Performance
        The weights as functions of s'.
    time : float
        t, time units of the plant as given.
    inputs : (n,)
        Diagonal of U.

    """

    plant: Plant
    uncertainty: Uncertainty
    performance: Performance
    time: float
    inputs: NDArray[np.float64]

    def given_back(self, controller: StateSpace) -> StateSpace:
        """Return what a controller of a block of this plant is on the one as given."""
        # Blocks of one channel are of units alike. Half of t goes with either matrix, so that
        # neither is far from 1.
        U = self.inputs[: len(controller.D), None]
        root = np.sqrt(self.time)
        return StateSpace(
            controller.A / self.time,
            controller.B / root,
            U * controller.C / root,
            U * controller.D,
        )


def in_natural_units(
    plant: Plant, uncertainty: Uncertainty, performance: Performance
) -> NaturalUnits:
    """Return the plant with its weights in natural units.

    Parameters
    ----------
    plant : Plant
        Outputs of one scale.
    uncertainty, performance : Uncertainty, Performance
        The weights.

    """
    bandwidth = bandwidth_of(plant, uncertainty, corners(plant, uncertainty))
    time = 1 / bandwidth
    # A full block of errors, and units that are alike, leave one unit for all inputs.
    if isinstance(plant, MatrixPlant):
        effects = np.linalg.norm(plant.response([bandwidth])[0], axis=0)
        if uncertainty.structure is Structure.FULL:
            effects = np.full(plant.n, effects.max())
        gains = (1 / effects).tolist()
        rows = [
            [_in_units(each, time, gain) for each, gain in zip(row, gains, strict=True)]
            for row in plant.rows
        ]
        scaled: Plant = MatrixPlant(rows)
    else:
        effect = max(abs(element.response([bandwidth])[0]) for element in plant.elements)
        effects = np.full(plant.n, effect)
        scaled = plant.mapped(lambda element: _in_units(element, time, 1 / effect))
    weight = uncertainty.weight
    weights = tuple(_in_units(each, time, 1.0) for each in uncertainty.weights)
    tau_p = performance.tau_p
    return NaturalUnits(
        scaled,
        replace(uncertainty, weight=weights if isinstance(weight, tuple) else weights[0]),
        performance if tau_p is None else performance.with_tau_p(tau_p / time),
        time,
        1 / effects,
    )


def _in_units(element: TransferFunction, time: float, gain: float) -> TransferFunction:
    """Return gain g(s'/t) as a function of s'."""
    if element.is_zero:
        return element
    num, den = (
        np.array(part) * time ** -np.arange(len(part) - 1.0, -1, -1)
        for part in (element.num, element.den)
    )
    size = np.abs(den).max()
    num, den = (
        np.where(np.abs(part) < SMALLEST, 0, part) for part in (gain * num / size, den / size)
    )
    return TransferFunction(num.tolist(), den.tolist(), element.dead_time / time)
