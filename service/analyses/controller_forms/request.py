"""What is asked: controllers, what they are typed into, and the plant they are judged on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import ConfigDict, Field, JsonValue

import solver.model.plants
import solver.model.weights
from service.schemas.arrangement import ArrangedRequest
from service.schemas.fields import (
    WHOLE,
    RequestModel,
    below,
)
from service.schemas.given_loops import default_scales
from service.schemas.loop_forms import GivenLoop
from service.schemas.plants import Plant
from service.schemas.weights import Performance, Uncertainty
from service.wording import TIME_UNIT
from solver.hand_over.conversion import MAX_DIGITS, Scales
from solver.hand_over.known import KNOWN
from solver.hand_over.law import FilterEntry, Form, GainEntry, IntegralEntry, Law, Names
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MAX_UNITS

__all__ = ["ControllerFormsRequest", "FormsTask", "HandOver"]

_LOOPS: JsonValue = [
    {"gain": 46.3, "integral_time": 101.0, "derivative_time": None},
    {"gain": 22.8, "integral_time": 3.15, "derivative_time": None},
]
SECONDS = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("min", "minute", "minutes"), 60.0),
    **dict.fromkeys(("h", "hr", "hour", "hours"), 3600.0),
    **dict.fromkeys(("d", "day", "days"), 86400.0),
}  # units of time that can be converted


class Target(RequestModel):
    """The control system that the settings are typed into: a known one, or its form and units."""

    controller: str | None = Field(
        default=None,
        description="Name of a known controller, see GET /v1/controllers; null: the fields below.",
        examples=["deltav_standard"],
    )
    form: Literal["cascade", "ideal", "parallel"] | None = Field(
        default=None, description="Form of the law.", examples=[None, "ideal"]
    )
    gain: Literal["gain", "proportional_band"] = Field(
        default="gain", description="Gain, or proportional band in per cent.", examples=["gain"]
    )
    integral: Literal["time", "repeats"] = Field(
        default="time",
        description="Integral time, or repeats per unit of time.",
        examples=["time"],
    )
    time_unit: Literal["s", "min"] | None = Field(
        default=None,
        description="Unit of typed times; null: that of the request.",
        examples=[None, "s"],
    )
    filter: Literal["ratio", "time", "gain", "measurement"] = Field(
        default="ratio",
        description="Filter of the derivative as a part of the derivative time, as a time, as "
        "derivative time over filter time, or as a time of a filter on the measurement.",
        examples=["ratio"],
    )
    digits: Annotated[int, Field(ge=1, le=MAX_DIGITS), WHOLE] = Field(
        default=4,
        description="Significant digits that are typed.",
        examples=[4],
        json_schema_extra={"x-unit": "1"},
    )

    def law(self) -> tuple[Law, str | None, str]:
        """Return the law, the unit of typed times and the equation.

        Raises
        ------
        InvalidInputError
            A controller that nobody knows, or a form without such settings.

        """
        if (self.controller is None) == (self.form is None):
            message = "give either the name of a controller or a form"
            raise InvalidInputError(message, "")
        if self.form is not None:
            gains = Names(gain="Kp", integral="Ki", derivative="Kd")
            form = Form(self.form)
            law = Law(
                form=form,
                gain=GainEntry(self.gain),
                integral=IntegralEntry(self.integral),
                filter=FilterEntry(self.filter),
                names=gains if form is Form.PARALLEL else Names(),
            )
            return law, self.time_unit, law.equation
        for known in KNOWN:
            if known.name == self.controller:
                return known.law, known.time_unit, known.equation
        message = f"no such controller; known are {', '.join(known.name for known in KNOWN)}"
        raise InvalidInputError(message, "/controller")


@dataclass(frozen=True)
class HandOver:
    """How settings are typed: the law, the scales of each loop, digits, unit and equation."""

    law: Law
    scales: tuple[Scales, ...]
    digits: int
    unit: str
    equation: str
    has_spans: bool


@dataclass(frozen=True)
class FormsTask:
    """Controllers, how they are typed, and the plant that the typed ones are judged on."""

    loops: tuple[Controller, ...]
    hand_over: HandOver | None
    plant: solver.model.plants.Plant | None
    uncertainty: solver.model.weights.Uncertainty | None
    performance: solver.model.weights.Performance | None


class ControllerFormsRequest(ArrangedRequest):
    """Ask for the ideal and parallel forms of controllers, or for what is typed of them."""

    loops: Annotated[tuple[GivenLoop, ...], Field(min_length=1, max_length=MAX_UNITS)] = Field(
        description="Controllers, each in any form.", examples=[_LOOPS]
    )
    target: Target | None = Field(
        default=None,
        description="What they are typed into; null: the three forms alone.",
        examples=[{"controller": "deltav_standard"}],
    )
    plant: Plant | None = Field(
        default=None,
        description="The plant: the typed values are judged on it; null: they are not.",
        examples=[None],
    )
    uncertainty: Uncertainty | None = Field(
        default=None, description="With a plant: its uncertainty.", examples=[None]
    )
    performance: Performance | None = Field(
        default=None, description="With a plant: the demand, with tau_p.", examples=[None]
    )

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "loops": _LOOPS,
                    "time_unit": "min",
                    "instruments": [{"output_span": 100.0, "input_span": 100.0}],
                    "target": {"controller": "deltav_standard"},
                }
            ]
        }
    )

    def build(self) -> FormsTask:
        """Return the solver's controllers, law, plant and weights.

        Raises
        ------
        InvalidInputError
            A value that no controller can have, by pointer into this request.

        """
        loops = []
        for index, loop in enumerate(self.loops):
            with below(f"/loops/{index}"):
                loops.append(loop.build())
        hand_over = None if self.target is None else self._hand_over(self.target, len(loops))
        plant, uncertainty, performance = self._judges(len(loops))
        return FormsTask(tuple(loops), hand_over, plant, uncertainty, performance)

    def _judges(
        self, count: int
    ) -> tuple[
        solver.model.plants.Plant | None,
        solver.model.weights.Uncertainty | None,
        solver.model.weights.Performance | None,
    ]:
        if self.plant is None:
            return None, None, None
        for name in ("target", "uncertainty", "performance"):
            if getattr(self, name) is None:
                message = "needed where a plant is given"
                raise InvalidInputError(message, f"/{name}")
        with below("/plant"):
            given = self.plant.build()
        plant = self.arranged(given)
        if count != plant.n:
            message = f"{count} loops for a plant of {plant.n} units"
            raise InvalidInputError(message, "/loops")
        with below("/uncertainty"):
            uncertainty = self.uncertainty.build(plant.n) if self.uncertainty else None
        scales = None
        if uncertainty is not None and self.mixing is None:
            scales = default_scales(self, plant.n, uncertainty)
        with below("/performance"):
            performance = self.performance.build(scales) if self.performance else None
        if performance is None or performance.tau_p is None:
            message = "an analysis needs a time constant"
            raise InvalidInputError(message, "/performance/tau_p")
        return plant, uncertainty and uncertainty.paired(self.pairing), performance

    def _hand_over(self, target: Target, count: int) -> HandOver:
        with below("/target"):
            law, unit, equation = target.law()
        time = 1.0
        if unit is not None:
            seconds = SECONDS.get(self.time_unit or "")
            if seconds is None:
                message = (
                    f"the unit of the given times is needed, to type them in {unit}: s, min, h or d"
                )
                raise InvalidInputError(message, "/time_unit")
            time = seconds / SECONDS[unit]
        instruments = self.signals(count)
        scales = []
        for index, signals in enumerate(instruments):
            spans = signals.output_span, signals.input_span
            if (spans[0] is None) != (spans[1] is None):
                missing = "output_span" if spans[0] is None else "input_span"
                place = 0 if self.instruments is not None and len(self.instruments) == 1 else index
                message = "needed beside the other span: a gain in per cent takes both"
                raise InvalidInputError(message, f"/instruments/{place}/{missing}")
            scales.append(Scales(gain=(spans[0] or 1.0) / (spans[1] or 1.0), time=time))
        return HandOver(
            law,
            tuple(scales),
            target.digits,
            unit or self.time_unit or TIME_UNIT,
            equation,
            all(signals.output_span is not None for signals in instruments),
        )
