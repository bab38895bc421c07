"""A sweep: one request, and the fields of it that are varied, on a grid."""

from __future__ import annotations

import copy
import difflib
import itertools
import json
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from service.batch.request_lines import Item, read_items
from service.schemas import Fault, RequestError, canonical, parse_batch_tuning

__all__ = ["MAX_POINTS", "Variation", "expand"]

MAX_POINTS = 100_000
_FORM = "write NAME=FIRST:LAST:COUNT, NAME=FIRST:LAST:COUNT:log or NAME=VALUE,VALUE,..."


@dataclass(frozen=True)
class Variation:
    """A field of a request and the values that it takes.

    Attributes
    ----------
    name : str
        Dotted name, as ``plant.interaction`` or ``uncertainty.epsilon``.
    values : tuple
        Numbers, or whatever JSON holds.

    """

    name: str
    values: tuple[Any, ...]

    @classmethod
    def of(cls, text: str) -> Variation:
        """Read ``name=first:last:count[:log]`` or ``name=value,value,...``.

        Raises
        ------
        RequestError
            The text has another form.

        """
        name, equals, values = text.partition("=")
        if not (name and equals and values):
            _refuse(f"--vary {text}: {_FORM}")
        if ":" not in values:
            return cls(name, tuple(_value(each) for each in values.split(",")))
        first, last, count, scale = [*values.split(":"), "", ""][:4]
        try:
            low, high, number = float(first), float(last), int(count)
        except ValueError:
            _refuse(f"--vary {text}: {_FORM}")
        if number < 1 or scale not in ("", "log") or values.count(":") > 3:
            _refuse(f"--vary {text}: {_FORM}")
        if not np.isfinite([low, high]).all() or (scale and min(low, high) <= 0):
            _refuse(f"--vary {text}: the ends must be finite, and positive for log")
        points = (np.geomspace if scale else np.linspace)(low, high, number)
        return cls(name, tuple(float(f"{point:.12g}") for point in points))


def expand(request: bytes, variations: list[Variation]) -> list[Item]:
    """Return the requests of a sweep, the last variation changing fastest.

    Parameters
    ----------
    request : bytes
        JSON text of a tuning request.
    variations : list of Variation
        What is varied; none: the request alone.

    Raises
    ------
    RequestError
        The request is at fault, it has no such field, or there are more than `MAX_POINTS` points.

    """
    base = json.loads(canonical(parse_batch_tuning(request)))
    given = json.loads(request)
    names = sorted(_names(base))
    for variation in variations:
        if variation.name not in names:
            near = difflib.get_close_matches(variation.name, names, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            _refuse(f"--vary {variation.name}: the request has no such field{hint}")
    total = int(np.prod([len(variation.values) for variation in variations], dtype=float))
    if total > MAX_POINTS:
        _refuse(f"a sweep of {total} points; at most {MAX_POINTS} are computed at once")
    lines = []
    for values in itertools.product(*(variation.values for variation in variations)):
        document = copy.deepcopy(given)
        for variation, value in zip(variations, values, strict=True):
            _put(document, variation.name.split("."), value, base)
        lines.append(json.dumps(document).encode())
    return read_items(b"\n".join(lines))


def _put(document: Any, path: list[str], value: object, default: Any) -> None:  # noqa: ANN401 - JSON
    """Set a member of nested JSON; what the request leaves to its defaults is filled in."""
    for part in path[:-1]:
        key: Any = int(part) - 1 if isinstance(document, list) else part
        if isinstance(document, dict) and document.get(key) is None:
            document[key] = copy.deepcopy(default[key])
        document, default = document[key], default[key]
    document[int(path[-1]) - 1 if isinstance(document, list) else path[-1]] = value


def _names(value: Any, name: str = "") -> set[str]:  # noqa: ANN401 - JSON
    """Return the dotted names of a JSON value and its parts; list entries count from 1."""
    found = {name} if name else set()
    if isinstance(value, dict):
        for key, each in value.items():
            found |= _names(each, f"{name}.{key}" if name else key)
    if isinstance(value, list):
        for index, each in enumerate(value, 1):
            found |= _names(each, f"{name}.{index}")
    return found


def _value(text: str) -> object:
    try:
        value: object = json.loads(text)
    except ValueError:
        return text
    return value


def _refuse(detail: str) -> NoReturn:
    raise RequestError((Fault("", detail),))
