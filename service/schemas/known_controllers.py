"""Known control systems as JSON."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, Field

from solver.hand_over.known import KNOWN, KnownController

__all__ = ["KnownControllerEntry", "KnownControllerList", "known_controllers"]


class KnownControllerEntry(BaseModel):
    """A control system's PID block."""

    name: str = Field(description="Name, unique.", examples=["deltav_standard"])
    title: str = Field(
        description="Maker, system and block.",
        examples=["Emerson DeltaV, PID block, FORM Standard"],
    )
    form: Literal["cascade", "ideal", "parallel"] = Field(
        description="Form of its law.", examples=["ideal"]
    )
    gain: Literal["gain", "proportional_band"] = Field(
        description="How the gain is typed, in per cent of span.", examples=["gain"]
    )
    integral: Literal["time", "repeats"] = Field(
        description="How integral action is typed.", examples=["time"]
    )
    time_unit: Literal["s", "min"] = Field(description="Unit of typed times.", examples=["s"])
    filter: Literal["ratio", "time", "gain", "measurement"] = Field(
        description="How the filter is typed.", examples=["ratio"]
    )
    filter_rule: str = Field(
        description="How the derivative is filtered.", examples=["fixed at 0.1 RATE"]
    )
    equation: str = Field(
        description="Its law, from the deviation to the output, both in per cent of span.",
        examples=["GAIN*(1 + 1/(RESET*s) + RATE*s/(1 + ALPHA*RATE*s))"],
    )
    source: str = Field(description="Where that is published.", examples=["DeltaV Books Online"])
    remark: str | None = Field(description="What else has to be set.", examples=[None])


class KnownControllerList(BaseModel):
    """Known control systems."""

    items: list[KnownControllerEntry] = Field(description="By maker.", examples=[[]])


def known_controllers() -> list[dict[str, Any]]:
    """Return the known controllers as JSON values."""
    return [_entry(known) for known in KNOWN]


def _entry(known: KnownController) -> dict[str, Any]:
    return {
        "name": known.name,
        "title": known.title,
        "form": str(known.law.form),
        "gain": str(known.law.gain),
        "integral": str(known.law.integral),
        "time_unit": known.time_unit,
        "filter": str(known.law.filter),
        "filter_rule": known.filter_rule,
        "equation": known.equation,
        "source": known.source,
        "remark": known.remark,
    }
