"""A tuning request and its result as JSON."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, JsonValue

from service.schemas.alternatives import Alternatives
from service.schemas.arrangement import PairingOrBest
from service.schemas.controllers import ControllerChoice, Loop
from service.schemas.demands import DemandOutcome, Demands
from service.schemas.encoding import encode
from service.schemas.fields import (
    WHOLE,
    IdentifiedResult,
    RecordedRequest,
    RequestModel,
    ResultModel,
    below,
)
from service.schemas.given_loops import default_scales
from service.schemas.loop_forms import GivenLoop, given_loops
from service.schemas.mixing import Mixing
from service.schemas.model_tolerance import ModelTolerance
from service.schemas.origin import Origin
from service.schemas.peaks import CURVES_EXAMPLE, Curves, Guarantee, Peaks
from service.schemas.plants import Plant
from service.schemas.scenarios import (
    MAX_SCENARIOS,
    ScenarioOutcome,
    Spread,
    SpreadOutcome,
    TuningScenario,
)
from service.schemas.settings_nearby import AsFound, PriceOfResolution, SettingsTolerance
from service.schemas.weights import Performance, Uncertainty
from solver.model.plants import MAX_UNITS
from solver.tuning.admission import require_tunable
from solver.tuning.record import LocalOptimum, Tuning
from solver.tuning.specification import (
    MAX_STARTS,
    Arrangement,
    ControllerKind,
    Objective,
    Signs,
    Specification,
)

__all__ = [
    "MAX_TIME_LIMIT",
    "BatchTuningRequest",
    "Search",
    "TuningRequest",
    "TuningResult",
    "tuning_to_json",
]

MAX_TIME_LIMIT = 86_400.0

EXAMPLE: dict[str, JsonValue] = {
    "plant": {
        "kind": "first_order",
        "n": 2,
        "gain": 1.0,
        "time_constant": 100.0,
        "interaction": 0.949,
        "dead_time": 0.0,
    },
    "uncertainty": {"epsilon": 0.2, "theta": 1.0, "structure": "diagonal"},
    "performance": {"max_peak": 2.0, "offset": 0.0, "tau_p": None},
    "controller": {"kind": "PI", "arrangement": "independent"},
    "objective": "tau_p",
    "search": {"starts": None, "seed": 0, "time_limit": 60.0},
    "certificate": "full",
}

Starts = Annotated[int, Field(ge=1, le=MAX_STARTS, json_schema_extra={"x-unit": "1"}), WHOLE]


class Search(RequestModel):
    """How hard to search."""

    starts: (
        Annotated[int, Field(ge=1, le=MAX_STARTS, json_schema_extra={"x-unit": "1"}), WHOLE] | None
    ) = Field(
        default=None,
        description="Starts of the search; null: until no further optimum is to be expected.",
        examples=[None, 24],
    )
    seed: Annotated[int, Field(ge=0, lt=2**63, json_schema_extra={"x-unit": "1"}), WHOLE] = Field(
        default=0,
        description="The same request and seed give the same digits.",
        examples=[0],
    )
    time_limit: Annotated[
        float, Field(gt=0, le=MAX_TIME_LIMIT, json_schema_extra={"x-unit": "s"})
    ] = Field(
        default=60.0,
        description="Longest computing time; the best settings up to then are returned.",
        examples=[60.0],
    )
    start: list[GivenLoop] | None = Field(
        default=None,
        description="Known settings, one entry a loop: only the best settings beside them are "
        "sought, in a third of the time; the status is then local.",
        examples=[None],
    )
    optimality_gap: bool = Field(
        default=False,
        description="Whether to prove how far the objective is from the least possible one, in "
        "what the search leaves of the time limit. For PI with at most three different controllers "
        "or PID with identical ones; a matrix plant has at most six units.",
        examples=[False],
    )
    limit: bool = Field(
        default=False,
        description="Whether to find what other kinds of controllers could do, in what the search "
        "leaves of the time limit: PID loops, decoupling, any multivariable controller.",
        examples=[False],
    )


class TuningRequest(RecordedRequest):
    """Ask for the loop settings that are as fast as the uncertainty permits."""

    plant: Plant = Field(description="The process to be controlled.", examples=[EXAMPLE["plant"]])
    uncertainty: Uncertainty = Field(
        description="Uncertainty of the plant's inputs, as an error and its time scale, or as a "
        "weight.",
        examples=[EXAMPLE["uncertainty"]],
    )
    performance: Performance = Field(
        default=Performance(),
        description="What the closed loop must do for every plant in the uncertainty set.",
        examples=[EXAMPLE["performance"]],
    )
    controller: ControllerChoice = Field(
        default=ControllerChoice(),
        description="Which controllers may be used.",
        examples=[EXAMPLE["controller"]],
    )
    demands: Demands = Field(
        default=Demands(),
        description="Hard constraints on the settings, beside robust performance.",
        examples=[{"max_load_error": 1.5}],
    )
    scenarios: Annotated[list[TuningScenario], Field(max_length=MAX_SCENARIOS)] = Field(
        default=[],
        description="Further plants, and sets of loops in service, that the same settings must "
        "serve.",
        examples=[[]],
    )
    spread: Spread | None = Field(
        default=None,
        description="Box of parameters around the plant, and around those of the scenarios: the "
        "settings must serve every plant in it.",
        examples=[None],
    )
    pairing: PairingOrBest | None = Field(
        default=None,
        description="Input, from 0, of each output; best: those that may have integral action in "
        "every loop are tried, the nearest to no interaction first. null: output i by input i.",
        examples=[None, [1, 0], "best"],
    )
    mixing: Mixing | None = Field(
        default=None,
        description="Coupled objectives: which combinations of outputs the loops control, and of "
        "inputs they move. null: loop i controls output i.",
        examples=[None, {"outputs": [[1.0, 1.0], [-1.0, 1.0]]}],
    )
    as_found: Annotated[list[GivenLoop], Field(min_length=1, max_length=MAX_UNITS)] | None = Field(
        default=None,
        description="Today's settings, one entry a loop; the result tells what they do, beside "
        "its own.",
        examples=[None],
    )
    origin: Origin | None = Field(
        default=None,
        description="Records that the plant and its uncertainty come from; the report shows it.",
        examples=[None],
        json_schema_extra={"x-record": True},
    )
    objective: Literal["tau_p", "mu"] = Field(
        default="tau_p",
        description="tau_p: the fastest closed loop (the literature's Approach 2); mu: the "
        "smallest peak of mu at a given performance.tau_p (Approach 1).",
        examples=["tau_p"],
    )
    search: Search = Field(
        default=Search(), description="How hard to search.", examples=[EXAMPLE["search"]]
    )
    certificate: Literal["none", "full"] = Field(
        default="full",
        description="full: the result carries a proof, for all frequencies, of a level just above "
        "its peak; none: the result is smaller, and its guarantee stands all the same.",
        examples=["full"],
    )
    model_tolerance: bool = Field(
        default=True,
        description="Whether the result tells how wrong each parameter of the plant may be, which "
        "takes a tenth of a second or so.",
        examples=[True],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> Specification:
        """Return the solver's specification.

        Raises
        ------
        InvalidInputError
            A value that the mathematics cannot accept, by pointer into this request.

        """
        with below("/plant"):
            plant = self.plant.build()
        with below("/uncertainty"):
            uncertainty = self.uncertainty.build(plant.n)
        mixing = None
        if self.mixing is not None:
            with below("/mixing"):
                mixing = self.mixing.build()
        # Spans are those of the outputs, which are not what the loops control then.
        scales = default_scales(self, plant.n, uncertainty) if mixing is None else None
        with below("/performance"):
            performance = self.performance.build(scales)
        with below("/controller/bounds"):
            bounds = self.controller.bounds.build()
        with below("/demands"):
            demands = self.demands.build(None if mixing is not None else self.gain_ratios(plant.n))
        scenarios = []
        for index, scenario in enumerate(self.scenarios):
            with below(f"/scenarios/{index}"):
                scenarios.append(scenario.build(plant))
        spread = None
        if self.spread is not None:
            with below("/spread"):
                spread = self.spread.build()
        start = None
        if self.search.start is not None:
            start = given_loops(self.search.start, "/search/start")
        resolution = None
        if self.controller.resolution is not None:
            with below("/controller/resolution"):
                resolution = self.controller.resolution.build()
        as_found = None
        if self.as_found is not None:
            as_found = given_loops(self.as_found, "/as_found")
        specification = Specification(
            plant=plant,
            uncertainty=uncertainty,
            performance=performance,
            kind=ControllerKind(self.controller.kind),
            arrangement=Arrangement(self.controller.arrangement),
            group_sizes=self.controller.group_sizes,
            groups=self.controller.groups,
            pairing=self.pairing,
            mixing=mixing,
            scan_time=self.controller.scan_time,
            objective=Objective(self.objective),
            bounds=bounds,
            signs=Signs(self.controller.signs),
            demands=demands,
            scenarios=tuple(scenarios),
            spread=spread,
            start=start,
            resolution=resolution,
            as_found=as_found,
            starts=self.search.starts,
            seed=self.search.seed,
            time_limit=self.search.time_limit,
            certificate=self.certificate == "full",
            model_tolerance=self.model_tolerance,
            optimality_gap=self.search.optimality_gap,
        )
        require_tunable(specification)
        return specification


class BatchTuningRequest(TuningRequest):
    """Ask for a tuning as one of many, whose results are to stay small."""

    certificate: Literal["none", "full"] = Field(
        default="none",
        description="full: the result carries a proof, for all frequencies, of a level just above "
        "its peak.",
        examples=["none"],
    )
    model_tolerance: bool = Field(
        default=False,
        description="Whether the result tells how wrong each parameter of the plant may be, which "
        "takes a tenth of a second or so.",
        examples=[False],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [{**EXAMPLE, "certificate": "none"}]})


class LoopOfUnits(Loop):
    """Settings shared by some units."""

    units: int = Field(
        description="Number of units with these settings.",
        examples=[1],
        json_schema_extra={"x-unit": "1"},
    )


class Optimum(ResultModel):
    """A distinct local optimum; permuted copies count as one."""

    value: float | None = Field(description="Value of the objective.", examples=[18.446])
    count: int = Field(
        description="Starts that ended there; 0 where another optimum led to it.", examples=[9]
    )
    loops: list[LoopOfUnits] = Field(
        description="Its distinct settings, with the number of units that have them.",
        examples=[[{"gain": 47.65, "integral_time": 101.2, "derivative_time": None, "units": 1}]],
    )


class SearchSummary(ResultModel):
    """What the search did."""

    starts: int = Field(description="Starts made.", examples=[24])
    local_optima: list[Optimum] = Field(
        description="Distinct local optima, best first. Values of those that cannot win are of the "
        "search's grid of frequencies.",
        examples=[[{"value": 18.446, "count": 9, "loops": []}]],
    )
    seed: int = Field(description="Seed of the search.", examples=[0])
    elapsed_seconds: float = Field(description="Computing time in seconds.", examples=[0.6])


class Comparison(ResultModel):
    """What different settings gain."""

    identical_value: float | None = Field(
        description="Objective of the best identical settings.", examples=[25.77]
    )
    identical_loop: Loop = Field(
        description="The best identical settings.",
        examples=[{"gain": 39.5, "integral_time": 57.6, "derivative_time": None}],
    )
    gain_percent: float | None = Field(
        description="100 (1 - best/identical) of the objective.", examples=[28.4]
    )


class Optimality(ResultModel):
    """A proven lower bound of tau_p, or of the peak of mu where that is the objective."""

    lower_bound: float | None = Field(
        description="No settings within the parameter bounds, with as many different controllers, "
        "meet the demand at a smaller tau_p, or have a smaller peak of mu at the given tau_p; 0: "
        "nothing is proven.",
        examples=[25.75],
    )
    gap: float | None = Field(
        description="1 - lower_bound/tau_p, or over the peak of mu: the greatest share by which it "
        "may still fall.",
        examples=[0.001],
    )
    goal: float = Field(description="The gap at which the proof ends.", examples=[0.001])
    status: Literal["reached", "stopped"] = Field(
        description="reached: the gap is at most its goal; stopped: the time limit, or memory, "
        "ended the proof first.",
        examples=["reached"],
    )
    boxes: int = Field(description="Boxes of settings examined.", examples=[57])
    points: int = Field(
        description="Points of the right half plane, frequencies for the most part, where the "
        "demand was used.",
        examples=[300],
    )


class TuningResult(IdentifiedResult, ResultModel):
    """Outcome of a tuning; null stands for a value that does not exist or is not finite."""

    status: Literal["optimal", "local", "infeasible", "time_limit"] = Field(
        description="optimal: the best settings found; local: the best beside the given ones; "
        "infeasible: none meet the demand, see reason; time_limit: the best settings up to the "
        "time limit.",
        examples=["optimal"],
    )
    demand_met: bool | None = Field(
        default=None,
        description="Whether the peak of robust performance is at most 1 at this tau_p, in every "
        "scenario.",
        examples=[True],
    )
    objective: Literal["tau_p", "mu"] = Field(
        description="What was made small.", examples=["tau_p"]
    )
    tau_p: float | None = Field(
        description="Closed-loop time constant, in the request's time unit.", examples=[18.446]
    )
    peaks: Peaks | None = Field(
        description="Peaks of the three mu curves.",
        examples=[
            {
                name: {"value": 1.0, "omega": 0.03}
                for name in ("robust_performance", "robust_stability", "nominal_performance")
            }
        ],
    )
    loops: list[Loop] = Field(
        description="Settings, one entry a loop.",
        examples=[[{"gain": 47.65, "integral_time": 101.2, "derivative_time": None}]],
    )
    groups: list[list[int]] = Field(
        description="Units (from 0) that share settings.", examples=[[[0], [1]]]
    )
    nominally_stable: bool = Field(
        description="Whether the nominal closed loop is stable.", examples=[True]
    )
    search: SearchSummary = Field(
        description="What the search did.",
        examples=[{"starts": 24, "local_optima": [], "seed": 0, "elapsed_seconds": 0.6}],
    )
    curves: Curves | None = Field(
        description="Upper bounds of mu over frequency.",
        examples=[CURVES_EXAMPLE],
    )
    guarantee: Guarantee | None = Field(
        default=None,
        description="What is proven of the peak of robust performance over all frequencies.",
        examples=[{"status": "proven", "level": 1.0001, "reason": None}],
    )
    demands: list[DemandOutcome] = Field(
        default=[],
        description="What the settings make of each demand.",
        examples=[[]],
    )
    scenarios: list[ScenarioOutcome] = Field(
        default=[],
        description="What the settings make of each scenario, the request's own plant first; empty "
        "where there are none.",
        examples=[[]],
    )
    active: str | None = Field(
        default=None,
        description="Name of the scenario that decides the result.",
        examples=["any two of four"],
    )
    spread: SpreadOutcome | None = Field(
        default=None,
        description="How densely the spread was searched, its worst plant, and what is proven.",
        examples=[None],
    )
    comparison: Comparison | None = Field(
        description="What different settings gain, for the arrangement best.", examples=[None]
    )
    certificate: dict[str, Any] | None = Field(
        description="Proof for all frequencies, where asked for.", examples=[None]
    )
    optimality: Optimality | None = Field(
        description="How far the objective is from the least possible one, where asked for.",
        examples=[None],
    )
    limit: Alternatives | None = Field(
        default=None,
        description="What other kinds of controllers could do, where asked for.",
        examples=[None],
    )
    integrity: str | None = Field(
        description="In one line, what happens with loops in manual.",
        examples=["loops out of service: of 3 sets of loops in service all stable, ..."],
    )
    pairing: list[int] | None = Field(
        default=None,
        description="Input, from 0, of each output, where the request asked for it.",
        examples=[None, [1, 0]],
    )
    resolution: PriceOfResolution | None = Field(
        default=None,
        description="What the numbers that the control system accepts cost, where asked for.",
        examples=[None],
    )
    settings_tolerance: SettingsTolerance | None = Field(
        default=None, description="How far the settings may be moved.", examples=[None]
    )
    model_tolerance: list[ModelTolerance] = Field(
        default=[],
        description="How wrong each parameter of the plant may be, alone, which the guarantee does "
        "not cover; empty where it was not asked for.",
        examples=[[]],
    )
    as_found: AsFound | None = Field(
        default=None, description="What today's settings do, where given.", examples=[None]
    )
    reason: str | None = Field(description="Why no settings meet the demand.", examples=[None])
    omega: float | None = Field(
        description="The frequency that forbids it, rad per time unit.", examples=[None]
    )
    advice: list[str] = Field(
        default=[],
        description="How the result may be read and used.",
        examples=[["The units are identical, so the settings may be interchanged: ..."]],
    )
    warnings: list[str] = Field(description="What to look at twice.", examples=[[]])


def tuning_to_json(tuning: Tuning) -> dict[str, Any]:
    """Return the result as the JSON object that `TuningResult` describes."""
    document: dict[str, Any] = encode(tuning)
    document["demand_met"] = tuning.demand_met
    if tuning.spread is not None:
        document["spread"]["worst"] = dict(tuning.spread.worst)
        if tuning.spread.proof is not None:
            document["spread"]["proof"]["deviations"] = dict(tuning.spread.proof.deviations)
    document["search"]["local_optima"] = [
        _optimum_to_json(optimum) for optimum in tuning.search.local_optima
    ]
    return document


def _optimum_to_json(optimum: LocalOptimum) -> dict[str, Any]:
    """Fold equal settings: a thousand units in two groups are two entries."""
    units = Counter(optimum.loops)
    return {
        "value": encode(optimum.value),
        "count": optimum.count,
        "loops": [{**encode(loop), "units": count} for loop, count in units.items()],
    }
