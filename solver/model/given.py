"""The checks of analyses that are given a plant, a controller for each unit and the weights."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.mixed_plant import MixedPlant, shares_inputs
from solver.model.plants import Plant
from solver.model.validation import instance, instances
from solver.model.weights import Performance, Structure, Uncertainty

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["require_alike", "require_fit", "require_loops", "require_weights"]


def require_loops(plant: Plant, loops: Sequence[Controller]) -> tuple[Controller, ...]:
    """Return the loops of a plant, one a unit.

    Raises
    ------
    InvalidInputError
        No plant, something else than controllers, not one a unit.

    """
    instance(plant, Plant, "/plant")
    given = instances(loops, Controller, "/loops")
    if len(given) != plant.n:
        message = f"{len(given)} loops for a plant of {plant.n} units"
        raise InvalidInputError(message, "/loops")
    return given


def require_weights(plant: Plant, uncertainty: Uncertainty, performance: Performance) -> None:
    """Refuse what is no weight, a demand without `tau_p`, and weights that do not fit the plant.

    Raises
    ------
    InvalidInputError
        So it is.

    """
    require_fit(plant, uncertainty, performance)
    if performance.tau_p is None:
        message = "an analysis needs a time constant"
        raise InvalidInputError(message, "/performance/tau_p")


def require_fit(plant: Plant, uncertainty: Uncertainty, performance: Performance) -> None:
    """Refuse what is no weight, and lists of errors that do not fit the plant.

    Raises
    ------
    InvalidInputError
        So it is.

    """
    instance(uncertainty, Uncertainty, "/uncertainty")
    instance(performance, Performance, "/performance")
    weight = uncertainty.weight
    inputs = plant.plant.n if shares_inputs(plant) else plant.n
    if isinstance(weight, tuple) and len(weight) != inputs:
        message = f"{len(weight)} uncertainties for a plant of {inputs} inputs: one an input"
        raise InvalidInputError(message, "/uncertainty")
    if isinstance(plant, MixedPlant) and uncertainty.outputs is not None:
        message = "sensors err in outputs as they are, not in combinations of them"
        raise InvalidInputError(message, "/uncertainty/outputs")
    outputs = None if uncertainty.outputs is None else uncertainty.outputs.weight
    if isinstance(outputs, tuple) and len(outputs) != plant.n:
        message = f"{len(outputs)} uncertainties for a plant of {plant.n} outputs: one an output"
        raise InvalidInputError(message, "/uncertainty/outputs")
    where = "/performance/output_scale"
    scales = performance.output_scale
    if scales is not None and len(scales) != plant.n:
        message = f"{len(scales)} permitted errors for a plant of {plant.n} outputs"
        raise InvalidInputError(message, where)
    if performance.unlike_outputs and uncertainty.structure is Structure.FULL:
        message = (
            "unlike permitted errors need diagonal uncertainty: inputs whose errors depend on each "
            "other are compared in units of their own"
        )
        raise InvalidInputError(message, where)


def require_alike(uncertainty: Uncertainty, made: str) -> None:
    """Refuse what only loops of one channel each can have: uncertainties of their own.

    Parameters
    ----------
    uncertainty : Uncertainty
        The weights.
    made : str
        What messages begin with, as "the limit is found for".

    Raises
    ------
    InvalidInputError
        So it is.

    """
    if uncertainty.unlike_inputs:
        message = f"{made} inputs of one uncertainty: give all of them the largest"
        raise InvalidInputError(message, "/uncertainty")
    if uncertainty.outputs is not None:
        message = f"{made} errors of the inputs alone"
        raise InvalidInputError(message, "/uncertainty/outputs")
