"""Analyse given loop settings.

Return stability, the peaks and curves of mu, and a worst case, of given settings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

import solver.model.mixing
import solver.model.plants
import solver.model.weights
from service.analysis import Analysis, Figures
from service.effort import different_loops
from service.model_wording import tolerance_lines
from service.printing import ROUNDED, Grid, Line, Part, peaks_grid, proof_lines, warning_lines
from service.schemas.drawn import DrawnRobustness
from service.schemas.encoding import encode
from service.schemas.fields import Frequency, IdentifiedResult, ResultModel, below
from service.schemas.full_controllers import Built, FullController
from service.schemas.given_loops import EXAMPLE, GivenLoops
from service.schemas.loop_forms import GivenLoop
from service.schemas.margins import Bandwidths, LoopMargins
from service.schemas.model_tolerance import ModelTolerance
from service.schemas.peaks import (
    CURVES_EXAMPLE,
    PEAK_EXAMPLE,
    Curves,
    Guarantee,
    MarginsGuarantee,
    Peak,
    Peaks,
)
from service.schemas.worst_case import WorstCase
from service.wording import number
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.loop_names import loops_text
from solver.model.mixing import mixed
from solver.model.plants import MAX_UNITS
from solver.tuning.advice import NEAR_ONE, weights_factor

__all__ = ["ANALYSIS", "RobustnessRequest", "RobustnessResult", "RobustnessTask"]

MAX_FREQUENCIES = 10_000
INFINITELY_MANY = 10**9  # solver.stability.encirclements; not imported, for numba's sake


@dataclass(frozen=True)
class RobustnessTask:
    """Arguments of `solver.robustness.analysis.analyse`; `omega` (k,) rad per time unit or None."""

    plant: solver.model.plants.Plant
    uncertainty: solver.model.weights.Uncertainty
    performance: solver.model.weights.Performance
    loops: tuple[Controller, ...]
    omega: NDArray[np.float64] | None
    certificate: bool


@dataclass(frozen=True)
class FullTask:
    """Arguments of `solver.robustness.centralised.analyse_centralised`."""

    plant: solver.model.plants.Plant
    uncertainty: solver.model.weights.Uncertainty
    performance: solver.model.weights.Performance
    controller: Built
    cross_check: bool


class RobustnessRequest(GivenLoops):
    """Ask how robust given loop settings are."""

    omega: (
        Annotated[tuple[Frequency, ...], Field(min_length=1, max_length=MAX_FREQUENCIES)] | None
    ) = Field(
        default=None,
        description="Frequencies of the curves, ascending; null: chosen from the loop.",
        examples=[None, [0.001, 0.01, 0.1, 1.0, 10.0]],
    )
    certificate: Literal["none", "full"] = Field(
        default="full",
        description="full: the result carries a proof, for all frequencies, of a level just above "
        "its peak; none: the result is smaller, and its guarantee stands all the same.",
        examples=["full"],
    )

    loops: Annotated[tuple[GivenLoop, ...], Field(max_length=MAX_UNITS)] = Field(
        default=(),
        description="Settings, one entry a loop; or else a controller.",
        examples=[EXAMPLE["loops"]],
    )
    controller: FullController | None = Field(
        default=None,
        description="A full controller u = C e in place of loops: a state space, a transfer "
        "matrix, or, for a parallel plant, one on the sum and one on the differences of its units. "
        "Certificates and margins are for single loops.",
        examples=[None],
    )

    method: Literal["kernel", "sdp"] = Field(
        default="kernel",
        description="sdp: the bound at the peak is recomputed by semidefinite programming, "
        "independently of the kernel, and both are given.",
        examples=["kernel"],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> RobustnessTask:
        """Return the arguments of the solver's analysis.

        Raises
        ------
        InvalidInputError
            A value that the mathematics cannot accept, by pointer into this request.

        """
        if self.controller is not None:
            message = "a full controller is analysed by itself"
            raise InvalidInputError(message, "/controller")
        task = self.parts()
        omega = None if self.omega is None else np.array(self.omega)
        if omega is not None and np.any(np.diff(omega) <= 0):
            index = int(np.argmax(np.diff(omega) <= 0)) + 1
            message = "the frequencies must ascend"
            raise InvalidInputError(message, f"/omega/{index}")
        return RobustnessTask(
            task.plant,
            task.uncertainty,
            task.performance,
            task.loops,
            omega,
            self.certificate == "full",
        )

    def build_full(self) -> FullTask:
        """Return the arguments of the solver's analysis of a full controller.

        Raises
        ------
        InvalidInputError
            As `build`, or what is for single loops alone beside it.

        """
        alone = {
            "/loops": bool(self.loops),
            "/omega": self.omega is not None,
        }
        for field, given in alone.items():
            if given:
                message = "this is for single loops, not for a full controller"
                raise InvalidInputError(message, field)
        plant, uncertainty, performance = self.weights()
        assert self.controller is not None  # noqa: S101 - for the type checker: who calls knows
        with below("/controller"):
            controller = self.controller.build()
        return FullTask(plant, uncertainty, performance, controller, self.method == "sdp")

    def combined(
        self, plant: solver.model.plants.Plant, mixing: solver.model.mixing.Mixing
    ) -> solver.model.plants.Plant:
        """Return the plant from what the loops move, or a full controller, to what they control."""
        if self.controller is None:
            return mixed(plant, mixing)
        if mixing.inputs is not None:
            message = "a full controller moves the inputs themselves"
            raise InvalidInputError(message, "/mixing/inputs")
        return super().combined(plant, mixing)


class CrossCheck(ResultModel):
    """Two upper bounds of mu of robust performance at one frequency."""

    omega: float = Field(description="Where the peak is, rad per time unit.", examples=[0.0314])
    kernel: float = Field(description="Bound by the kernel.", examples=[1.0003])
    sdp: float = Field(description="Bound by semidefinite programming.", examples=[1.0003])
    agree: bool = Field(description="Whether they are within 1e-5.", examples=[True])


class RobustnessResult(IdentifiedResult, ResultModel):
    """Robustness of given loops; peaks and curves are null where the loops are unstable."""

    nominally_stable: bool = Field(
        description="Whether the nominal closed loop is stable.", examples=[True]
    )
    unstable_poles: int = Field(
        description="Closed-loop poles in the right half plane, those at s = 0 apart; 1000000000 "
        "stands for more than can be counted.",
        examples=[0],
    )
    poles_at_origin: int = Field(
        default=0,
        description="Closed-loop poles at s = 0: integrators that drift, since the plant's static "
        "gain is singular.",
        examples=[0],
    )
    stable_gain_factor: float | None = Field(
        default=None,
        description="Unstable loops become stable with all gains times this factor; null: none "
        "was found, or the loops are stable.",
        examples=[None],
    )
    guarantee: Guarantee | None = Field(
        default=None,
        description="What is proven over all frequencies; null where the loops are unstable.",
        examples=[{"status": "proven", "level": 1.0001, "reason": None}],
    )
    peaks: Peaks | None = Field(
        description="Peaks of the three mu curves.",
        examples=[
            {
                "robust_performance": PEAK_EXAMPLE,
                "robust_stability": PEAK_EXAMPLE,
                "nominal_performance": PEAK_EXAMPLE,
            }
        ],
    )
    curves: Curves | None = Field(
        description="Upper bounds of mu over frequency.",
        examples=[CURVES_EXAMPLE],
    )
    model_tolerance: list[ModelTolerance] = Field(
        default=[],
        description="How wrong each parameter of the plant may be, alone: what the guarantee does "
        "not cover.",
        examples=[[]],
    )
    lower_bound: Peak | None = Field(
        description="Lower bound of the robust performance peak.", examples=[PEAK_EXAMPLE]
    )
    cross_check: CrossCheck | None = Field(
        default=None,
        description="The bound at the peak by a second method, where the request asks for it and "
        "the loops are stable.",
        examples=[None],
    )
    worst_case: WorstCase | None = Field(
        description="The perturbation that reaches the lower bound.", examples=[None]
    )
    uncertainty_scaling: float | None = Field(
        description="Factor by which the uncertainty may grow before robust stability is no "
        "longer assured.",
        examples=[1.84],
    )
    margins: list[LoopMargins] = Field(
        description="Stability margins, an entry for each different loop.", examples=[[]]
    )
    bandwidths: Bandwidths | None = Field(
        default=None,
        description="How fast the loops are alone, and the slowest and fastest direction of all "
        "together; null: unstable.",
        examples=[{"alone": 0.392, "worst_direction": 0.019, "best_direction": 0.768}],
    )
    margins_guarantee: MarginsGuarantee | None = Field(
        default=None,
        description="What is proven of Ms, Mt and the bandwidths over all frequencies; null where "
        "there are none.",
        examples=[{"status": "proven", "within": 1e-4, "reason": None}],
    )
    certificate: dict[str, Any] | None = Field(
        description="Proof for all frequencies.", examples=[None]
    )
    warnings: list[str] = Field(description="What to look at twice.", examples=[[]])


def compute(request: RobustnessRequest) -> dict[str, Any]:
    """Return the robustness of the request's loops."""
    if request.controller is not None:
        return _full(request.build_full())
    from solver.robustness.analysis import analyse
    from solver.robustness.scan import scan_remark

    task = request.build()
    found = analyse(
        task.plant,
        task.uncertainty,
        task.performance,
        task.loops,
        task.omega,
        certificate=task.certificate,
    )
    document: dict[str, Any] = encode(found)
    if found.nominally_stable:
        slow = scan_remark(task.plant, task.loops, request.scan_time)
        document["warnings"] += [slow] if slow else []
    if request.method == "sdp" and found.peaks is not None:
        from solver.model.blocks import group_loops
        from solver.robustness.cross_check import cross_check
        from solver.robustness.curves import LoopAnalysis

        loops = group_loops(task.plant, task.loops, task.uncertainty, task.performance.output_scale)
        analysis = LoopAnalysis(*loops, task.uncertainty, task.performance)
        document["cross_check"] = encode(cross_check(analysis, found.peaks.robust_performance))
    return document


