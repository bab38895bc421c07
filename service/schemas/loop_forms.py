"""Settings of a loop as requests take them: in cascade, ideal or parallel form."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag

import solver.model.controllers
from service.schemas.controllers import Loop
from service.schemas.fields import Gain, PositiveTime, RequestModel, Time, below
from solver.model.errors import InvalidInputError

__all__ = [
    "FORM_UNKNOWN",
    "CascadeLoop",
    "GivenLoop",
    "IdealLoop",
    "ParallelLoop",
    "by_form",
    "given_loops",
]

FORM_UNKNOWN = "loop_form"  # kind of error
_GAINS = {"integral_time": "integral_gain", "derivative_time": "derivative_gain"}
_FILTER = (
    "T_f of the derivative; null or 0: the filter time is a tenth of the derivative time of the "
    "cascade form."
)


class CascadeLoop(Loop):
    """Settings in cascade form, k (1 + tau_I s)/(tau_I s) (1 + tau_D s)/(1 + tau_F s)."""

    form: Literal["cascade"] = Field(
        default="cascade", description="Form of the law.", examples=["cascade"]
    )


class IdealLoop(RequestModel):
    """Settings in ideal (ISA) form, K (1 + 1/(T_i s) + T_d s/(1 + T_f s))."""

    form: Literal["ideal"] = Field(description="Form of the law.", examples=["ideal"])
    gain: Gain = Field(description="K, not zero.", examples=[46.3])
    integral_time: PositiveTime | None = Field(
        description="T_i; null for P and PD.", examples=[101.0, None]
    )
    derivative_time: Time | None = Field(
        default=None,
        description="T_d; null or 0 for P and PI. Beyond about a quarter of T_i there is no "
        "cascade form.",
        examples=[None, 5.0],
    )
    filter_time: Time | None = Field(default=None, description=_FILTER, examples=[None, 0.5])

    def build(self) -> solver.model.controllers.Controller:
        """Return the solver's controller."""
        ideal = solver.model.controllers.IdealForm(
            self.gain, self.integral_time, self.derivative_time or 0.0, self.filter_time or 0.0
        )
        return solver.model.controllers.Controller.from_ideal(ideal)


class ParallelLoop(RequestModel):
    """Settings in parallel form, K_p + K_i/s + K_d s/(1 + T_f s); the gains have one sign."""

    form: Literal["parallel"] = Field(description="Form of the law.", examples=["parallel"])
    proportional_gain: Gain = Field(description="K_p, not zero.", examples=[46.3])
    integral_gain: Gain | None = Field(
        description="K_i, per unit of time; null or 0 for P and PD.",
        examples=[0.458, None],
        json_schema_extra={"x-unit": "gain/time"},
    )
    derivative_gain: Gain | None = Field(
        default=None,
        description="K_d, times the unit of time; null or 0 for P and PI.",
        examples=[None, 230.0],
        json_schema_extra={"x-unit": "gain*time"},
    )
    filter_time: Time | None = Field(default=None, description=_FILTER, examples=[None, 0.5])

    def build(self) -> solver.model.controllers.Controller:
        """Return the solver's controller."""
        parallel = solver.model.controllers.ParallelForm(
            self.proportional_gain,
            self.integral_gain or 0.0,
            self.derivative_gain or 0.0,
            self.filter_time or 0.0,
        )
        try:
            return solver.model.controllers.Controller.from_parallel(parallel)
        except InvalidInputError as error:
            name = error.field.removeprefix("/")
            if name not in _GAINS:
                raise
            message = f"{error.message}, where integral_time = K_p/K_i, derivative_time = K_d/K_p"
            raise InvalidInputError(message, f"/{_GAINS[name]}") from None


def _form_of(value: Any) -> str:  # noqa: ANN401 - whatever the caller sent
    """Tell the form of given settings; cascade where they name none."""
    given = value.get("form", "cascade") if isinstance(value, dict) else None
    return str(given or getattr(value, "form", "cascade"))


def by_form() -> Discriminator:
    """Return what tells the forms of a loop apart."""
    return Discriminator(
        _form_of,
        custom_error_type=FORM_UNKNOWN,
        custom_error_message="the form of a loop is cascade, ideal or parallel",
    )


GivenLoop: TypeAlias = Annotated[
    Annotated[CascadeLoop, Tag("cascade")]
    | Annotated[IdealLoop, Tag("ideal")]
    | Annotated[ParallelLoop, Tag("parallel")],
    by_form(),
]


def given_loops(
    loops: Iterable[CascadeLoop | IdealLoop | ParallelLoop], where: str
) -> tuple[solver.model.controllers.Controller, ...]:
    """Return the solver's controllers; an error points below `where`."""
    found = []
    for index, loop in enumerate(loops):
        with below(f"{where}/{index}"):
            found.append(loop.build())
    return tuple(found)
