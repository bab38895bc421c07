"""Demands on settings beside robust performance, as JSON."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

import solver.tuning.demands
from service.schemas.fields import RequestModel, ResultModel
from solver.model.transfer_function import LARGEST
from solver.tuning.demands import IntegrityDemand

__all__ = ["DemandOutcome", "Demands"]


class Demands(RequestModel):
    """Hard constraints on the settings; null: not asked for."""

    max_controller_gain: (
        Annotated[float, Field(gt=0, le=LARGEST, json_schema_extra={"x-unit": "gain"})] | None
    ) = Field(
        default=None,
        description="Greatest permitted amplification of noise by a controller: |k| for PI and "
        "PIF, 10 |k| for PID, |k| max(1, tau_D/tau_F) for PIDF. In per cent of span per per cent "
        "of span where the instruments give both spans of every loop.",
        examples=[200.0],
    )
    max_load_error: (
        Annotated[float, Field(gt=0, le=LARGEST, json_schema_extra={"x-unit": "time per gain"})]
        | None
    ) = Field(
        default=None,
        description="Greatest permitted integrated error after a unit step of load at a loop's "
        "own input: tau_I/|k|.",
        examples=[1.5],
    )
    max_sensitivity_alone: (
        Annotated[float, Field(gt=1, le=LARGEST, json_schema_extra={"x-unit": "1"})] | None
    ) = Field(
        default=None,
        description="Greatest permitted peak of the sensitivity of each loop with all others in "
        "manual.",
        examples=[1.8],
    )

    integrity: Literal["none", "stable", "robustly_stable"] = Field(
        default="none",
        description="What holds for every set of loops in service, the others being in manual: "
        "stability, or robust stability.",
        examples=["none"],
    )

    def build(self, gain_ratios: tuple[float, ...] | None) -> solver.tuning.demands.Demands:
        """Return the solver's demands; `gain_ratios`: output span over input span of each loop."""
        return solver.tuning.demands.Demands(
            self.max_controller_gain,
            self.max_load_error,
            self.max_sensitivity_alone,
            IntegrityDemand(self.integrity),
            None if self.max_controller_gain is None else gain_ratios,
        )


class DemandOutcome(ResultModel):
    """What the settings make of one demand."""

    name: str = Field(description="Name of the demand.", examples=["max_load_error"])
    limit: float = Field(description="What was asked for.", examples=[1.5])
    value: float | None = Field(
        description="What the worst loop has; null where it has no bound.", examples=[1.5]
    )
    met: bool = Field(description="Whether the value is within the limit.", examples=[True])
    active: bool = Field(
        description="Whether the demand binds: the value is at its limit.", examples=[True]
    )
