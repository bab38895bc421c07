"""The runs of a source: requests to analyses, computed once, and values in their results.

A value is named by a JSON pointer (RFC 6901) into the result, in which ``*`` goes through a list:
``/curves/omega``, ``/theory/response/*/im``. ``abs:`` in front of it takes magnitudes; ``max:``,
``min:``, ``absmax:`` and ``last:`` take one number of a list.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

from service import registry
from service.analysis import compute
from service.gallery.definitions import Source
from service.schemas.parsing import parse

__all__ = ["Runs", "value_at"]


class Runs:
    """Results of the runs of one source, each computed when it is first asked for."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._results: dict[str, dict[str, Any]] = {}

    def result(self, name: str) -> dict[str, Any]:
        """Return the result of a run, as JSON values.

        Raises
        ------
        RequestError
            Its request is at fault.

        """
        if name not in self._results:
            run = self._source.runs[name]
            analysis = registry.load(run.analysis)
            document = filled(run.request, self._source.parts)
            request = parse(analysis.request, json.dumps(document))
            self._results[name] = compute(analysis.compute, request)
        return self._results[name]

    def value(self, name: str, pointer: str) -> Any:  # noqa: ANN401 - whatever stands there
        """Return a value in the result of a run."""
        return value_at(self.result(name), pointer)


def filled(value: Any, parts: dict[str, Any]) -> Any:  # noqa: ANN401 - JSON values
    """Return JSON values with each string ``$name`` replaced by the part of that name."""
    match value:
        case str() if value.startswith("$"):
            return filled(parts[value[1:]], parts)
        case dict():
            return {key: filled(each, parts) for key, each in value.items()}
        case list():
            return [filled(each, parts) for each in value]
    return value


def value_at(document: Any, pointer: str) -> Any:  # noqa: ANN401 - JSON values
    """Return what stands at a pointer.

    Raises
    ------
    LookupError
        Nothing does.

    """
    how, colon, path = pointer.partition(":")
    if not colon:
        return _follow(document, pointer.split("/")[1:])
    found = _follow(document, path.split("/")[1:])
    return _REDUCTIONS[how](found)


def _follow(value: Any, steps: list[str]) -> Any:  # noqa: ANN401 - JSON values
    for index, step in enumerate(steps):
        if step == "*":
            return [_follow(each, steps[index + 1 :]) for each in value]
        value = value[int(step)] if isinstance(value, list) else value[step]
    return value


def _magnitude(value: Any) -> Any:  # noqa: ANN401 - JSON values
    if isinstance(value, list):
        return [_magnitude(each) for each in value]
    if isinstance(value, dict):
        return math.hypot(value["re"], value["im"])
    return abs(value)


def _numbers(values: list[float | None]) -> list[float]:
    return [value for value in values if value is not None]


_REDUCTIONS: dict[str, Callable[[Any], Any]] = {
    "abs": _magnitude,
    "absmax": lambda values: max(_magnitude(values)),
    "last": lambda values: values[-1],
    "max": lambda values: max(_numbers(values)),
    "min": lambda values: min(_numbers(values)),
}
