"""Analyse units with integral action on one load.

Return the integrator modes that are free, what mends them, and both in simulation.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, JsonValue

from service.analyses.parallel_drives.drawn import DrawnParallelDrives
from service.analysis import Analysis, Figures
from service.printing import Grid, Line, Part
from service.schemas.complex import Complex
from service.schemas.encoding import encode
from service.schemas.fields import (
    WHOLE,
    AnalysisRequest,
    IdentifiedResult,
    PositiveTime,
    RequestModel,
    below,
)
from service.schemas.plants import TransferFunction
from service.wording import number
from solver.interaction.drive_simulation import (
    MAX_POINTS,
    DriveExperiment,
    DriveScenario,
)
from solver.interaction.parallel_drives import (
    MAX_DRIVES,
    Drive,
    ParallelDrives,
)
from solver.model.transfer_function import LARGEST

__all__ = ["ANALYSIS", "ParallelDrivesRequest", "ParallelDrivesResult"]

_LOAD: JsonValue = {"num": [1.0], "den": [1.0, 0.1], "dead_time": 0.0}
_DRIVE: JsonValue = {"proportional_gain": 1.0, "integral_gain": 0.5}
_SCENARIO: JsonValue = {"pulse": 3.0, "end": 60.0}
EXAMPLE: dict[str, JsonValue] = {
    "load": _LOAD,
    "drives": [_DRIVE, _DRIVE],
    "shares": [0.5, 0.5],
    "scenario": _SCENARIO,
}

DriveGain = Annotated[float, Field(ge=0, le=LARGEST, json_schema_extra={"x-unit": "gain"})]
Bias = Annotated[float, Field(ge=-LARGEST, le=LARGEST, json_schema_extra={"x-unit": "signal"})]
Share = Annotated[float, Field(ge=0, le=1, json_schema_extra={"x-unit": "1"})]
Height = Annotated[float, Field(ge=-1e6, le=1e6, json_schema_extra={"x-unit": "signal"})]
UnitIndex = Annotated[int, Field(ge=0, lt=MAX_DRIVES, json_schema_extra={"x-unit": "1"}), WHOLE]
Numbers = list[float | None]


class DriveSettings(RequestModel):
    """PI controller of a unit, effort = proportional_gain e + integral_gain times integral of e."""

    proportional_gain: DriveGain = Field(description="K, not negative.", examples=[1.0])
    integral_gain: DriveGain = Field(
        default=0.0, description="K_I, not negative; 0: no integral action.", examples=[0.5]
    )

    bias: Bias = Field(
        default=0.0,
        description="M_i0: effort where output and set point agree, from 0 on.",
        examples=[0.0],
    )

    def build(self) -> Drive:
        """Return the solver's unit."""
        return Drive(self.proportional_gain, self.integral_gain, self.bias)


class Scenario(RequestModel):
    """A step of the set point at 0, a load step, a pulse in one unit's measurement."""

    set_point: Height = Field(default=1.0, description="Height of its step.", examples=[1.0])
    load: Height = Field(default=1.0, description="Height of its step.", examples=[1.0])
    load_time: PositiveTime = Field(default=10.0, description="When it comes.", examples=[10.0])
    pulse: Height = Field(default=1.0, description="Height of the pulse.", examples=[3.0])
    pulse_unit: UnitIndex | None = Field(
        default=None,
        description="Unit whose measurement errs, from 0; null: the second one, or the only.",
        examples=[1],
    )
    pulse_time: PositiveTime = Field(
        default=20.0, description="When it begins, after the load.", examples=[20.0]
    )
    pulse_duration: PositiveTime = Field(
        default=1.0, description="How long it lasts.", examples=[1.0]
    )
    end: PositiveTime = Field(
        default=40.0, description="End of the simulation, after the pulse.", examples=[60.0]
    )
    points: Annotated[int, Field(ge=10, le=MAX_POINTS), WHOLE] = Field(
        default=401,
        description="Points of the response.",
        examples=[401],
        json_schema_extra={"x-unit": "1"},
    )

    def build(self) -> DriveScenario:
        """Return the solver's scenario."""
        return DriveScenario(
            set_point=self.set_point,
            load=self.load,
            load_time=self.load_time,
            pulse=self.pulse,
            pulse_unit=self.pulse_unit,
            pulse_time=self.pulse_time,
            pulse_duration=self.pulse_duration,
            end=self.end,
            points=self.points,
        )


