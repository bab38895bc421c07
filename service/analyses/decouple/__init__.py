"""Decouple a plant and design its loops.

Return a decoupler, PI settings with the greatest integral gain, and responses.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue

import solver.model.controllers
from service.analyses.decouple.drawn import DrawnDecoupling
from service.analysis import Analysis, Figures
from service.printing import Grid, Line, Part, matrix, warning_lines
from service.schemas.complex import Complex
from service.schemas.controllers import ParallelForm
from service.schemas.encoding import encode
from service.schemas.fields import (
    AnalysisRequest,
    Gain,
    IdentifiedResult,
    RequestModel,
    Time,
    below,
)
from service.schemas.frequencies import Frequencies, ascending
from service.schemas.peaks import Peak
from service.schemas.plants import Plant
from service.wording import number
from solver.interaction.decoupling import DecouplingSpecification
from solver.interaction.loop_shape import RobustnessLimits
from solver.model.plants import MAX_MATRIX_SIZE
from solver.model.transfer_function import LARGEST

__all__ = ["ANALYSIS", "DecouplingRequest", "DecouplingResult"]

_WOOD_BERRY: JsonValue = {
    "kind": "matrix",
    "elements": [
        [
            {"num": [12.8], "den": [16.7, 1.0], "dead_time": 1.0},
            {"num": [-18.9], "den": [21.0, 1.0], "dead_time": 3.0},
        ],
        [
            {"num": [6.6], "den": [10.9, 1.0], "dead_time": 7.0},
            {"num": [-19.4], "den": [14.4, 1.0], "dead_time": 3.0},
        ],
    ],
}
_LIMITS: JsonValue = {"max_sensitivity": 1.6, "max_complementary": 1.6}
EXAMPLE: dict[str, JsonValue] = {
    "plant": _WOOD_BERRY,
    "limits": _LIMITS,
    "max_index": 1.0,
    "set_point_weights": [0.0, 0.0],
}

PositiveGain = Annotated[float, Field(gt=0, le=LARGEST, json_schema_extra={"x-unit": "gain"})]
PeakLimit = Annotated[float, Field(gt=1, le=1e3, json_schema_extra={"x-unit": "1"})]
Weight = Annotated[float, Field(ge=0, le=1, json_schema_extra={"x-unit": "1"})]
Factor = Annotated[float, Field(ge=1, le=1e6, json_schema_extra={"x-unit": "1"})]
Index = Annotated[float, Field(gt=0, le=1e6, json_schema_extra={"x-unit": "1"})]
Matrix = list[list[float | None]]
Responses = list[list[list[Complex]]]


class DesignLimits(RequestModel):
    """Greatest peaks of the sensitivities of each loop."""

    max_sensitivity: PeakLimit = Field(default=1.6, description="M_s, of |S|.", examples=[1.6])
    max_complementary: PeakLimit = Field(default=1.6, description="M_t, of |T|.", examples=[1.6])

    def build(self) -> RobustnessLimits:
        """Return the solver's limits."""
        return RobustnessLimits(self.max_sensitivity, self.max_complementary)


class OwnGains(RequestModel):
    """Own PI settings of a decoupled loop, K_p + K_i/s."""

    proportional_gain: Gain = Field(description="K_p.", examples=[0.2975])
    integral_gain: PositiveGain = Field(description="K_i.", examples=[0.342])

    def build(self) -> solver.model.controllers.ParallelForm:
        """Return the solver's form."""
        return solver.model.controllers.ParallelForm(self.proportional_gain, self.integral_gain)


