"""What a demand costs: the same tuning over a range of one of its fields, or of two."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from service.batch.sweep import Variation, expand
from service.schemas import RequestError, TuningRequest, canonical, parse_tuning_request
from service.schemas.parsing import Fault
from service.schemas.trade_off import TradeOff, TradeOffPoint
from service.tuned import RequestedTuning
from solver.tuning.record import Progress

__all__ = ["Collected", "sweep"]


class Collected:
    """The points of a sweep, gathered from its results.

    Parameters
    ----------
    variations : sequence of Variation
        One field of numbers, or two: a curve for each value of the other.

    Raises
    ------
    RequestError
        No figure shows that.

    """

    def __init__(self, variations: Sequence[Variation]) -> None:
        numeric = [each for each in variations if all(map(_is_number, each.values))]
        if not numeric or len(variations) > 2:
            message = "a figure shows one field of numbers, and one more as curves"
            raise RequestError((Fault("", message),))
        self._along = max(numeric, key=lambda each: len(each.values))
        self._others = [each for each in variations if each is not self._along]
        self._points: list[TradeOffPoint] = []

    def add(self, fields: Mapping[str, Any], result: Mapping[str, Any] | None) -> None:
        """Add what was found for a request.

        Parameters
        ----------
        fields : mapping
            The request as JSON values.
        result : mapping or None
            The result; None where there is none.

        """
        found = result or {}
        by = [_value(fields, each.name) for each in self._others]
        point = TradeOffPoint(
            value=float(_value(fields, self._along.name)),
            tau_p=found.get("tau_p"),
            identical=(found.get("comparison") or {}).get("identical_value"),
            by=by[0] if by else None,
        )
        self._points.append(point)

    def trade_off(self) -> TradeOff:
        """Return the points, in the order of their values."""
        points = sorted(self._points, key=lambda point: point.value)
        by = self._others[0].name if self._others else None
        return TradeOff(parameter=self._along.name, by=by, points=points)


def sweep(
    request: TuningRequest,
    field: str,
    values: Sequence[float],
    progress: Callable[[Progress], None] | None = None,
) -> TradeOff:
    """Tune `request` at each value of a field, in this process.

    Parameters
    ----------
    request : TuningRequest
        Objective tau_p.
    field : str
        Dotted name of what is varied, as ``uncertainty.epsilon``.
    values : sequence of float
        Its values.
    progress : callable or None
        As for `solver.tuning.tuner.tune`, of each tuning in turn.

    Raises
    ------
    RequestError, InvalidInputError
        There is no such field, or it cannot have a value.

    """
    from solver.tuning import tuner  # noqa: PLC0415 - compiled kernels, where tunings run alone

    # What is drawn of a tuning needs neither certificate nor tolerances of the model.
    plain = request.model_copy(update={"certificate": "none", "model_tolerance": False})
    variation = Variation(field, tuple(values))
    collected = Collected([variation])
    for item in expand(canonical(plain).encode(), [variation]):
        if item.faults:
            raise RequestError(item.faults)
        varied = parse_tuning_request(item.request)
        result = RequestedTuning.of(varied, tuner.tune(varied.build(), progress)).result
        collected.add(item.fields, json.loads(result.model_dump_json()))
    return collected.trade_off()


def _value(fields: Mapping[str, Any], name: str) -> Any:  # noqa: ANN401 - JSON
    """Return the value of a field by its dotted name; entries of lists count from 1."""
    value: Any = fields
    for part in name.split("."):
        value = value[int(part) - 1] if isinstance(value, list) else value[part]
    return value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
