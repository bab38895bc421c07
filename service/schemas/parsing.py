"""JSON text to request models, with every fault named by its JSON pointer."""

from __future__ import annotations

import difflib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ValidationError

from service.schemas.fields import RecordedRequest
from service.schemas.loop_forms import FORM_UNKNOWN
from service.schemas.tunings import BatchTuningRequest, TuningRequest

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

__all__ = [
    "Fault",
    "RequestError",
    "canonical",
    "computation",
    "parse",
    "parse_batch_tuning",
    "parse_tuning_request",
]

_Model = TypeVar("_Model", bound=BaseModel)

_MAX_FAULTS = 20
_LOOKED_AT = 60  # some of them say the same
_MANY, _FIRST = 20_000, 50  # faults beyond which the first entries of each list stand for it
_MEANT = "no such field; did you mean "


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
        parsed = model.model_validate_json(text)
    except ValidationError as error:
        value = _value(text)
        # Whoever sends ten thousand faults gets the first ones: words for each cost a millisecond.
        details = _details(model, error, value)[:_LOOKED_AT]
        found = []
        for item in details:
            place = _place(item["loc"], item["type"], value)
            found.append(
                (item["type"], Fault(_pointer(place, item["type"]), _words(model, item, place)))
            )
        faults = _once(found)[:_MAX_FAULTS]
        raise RequestError(
            faults, is_json=all(item["type"] != "json_invalid" for item in details)
        ) from None
    _refuse_repetition(text)
    return parsed


def _details(model: type[BaseModel], error: ValidationError, value: object) -> list[ErrorDetails]:
    """Return what is wrong with a JSON value; of very many faults some of the first ones.

    A kilobyte is needed for each: half a gigabyte for those of a body of one megabyte.
    """
    if error.error_count() > _MANY:
        try:
            model.model_validate_json(json.dumps(_shortened(value)))
        except ValidationError as shorter:
            error = shorter
        else:
            message = f"{error.error_count()} faults, none of them among the first of their lists"
            return [{"type": "value_error", "loc": (), "msg": message, "input": None}]
    return error.errors(include_url=False, include_input=False)


def _shortened(value: object) -> object:
    """Return a JSON value with the first entries of its lists."""
    if isinstance(value, list):
        return [_shortened(each) for each in value[:_FIRST]]
    if isinstance(value, dict):
        return {key: _shortened(each) for key, each in value.items()}
    return value


def parse_batch_tuning(text: bytes | str) -> BatchTuningRequest:
    """Return the tuning request of a batch that the JSON `text` holds.

    Raises
    ------
    RequestError
        The text is not JSON, or does not match the schema.

    """
    return parse(BatchTuningRequest, text)


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


def _once(faults: list[tuple[str, Fault]]) -> tuple[Fault, ...]:
    """Return each fault once.

    A list that lost a faulty item is not too short besides, and a field whose name is misspelt is
    not missing besides. What several forms of a value refuse is told by the first of them, and
    no value of the wrong type is one that another form has looked into.
    """
    # The form counts whose type is right, else the first one.
    faults = sorted(faults, key=lambda each: each[0].endswith("_type"))
    faults = list({fault.pointer: (kind, fault) for kind, fault in reversed(faults)}.values())[::-1]
    pointers = [fault.pointer for _, fault in faults]
    meant = {
        f"{fault.pointer.rsplit('/', 1)[0]}/{fault.detail.removeprefix(_MEANT).removesuffix('?')}"
        for kind, fault in faults
        if kind == "extra_forbidden"
    }
    return tuple(
        fault
        for kind, fault in faults
        if not (kind == "missing" and fault.pointer in meant)
        and not (
            (kind == "too_short" or kind.endswith("_type"))
            and any(pointer.startswith(f"{fault.pointer}/") for pointer in pointers)
        )
    )


def _words(model: type[BaseModel], item: ErrorDetails, place: Sequence[int | str]) -> str:
    """Return what is wrong, with the name that was meant where one is near."""
    if item["type"] == "too_short":
        context = item.get("ctx", {})
        least = context.get("min_length", 1)
        return f"at least {least} {'entry' if least == 1 else 'entries'} needed"
    if item["type"] in {"union_tag_invalid", "union_tag_not_found"}:
        kinds = _kinds(_schema(model), place)
        near = difflib.get_close_matches(str(item.get("ctx", {}).get("tag")), kinds, 1)
        what = "no such kind" if item["type"] == "union_tag_invalid" else "a kind is needed"
        return f"{what}; did you mean {near[0]}?" if near else f"{what}: {', '.join(kinds)}"
    if item["type"] != "extra_forbidden":
        return item["msg"]
    given = str(place[-1])
    names = field_names(_schema(model), place[:-1])
    # A field of another kind of plant is named rightly, and has no place here.
    near = [] if given in names else difflib.get_close_matches(given, names, 1)
    return f"{_MEANT}{near[0]}?" if near else "no such field"