class DecouplingRequest(AnalysisRequest):
    """Ask for a static decoupler and PI settings of the decoupled loops."""

    plant: Plant = Field(
        description="A stable process with a regular static gain, at most 10 loops.",
        examples=[_WOOD_BERRY],
    )
    limits: DesignLimits = Field(
        default=DesignLimits(), description="Robustness of each loop.", examples=[_LIMITS]
    )
    max_index: Index | None = Field(
        default=None,
        description="Peak of |h_ij| off the diagonal that no loop may exceed; null: no detuning.",
        examples=[None, 1.0],
    )
    set_point_weights: (
        Annotated[tuple[Weight, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)] | None
    ) = Field(
        default=None,
        description="b, one a loop; null: 0, which disturbs the other loops least.",
        examples=[None, [0.0, 0.0]],
    )
    omega: Frequencies | None = Field(
        default=None,
        description="Frequencies of the responses, ascending; null: chosen from the plant.",
        examples=[None, [0.01, 0.1, 1.0]],
    )
    gains: (
        Annotated[tuple[OwnGains, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)] | None
    ) = Field(
        default=None,
        description="Own settings, one a loop, to be analysed as they are; null: designed.",
        examples=[None, [{"proportional_gain": 0.2975, "integral_gain": 0.342}] * 2],
    )

    decoupler: Literal["static", "dynamic"] = Field(
        default="static",
        description="static: the inverse of the static gain. dynamic: for two loops, what each "
        "does to the other is cancelled at all frequencies, where that can be built.",
        examples=["static"],
    )
    derivative_times: (
        Annotated[tuple[Time, ...], Field(min_length=1, max_length=MAX_MATRIX_SIZE)] | None
    ) = Field(
        default=None,
        description="tau_D of each loop, 0 for none: derivative action over a decade in series "
        "with the PI controller, whose settings are designed for the process behind it; null: PI.",
        examples=[None, [1.0, 3.0]],
    )
    slower: Factor | None = Field(
        default=None,
        description="Integral gains are divided by this factor after the design, proportional "
        "gains by its square root; null: they are not.",
        examples=[None, 4.0],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> DecouplingSpecification:
        """Return the solver's specification."""
        with below("/plant"):
            plant = self.plant.build()
        with below("/limits"):
            limits = self.limits.build()
        return DecouplingSpecification(
            plant,
            limits,
            self.max_index,
            self.set_point_weights,
            ascending(self.omega),
            None if self.gains is None else tuple(gains.build() for gains in self.gains),
            dynamic=self.decoupler == "dynamic",
            derivative_times=self.derivative_times,
            slower=self.slower,
        )


class PIDesign(BaseModel):
    """PI settings of a decoupled loop."""

    status: Literal["optimal", "detuned", "unbounded", "given"] = Field(
        description="optimal: greatest integral gain. detuned: reduced to keep max_index. "
        "unbounded: the model has no finite optimum; give max_index. given: own settings.",
        examples=["optimal"],
    )
    gains: ParallelForm | None = Field(
        description="The settings; null: unbounded.",
        examples=[
            {
                "proportional_gain": 2.363,
                "integral_gain": 1.537,
                "derivative_gain": 0.0,
                "filter_time": 0.0,
            }
        ],
    )
    sensitivity: Peak | None = Field(
        description="Peak of |S|; a frequency of null is infinite.",
        examples=[{"value": 1.6, "omega": 0.87}],
    )
    complementary: Peak | None = Field(
        description="Peak of |T|.", examples=[{"value": 1.59, "omega": 0.34}]
    )
    greatest_integral_gain: float | None = Field(
        description="The optimum without max_index; null: unbounded.", examples=[1.537]
    )


class DecouplerElement(BaseModel):
    """A transfer function of a dynamic decoupler."""

    num: list[float] = Field(description="Numerator, descending powers.", examples=[[1.0]])
    den: list[float] = Field(description="Denominator.", examples=[[10.0, 1.0]])
    dead_time: float = Field(description="Dead time.", examples=[2.0])


class ClosedLoop(BaseModel):
    """The decoupled loops together."""

    stable: bool = Field(
        description="Whether they are stable with the interaction that remains.", examples=[True]
    )
    omega: list[float] = Field(
        description="Frequencies, rad per time unit.", examples=[[0.01, 0.1]]
    )
    approximate: Responses = Field(
        description="H, from set points to outputs without products of interactions.",
        examples=[[[[{"re": 1.0, "im": 0.0}]]]],
    )
    exact: Responses = Field(
        description="H-bar, from set points to outputs.", examples=[[[[{"re": 1.0, "im": 0.0}]]]]
    )
    approximate_peaks: Matrix = Field(
        description="Peaks of |H| by output and set point.", examples=[[[1.0, 0.24], [3.3, 1.0]]]
    )
    exact_peaks: Matrix = Field(
        description="Peaks of |H-bar| by output and set point.",
        examples=[[[1.0, 0.43], [2.5, 1.0]]],
    )
    indices: Matrix = Field(
        description="Interaction indices: how much loop j (column) disturbs loop i (row), a "
        "crude estimate of the peaks.",
        examples=[[[0.0, 5.9], [1.3, 0.0]]],
    )
    process: Responses = Field(
        default=[],
        description="Q = P D, the decoupled process, at the frequencies.",
        examples=[[[[{"re": 1.0, "im": 0.0}]]]],
    )
    tolerated_input_error: float | None = Field(
        default=None,
        description="Relative error of all inputs at once, of any phase, up to which the loops "
        "stay stable, by mu; null: they are not stable.",
        examples=[0.35],
    )


class DecouplingResult(IdentifiedResult):
    """A static decoupler and its loops."""

    decoupler: Matrix = Field(
        description="D: the inverse of the static gain; of a dynamic one its static gain.",
        examples=[[[0.157, -0.153], [0.053, -0.104]]],
    )
    elements: list[DecouplerElement] | None = Field(
        default=None,
        description="Of a dynamic decoupler: -p12/p11, from controller 2 to input 1, and -p21/p22, "
        "from controller 1 to input 2; null: static.",
        examples=[None],
    )
    kappa: Matrix = Field(
        description="First Taylor coefficients of P(s) D, time units; off the diagonal the "
        "interaction left.",
        examples=[[[-11.3, -12.3], [-0.52, -16.9]]],
    )
    loops: list[PIDesign] = Field(description="Settings, one entry a loop.", examples=[[]])
    set_point_weights: list[float] = Field(description="b, one a loop.", examples=[[0.0, 0.0]])
    closed_loop: ClosedLoop | None = Field(
        description="The loops together; null where one is unbounded.", examples=[None]
    )
    input_error_gain: float | None = Field(
        description="Greatest relative change of a loop's gain per relative error of the inputs: "
        "large values make a decoupler dangerous.",
        examples=[3.0],
    )
    warnings: list[str] = Field(description="What to look at twice.", examples=[[]])


def compute(request: DecouplingRequest) -> dict[str, Any]:
    """Return the decoupling of the request's plant."""
    from solver.interaction.decoupling import decouple

    document: dict[str, Any] = encode(decouple(request.build()))
    return document


def table(result: DecouplingResult) -> list[Part]:
    """Return the decoupler, its loops and what they do together."""
    parts: list[Part] = [
        matrix("Decoupler u = D u'", result.decoupler, "input", "controller"),
        _loops(result),
    ]
    if result.closed_loop is not None:
        stable = "stable" if result.closed_loop.stable else "UNSTABLE"
        parts += [
            matrix("Interaction index", result.closed_loop.indices, "output", "set point"),
            matrix("Peak of |H|", result.closed_loop.exact_peaks, "output", "set point"),
            Line(f"The loops together are {stable}."),
        ]
        tolerated = result.closed_loop.tolerated_input_error
        if tolerated is not None:
            percent = number(100 * tolerated, 3)
            parts.append(Line(f"They stay stable with every input off by up to {percent} %."))
    return [*parts, *warning_lines(result.warnings)]


def _loops(result: DecouplingResult) -> Grid:
    rows = []
    for index, (loop, weight) in enumerate(
        zip(result.loops, result.set_point_weights, strict=True)
    ):
        gains = loop.gains
        rows.append(
            (
                str(index + 1),
                number(None if gains is None else gains.proportional_gain),
                number(None if gains is None else gains.integral_gain),
                number(weight),
                number(None if loop.sensitivity is None else loop.sensitivity.value),
                number(None if loop.complementary is None else loop.complementary.value),
                loop.status,
                number(loop.greatest_integral_gain),
            )
        )
    return Grid(("Loop", "Kp", "Ki", "b", "Ms", "Mt", "design", "greatest Ki"), rows)


def draw(result: DrawnDecoupling, unit: str) -> dict[str, Any]:
    """Return the responses of the decoupled loops."""
    from service.analyses.decouple.figure import decoupled
    from service.figures.document import figures_to_json

    if result.closed_loop is None:
        return figures_to_json({}, {"decoupled": "a loop is unbounded"})
    return figures_to_json({"decoupled": decoupled(result.closed_loop, unit)})


ANALYSIS = Analysis(
    name="decoupling",
    resource="decouplings",
    text=__doc__,
    outcome="The decoupler and its loops.",
    request=DecouplingRequest,
    result=DecouplingResult,
    compute=compute,
    computes_with=("solver.interaction.decoupling",),
    table=table,
    figures=Figures(of="a decoupling", drawn=DrawnDecoupling, draw=draw),
)
