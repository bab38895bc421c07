"""A plant whose outputs may err unlike, as one whose outputs may all err alike.

With permitted errors E = diag(e_i) the demand on S is that on E^-1 S E. The plant E^-1 G under the
controller C E has just that sensitivity, and moves its inputs as G does under C: N_RP is the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.deviations import change_gain
from solver.model.errors import InvalidInputError
from solver.model.mode_controller import ModeController
from solver.model.plants import MatrixPlant, Plant
from solver.model.state_space import StateSpace

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.weights import Performance

__all__ = ["OneScale", "of_one_scale"]


@dataclass(frozen=True, eq=False)
class OneScale:
    """A plant and the demand on it, all permitted errors being equal.

    Attributes
    ----------
    plant : Plant
        E^-1 G; the plant as given where its outputs may err alike.
    performance : Performance
        The demand on it.
    errors : (n,)
        e_i over their geometric mean: 1 where they are alike.

    """

    plant: Plant
    performance: Performance
    errors: NDArray[np.float64]

    def taken(
        self, controller: StateSpace | MatrixPlant | ModeController
    ) -> StateSpace | MatrixPlant | ModeController:
        """Return C E, what a controller C of the plant as given is on this one."""
        if isinstance(controller, MatrixPlant):
            return MatrixPlant(
                [
                    [change_gain(element, e) for element, e in zip(row, self.errors, strict=True)]
                    for row in controller.elements_by_row
                ]
            )
        return _of_errors(controller, self.errors)

    def given_back(self, controller: StateSpace | ModeController) -> StateSpace | ModeController:
        """Return C E^-1, what a controller C of this plant is on the one as given."""
        return _of_errors(controller, 1 / self.errors)


def of_one_scale(plant: Plant, performance: Performance, largest: int, made: str) -> OneScale:
    """Return a plant and the demand on it with outputs of one scale.

    Parameters
    ----------
    plant : Plant
        Any; where its outputs may err unlike, that returned is a matrix.
    performance : Performance
        The demand, a permitted error an output.
    largest : int
        Most outputs that may err unlike.
    made : str
        What the message begins with, as "the limit is found for".

    Raises
    ------
    InvalidInputError
        More outputs that may err unlike.

    """
    if not performance.unlike_outputs or performance.output_scale is None:
        return OneScale(plant, performance, np.ones(plant.n))
    if plant.n > largest:
        message = f"{made} unlike permitted errors of up to {largest} outputs"
        raise InvalidInputError(message, "/performance/output_scale")
    # Their ratios alone matter: the plant keeps its order of magnitude.
    errors = np.array(performance.output_scale)
    errors /= np.exp(np.log(errors).mean())
    rows = [
        [change_gain(element, 1 / e) for element in row]
        for row, e in zip(plant.rows, errors.tolist(), strict=True)
    ]
    return OneScale(MatrixPlant(rows), replace(performance, output_scale=None), errors)


def _of_errors(
    controller: StateSpace | ModeController, factors: NDArray[np.float64]
) -> StateSpace | ModeController:
    """Return the controller with each of its inputs times a factor (n,)."""
    if (factors == 1).all():
        return controller
    if isinstance(controller, ModeController):
        controller = controller.full(factors.size)
    return StateSpace(controller.A, controller.B * factors, controller.C, controller.D * factors)
