"""Given loop settings of a plant, and the weights that they are judged by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, JsonValue

import solver.model.plants
import solver.model.weights
from service.schemas.arrangement import ArrangedRequest
from service.schemas.fields import RecordedRequest, below
from service.schemas.loop_forms import GivenLoop, given_loops
from service.schemas.plants import Plant
from service.schemas.weights import Performance, Uncertainty
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MAX_UNITS
from solver.model.weights import Structure

__all__ = ["EXAMPLE", "GivenLoops", "LoopsTask", "default_scales"]

EXAMPLE: dict[str, JsonValue] = {
    "plant": {
        "kind": "first_order",
        "n": 2,
        "gain": 1.0,
        "time_constant": 100.0,
        "interaction": 0.949,
    },
    "uncertainty": {"epsilon": 0.2, "theta": 1.0},
    "performance": {"max_peak": 2.0, "offset": 0.0, "tau_p": 19.0},
    "loops": [
        {"gain": 46.3, "integral_time": 101.0, "derivative_time": None},
        {"gain": 22.8, "integral_time": 3.15, "derivative_time": None},
    ],
}


@dataclass(frozen=True)
class LoopsTask:
    """Arguments that all analyses of given loops share."""

    plant: solver.model.plants.Plant
    uncertainty: solver.model.weights.Uncertainty
    performance: solver.model.weights.Performance
    loops: tuple[Controller, ...]


def default_scales(
    request: RecordedRequest, n: int, uncertainty: solver.model.weights.Uncertainty
) -> tuple[float, ...] | None:
    """Return the spans of n outputs as their permitted errors, where that has a meaning.

    Inputs whose errors depend on each other are compared in their own units, which outputs do not
    tell.
    """
    spans = request.output_spans(n)
    return None if uncertainty.structure is Structure.FULL else spans


class GivenLoops(ArrangedRequest):
    """Given loop settings and the weights that they are judged by."""

    plant: Plant = Field(description="The process.", examples=[EXAMPLE["plant"]])
    uncertainty: Uncertainty = Field(
        description="Uncertainty of the plant's inputs.", examples=[EXAMPLE["uncertainty"]]
    )
    performance: Performance = Field(
        description="The demand; tau_p is needed.", examples=[EXAMPLE["performance"]]
    )
    loops: Annotated[tuple[GivenLoop, ...], Field(min_length=1, max_length=MAX_UNITS)] = Field(
        description="Settings, one entry a loop.", examples=[EXAMPLE["loops"]]
    )

    def weights(
        self,
    ) -> tuple[
        solver.model.plants.Plant,
        solver.model.weights.Uncertainty,
        solver.model.weights.Performance,
    ]:
        """Return the solver's plant and weights.

        Raises
        ------
        InvalidInputError
            As `parts`.

        """
        with below("/plant"):
            given = self.plant.build()
        plant = self.arranged(given)
        with below("/uncertainty"):
            uncertainty = self.uncertainty.build(plant.n).paired(self.order)
        # Spans are those of the outputs, which are not what the loops control under a mixing.
        scales = default_scales(self, plant.n, uncertainty) if self.mixing is None else None
        with below("/performance"):
            performance = self.performance.build(scales)
        if performance.tau_p is None:
            message = "an analysis needs a time constant"
            raise InvalidInputError(message, "/performance/tau_p")
        return plant, uncertainty, performance

    def parts(self) -> LoopsTask:
        """Return the solver's plant, weights and loops.

        Raises
        ------
        InvalidInputError
            A value that the mathematics cannot accept, by pointer into this request.

        """
        plant, uncertainty, performance = self.weights()
        loops = given_loops(self.loops, "/loops")
        if len(loops) != plant.n:
            message = f"{len(loops)} loops for a plant of {plant.n} units"
            raise InvalidInputError(message, "/loops")
        return LoopsTask(plant, uncertainty, performance, loops)