class ParallelDrivesRequest(AnalysisRequest):
    """Ask what integral action does in units that act on one load."""

    load: TransferFunction = Field(
        description="From the sum of the efforts to the common output; strictly proper, no dead "
        "time.",
        examples=[_LOAD],
    )
    drives: Annotated[tuple[DriveSettings, ...], Field(min_length=1, max_length=MAX_DRIVES)] = (
        Field(description="The units' controllers.", examples=[[_DRIVE, _DRIVE]])
    )
    shares: Annotated[tuple[Share, ...], Field(min_length=1, max_length=MAX_DRIVES)] | None = Field(
        default=None,
        description="Wanted share of each unit in the steady load, summing to 1; null: as the "
        "proportional gains.",
        examples=[None, [0.5, 0.5]],
    )
    scenario: Scenario = Field(
        default=Scenario(), description="What is simulated.", examples=[_SCENARIO]
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> DriveExperiment:
        """Return what to analyse and simulate."""
        with below("/load"):
            load = self.load.build()
        drives = []
        for index, drive in enumerate(self.drives):
            with below(f"/drives/{index}"):
                drives.append(drive.build())
        with below("/scenario"):
            scenario = self.scenario.build()
        return DriveExperiment(ParallelDrives(load, drives, self.shares), scenario)


_REMEDY: JsonValue = {
    "shares": [0.5, 0.5],
    "weights": [0.5, 0.5],
    "proportional_gains": [1.0, 1.0],
    "integral_gain": 1.0,
    "poles": [{"re": -1.31, "im": 0.0}, {"re": -0.76, "im": 0.0}],
    "hidden_modes": 0,
    "text": "Use one integrator with the gain 1 and share its output out (0.5, 0.5) ...",
}
_ANALYSIS: JsonValue = {
    "integrating": [0, 1],
    "uncontrollable_modes": 1,
    "unobservable_modes": 1,
    "effort_drifts": [[0.707, -0.707]],
    "poles": [{"re": 0.0, "im": 0.0}, {"re": -1.31, "im": 0.0}, {"re": -0.76, "im": 0.0}],
    "stable": True,
    "text": "Units 1 and 2 integrate the same error ...",
    "remedy": _REMEDY,
}
_RESPONSE: JsonValue = {
    "time": [0.0, 0.1],
    "set_point": [1.0, 1.0],
    "load": [0.0, 0.0],
    "measurement_error": [0.0, 0.0],
    "output": [0.0, 0.18],
    "efforts": [[1.0, 1.0], [0.87, 0.87]],
    "bounded": True,
    "shares_before_pulse": [0.5, 0.5],
    "shares_at_end": [1.18, -0.18],
}


class Remedy(BaseModel):
    """One integrator whose output is shared out; proportional parts stay with the units."""

    shares: list[float] = Field(
        description="Share of each unit in the integrator's output.", examples=[[0.5, 0.5]]
    )
    weights: list[float] = Field(
        description="Weight of each unit's error at the integrator's input.",
        examples=[[0.5, 0.5]],
    )
    proportional_gains: list[float] = Field(
        description="Proportional gains, as they were.", examples=[[1.0, 1.0]]
    )
    integral_gain: float = Field(description="Gain of the one integrator.", examples=[1.0])
    poles: list[Complex] = Field(
        description="Closed-loop poles.", examples=[[{"re": -1.3, "im": 0.0}]]
    )
    hidden_modes: int = Field(description="Free modes left: none.", examples=[0])
    text: str = Field(description="The remedy in words.", examples=["Use one integrator ..."])


class RemainingDrive(BaseModel):
    """A controller of the other remedy."""

    proportional_gain: float = Field(description="K.", examples=[1.0])
    integral_gain: float = Field(description="K_I; zero in all units but one.", examples=[1.0])
    bias: float = Field(description="M_i0.", examples=[0.0])


class OneIntegrator(BaseModel):
    """The other remedy: one unit with all integral action, the others proportional."""

    drives: list[RemainingDrive] = Field(description="The units' controllers.", examples=[[]])


class SteadyState(BaseModel):
    """Where proportional units come to rest."""

    set_point: float = Field(description="Share of the set point reached.", examples=[0.889])
    load: float = Field(description="Change of the output for a load of 1.", examples=[-0.222])
    bias: float = Field(description="Output that the biases alone make.", examples=[0.0])
    effort_ratios: list[float] = Field(
        description="(M_i - M_i0) of each unit over that of the first one with a gain.",
        examples=[[1.0, 3.0]],
    )


class DriveAnalysisResult(BaseModel):
    """Integrator modes that the common signals neither move nor show."""

    integrating: list[int] = Field(
        description="Units with integral action, from 0.", examples=[[0, 1]]
    )
    uncontrollable_modes: int = Field(
        description="Modes at 0 that set point and load do not move.", examples=[1]
    )
    unobservable_modes: int = Field(
        description="Modes at 0 that the common output does not show.", examples=[1]
    )
    effort_drifts: list[list[float]] = Field(
        description="Orthonormal patterns in which efforts drift freely.",
        examples=[[[0.707, -0.707]]],
    )
    poles: list[Complex] = Field(
        description="Closed-loop poles, the free ones included.",
        examples=[[{"re": 0.0, "im": 0.0}]],
    )
    stable: bool = Field(description="Whether all other poles are stable.", examples=[True])
    text: str = Field(
        description="Which controllers cause it, in words.",
        examples=["Units 1 and 2 integrate the same error ..."],
    )
    remedy: Remedy | None = Field(description="Null without integral action.", examples=[None])
    alternative: OneIntegrator | None = Field(
        default=None,
        description="All integral action in one unit, which then takes up the steady load; null: "
        "at most one has any.",
        examples=[None],
    )
    steady: SteadyState | None = Field(
        default=None,
        description="Of units without integral action on a load that does not integrate.",
        examples=[None],
    )


class DriveResponse(BaseModel):
    """Response over time; at each event the values before and after it."""

    time: list[float] = Field(description="Times.", examples=[[0.0, 0.1]])
    set_point: list[float] = Field(description="Set point.", examples=[[1.0, 1.0]])
    load: list[float] = Field(description="Load.", examples=[[0.0, 0.0]])
    measurement_error: list[float] = Field(
        description="Measurement error of the disturbed unit.", examples=[[0.0, 0.0]]
    )
    output: list[float] = Field(description="Common output.", examples=[[0.0, 0.17]])
    efforts: list[list[float]] = Field(
        description="Efforts of the units at each time.", examples=[[[1.0, 1.0], [0.9, 0.9]]]
    )
    bounded: bool = Field(
        description="False: cut off because it grew without bound.", examples=[True]
    )
    shares_before_pulse: Numbers = Field(
        description="Shares of the units in the effort before the pulse; null: none.",
        examples=[[0.5, 0.5]],
    )
    shares_at_end: Numbers = Field(
        description="Shares of the units in the effort at the end; null: none.",
        examples=[[1.18, -0.18]],
    )


class DriveSimulationResult(BaseModel):
    """The units as they are, and mended."""

    original: DriveResponse = Field(description="As they are.", examples=[_RESPONSE])
    mended: DriveResponse | None = Field(
        description="With one integrator shared out; null without integral action.",
        examples=[_RESPONSE],
    )
    alternative: DriveResponse | None = Field(
        default=None,
        description="With all integral action in one unit; null: at most one has any.",
        examples=[None],
    )


class ParallelDrivesResult(IdentifiedResult):
    """Free modes of parallel units, the remedy, and both in simulation."""

    analysis: DriveAnalysisResult = Field(description="What is hidden.", examples=[_ANALYSIS])
    simulation: DriveSimulationResult = Field(
        description="Time responses.", examples=[{"original": _RESPONSE, "mended": _RESPONSE}]
    )


def compute(request: ParallelDrivesRequest) -> dict[str, Any]:
    """Return the analysis and the simulation of the request's units."""
    from solver.interaction.drive_simulation import simulate_drives
    from solver.interaction.parallel_drives import analyse_drives

    experiment = request.build()
    analysis, simulation = analyse_drives(experiment.system), simulate_drives(experiment)
    return {"analysis": encode(analysis), "simulation": encode(simulation)}


def table(result: ParallelDrivesResult) -> list[Part]:
    """Return which modes are free, what mends them, and the shares of the effort."""
    analysis, simulation = result.analysis, result.simulation
    parts: list[Part] = [Line(analysis.text, "strong")]
    if not analysis.stable:
        parts.append(Line("The loop is unstable.", "alarm"))
    if analysis.remedy is not None:
        parts.append(Line(analysis.remedy.text))
    if analysis.alternative is not None:
        gains = [drive.integral_gain for drive in analysis.alternative.drives]
        chosen = max(range(len(gains)), key=gains.__getitem__)
        parts.append(
            Line(
                f"Or else: all integral action, {number(gains[chosen])}, in unit {chosen + 1}, the "
                "others proportional. Nothing drifts; that unit takes up the steady load."
            )
        )
    if analysis.steady is not None:
        steady = analysis.steady
        parts.append(
            Line(
                f"At rest the output is {number(steady.set_point)} times the set point, "
                f"{number(steady.load)} for each unit of load, {number(steady.bias)} by the "
                "biases; the efforts beyond the biases are shared "
                f"{' : '.join(map(number, steady.effort_ratios))}."
            )
        )
    before, after, other = simulation.original, simulation.mended, simulation.alternative
    rows = [
        (
            f"unit {index + 1}",
            number(before.shares_before_pulse[index]),
            number(before.shares_at_end[index]),
            number(None if after is None else after.shares_at_end[index]),
            number(None if other is None else other.shares_at_end[index]),
        )
        for index in range(len(before.shares_at_end))
    ]
    heads = ("Share of the effort", "before the pulse", "at the end", "one remedy", "the other")
    return [*parts, Grid(heads, rows)]


def draw(result: DrawnParallelDrives, unit: str) -> dict[str, Any]:
    """Return the simulation."""
    from service.analyses.parallel_drives.figure import drives
    from service.figures.document import figures_to_json

    return figures_to_json({"drives": drives(result.simulation, unit)})


ANALYSIS = Analysis(
    name="parallel_drives",
    resource="parallel-drives",
    text=__doc__,
    outcome="Free modes, remedy and simulation.",
    request=ParallelDrivesRequest,
    result=ParallelDrivesResult,
    compute=compute,
    computes_with=("solver.interaction.drive_simulation", "solver.interaction.parallel_drives"),
    table=table,
    figures=Figures(of="parallel drives", drawn=DrawnParallelDrives, draw=draw),
)
