"""Reference of all fields, from the OpenAPI document: a section a record, a row a field."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

__all__ = ["fields_of_requests"]

DOCUMENT = Path(__file__).parent.parent / "openapi" / "openapi.json"
_UNITS = {"1": "number", "time": "time", "s": "seconds"}


def fields_of_requests() -> str:
    """Return Markdown: the routes that take a body, then every record that requests are made of."""
    document = json.loads(DOCUMENT.read_text(encoding="utf-8"))
    schemas: dict[str, Any] = document["components"]["schemas"]
    lines = ["## Routes with a body", "", "| route | request |", "|---|---|"]
    waiting: list[str] = []
    for path, item in document["paths"].items():
        body = item.get("post", {}).get("requestBody")
        if body is None or "/figures/" in path:
            continue
        names = [
            name for content in body["content"].values() for name in _references(content["schema"])
        ]
        waiting += names
        lines.append(f"| `POST {path}` | {', '.join(map(_link, names))} |")
    done: list[str] = []
    while waiting:
        name = waiting.pop(0)
        if name in done:
            continue
        done.append(name)
        lines += ["", *_section(name, schemas[name])]
        waiting += [each for each in _references(schemas[name]) if each not in done]
    return "\n".join(lines) + "\n"


def _section(name: str, schema: dict[str, Any]) -> list[str]:
    lines = [f"## {name}", "", _plain(schema.get("description", "")), ""]
    if "properties" not in schema:
        return lines
    needed = schema.get("required", [])
    lines += ["| field | kind | default | meaning |", "|---|---|---|---|"]
    for field, details in schema["properties"].items():
        default = "needed" if field in needed else _value(details.get("default"))
        meaning = _plain(details.get("description", ""))
        lines.append(f"| `{field}` | {_kind(details)} | {default} | {meaning} |")
    return lines


def _kind(schema: dict[str, Any]) -> str:
    """Return what may stand there: type, choices, unit, range."""
    if "$ref" in schema:
        return _link(schema["$ref"].rpartition("/")[2])
    for choice in ("anyOf", "oneOf"):
        if choice in schema:
            return " or ".join(dict.fromkeys(map(_kind, schema[choice])))
    if "const" in schema:
        return _value(schema["const"])
    if "enum" in schema:
        return ", ".join(map(_value, schema["enum"]))
    if schema.get("type") == "array":
        inner = schema.get("items") or (schema.get("prefixItems") or [{}])[0]
        return f"list of {_kind(inner)}"
    unit = schema.get("x-unit")
    kind = str(schema.get("type", "anything"))
    named = _UNITS.get(unit, f"number ({unit})") if unit else kind
    return named + _range(schema)


def _range(schema: dict[str, Any]) -> str:
    """Return the limits that a reader may meet; the widest ones say nothing."""
    low = schema.get("exclusiveMinimum", schema.get("minimum"))
    high = schema.get("exclusiveMaximum", schema.get("maximum"))
    words = []
    if low is not None and abs(low) < 1e6:
        words.append(f"{'above' if 'exclusiveMinimum' in schema else 'from'} {low:g}")
    if high is not None and abs(high) < 1e6:
        words.append(f"{'below' if 'exclusiveMaximum' in schema else 'to'} {high:g}")
    return f", {' '.join(words)}" if words else ""


def _references(schema: object) -> list[str]:
    """Return the names of the records that a schema refers to, in their order."""
    found: list[str] = []
    if isinstance(schema, dict):
        if isinstance(schema.get("$ref"), str):
            found.append(schema["$ref"].rpartition("/")[2])
        for key, value in schema.items():
            if key not in {"examples", "discriminator"}:
                found += _references(value)
    elif isinstance(schema, list):
        for value in schema:
            found += _references(value)
    return list(dict.fromkeys(found))


def _link(name: str) -> str:
    return f"[{name}](#{name.lower()})"


def _value(value: object) -> str:
    return f"`{json.dumps(value)}`"


def _plain(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
