"""Find what any controller could do.

Return the least tau_p (or mu) of all linear multivariable controllers, one of limited order that
can be built, a bound that none can pass, and beside them single loops, decoupling and mode control
made for the same demand.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

from pydantic import ConfigDict, Field, JsonValue

from service.analysis import Analysis, Figures, LongWork, OnProgress
from service.beyond import SHORTEST, alternatives_to_json, comparison_table
from service.printing import Grid, Line, Part, peaks_grid, proof_lines, warning_lines
from service.schemas.alternatives import Alternative, LowerBound
from service.schemas.controllers import Loop
from service.schemas.drawn import Drawn, DrawnCurves
from service.schemas.encoding import encode
from service.schemas.fields import AnalysisRequest, ResultModel
from service.schemas.jobs import JobState
from service.schemas.peaks import CURVES_EXAMPLE, PEAK_EXAMPLE, Curves, Guarantee, Peaks
from service.schemas.tunings import TuningRequest

__all__ = ["ANALYSIS", "LimitRequest", "LimitResult"]

EXAMPLE: dict[str, JsonValue] = {
    "plant": {
        "kind": "first_order",
        "n": 2,
        "gain": 1.0,
        "time_constant": 10.0,
        "interaction": 0.5,
    },
    "uncertainty": {"epsilon": 0.2, "theta": 1.0},
    "controller": {"kind": "PI", "arrangement": "identical"},
    "objective": "tau_p",
}
_PEAKS = dict.fromkeys(
    ("robust_performance", "robust_stability", "nominal_performance"), PEAK_EXAMPLE
)


class LimitRequest(TuningRequest, AnalysisRequest):
    """Ask what any controller could do; a tuning request, whose loops are tuned beside it."""

    certificate: Literal["none", "full"] = Field(
        default="none",
        description="Without effect: a limit carries no proof of the loops beside it.",
        examples=["none"],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE], "x-form": False})


class StateSpace(ResultModel):
    """A linear system x' = A x + B u, y = C x + D u."""

    A: list[list[float]] = Field(description="States by states.", examples=[[[0.0]]])
    B: list[list[float]] = Field(description="States by inputs.", examples=[[[1.0]]])
    C: list[list[float]] = Field(description="Outputs by states.", examples=[[[0.5]]])
    D: list[list[float]] = Field(description="Outputs by inputs.", examples=[[[2.0]]])


class Multivariable(ResultModel):
    """A controller that can be built, u = C e, with integral action."""

    tau_p: float = Field(description="Time constant that it reaches.", examples=[4.46])
    states: int = Field(description="States, each mode counted once.", examples=[40])
    matrix: StateSpace | None = Field(
        description="The controller of a matrix plant; null for a parallel one.", examples=[None]
    )
    total: StateSpace | None = Field(
        description="Parallel plant: what acts on the mean of all units' errors.", examples=[None]
    )
    difference: StateSpace | None = Field(
        description="Parallel plant: what acts on the rest of each unit's error; without effect "
        "for one unit.",
        examples=[None],
    )
    peaks: Peaks = Field(description="Peaks of its three mu curves.", examples=[_PEAKS])
    curves: Curves = Field(
        description="Upper bounds of mu over frequency.",
        examples=[CURVES_EXAMPLE],
    )
    guarantee: Guarantee = Field(
        description="What is known of mu over all frequencies.",
        examples=[{"status": "proven", "level": 1.0001, "reason": None}],
    )


class Decentralised(ResultModel):
    """Single loops tuned for the same demand."""

    status: str = Field(description="Status of the tuning.", examples=["optimal"])
    value: float | None = Field(description="Their tau_p or mu.", examples=[18.4])
    loops: list[Loop] = Field(description="Settings, one entry a loop.", examples=[[]])


class LimitResult(ResultModel):
    """What any controller could do, beside what single loops do."""

    status: Literal["found", "infeasible", "unlimited", "time_limit"] = Field(
        description="found; infeasible: no controller was found that meets the demand; unlimited: "
        "nothing in the model ends the bandwidth; time_limit: the search was ended early, and the "
        "value, if any, is the best by then.",
        examples=["found"],
    )
    objective: Literal["tau_p", "mu"] = Field(description="What value is.", examples=["tau_p"])
    value: float | None = Field(
        description="Least tau_p or mu found over all controllers of any order: a local optimum.",
        examples=[4.15],
    )
    reason: str | None = Field(description="Why there is no value.", examples=[None])
    multivariable: Multivariable | None = Field(
        description="A controller of limited order near it; null where none was found.",
        examples=[None],
    )
    lower_bound: LowerBound = Field(
        description="What no linear controller can pass.",
        examples=[{"value": 0.62, "point": {"re": 1.6, "im": 0.0}, "limitation": "uncertainty"}],
    )
    decentralised: Decentralised = Field(
        description="Single loops of the request's kind, tuned for the same demand.",
        examples=[{"status": "optimal", "value": 18.4, "loops": []}],
    )
    alternatives: list[Alternative] = Field(
        description="One entry for each kind of controller, from identical PI loops to a "
        "multivariable one, all for the same demand.",
        examples=[[]],
    )
    verdict: str = Field(
        description="All of it in words, a line for each kind of controller.",
        examples=["Single loops: τP = 18.446 (unlike PI)."],
    )
    peaks: Peaks | None = Field(
        description="Peaks of the multivariable controller, as in it; null without one.",
        examples=[None],
    )
    curves: Curves | None = Field(
        description="Curves of the multivariable controller, as in it; null without one.",
        examples=[None],
    )
    warnings: list[str] = Field(description="What to look at twice.", examples=[[]])