def _full(task: FullTask) -> dict[str, Any]:
    """Return the robustness of a full controller; what is for single loops is left out."""
    from solver.robustness.centralised import analyse_centralised

    found = analyse_centralised(
        task.plant,
        task.uncertainty,
        task.performance,
        task.controller,
        cross_check=task.cross_check,
    )
    of_loops = ("lower_bound", "worst_case", "uncertainty_scaling", "certificate")
    return {**encode(found), **dict.fromkeys(of_loops), "margins": []}


def table(result: RobustnessResult) -> list[Part]:
    """Return the analysis as lines and grids."""
    tolerance = tolerance_lines(result.model_tolerance)
    parts: list[Part] = [*_verdict(result), *(line for line in tolerance if line.style != "plain")]
    if result.peaks is not None:
        parts.append(peaks_grid(result.peaks))
        peak = result.peaks.robust_performance.value
        if peak is not None and peak > 0 and abs(peak - 1) > NEAR_ONE:
            parts.append(Line(weights_factor(peak)))
    parts += proof_lines(result.certificate, result.guarantee)
    if result.lower_bound is not None:
        bound = number(result.lower_bound.value)
        parts.append(Line(f"A plant in the set reaches {bound}: the lower bound of that peak."))
    if result.cross_check is not None:
        both = result.cross_check
        text = (
            f"The peak is {both.kernel:.7g} by the kernel, {both.sdp:.7g} by semidefinite programs"
        )
        says = "they agree" if both.agree else "they DISAGREE"
        parts.append(Line(f"{text}: {says}.", "plain" if both.agree else "alarm"))
    if result.uncertainty_scaling is not None:
        factor = number(result.uncertainty_scaling)
        parts.append(Line(f"All plants stay stable up to {factor} times the uncertainty."))
    parts += [line for line in tolerance if line.style == "plain"]
    if result.margins:
        parts.append(_margins(result.margins))
    if result.bandwidths is not None:
        found = result.bandwidths
        rows = [
            ("slowest loop alone", number(found.alone)),
            ("worst direction, all closed", number(found.worst_direction)),
            ("best direction, all closed", number(found.best_direction)),
        ]
        parts.append(Grid(("bandwidth (rad/time)", ""), rows))
    if result.margins_guarantee is not None:
        parts.append(Line(_margins_text(result.margins_guarantee)))
    return [*parts, *warning_lines(result.warnings)]


