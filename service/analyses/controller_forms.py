"""Convert controllers to other forms.

Return the ideal and parallel forms of controllers in cascade form.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, JsonValue

from service.analysis import Analysis
from service.printing import Part, form_parts
from service.schemas.controllers import IdealForm, Loop, ParallelForm
from service.schemas.encoding import encode
from service.schemas.fields import AnalysisRequest, IdentifiedResult, below
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MAX_UNITS

__all__ = ["ANALYSIS", "ControllerFormsRequest", "ControllerFormsResult"]

_LOOPS: JsonValue = [
    {"gain": 46.3, "integral_time": 101.0, "derivative_time": None},
    {"gain": 22.8, "integral_time": 3.15, "derivative_time": None},
]


class ControllerFormsRequest(AnalysisRequest):
    """Ask for the ideal and parallel forms of controllers."""

    loops: Annotated[tuple[Loop, ...], Field(min_length=1, max_length=MAX_UNITS)] = Field(
        description="Controllers in cascade form.", examples=[_LOOPS]
    )

    model_config = ConfigDict(json_schema_extra={"examples": [{"loops": _LOOPS}]})

    def build(self) -> tuple[Controller, ...]:
        """Return the solver's controllers.

        Raises
        ------
        InvalidInputError
            A value that no controller can have, by pointer into this request.

        """
        loops = []
        for index, loop in enumerate(self.loops):
            with below(f"/loops/{index}"):
                loops.append(loop.build())
        return tuple(loops)


class ControllerForms(BaseModel):
    """One controller in its three forms: the same transfer function, filter included."""

    cascade: Loop = Field(
        description="Cascade form, as given.",
        examples=[{"gain": 46.3, "integral_time": 101.0, "derivative_time": None}],
    )
    ideal: IdealForm | None = Field(
        description="Ideal form; null where none exists, see reason.",
        examples=[
            {"gain": 46.3, "integral_time": 101.0, "derivative_time": 0.0, "filter_time": 0.0}
        ],
    )
    parallel: ParallelForm | None = Field(
        description="Parallel form; null where none exists, see reason.",
        examples=[
            {
                "proportional_gain": 46.3,
                "integral_gain": 0.458,
                "derivative_gain": 0.0,
                "filter_time": 0.0,
            }
        ],
    )
    reason: str | None = Field(description="Why a form does not exist.", examples=[None])


class ControllerFormsResult(IdentifiedResult):
    """Controllers in their forms."""

    forms: list[ControllerForms] = Field(
        description="One entry a controller, in the order given.", examples=[[]]
    )


def compute(request: ControllerFormsRequest) -> dict[str, Any]:
    """Return the forms of the request's controllers."""
    return {"forms": [_forms(loop) for loop in request.build()]}


def _forms(loop: Controller) -> dict[str, Any]:
    ideal = parallel = reason = None
    try:
        ideal, parallel = encode(asdict(loop.to_ideal())), encode(asdict(loop.to_parallel()))
    except InvalidInputError as error:
        reason = error.message
    return {"cascade": encode(asdict(loop)), "ideal": ideal, "parallel": parallel, "reason": reason}


def table(result: ControllerFormsResult) -> list[Part]:
    """Return the controllers in each form."""
    loops = [(str(index + 1), each.cascade.build()) for index, each in enumerate(result.forms)]
    return list(form_parts(loops))


ANALYSIS = Analysis(
    name="controller_forms",
    resource="controller-forms",
    text=__doc__,
    outcome="The forms.",
    request=ControllerFormsRequest,
    result=ControllerFormsResult,
    compute=compute,
    table=table,
    immediate=True,
)
