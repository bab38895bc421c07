"""Loops, steps, limits and actuators of simulations as JSON."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field, Tag

import solver.model.controllers
import solver.simulation.experiment
import solver.simulation.loops
from service.schemas.fields import WHOLE, PositiveTime, RequestModel, Time
from service.schemas.loop_forms import CascadeLoop, IdealLoop, ParallelLoop, by_form
from solver.model.plants import MAX_UNITS
from solver.model.transfer_function import LARGEST

__all__ = ["InputLimits", "SimulatedLoop", "Size", "TimeStep", "Unit"]

Unit = Annotated[
    int, Field(ge=0, lt=MAX_UNITS, json_schema_extra={"x-unit": "1", "x-index": True}), WHOLE
]
Weight = Annotated[float, Field(ge=0, le=1, json_schema_extra={"x-unit": "1"})]
Size = Annotated[
    float, Field(ge=-LARGEST, le=LARGEST, json_schema_extra={"x-unit": "of the signal"})
]


class _Weighted(RequestModel):
    """Set-point weights, v = P (b r - y) + I/s (r - y) + D s/(1 + T_f s) (c r - y)."""

    setpoint_weight: Weight = Field(
        default=1.0,
        description="b: share of the set point that the proportional part sees; 1 is error "
        "feedback.",
        examples=[1.0, 0.0],
    )
    derivative_weight: Weight = Field(
        default=1.0,
        description="c: share of the set point that the derivative part sees.",
        examples=[1.0, 0.0],
    )

    def around(
        self, controller: solver.model.controllers.Controller
    ) -> solver.simulation.loops.Loop:
        """Return the solver's loop of a controller with these weights."""
        return solver.simulation.loops.Loop(
            controller.gain,
            controller.integral_time,
            controller.derivative_time,
            self.setpoint_weight,
            self.derivative_weight,
            controller.filter_time,
        )


class SimulatedCascadeLoop(CascadeLoop, _Weighted):
    """A closed loop in cascade form, with set-point weights."""

    integral_time: PositiveTime | None = Field(
        default=None,
        description="Integral time tau_I; null: no integral action.",
        examples=[101.0, None],
    )


class SimulatedIdealLoop(IdealLoop, _Weighted):
    """A closed loop in ideal form, with set-point weights."""


class SimulatedParallelLoop(ParallelLoop, _Weighted):
    """A closed loop in parallel form, with set-point weights."""


SimulatedLoop: TypeAlias = Annotated[
    Annotated[SimulatedCascadeLoop, Tag("cascade")]
    | Annotated[SimulatedIdealLoop, Tag("ideal")]
    | Annotated[SimulatedParallelLoop, Tag("parallel")],
    by_form(),
]


class TimeStep(RequestModel):
    """A step in one signal of one loop; two of them make a pulse."""

    kind: Literal["setpoint", "load", "measurement", "input"] = Field(
        description="setpoint: the wanted output. load: added to the plant input. measurement: "
        "added to the measured output. input: added to the wanted input, as by hand.",
        examples=["setpoint"],
    )
    unit: Unit = Field(description="The loop, from 0.", examples=[0])
    time: Time = Field(default=0.0, description="When it happens.", examples=[0.0])
    size: Size = Field(default=1.0, description="Its size, not zero.", examples=[1.0])

    def build(self) -> solver.simulation.experiment.Step:
        """Return the solver's step."""
        return solver.simulation.experiment.Step(
            solver.simulation.experiment.StepKind(self.kind), self.unit, self.time, self.size
        )


class InputLimits(RequestModel):
    """Limits of an input as deviations from where it rests, with anti-windup."""

    low: Annotated[
        float, Field(ge=-LARGEST, le=0, json_schema_extra={"x-unit": "of the signal"})
    ] = Field(description="Low limit, at most 0.", examples=[-1.0])
    high: Annotated[
        float, Field(ge=0, le=LARGEST, json_schema_extra={"x-unit": "of the signal"})
    ] = Field(description="High limit, at least 0.", examples=[2.0])
    tracking_time: PositiveTime | None = Field(
        default=None,
        description="Time constant with which the integrator follows the limited input; null: "
        "the integral time, with derivative action the geometric mean of both times.",
        examples=[None, 10.0],
    )

    def build(self) -> solver.simulation.loops.Limits:
        """Return the solver's limits."""
        return solver.simulation.loops.Limits(self.low, self.high, self.tracking_time)
