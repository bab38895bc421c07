"""Scenarios of a tuning, and what the settings make of them, as JSON."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

import solver.model.plants
import solver.tuning.scenarios
import solver.tuning.spread
from service.schemas.fields import WHOLE, RequestModel, ResultModel, below
from service.schemas.peaks import CURVES_EXAMPLE, Curves, Guarantee, Peaks
from service.schemas.plants import Plant
from service.schemas.weights import Uncertainty
from solver.model.plants import MAX_UNITS
from solver.tuning.scenarios import LONGEST_NAME, MAX_SCENARIOS

__all__ = ["MAX_SCENARIOS", "ScenarioOutcome", "Spread", "SpreadOutcome", "TuningScenario"]

Count = Annotated[int, Field(ge=1, le=MAX_UNITS, json_schema_extra={"x-unit": "1"}), WHOLE]
Unit = Annotated[
    int, Field(ge=0, lt=MAX_UNITS, json_schema_extra={"x-unit": "1", "x-index": True}), WHOLE
]


class AnyInService(RequestModel):
    """Every set of so many loops."""

    any: Count | Annotated[list[Count], Field(min_length=1, max_length=MAX_UNITS)] = Field(
        description="Number of loops in service, or several such numbers.", examples=[[2, 3, 4]]
    )


class TuningScenario(RequestModel):
    """A further plant, or set of loops in service, that the same settings must serve."""

    name: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)] = Field(
        description="Told in the result.", examples=["any two of four"]
    )
    plant: Plant | None = Field(
        default=None,
        description="The plant with all its loops; null: that of the request.",
        examples=[None],
    )
    uncertainty: Uncertainty | None = Field(
        default=None,
        description="Uncertainty of its inputs; null: that of the request.",
        examples=[None],
    )
    in_service: (
        AnyInService | Annotated[list[Unit], Field(min_length=1, max_length=MAX_UNITS)] | None
    ) = Field(
        default=None,
        description="Units (from 0) whose loops are in service, the others being in manual; or "
        '{"any": k}: every set of k loops; null: all.',
        examples=[{"any": [2, 3, 4]}, [0, 1]],
    )

    def build(self, task: solver.model.plants.Plant) -> solver.tuning.scenarios.Scenario:
        """Return the solver's scenario for a task with the plant `task`."""
        plant = uncertainty = None
        if self.plant is not None:
            with below("/plant"):
                plant = self.plant.build()
        if self.uncertainty is not None:
            with below("/uncertainty"):
                uncertainty = self.uncertainty.build(task.n)
        units = counts = None
        if isinstance(self.in_service, AnyInService):
            given = self.in_service.any
            counts = tuple(given) if isinstance(given, list) else (given,)
        elif self.in_service is not None:
            units = tuple(self.in_service)
        return solver.tuning.scenarios.Scenario(self.name, plant, uncertainty, units, counts)


Deviation = Annotated[float, Field(ge=0, lt=1, json_schema_extra={"x-unit": "1"})]


class Spread(RequestModel):
    """Relative deviations of parameters of the plant, up and down."""

    gain: Deviation = Field(default=0.0, description="Of all gains.", examples=[0.1])
    time_constant: Deviation = Field(
        default=0.0, description="Of all time constants, zeros included.", examples=[0.2]
    )
    dead_time: Deviation = Field(default=0.0, description="Of all dead times.", examples=[0.3])
    interaction: Deviation = Field(
        default=0.0, description="Of the effect of each unit on the others.", examples=[0.02]
    )

    each_unit: bool = Field(
        default=False,
        description="Whether each unit deviates by itself, in all that its input acts on; else "
        "all units together.",
        examples=[False],
    )

    def build(self) -> solver.tuning.spread.Spread:
        """Return the solver's spread."""
        return solver.tuning.spread.Spread(
            self.gain, self.time_constant, self.dead_time, self.interaction, self.each_unit
        )


class SpreadProof(ResultModel):
    """What is proven of all plants of a spread, at all frequencies."""

    level: float = Field(
        description="Of mu of robust performance, which no plant exceeds where nothing is open.",
        examples=[1.0001],
    )
    boxes: int = Field(
        description="Boxes of plants and frequencies that were looked at.", examples=[2124]
    )
    open: int = Field(
        description="Boxes that were left without a proof, all within omega and deviations.",
        examples=[0],
    )
    omega: tuple[float, float | None] | None = Field(
        description="Frequencies of these, rad per time unit; an upper one of null is infinite.",
        examples=[None, [0.01, 0.1]],
    )
    deviations: dict[str, tuple[float, float]] = Field(
        description="Relative deviations of each parameter in them.",
        examples=[{}, {"interaction": [0.015, 0.02]}],
    )
    reason: str | None = Field(
        description="Why not all is proven; null where it is.", examples=[None]
    )


class SpreadOutcome(ResultModel):
    """How densely a spread was searched, the worst plant found in it, and what is proven."""

    plants: int = Field(
        description="Plants looked at beside the corners, for the settings of the result.",
        examples=[71],
    )
    worst: dict[str, float] = Field(
        description="Relative deviation of each parameter in the worst plant, of each unit where "
        "they deviate by themselves.",
        examples=[{"interaction": 0.02}],
    )
    tau_p: float | None = Field(
        description="Least time constant that the settings permit there; null where it was given.",
        examples=[27.67],
    )
    proof: SpreadProof | None = Field(
        default=None,
        description="What is proven of the plants between those that were looked at.",
        examples=[
            {
                "level": 1.0001,
                "boxes": 2124,
                "open": 0,
                "omega": None,
                "deviations": {},
                "reason": None,
            }
        ],
    )


class ScenarioOutcome(ResultModel):
    """What the settings make of one scenario."""

    name: str = Field(
        description="Of the scenario; 'as given' is the plant of the request itself.",
        examples=["any two of four"],
    )
    in_service: list[int] = Field(
        description="Units (from 0) in service, of the worst set where there are several.",
        examples=[[0, 1]],
    )
    sets: int = Field(
        description="Different sets of loops in service; those equal by symmetry count once.",
        examples=[1],
    )
    tau_p: float | None = Field(
        description="Least time constant that the settings permit here alone; null where it was "
        "given.",
        examples=[13.9],
    )
    peaks: Peaks = Field(
        description="Peaks of the worst set, at the tau_p of the result.",
        examples=[
            {
                name: {"value": 1.0, "omega": 0.03}
                for name in ("robust_performance", "robust_stability", "nominal_performance")
            }
        ],
    )
    curves: Curves = Field(
        description="Upper bounds of mu over frequency, of the worst set.",
        examples=[CURVES_EXAMPLE],
    )
    guarantee: Guarantee = Field(
        description="What is proven of all its sets over all frequencies.",
        examples=[{"status": "proven", "level": 1.0001, "reason": None}],
    )
    certificates: list[dict[str, Any]] = Field(
        default=[], description="A proof of each set, where asked for.", examples=[[]]
    )
