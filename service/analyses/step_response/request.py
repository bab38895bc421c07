"""A step response request as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, JsonValue

import solver.model.mixing
import solver.model.plants
import solver.model.weights
import solver.simulation.directions
import solver.simulation.loops
import solver.simulation.step_response
from service.schemas.arrangement import ArrangedRequest
from service.schemas.fields import (
    WHOLE,
    Coefficient,
    PositiveTime,
    RequestModel,
    Time,
    below,
)
from service.schemas.full_controllers import FullController, full_state_space
from service.schemas.loops_in_time import InputLimits, SimulatedLoop, Size, TimeStep
from service.schemas.perturbations import Perturbation, WorstCasePerturbation
from service.schemas.plants import Plant
from solver.model.errors import InvalidInputError
from solver.model.mixing import summed_outputs
from solver.model.plants import MAX_MATRIX_SIZE, MAX_UNITS
from solver.model.state_space import StateSpace
from solver.model.transfer_function import LARGEST
from solver.simulation.experiment import MAX_SAMPLES, Experiment, Step, StepKind

__all__ = ["EXAMPLE", "StepResponseRequest", "StepResponseTask"]

_MAX_STEPS = 1000

_PLANT: JsonValue = {
    "kind": "first_order",
    "n": 2,
    "gain": 1.0,
    "time_constant": 100.0,
    "interaction": 0.949,
    "dead_time": 1.0,
}

_LOOPS: JsonValue = [
    {"gain": 46.3, "integral_time": 101.0, "derivative_time": None},
    {"gain": 22.8, "integral_time": 3.15, "derivative_time": None},
]

_DIRECTION: JsonValue = {"kind": "difficult", "size": 1.0, "time": 0.0}

_STEPS: JsonValue = [{"kind": "load", "unit": 0, "time": 100.0, "size": 0.1}]

EXAMPLE: dict[str, JsonValue] = {
    "plant": _PLANT,
    "loops": _LOOPS,
    "direction": _DIRECTION,
    "steps": _STEPS,
    "duration": 200.0,
    "samples": 401,
}

Samples = Annotated[int, Field(ge=2, le=MAX_SAMPLES, json_schema_extra={"x-unit": "1"}), WHOLE]


class SetPointDirection(RequestModel):
    """Set-point steps of all units at once, in the plant's easy or difficult direction."""

    kind: Literal["easy", "difficult"] = Field(
        description="easy: the change that needs the least input at steady state; difficult: "
        "the one that needs the most.",
        examples=["difficult"],
    )
    size: Size = Field(default=1.0, description="Largest of the steps, not zero.", examples=[1.0])
    time: Time = Field(default=0.0, description="When they happen.", examples=[0.0])

    def build(self, plant: solver.model.plants.Plant) -> tuple[Step, ...]:
        """Return the solver's steps."""
        find = {
            "easy": solver.simulation.directions.easy_direction,
            "difficult": solver.simulation.directions.difficult_direction,
        }[self.kind]
        return tuple(
            Step(
                StepKind.SETPOINT,
                unit,
                self.time,
                self.size * float(share),
            )
            for unit, share in enumerate(find(plant))
            if share != 0
        )


@dataclass(frozen=True)
class StepResponseTask:
    """What to simulate; the worst perturbation, where it is wanted, is found first.

    `demand` holds the weights that define it, None where it is not wanted.
    """

    experiment: Experiment
    demand: tuple[solver.model.weights.Uncertainty, solver.model.weights.Performance] | None

    def simulate(self) -> solver.simulation.step_response.StepResponse:
        """Return the responses.

        Raises
        ------
        InvalidInputError
            As `solver.simulation.step_response.step_response`, or there is no worst perturbation.

        """
        if self.demand is None:
            return solver.simulation.step_response.step_response(self.experiment)
        # Here, since it brings the kernels, and the service that reads requests needs none.
        from solver.simulation.worst_actuators import with_worst_actuators

        with below("/perturbation"):
            perturbed = with_worst_actuators(self.experiment, *self.demand)
        return solver.simulation.step_response.step_response(perturbed)

    def within(self, halves: Sequence[float | None]) -> StepResponseTask:
        """Return the same with each input kept so far to either side; None: it is free."""
        limits = tuple(
            None if half is None else solver.simulation.loops.Limits(-half, half) for half in halves
        )
        return replace(self, experiment=replace(self.experiment, limits=limits))


Row = Annotated[tuple[Coefficient, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)]


