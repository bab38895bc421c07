"""Derive a plant from physical data.

Return the plant of a stream split, cooled reactors, heat exchangers, compressors, burner passes or
a blender from its physical data, with its interaction a and the limits of a for such equipment.
"""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, JsonValue

from service.analysis import Analysis, always
from service.printing import Grid, Line, Part
from service.schemas.fields import AnalysisRequest, ResultModel, below
from service.schemas.transfer_functions import plant_document
from service.wording import number
from solver.model.errors import InvalidInputError
from solver.model.parallel_equipment import BurnerPasses, ParallelCompressors, ParallelExchangers
from solver.model.physical_models import Blender, CooledReactors, StreamSplit
from solver.model.plants import MAX_UNITS, ParallelPlant
from solver.model.transfer_function import LARGEST

__all__ = ["ANALYSIS", "EXAMPLE", "PhysicalModelRequest", "PhysicalModelResult"]

Equipment = (
    StreamSplit | CooledReactors | ParallelExchangers | ParallelCompressors | BurnerPasses | Blender
)
_KINDS: dict[str, type[Equipment]] = {
    "stream_split": StreamSplit,
    "cooled_reactors": CooledReactors,
    "exchangers": ParallelExchangers,
    "compressors": ParallelCompressors,
    "burner_passes": BurnerPasses,
    "blender": Blender,
}


def _names(kind: type[Equipment]) -> dict[str, bool]:
    """Return the names of the data, and whether each must be given."""
    return {
        field.name: field.default is dataclasses.MISSING
        for field in dataclasses.fields(kind)
        if field.name != "n"
    }


def _listed() -> str:
    texts = []
    for name, kind in _KINDS.items():
        known = ", ".join(key if needed else f"{key} (0)" for key, needed in _names(kind).items())
        texts.append(f"{name}: {known}")
    return ". ".join(texts)


_DATA: dict[str, JsonValue] = {
    "head_per_speed": 3.0,
    "head_per_flow": 2.0,
    "inertia": 1.0,
    "consumer_resistance": 2.5,
    "header_time": 6.0,
}
EXAMPLE: dict[str, JsonValue] = {"kind": "compressors", "n": 3, "data": _DATA}


class PhysicalModelRequest(AnalysisRequest):
    """Ask for the plant of a piece of equipment."""

    kind: Literal[
        "stream_split", "cooled_reactors", "exchangers", "compressors", "burner_passes", "blender"
    ] = Field(description="What it is.", examples=["compressors"])
    n: Annotated[int, Field(ge=1, le=MAX_UNITS, json_schema_extra={"x-unit": "1"})] = Field(
        default=2, description="Number of units; a blender has two streams.", examples=[3]
    )
    data: dict[str, Annotated[float, Field(ge=-LARGEST, le=LARGEST)]] = Field(
        description=f"Physical data in any consistent set of units. {_listed()}.",
        examples=[_DATA],
        json_schema_extra={"x-unit": "consistent"},
    )

    # The names of the data depend on the equipment, which a form of the page does not know.
    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE], "x-form": False})

    def build(self) -> Equipment:
        """Return the solver's model.

        Raises
        ------
        InvalidInputError
            Data that are missing, unknown or without meaning, by pointer into this request.

        """
        kind = _KINDS[self.kind]
        names = _names(kind)
        for name in self.data:
            if name not in names:
                message = f"unknown; {self.kind} takes {', '.join(names)}"
                raise InvalidInputError(message, f"/data/{name}")
        for name, needed in names.items():
            if needed and name not in self.data:
                message = f"{name} is missing"
                raise InvalidInputError(message, "/data")
        if self.kind == "blender" and self.n != 2:
            message = "a blender has two streams"
            raise InvalidInputError(message, "/n")
        arguments: dict[str, Any] = dict(self.data)
        if self.kind != "blender":
            arguments["n"] = self.n
        with below("/data"):
            return kind(**arguments)


class PhysicalModelResult(ResultModel):
    """The plant of a piece of equipment."""

    plant: dict[str, Any] = Field(
        description="As a tuning request takes it.", examples=[{"kind": "parallel", "n": 3}]
    )
    interaction: float | None = Field(
        description="a: static effect on a neighbour relative to that on the unit itself; null: of "
        "a blender, or one unit.",
        examples=[-0.357],
    )
    limits: list[float] | None = Field(
        description="Least and greatest a that such equipment can have.", examples=[[-0.5, 0.0]]
    )


def compute(request: PhysicalModelRequest) -> dict[str, Any]:
    """Return the plant."""
    model = request.build()
    with below("/data"):
        plant = model.plant()
    interaction = limits = None
    if isinstance(plant, ParallelPlant) and plant.n > 1:
        interaction = plant.interaction.static_gain / plant.process.static_gain
        if isinstance(model, StreamSplit):
            limits = [-1 / (plant.n - 1), 0.0]
        elif isinstance(model, CooledReactors):
            limits = [-1 / (plant.n - 1), 1.0]
        elif not isinstance(model, Blender):
            limits = list(model.interaction_limits)
    return {"plant": plant_document(plant), "interaction": interaction, "limits": limits}


def table(result: PhysicalModelResult) -> list[Part]:
    """Return the transfer functions and a."""
    named = (
        [("g", result.plant["process"]), ("i", result.plant["interaction"])]
        if result.plant["kind"] == "parallel"
        else [
            (f"output {r + 1}, input {c + 1}", element)
            for r, row in enumerate(result.plant["elements"])
            for c, element in enumerate(row)
        ]
    )
    rows = [
        (
            name,
            ", ".join(number(v, 5) for v in function["num"]),
            ", ".join(number(v, 5) for v in function["den"]),
            number(function["dead_time"], 5),
        )
        for name, function in named
    ]
    parts: list[Part] = [Grid(("element", "numerator", "denominator", "dead time"), rows)]
    if result.interaction is not None and result.limits is not None:
        low, high = (number(v, 4) for v in result.limits)
        text = f"Interaction a = {number(result.interaction, 4)}; such equipment: {low} to {high}."
        parts.append(Line(text, "strong"))
    return parts


ANALYSIS = Analysis(
    name="physical_model",
    resource="physical-models",
    text=__doc__,
    outcome="The plant.",
    request=PhysicalModelRequest,
    result=PhysicalModelResult,
    compute=compute,
    table=table,
    immediate=always,
)