def _verdict(result: RobustnessResult) -> Iterator[Line]:
    """Yield what is to be read first."""
    if result.nominally_stable:
        yield _demand(result)
    else:
        yield Line(_unstable(result), "alarm")
    if result.stable_gain_factor is not None:
        factor = number(result.stable_gain_factor)
        yield Line(f"Stable with all gains reduced to {factor} times these, and below.")
    elif not result.nominally_stable and not result.poles_at_origin:
        yield Line(
            "Not stable with all gains reduced alike either: check the signs of the gains, and "
            "which input belongs to which output."
        )


def _demand(result: RobustnessResult) -> Line:
    """Say first whether the demand holds."""
    peak = result.peaks.robust_performance.value if result.peaks else None
    if peak is None:
        return Line("Nominally stable.", "strong")
    if peak <= 1 + ROUNDED:
        return Line("Nominally stable, demand met: mu is at most 1.", "strong")
    return Line(f"Nominally stable, demand not met: mu reaches {number(peak)}, above 1.", "alarm")


def _unstable(result: RobustnessResult) -> str:
    poles, drifting = result.unstable_poles, result.poles_at_origin
    found = []
    if poles >= INFINITELY_MANY:
        found.append("more closed-loop poles in the right half plane than can be counted")
    elif poles:
        found.append(f"{poles} closed-loop pole{'s' * (poles != 1)} in the right half plane")
    if drifting:
        found.append(f"{drifting} at s = 0, where integrators drift")
    return f"Unstable: {', '.join(found)}."


