"""Loops, steps, limits and actuators of simulations as JSON."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

import solver.simulation.experiment
import solver.simulation.loops
from service.schemas.fields import WHOLE, Gain, PositiveTime, RequestModel, Time
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


class SimulatedLoop(RequestModel):
    """A closed loop: PI, PID or proportional control, with set-point weights."""

    gain: Gain = Field(description="Controller gain k, not zero.", examples=[46.3])
    integral_time: PositiveTime | None = Field(
        default=None,
        description="Integral time tau_I; null: no integral action.",
        examples=[101.0, None],
    )
    derivative_time: PositiveTime | None = Field(
        default=None,
        description="Derivative time tau_D; null: no derivative action.",
        examples=[None, 5.0],
    )
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

    def build(self) -> solver.simulation.loops.Loop:
        """Return the solver's loop."""
        return solver.simulation.loops.Loop(
            self.gain,
            self.integral_time,
            self.derivative_time,
            self.setpoint_weight,
            self.derivative_weight,
        )


class TimeStep(RequestModel):
    """A step in one signal of one unit; two of them make a pulse."""

    kind: Literal["setpoint", "load", "measurement", "input"] = Field(
        description="setpoint: the wanted output. load: added to the plant input. measurement: "
        "added to the measured output. input: added to the wanted input, as by hand.",
        examples=["setpoint"],
    )
    unit: Unit = Field(description="The unit, from 0.", examples=[0])
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
