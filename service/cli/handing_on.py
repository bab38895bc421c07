"""Requests as commands take them: with a unit of time, or from what another command printed."""

from __future__ import annotations

import json
from typing import Any, TypeVar

from service.schemas import parse
from service.schemas.fields import RecordedRequest

__all__ = ["in_unit", "requested"]

_Request = TypeVar("_Request", bound=RecordedRequest)


def in_unit(request: _Request, time_unit: str | None) -> _Request:
    """Return the request with another name of its unit of time; None: with its own.

    Raises
    ------
    RequestError
        A name that no unit can have.

    """
    if time_unit is None:
        return request
    document = request.model_dump(mode="json", exclude_unset=True) | {"time_unit": time_unit}
    return parse(type(request), json.dumps(document))


def requested(model: type[_Request], text: bytes) -> _Request:
    """Return the request that `text` holds, or the one that a printed tuning leads to.

    What ``mutune tune --json`` prints has the request beside the result: the analysis is that of
    the settings found, at the time constant found.

    Raises
    ------
    RequestError
        The text does not match the schema.

    """
    printed = _printed(text)
    if printed is None:
        return parse(model, text)
    asked, known = printed["request"], model.model_fields.keys()
    # The controller of a tuning is the kind of its loops, that of an analysis a whole controller.
    taken = {name: value for name, value in asked.items() if name in known - {"controller"}}
    if "loops" in known:
        taken["loops"] = printed["loops"]
    if "performance" in taken and printed.get("tau_p") is not None:
        taken["performance"] = {**taken["performance"], "tau_p": printed["tau_p"]}
    elif "performance" in known and printed.get("tau_p") is not None:
        taken["performance"] = {"tau_p": printed["tau_p"]}
    return parse(model, json.dumps(taken))


def _printed(text: bytes) -> dict[str, Any] | None:
    """Return a tuning as ``mutune tune --json`` prints it, None for anything else."""
    try:
        document = json.loads(text)
    except ValueError:
        return None
    is_printed = isinstance(document, dict) and {"request", "loops", "status"} <= document.keys()
    return document if is_printed and isinstance(document["request"], dict) else None
