"""Controllers as JSON: settings of one loop, and what a tuning may choose."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field

import solver.model.controllers
import solver.tuning.resolution
import solver.tuning.specification
from service.schemas.fields import SMALLEST, WHOLE, Gain, PositiveTime, RequestModel, Time
from solver.model.plants import MAX_UNITS
from solver.model.transfer_function import LARGEST
from solver.tuning.resolution import MAX_DIGITS

__all__ = [
    "Bounds",
    "ControllerChoice",
    "IdealForm",
    "Loop",
    "ParallelForm",
    "Resolution",
]

_LARGEST_BOUND = 1e9  # as solver.tuning.specification.Bounds


class Loop(RequestModel):
    """Settings of one loop, c(s) = k (1 + tau_I s)/(tau_I s) (1 + tau_D s)/(1 + tau_F s)."""

    gain: Gain = Field(description="Controller gain k, not zero.", examples=[46.3])
    integral_time: PositiveTime | None = Field(
        description="Integral time tau_I; null for P and PD.", examples=[101.0, None]
    )
    derivative_time: PositiveTime | None = Field(
        default=None, description="Derivative time tau_D; null for P and PI.", examples=[None, 5.0]
    )
    filter_time: PositiveTime | None = Field(
        default=None,
        description="Filter time tau_F; null: 0.1 tau_D, and no filter where there is no tau_D.",
        examples=[None, 0.5],
    )

    def build(self) -> solver.model.controllers.Controller:
        """Return the solver's controller."""
        return solver.model.controllers.Controller(
            self.gain, self.integral_time, self.derivative_time, self.filter_time
        )


class IdealForm(BaseModel):
    """Ideal (ISA) form, K (1 + 1/(T_i s) + T_d s/(1 + T_f s))."""

    gain: float = Field(description="K.", examples=[46.3])
    integral_time: float | None = Field(
        description="T_i; null without integral action.", examples=[101.0]
    )
    derivative_time: float = Field(description="T_d; 0 for PI.", examples=[0.0])
    filter_time: float = Field(description="T_f.", examples=[0.0])


class ParallelForm(BaseModel):
    """Parallel form, K_p + K_i/s + K_d s/(1 + T_f s)."""

    proportional_gain: float = Field(description="K_p.", examples=[46.3])
    integral_gain: float = Field(description="K_i.", examples=[0.458])
    derivative_gain: float = Field(description="K_d; 0 for PI.", examples=[0.0])
    filter_time: float = Field(description="T_f.", examples=[0.0])


def _range(unit: str) -> object:
    return Field(min_length=2, max_length=2, json_schema_extra={"x-unit": unit})


Limit = Annotated[float, Field(ge=SMALLEST, le=_LARGEST_BOUND)]
GainRange = Annotated[tuple[Limit, Limit], _range("gain")]
TimeRange = Annotated[tuple[Limit, Limit], _range("time")]


class Bounds(RequestModel):
    """Permitted range [low, high] of each parameter; null: chosen from the plant."""

    gain: GainRange | None = Field(
        default=None, description="Range of the gain's magnitude.", examples=[[0.1, 1000.0]]
    )
    integral_time: TimeRange | None = Field(
        default=None, description="Range of the integral time.", examples=[[0.5, 500.0]]
    )
    derivative_time: TimeRange | None = Field(
        default=None, description="Range of the derivative time.", examples=[[0.05, 50.0]]
    )

    filter_time: TimeRange | None = Field(
        default=None,
        description="Range of the filter time, for PIF and PIDF.",
        examples=[[0.05, 50.0]],
    )

    def build(self) -> solver.tuning.specification.Bounds:
        """Return the solver's bounds."""
        return solver.tuning.specification.Bounds(
            self.gain, self.integral_time, self.derivative_time, self.filter_time
        )


class Resolution(RequestModel):
    """Numbers that the control system accepts: significant digits, or steps."""

    digits: Annotated[int, Field(ge=1, le=MAX_DIGITS, json_schema_extra={"x-unit": "1"}), WHOLE] | (
        None
    ) = Field(
        default=None,
        description="Significant digits of every setting; instead of steps.",
        examples=[3],
    )
    gain: (
        Annotated[float, Field(ge=SMALLEST, le=LARGEST, json_schema_extra={"x-unit": "gain"})]
        | None
    ) = Field(default=None, description="Step of the gain; null: any number.", examples=[0.1])
    time: PositiveTime | None = Field(
        default=None, description="Step of the times; null: any number.", examples=[0.01]
    )

    def build(self) -> solver.tuning.resolution.Resolution:
        """Return the solver's resolution."""
        return solver.tuning.resolution.Resolution(self.digits, self.gain, self.time)


UnitIndex = Annotated[int, Field(ge=0, lt=MAX_UNITS, json_schema_extra={"x-index": True}), WHOLE]
GroupSize = Annotated[int, Field(ge=1, le=MAX_UNITS), WHOLE]


class ControllerChoice(RequestModel):
    """Which controllers the tuning may use."""

    kind: Literal["PI", "PID", "PIF", "PIDF"] = Field(
        default="PI",
        description="Controller kind, in cascade form; with F the filter time is free too, else "
        "it is 0.1 tau_D.",
        examples=["PI"],
    )
    arrangement: Literal["identical", "independent", "grouped", "best"] = Field(
        default="independent",
        description="Which loops share settings: all (identical), none (independent: the "
        "literature's different controllers), those of a group (grouped, with groups or "
        "group_sizes), or as found best (best).",
        examples=["independent"],
    )
    group_sizes: (
        Annotated[tuple[GroupSize, ...], Field(min_length=1, max_length=MAX_UNITS)] | None
    ) = Field(
        default=None,
        description="Sizes of the groups, summing to n; for the arrangement grouped only.",
        examples=[None, [1, 1]],
        json_schema_extra={"x-unit": "1"},
    )
    groups: (
        Annotated[
            tuple[Annotated[tuple[UnitIndex, ...], Field(min_length=1)], ...], Field(min_length=1)
        ]
        | None
    ) = Field(
        default=None,
        description="Loops, from 0, of each group, each loop once; for the arrangement grouped, "
        "instead of group_sizes.",
        examples=[None, [[0, 2], [1, 3]]],
        json_schema_extra={"x-unit": "1"},
    )
    scan_time: Time = Field(
        default=0.0,
        description="Time between two scans of a digital controller; 3/2 of it is dead time in "
        "every loop, for hold and computation.",
        examples=[0.0],
    )
    bounds: Bounds = Field(
        default=Bounds(), description="Permitted ranges of the parameters.", examples=[{}]
    )
    signs: Literal["usual", "any"] = Field(
        default="usual",
        description="Signs of the gains. usual: those of the loops' own processes, which loops "
        "need that are to run alone; any: others are tried too where those permit no settings.",
        examples=["usual"],
    )
    resolution: Resolution | None = Field(
        default=None,
        description="Numbers that the control system accepts, in cascade form: the best settings "
        "among them are returned, and what that costs. null: any numbers.",
        examples=[None, {"digits": 3}],
    )
