"""What a demand costs: the same tuning over a range of uncertainties or permitted peaks."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Literal

from pydantic import BaseModel, Field

import solver.tuning
from service.schemas import TuningRequest, parse
from service.tuned import Tuned
from solver.results import Progress

__all__ = ["Parameter", "TradeOff", "TradeOffPoint", "sweep"]

Parameter = Literal["epsilon", "max_peak"]
MAX_POINTS = 200
_GROUPS: dict[Parameter, str] = {"epsilon": "uncertainty", "max_peak": "performance"}


class TradeOffPoint(BaseModel):
    """What is reached at one value of the parameter; null where no settings meet the demand."""

    value: float = Field(description="Value of the parameter.", examples=[0.2])
    tau_p: float | None = Field(
        description="Closed-loop time constant of the best settings.", examples=[18.45]
    )
    identical: float | None = Field(
        default=None, description="That of the best identical settings.", examples=[25.77]
    )


class TradeOff(BaseModel):
    """What is reached over a range of one parameter."""

    parameter: Parameter = Field(
        description="epsilon: the inputs' relative error; max_peak: the permitted peak of the "
        "sensitivity.",
        examples=["epsilon"],
    )
    points: list[TradeOffPoint] = Field(
        max_length=MAX_POINTS,
        description="The points, in the order of their values.",
        examples=[[{"value": 0.2, "tau_p": 18.45, "identical": 25.77}]],
    )


def sweep(
    request: TuningRequest,
    parameter: Parameter,
    values: Sequence[float],
    progress: Callable[[Progress], None] | None = None,
) -> TradeOff:
    """Tune `request` at each value of `parameter`.

    Parameters
    ----------
    request : TuningRequest
        Objective tau_p; for epsilon its uncertainty is given by epsilon and theta.
    parameter, values
        What is varied.
    progress : callable or None
        As for `solver.tuning.tune`, of each tuning in turn.

    Raises
    ------
    RequestError, InvalidInputError
        A value that the request cannot have.

    """
    points = []
    for value in sorted(values):
        document = request.model_dump(mode="json")
        document[_GROUPS[parameter]][parameter] = value
        varied = parse(TuningRequest, json.dumps(document))
        result = Tuned.of(varied, solver.tuning.tune(varied.build(), progress)).result
        comparison = result.comparison
        alone = comparison.identical_value if comparison else None
        points.append(TradeOffPoint(value=value, tau_p=result.tau_p, identical=alone))
    return TradeOff(parameter=parameter, points=points)
