"""The outcome of a relay experiment as JSON."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

from service.schemas.complex import Complex
from service.schemas.controllers import Loop
from service.schemas.fields import (
    IdentifiedResult,
)

__all__ = [
    "Harmonic",
    "LimitCycle",
    "McAvoy",
    "PeriodicSolution",
    "Regime",
    "RelayExperimentResult",
    "RelayTheory",
    "RuleSettings",
    "Series",
    "UltimatePoint",
]

Series = list[float | None]


class Regime(BaseModel):
    """A stretch of similar periods."""

    start: float = Field(
        description="Its first switching.", examples=[0.33], json_schema_extra={"x-unit": "time"}
    )
    end: float = Field(
        description="Its last switching.", examples=[10.99], json_schema_extra={"x-unit": "time"}
    )
    period: float = Field(
        description="Its last period.", examples=[0.61], json_schema_extra={"x-unit": "time"}
    )
    switchings: int = Field(description="Switchings in a period.", examples=[2])


class UltimatePoint(BaseModel):
    """Ultimate gain and frequency."""

    gain: float | None = Field(description="K_u.", examples=[18.0])
    omega: float | None = Field(
        description="omega_u, rad per time unit; the ultimate period is 2 pi/omega_u.",
        examples=[9.44],
        json_schema_extra={"x-unit": "rad/time"},
    )


class Harmonic(BaseModel):
    """First harmonic of an output over that of the relay."""

    gain: float | None = Field(description="Magnitude.", examples=[0.0558])
    phase: float | None = Field(
        description="Phase, rad, in -2 pi..0.",
        examples=[-2.98],
        json_schema_extra={"x-unit": "rad"},
    )


class RuleSettings(BaseModel):
    """PI settings by rule."""

    ziegler_nichols: Loop = Field(
        description="K_c = 0.4 K_u, T_i = 0.8 T_u: fast, poorly damped.",
        examples=[{"gain": 7.2, "integral_time": 0.53, "derivative_time": None}],
    )
    tyreus_luyben: Loop = Field(
        description="K_c = K_u/3.2, T_i = 2.2 T_u: for loops that must leave others alone.",
        examples=[{"gain": 5.6, "integral_time": 1.47, "derivative_time": None}],
    )


class LimitCycle(BaseModel):
    """The limit cycle at the end."""

    period: float = Field(
        description="Its period.", examples=[0.666], json_schema_extra={"x-unit": "time"}
    )
    switchings: int = Field(
        description="Switchings in a period; with more than two there is no ultimate point.",
        examples=[2],
    )
    amplitudes: Series = Field(
        description="Half the range of each output.", examples=[[0.0707, 0.0707]]
    )
    phase: float = Field(
        description="Of the process that the relay sees, at the cycle's frequency, its static sign "
        "turned to plus; -pi at the ultimate point.",
        examples=[-2.98],
        json_schema_extra={"x-unit": "rad"},
    )
    ultimate: UltimatePoint | None = Field(
        description="By the describing function: K_u = 4 d/(pi a); by the first harmonic where the "
        "output is no sine wave or the half periods are unequal. Null where the cycle is not at "
        "the ultimate point, by its phase (more than 20 degrees off) or its switchings.",
        examples=[{"gain": 18.0, "omega": 9.44}],
    )
    remark: str | None = Field(
        description="What keeps the cycle from the ultimate point; null: nothing does.",
        examples=["The phase at this frequency is -2.98 rad, not quite -pi: ..."],
    )
    cross_gains: Series = Field(
        description="4 d/(pi a) for every output; null where it rests.", examples=[[18.0, 18.0]]
    )
    harmonics: list[Harmonic] = Field(
        description="Frequency response from the relay to each output, measured.",
        examples=[[{"gain": 0.0558, "phase": -2.98}]],
    )
    settings: RuleSettings | None = Field(
        description="PI settings; null without an ultimate point.",
        examples=[None],
    )


class PeriodicSolution(BaseModel):
    """A solution of f(h) = eps/d: a candidate for a symmetric oscillation."""

    half_period: float = Field(
        description="h.", examples=[0.333], json_schema_extra={"x-unit": "time"}
    )
    slope: float | None = Field(
        description="Slope of the output at the switching, must be positive; null for a sampled "
        "relay.",
        examples=[0.699],
    )
    lowest: float | None = Field(
        description="Least y + eps within the half period; negative: it switches earlier.",
        examples=[0.0006],
    )
    eigenvalues: list[Complex] | None = Field(
        description="Of the Jacobian W, largest first; null with dead time.",
        examples=[[{"re": 0.717, "im": 0.0}]],
    )
    exists: bool = Field(description="Whether the relay switches as supposed.", examples=[True])
    stable: bool | None = Field(
        description="Whether it exists and is locally stable; null: not known with dead time.",
        examples=[True],
    )
    waveform_time: list[float] = Field(
        default=[], description="Times over the half period, from a switching on.", examples=[[0.0]]
    )
    waveform: list[float] = Field(
        default=[], description="The output at these times.", examples=[[0.01]]
    )


class McAvoy(BaseModel):
    """Ultimate point of the loop among equal ones, by the dynamic relative gain."""

    factor: Complex = Field(
        description="K_uI/K_u at the unchanged frequency.", examples=[{"re": 0.418, "im": -0.0215}]
    )
    rough: UltimatePoint = Field(
        description="At the unchanged frequency.", examples=[{"gain": 10.1, "omega": 10.95}]
    )
    exact: UltimatePoint | None = Field(
        description="Without that approximation; null: equal loops never oscillate.",
        examples=[{"gain": 7.43, "omega": 1.78}],
    )
    rough_settings: RuleSettings | None = Field(
        default=None, description="PI settings by rule from `rough`.", examples=[None]
    )
    exact_settings: RuleSettings | None = Field(
        default=None, description="PI settings by rule from `exact`.", examples=[None]
    )


class RelayTheory(BaseModel):
    """What is known of the experiment without simulation."""

    solutions: list[PeriodicSolution] = Field(
        description="Symmetric periodic solutions, also those that do not exist.", examples=[[]]
    )
    described: UltimatePoint | None = Field(
        description="Oscillation that the describing function predicts.",
        examples=[{"gain": 18.5, "omega": 9.59}],
    )
    ultimate: UltimatePoint | None = Field(
        description="Ultimate point of the process that the relay sees.",
        examples=[{"gain": 24.2, "omega": 10.95}],
    )
    mcavoy: McAvoy | None = Field(
        description="The loop among equal ones; null: pairing incomplete, or no such point.",
        examples=[None],
    )
    omega: list[float] = Field(
        default=[],
        description="Frequencies of the Nyquist curve, rad per time unit.",
        examples=[[1.0]],
    )
    response: list[Complex] = Field(
        default=[],
        description="Nyquist curve of the process that the relay sees.",
        examples=[[{"re": -0.05, "im": -0.01}]],
    )
    describing_level: float | None = Field(
        default=None,
        description="Imaginary part of -1/N(a), -pi eps/(4 d): where the curve crosses that line "
        "the describing function predicts the oscillation.",
        examples=[-0.00785],
    )


class RelayExperimentResult(IdentifiedResult):
    """Outcome of a relay experiment."""

    behaviour: Literal[
        "limit_cycle",
        "constant",
        "stopped",
        "no_switching",
        "irregular",
        "diverged",
        "step_limit",
    ] = Field(
        description="How it ended. limit_cycle: the last three periods agree. constant: the relay "
        "stopped and the outputs rest. stopped: it stopped, the outputs still move. no_switching: "
        "it never switched; take less hysteresis, more amplitude, or the other sign. irregular: "
        "no period is seen; simulate longer. diverged: the loops under control are unstable. "
        "step_limit: give the relay more hysteresis, or simulate less long.",
        examples=["limit_cycle"],
    )
    time: list[float] = Field(description="Times.", examples=[[0.0, 0.1]])
    units: list[list[int]] = Field(
        description="The units (from 0) that each row of outputs and inputs stands for.",
        examples=[[[0], [1]]],
    )
    outputs: list[Series] = Field(description="Outputs.", examples=[[[0.0, 0.01], [0.0, 0.01]]])
    inputs: list[Series] = Field(description="Inputs.", examples=[[[1.0, 1.0], [0.0, 0.0]]])
    switchings: list[float] = Field(
        description="Switching times; the relay falls at the first.", examples=[[0.1, 0.34]]
    )
    regimes: list[Regime] = Field(
        description="Stretches of similar periods; more than one is a change of behaviour.",
        examples=[[]],
    )
    cycle: LimitCycle | None = Field(description="The limit cycle.", examples=[None])
    final_outputs: Series = Field(description="Outputs at the end.", examples=[[0.0, -0.5]])
    theory: RelayTheory = Field(
        description="Periodic solutions, describing function, ultimate points.",
        examples=[{"solutions": [], "described": None, "ultimate": None, "mcavoy": None}],
    )
