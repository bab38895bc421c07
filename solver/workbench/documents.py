"""Results in files: records as JSON, each with its class, read back through its own checks."""

from __future__ import annotations

import json
import math
from enum import Enum
from importlib import import_module
from inspect import signature
from typing import Any

import numpy as np

from solver.certificate.reading import read_certificate
from solver.certificate.record import Certificate
from solver.model.errors import InvalidInputError
from solver.model.validation import read_only

__all__ = ["read", "write"]

FORMAT = "mutune-result"
VERSION = 1
# The only classes that a file can make, each with its module.
_MODULES = {
    "solver.model.controllers": ("Controller",),
    "solver.model.measured": ("MeasuredPlant",),
    "solver.model.mixing": ("Mixing",),
    "solver.model.neighbours": ("NeighbourPlant",),
    "solver.model.peaks": ("Peak",),
    "solver.model.plants": ("MatrixPlant", "ParallelPlant"),
    "solver.model.transfer_function": ("TransferFunction",),
    "solver.model.weights": ("Performance", "Structure", "Uncertainty"),
    "solver.optimality.record": ("Optimality", "Proof"),
    "solver.robustness.record": ("Curves", "Guarantee", "GuaranteeStatus", "Peaks"),
    "solver.robustness.model_tolerance": ("ModelTolerance",),
    "solver.robustness.margins": ("LoopMargins", "Margins"),
    "solver.tuning.beside": (
        "AsFound", "PriceOfResolution", "SettingMove", "SettingRange", "SettingsTolerance",
    ),
    "solver.tuning.resolution": ("Resolution",),
    "solver.tuning.demands": ("DemandOutcome", "Demands", "IntegrityDemand"),
    "solver.tuning.record": (
        "Comparison", "LocalOptimum", "ScenarioOutcome", "SearchSummary", "Status", "Tuning",
    ),
    "solver.tuning.scenarios": ("Scenario",),
    "solver.tuning.spread": ("Spread", "SpreadOutcome", "SpreadProof"),
    "solver.tuning.specification": (
        "Arrangement", "Bounds", "ControllerKind", "Objective", "Signs", "Specification",
    ),
    "solver.workbench.tuned": ("Tuned",),
}  # fmt: skip
_HOME = {name: module for module, names in _MODULES.items() for name in names}


def write(record: object) -> str:
    """Return the document of a record: JSON, every number exact, no NaN."""
    document = {"format": FORMAT, "version": VERSION, **_encoded(record)}
    return json.dumps(document, allow_nan=False, indent=1)


def read(text: str) -> object:
    """Return the record in a document that `write` made.

    Raises
    ------
    InvalidInputError
        No such document, or one whose values the records refuse.

    """
    try:
        document = json.loads(text)
    except ValueError as error:
        message = f"no JSON document: {error}"
        raise InvalidInputError(message, "") from None
    if not isinstance(document, dict) or document.pop("format", None) != FORMAT:
        message = f"not a document of the format {FORMAT!r}"
        raise InvalidInputError(message, "/format")
    if document.pop("version", None) != VERSION:
        message = f"this mutune reads version {VERSION}"
        raise InvalidInputError(message, "/version")
    return _decoded(document, "")


def _encoded(value: Any) -> Any:  # noqa: ANN401, PLR0911 - one for each kind of value
    if isinstance(value, Enum):
        return {"type": type(value).__name__, "value": value.value}
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"type": "number", "value": repr(value)}
    if isinstance(value, np.ndarray):
        return {"type": "array", "values": [_encoded(each) for each in value.tolist()]}
    if isinstance(value, Certificate):
        return {"type": "Certificate", "document": value.to_document()}
    if isinstance(value, tuple | list):
        return [_encoded(each) for each in value]
    name = type(value).__name__
    if name not in _HOME:
        message = f"a {name} has no place in a result's document"
        raise TypeError(message)
    return {
        "type": name,
        **{field: _encoded(getattr(value, field)) for field in signature(type(value)).parameters},
    }


def _decoded(value: Any, field: str) -> Any:  # noqa: ANN401, PLR0911 - one for each kind of value
    if isinstance(value, list):
        return tuple(_decoded(each, f"{field}/{index}") for index, each in enumerate(value))
    if not isinstance(value, dict):
        return value
    content = dict(value)
    name = content.pop("type", None)
    if name not in {"number", "array", "Certificate", *_HOME}:
        message = f"unknown type {name!r}"
        raise InvalidInputError(message, f"{field}/type")
    try:
        if name == "number":
            return float(content["value"])
        if name == "array":
            values = [_decoded(each, f"{field}/values") for each in content["values"]]
            return read_only(np.array(values, dtype=float))
        if name == "Certificate":
            return read_certificate(json.dumps(content["document"]))
        made = getattr(import_module(_HOME[name]), name)
        if issubclass(made, Enum):
            return made(content["value"])
        return made(**{key: _decoded(each, f"{field}/{key}") for key, each in content.items()})
    except InvalidInputError as error:
        raise (error if error.field.startswith(field) else error.within(field)) from None
    except (KeyError, TypeError, ValueError) as error:
        message = f"no {name}: {error}"
        raise InvalidInputError(message, field) from None