class LimitJob(JobState):
    """A job that looks for the limit."""

    request: LimitRequest = Field(description="The request, with all defaults.", examples=[EXAMPLE])
    result: LimitResult | None = Field(
        description="The limit, once the job has succeeded.", examples=[None]
    )


class DrawnLimit(Drawn):
    """Curves and peaks of the multivariable controller; null without one."""

    peaks: Peaks | None = Field(description="Peaks of the three mu curves.", examples=[None])
    curves: DrawnCurves | None = Field(description="Upper bounds of mu.", examples=[None])


def compute(request: LimitRequest, on_progress: OnProgress | None = None) -> dict[str, Any]:
    """Return the limit and the tuned loops."""
    from solver.limits.comparison import LOOPS_SHARE, compare_controllers
    from solver.limits.ending import EnoughError
    from solver.model.state_space import StateSpace as System
    from solver.tuning.record import Progress
    from solver.tuning.tuner import tune

    def tuned(progress: Progress) -> bool:
        progress = replace(progress, fraction=LOOPS_SHARE * progress.fraction)
        return on_progress is not None and on_progress(progress)

    def tick() -> None:
        if on_progress is not None and on_progress(Progress(LOOPS_SHARE, tuning.tau_p, 1, 1)):
            raise EnoughError

    specification = request.build()
    seconds = request.search.time_limit
    tuning = tune(replace(specification, time_limit=LOOPS_SHARE * seconds), tuned)
    left = max(seconds - tuning.search.elapsed_seconds, SHORTEST)
    task = replace(specification.arranged(tuning.pairing), time_limit=left)
    comparison = compare_controllers(task, tick=tick)
    limit = comparison.limit
    others = alternatives_to_json(comparison)
    peak = None if tuning.peaks is None else tuning.peaks.robust_performance.value
    loops_value = tuning.tau_p if limit.objective == "tau_p" else peak
    built = None
    if limit.realised is not None:
        controller = limit.realised.controller
        whole = isinstance(controller, System)
        robustness = limit.realised.robustness
        built = {
            "tau_p": limit.realised.tau_p,
            "states": limit.realised.states,
            "matrix": encode(controller) if whole else None,
            "total": None if isinstance(controller, System) else encode(controller.total),
            "difference": None if isinstance(controller, System) else encode(controller.difference),
            "peaks": encode(robustness.peaks),
            "curves": encode(robustness.curves),
            "guarantee": encode(robustness.guarantee),
        }
    document: dict[str, Any] = {
        "status": limit.status.value,
        "objective": limit.objective,
        "value": encode(limit.value),
        "reason": limit.reason,
        "multivariable": built,
        "lower_bound": encode(limit.lower_bound),
        "decentralised": {
            "status": tuning.status.value,
            "value": encode(loops_value),
            "loops": encode(tuning.loops),
        },
        "peaks": None if built is None else built["peaks"],
        "curves": None if built is None else built["curves"],
        **{name: others[name] for name in ("alternatives", "verdict")},
        "warnings": list(comparison.warnings),
    }
    return document


def time_limit(request: LimitRequest) -> float:
    """Return the seconds after which the comparison ends with what it has."""
    return request.search.time_limit


def table(result: LimitResult) -> list[Part]:
    """Return the verdict, the table and the peaks."""
    parts: list[Part] = [Line(text, "strong") for text in result.verdict.splitlines()]
    built = result.multivariable
    least = result.lower_bound.value
    if result.value is not None or any(each.value is not None for each in result.alternatives):
        parts.append(
            Grid(*comparison_table(result.alternatives, result.objective, result.value, least))
        )
    if built is not None:
        parts.append(peaks_grid(built.peaks))
        parts += proof_lines(None, built.guarantee)
    return [*parts, *warning_lines(result.warnings)]


def draw(result: DrawnLimit, unit: str) -> dict[str, Any]:
    """Return the curves of mu of the controller that can be built."""
    from service.figures.document import figures_to_json
    from service.figures.frequency import mu

    if result.curves is None or result.peaks is None:
        return figures_to_json({}, {"mu": "there are no curves: no controller was built"})
    return figures_to_json({"mu": mu(result.curves, result.peaks, lower_bound=None, unit=unit)})


ANALYSIS = Analysis(
    name="limit",
    resource="limits",
    text=__doc__,
    outcome="The limit.",
    request=LimitRequest,
    result=LimitResult,
    compute=compute,
    job=LongWork(model=LimitJob, compute=compute, time_limit=time_limit),
    computes_with=("solver.limits.comparison", "solver.tuning.tuner"),
    table=table,
    figures=Figures(of="a limit", drawn=DrawnLimit, draw=draw),
)
