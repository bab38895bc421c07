"""What a demand costs: the same tuning over a range of uncertainties or permitted peaks."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence

from service.schemas import TuningRequest, parse
from service.schemas.trade_off import Parameter, TradeOff, TradeOffPoint
from service.tuned import Tuned
from solver.tuning.record import Progress

__all__ = ["sweep"]

_GROUPS: dict[Parameter, str] = {"epsilon": "uncertainty", "max_peak": "performance"}


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
        As for `solver.tuning.tuner.tune`, of each tuning in turn.

    Raises
    ------
    RequestError, InvalidInputError
        A value that the request cannot have.

    """
    from solver.tuning import tuner  # noqa: PLC0415 - compiled kernels, where tunings run alone

    points = []
    for value in sorted(values):
        document = request.model_dump(mode="json")
        document[_GROUPS[parameter]][parameter] = value
        varied = parse(TuningRequest, json.dumps(document))
        result = Tuned.of(varied, tuner.tune(varied.build(), progress)).result
        comparison = result.comparison
        alone = comparison.identical_value if comparison else None
        points.append(TradeOffPoint(value=value, tau_p=result.tau_p, identical=alone))
    return TradeOff(parameter=parameter, points=points)