def _margins(margins: Sequence[LoopMargins]) -> Grid:
    rows: list[tuple[str, ...]] = []
    for loop in margins:
        name = loops_text(loop.units)
        for others, each, factor in (
            ("open", loop.alone, loop.alone_factor),
            ("closed", loop.together, loop.together_factor),
        ):
            if each is None:
                reduced = "unstable" if factor is None else f"unstable: x {number(factor, 3)}"
                rows.append((name, others, reduced, "", "", "", "", ""))
                continue
            values = (
                each.gain_increase,
                each.phase_margin,
                each.delay_margin,
                each.sensitivity.value,
                each.complementary_sensitivity.value,
                each.bandwidth,
            )
            rows.append((name, others, *map(number, values)))
    heads = ("margins", "others", "gain", "phase (°)", "delay", "Ms", "Mt", "bandwidth")
    return Grid(heads, rows, frozenset({0, 1}))


def _margins_text(guarantee: MarginsGuarantee) -> str:
    what = "Ms, Mt and bandwidths over all frequencies"
    if guarantee.status == "proven":
        return f"Proven: {what}, to {100 * guarantee.within:.2g} %."
    return f"Not proven: {what}: {guarantee.reason}. They are sampled and refined."


def draw(result: DrawnRobustness, unit: str) -> dict[str, Any]:
    """Return the curves of mu."""
    from service.figures.document import figures_to_json
    from service.figures.frequency import mu

    if result.curves is None or result.peaks is None:
        return figures_to_json({}, {"mu": "there are no curves: the loops are unstable"})
    figure = mu(result.curves, result.peaks, lower_bound=result.lower_bound, unit=unit)
    return figures_to_json({"mu": figure})


ANALYSIS = Analysis(
    name="robustness",
    resource="robustness",
    text=__doc__,
    outcome="The analysis.",
    request=RobustnessRequest,
    result=RobustnessResult,
    compute=compute,
    computes_with=("solver.robustness.analysis", "solver.certificate.search"),
    table=table,
    effort=lambda task: different_loops(task.plant, task.loops, task.uncertainty, task.performance),
    fails=lambda result: not result.nominally_stable,
    figures=Figures(of="a robustness analysis", drawn=DrawnRobustness, draw=draw),
)