@lru_cache(maxsize=2)  # of the model that a faulty request is of: made once, not for each fault
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def field_names(schema: dict[str, Any], location: Sequence[int | str]) -> list[str]:
    """Return the names of the fields that an object at `location` may have, all forms together.

    Parameters
    ----------
    schema : dict
        JSON schema of the whole.
    location : sequence of int or str
        Where the object is in the JSON.

    """
    return sorted({name for each in _at(schema, location) for name in each.get("properties", {})})


def _kinds(schema: dict[str, Any], location: Sequence[int | str]) -> list[str]:
    """Return the kinds that an object at `location` may be of."""
    tags = [each.get("discriminator", {}).get("mapping", {}) for each in _at(schema, location)]
    return [kind for mapping in tags for kind in mapping]


def _at(schema: dict[str, Any], location: Sequence[int | str]) -> list[dict[str, Any]]:
    """Return the schemas of what is at `location`, all forms together."""
    places = _forms(schema, schema)
    for part in location:
        inside = [
            place["properties"][part]
            for place in places
            if part in place.get("properties", {})
        ] if isinstance(part, str) else [
            item for place in places for item in [place.get("items")] if isinstance(item, dict)
        ]  # fmt: skip
        places = [form for each in inside for form in _forms(each, schema)]
    return places


def _forms(place: dict[str, Any], schema: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the schemas that one stands for, references and unions resolved."""
    if "$ref" in place:
        return _forms(schema["$defs"][place["$ref"].rsplit("/", 1)[-1]], schema)
    choices = [*place.get("anyOf", ()), *place.get("oneOf", ()), *place.get("allOf", ())]
    return [place, *(form for choice in choices for form in _forms(choice, schema))]


def computation(request: RecordedRequest) -> str:
    """Return what of the request has a say in the result, as JSON: equal texts, equal numbers."""
    document = request.model_dump(mode="json", exclude={"title", "time_unit", "id", "labels"})
    return json.dumps(document, sort_keys=True, separators=(",", ":"))


def _refuse_repetition(text: bytes | str) -> None:
    """Refuse objects that name a member twice: readers do not agree which of them counts."""

    def members(pairs: list[tuple[str, object]]) -> dict[str, object]:
        found = dict(pairs)
        if len(found) < len(pairs):
            names = [name for name, _ in pairs]
            name = next(name for name in names if names.count(name) > 1)
            raise RequestError((Fault("", f'the member "{name}" is there twice'),))
        return found

    json.loads(text, object_pairs_hook=members)


def _value(text: bytes | str) -> object:
    try:
        value: object = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return value


def _place(location: Sequence[int | str], kind: str, value: object) -> list[int | str]:
    """Return pydantic's location without the forms of unions that it names: no part of the JSON."""
    found = _resolved(list(location), kind, value)
    return list(location) if found is None else found


def _resolved(location: list[int | str], kind: str, value: object) -> list[int | str] | None:
    """Return the parts that lead through a JSON value; None where none of the readings does."""
    if not location:
        return []
    part, rest = location[0], location[1:]
    inside: object = None
    if isinstance(part, int):
        there = isinstance(value, list) and part < len(value)
        inside = value[part] if isinstance(value, list) and there else None
    else:
        there = isinstance(value, dict) and part in value
        inside = value[part] if isinstance(value, dict) and there else None
    if not rest and kind == "missing":
        return None if there else [part]
    if there:
        after = _resolved(rest, kind, inside)
        if after is not None:
            return [part, *after]
    if isinstance(part, int) or (not rest and kind == "extra_forbidden"):
        return None
    return _resolved(rest, kind, value)


def _pointer(place: Sequence[int | str], kind: str) -> str:
    parts = [str(part).replace("~", "~0").replace("/", "~1") for part in place]
    if kind in {"union_tag_invalid", "union_tag_not_found"}:
        parts.append("kind")
    if kind == FORM_UNKNOWN:
        parts.append("form")
    return "".join(f"/{part}" for part in parts)
