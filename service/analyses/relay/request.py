"""A relay experiment request as JSON."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field, JsonValue

import solver.relay.experiment
from service.schemas.fields import (
    WHOLE,
    AnalysisRequest,
    Gain,
    PositiveTime,
    RequestModel,
    below,
)
from service.schemas.loops_in_time import SimulatedLoop, TimeStep, Unit
from service.schemas.plants import Plant
from solver.model.plants import MAX_UNITS
from solver.model.transfer_function import LARGEST
from solver.simulation.experiment import MAX_SAMPLES

__all__ = ["EXAMPLE", "RelayExperimentRequest"]

_MAX_STEPS = 1000

_OWN: JsonValue = {"num": [100.0], "den": [1.0, 21.0, 120.0, 100.0]}

_PLANT: JsonValue = {
    "kind": "matrix",
    "elements": [[_OWN, {"num": [200.0], "den": [1.0, 23.0, 160.0, 300.0]}], [_OWN, _OWN]],
}

_RELAY: JsonValue = {"amplitude": 1.0, "hysteresis": 0.01, "sampling_period": None}

_PLACED: JsonValue = {"output": 1, "input": 1, "loop": {"gain": 6.5, "integral_time": 0.56}}

EXAMPLE: dict[str, JsonValue] = {
    "plant": _PLANT,
    "output": 0,
    "input": 0,
    "relay": _RELAY,
    "loops": [_PLACED],
    "duration": 40.0,
    "samples": 2001,
}

Level = Annotated[float, Field(ge=0, le=LARGEST, json_schema_extra={"x-unit": "of the outputs"})]

Samples = Annotated[int, Field(ge=2, le=MAX_SAMPLES, json_schema_extra={"x-unit": "1"}), WHOLE]


class RelaySettings(RequestModel):
    """A relay with hysteresis: its output is the amplitude, with the sign of -y."""

    amplitude: Gain = Field(
        default=1.0,
        description="Output d, not zero; negative for a process with negative gain.",
        examples=[1.0],
        json_schema_extra={"x-unit": "of the inputs"},
    )
    hysteresis: Level = Field(
        default=0.0,
        description="eps: it switches when the output passes +eps or -eps.",
        examples=[0.01],
    )
    sampling_period: PositiveTime | None = Field(
        default=None,
        description="It looks at the output at multiples of this time only; null: always.",
        examples=[None, 0.01],
    )

    def build(self) -> solver.relay.experiment.Relay:
        """Return the solver's relay."""
        return solver.relay.experiment.Relay(self.amplitude, self.hysteresis, self.sampling_period)


class PlacedLoop(RequestModel):
    """A controller from an output to an input."""

    output: Unit = Field(description="The output, from 0.", examples=[1])
    input: Unit = Field(description="The input, from 0.", examples=[1])
    loop: SimulatedLoop = Field(
        description="Its settings.", examples=[{"gain": 6.5, "integral_time": 0.56}]
    )

    def build(self) -> solver.relay.experiment.PlacedLoop:
        """Return the solver's loop."""
        with below("/loop"):
            return solver.relay.experiment.PlacedLoop(
                self.output, self.input, self.loop.around(self.loop.build())
            )


class RelayExperimentRequest(AnalysisRequest):
    """Ask what happens when a relay closes one loop; everything rests at zero before."""

    plant: Plant = Field(description="The process; dead time is exact.", examples=[_PLANT])
    output: Unit = Field(description="Output that the relay looks at, from 0.", examples=[0])
    input: Unit = Field(description="Input that the relay drives, from 0.", examples=[0])
    relay: RelaySettings = Field(
        default=RelaySettings(), description="The relay.", examples=[_RELAY]
    )
    loops: Annotated[tuple[PlacedLoop, ...], Field(max_length=MAX_UNITS)] = Field(
        default=(),
        description="Loops under control meanwhile; all others are open.",
        examples=[[], [_PLACED]],
    )
    steps: Annotated[tuple[TimeStep, ...], Field(max_length=_MAX_STEPS)] = Field(
        default=(), description="Disturbances meanwhile.", examples=[[]]
    )
    duration: PositiveTime = Field(description="Time simulated.", examples=[40.0])
    samples: Annotated[
        int, Field(ge=2, le=MAX_SAMPLES, json_schema_extra={"x-unit": "1"}), WHOLE
    ] = Field(default=2001, description="Equidistant samples returned.", examples=[2001])

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> solver.relay.experiment.RelayExperiment:
        """Return the solver's experiment."""
        with below("/plant"):
            plant = self.plant.build()
        with below("/relay"):
            relay = self.relay.build()
        loops = []
        for index, loop in enumerate(self.loops):
            with below(f"/loops/{index}"):
                loops.append(loop.build())
        steps = []
        for index, step in enumerate(self.steps):
            with below(f"/steps/{index}"):
                steps.append(step.build())
        return solver.relay.experiment.RelayExperiment(
            plant=plant,
            output=self.output,
            input=self.input,
            relay=relay,
            loops=tuple(loops),
            duration=self.duration,
            samples=self.samples,
            steps=tuple(steps),
        )
