"""JSON text to request models, with every fault named by its JSON pointer."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from service.schemas.tunings import TuningRequest

__all__ = ["Fault", "RequestError", "canonical", "parse", "parse_tuning_request"]

_Model = TypeVar("_Model", bound=BaseModel)

# A union puts the tag of the chosen form into pydantic's location; it is no part of the JSON.
_TAGS = {
    "plant": {"parallel", "first_order", "matrix"},
    "uncertainty": {"error", "weight"},
    "perturbation": {"actuators", "coupled", "worst_case"},
}
_MAX_FAULTS = 20


@dataclass(frozen=True)
class Fault:
    """One fault of a request: where (JSON pointer) and what."""

    pointer: str
    detail: str


class RequestError(Exception):
    """A request that does not match its schema.

    Parameters
    ----------
    faults : tuple of Fault
        At least one.
    is_json : bool
        False where the text is not JSON at all.

    """

    def __init__(self, faults: tuple[Fault, ...], *, is_json: bool = True) -> None:
        super().__init__("; ".join(f"{fault.pointer or '/'}: {fault.detail}" for fault in faults))
        self.faults = faults
        self.is_json = is_json

    def within(self, prefix: str) -> RequestError:
        """Return the same error with its pointers below `prefix`."""
        faults = tuple(Fault(prefix + fault.pointer, fault.detail) for fault in self.faults)
        return RequestError(faults, is_json=self.is_json)


def parse(model: type[_Model], text: bytes | str) -> _Model:
    """Return the request of kind `model` that the JSON `text` holds.

    Raises
    ------
    RequestError
        The text is not JSON, or does not match the schema.

    """
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        details = error.errors(include_url=False, include_context=False, include_input=False)
        faults = tuple(
            Fault(_pointer(item["loc"], item["type"]), item["msg"])
            for item in details[:_MAX_FAULTS]
        )
        raise RequestError(
            faults, is_json=all(item["type"] != "json_invalid" for item in details)
        ) from None


def parse_tuning_request(text: bytes | str) -> TuningRequest:
    """Return the tuning request that the JSON `text` holds.

    Raises
    ------
    RequestError
        The text is not JSON, or does not match the schema.

    """
    return parse(TuningRequest, text)


def canonical(request: BaseModel) -> str:
    """Return the request as JSON with sorted keys and all defaults: equal requests, equal text."""
    return json.dumps(request.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))


def _pointer(location: Sequence[int | str], kind: str) -> str:
    parts: list[str] = []
    previous: int | str | None = None
    for part in location:
        is_tag = isinstance(previous, str) and part in _TAGS.get(previous, ())
        previous = None if is_tag else part
        if not is_tag:
            parts.append(str(part).replace("~", "~0").replace("/", "~1"))
    if kind in {"union_tag_invalid", "union_tag_not_found"}:
        parts.append("kind")
    return "".join(f"/{part}" for part in parts)