class StepResponseRequest(ArrangedRequest):
    """Ask how a plant and its loops move after steps; everything rests at zero before."""

    plant: Plant = Field(description="The process; dead time is exact.", examples=[_PLANT])
    loops: Annotated[tuple[SimulatedLoop | None, ...], Field(max_length=MAX_UNITS)] = Field(
        default=(),
        description="Settings, one entry a loop; null: open loop. Or else a controller.",
        examples=[_LOOPS],
    )
    controller: FullController | None = Field(
        default=None,
        description="A full controller u = C e in place of loops: a state space, a transfer matrix "
        "without dead time, or, for a parallel plant, one on the sum and one on the differences of "
        "its units.",
        examples=[None],
    )
    steps: Annotated[tuple[TimeStep, ...], Field(max_length=_MAX_STEPS)] = Field(
        default=(), description="Steps of any signals.", examples=[_STEPS]
    )
    direction: SetPointDirection | None = Field(
        default=None, description="Set-point steps of all units at once.", examples=[_DIRECTION]
    )
    duration: PositiveTime = Field(description="Time simulated.", examples=[200.0])
    samples: Annotated[
        int, Field(ge=2, le=MAX_SAMPLES, json_schema_extra={"x-unit": "1"}), WHOLE
    ] = Field(default=501, description="Equidistant samples returned.", examples=[501])
    perturbation: Perturbation | None = Field(
        default=None,
        description="What the inputs do instead of what they should; null: exactly that.",
        examples=[None, {"kind": "worst_case", "uncertainty": {"epsilon": 0.2, "theta": 1.0},
                         "performance": {"tau_p": 19.0}}],
    )  # fmt: skip
    limits: (
        Annotated[tuple[InputLimits | None, ...], Field(min_length=1, max_length=MAX_UNITS)] | None
    ) = Field(
        default=None,
        description="Limits of the inputs, one entry a loop; null: none.",
        examples=[None, [{"low": -1.0, "high": 2.0}, None]],
    )
    distribution: (
        Annotated[tuple[Row, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)] | None
    ) = Field(
        default=None,
        description="Square matrix from controller outputs to plant inputs: a static decoupler, or "
        "the shares of one controller; null: each controller has its own input.",
        examples=[None, [[1.0, -0.5], [-0.5, 1.0]]],
        json_schema_extra={"x-unit": "gain"},
    )
    bound: (
        Annotated[
            float, Field(gt=0, le=LARGEST, json_schema_extra={"x-unit": "of the outputs"})
        ]
        | None
    ) = Field(
        default=None,
        description="The simulation ends where an output exceeds it; null: 1e6 times the largest "
        "step, or what the plant's gain makes of it.",
        examples=[None, 1000.0],
    )  # fmt: skip

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> StepResponseTask:
        """Return what to simulate."""
        with below("/plant"):
            given = self.plant.build()
        plant = self.arranged(given)
        self.signals(plant.n)
        loops = []
        for index, loop in enumerate(self.loops):
            with below(f"/loops/{index}"):
                loops.append(None if loop is None else loop.around(loop.build()))
        controller = self._full(plant.n)
        if controller is not None:
            loops = [None] * plant.n
        steps = []
        for index, step in enumerate(self.steps):
            with below(f"/steps/{index}"):
                steps.append(step.build())
        limits = []
        for index, limit in enumerate(self.limits or ()):
            with below(f"/limits/{index}"):
                limits.append(None if limit is None else limit.build())
        if self.direction is not None:
            with below("/direction"):
                if len(loops) == plant.n and None in loops and controller is None:
                    message = "a direction of set points needs every loop closed"
                    raise InvalidInputError(message, "")
                steps.extend(self.direction.build(plant))
        actuators, demand = None, None
        with below("/perturbation"):
            if isinstance(self.perturbation, WorstCasePerturbation):
                uncertainty, performance = self.perturbation.build(plant.n)
                demand = uncertainty.paired(self.pairing), performance
            elif self.perturbation is not None:
                actuators = self.perturbation.build()
        if actuators is not None and len(actuators) != plant.n:
            message = f"{len(actuators)} actuators for a plant of {plant.n} units"
            raise InvalidInputError(message, "/perturbation")
        experiment = Experiment(
            plant=plant,
            loops=tuple(loops),
            steps=tuple(steps),
            duration=self.duration,
            samples=self.samples,
            actuators=actuators,
            limits=tuple(limits) if self.limits is not None else None,
            distribution=self._matrix(),
            bound=self.bound,
            controller=controller,
        )
        return StepResponseTask(experiment, demand)

    def combined(
        self, plant: solver.model.plants.Plant, mixing: solver.model.mixing.Mixing
    ) -> solver.model.plants.Plant:
        """Return the plant from its inputs to what the loops control."""
        return summed_outputs(plant, mixing)

    def _full(self, n: int) -> StateSpace | None:
        if self.controller is None:
            return None
        if self.loops:
            message = "give loops or a full controller, not both"
            raise InvalidInputError(message, "/loops")
        with below("/controller"):
            return full_state_space(self.controller.build(), n)

    def _matrix(self) -> np.ndarray[Any, np.dtype[np.float64]] | None:
        mixed = None if self.mixing is None else self.mixing.inputs
        if mixed is not None:
            if self.distribution is not None or self.controller is not None:
                message = "one of mixing.inputs, distribution and controller is enough"
                raise InvalidInputError(message, "/mixing/inputs")
            return np.array(mixed)
        if self.distribution is None:
            return None
        for index, row in enumerate(self.distribution):
            if len(row) != len(self.distribution):
                message = (
                    f"row {index + 1} has {len(row)} entries, {len(self.distribution)} are needed"
                )
                raise InvalidInputError(message, f"/distribution/{index}")
        return np.array(self.distribution)
