"""Strict reading of certificate documents: a valid `Certificate`, or the fault and its pointer."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from solver.certificate.enclosures import Interval
from solver.certificate.record import FORMAT, VERSION, Certificate, Claim, ProvenInterval
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.mixed_plant import MixedPlant
from solver.model.plants import MatrixPlant, ParallelPlant
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.model.plants import Plant

__all__ = ["read_certificate"]

T = TypeVar("T")


def read_certificate(text: str | bytes) -> Certificate:
    """Return the certificate that `text` holds.

    Parameters
    ----------
    text : str or bytes
        A JSON document, UTF-8.

    Raises
    ------
    InvalidInputError
        It is not JSON, has another format or version, lacks a member or has an unknown one,
        holds a value out of range, or its intervals do not follow each other from 0 to infinity.

    """
    try:
        document = json.loads(
            text, object_pairs_hook=_without_duplicates, parse_constant=_no_constant
        )
    except InvalidInputError:
        raise
    except (ValueError, RecursionError) as error:
        message = f"not a JSON document: {error}"
        raise InvalidInputError(message) from error
    return _certificate(document)


def _certificate(document: object) -> Certificate:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        _refuse(f'not a certificate: "format" is not "{FORMAT}"', "/format")
    if document.get("version") is True or document.get("version") != VERSION:
        _refuse(f"unknown version: this program checks version {VERSION}", "/version")
    names = "format version gamma plant uncertainty performance loops intervals digest"
    members = _members(document, names)
    gamma = _within("/gamma", _number, members["gamma"])
    plant = _within("/plant", _plant, members["plant"])
    uncertainty = _within("/uncertainty", _uncertainty, members["uncertainty"])
    performance = _within("/performance", _performance, members["performance"])
    loops = _within("/loops", _each(_loop), members["loops"])
    intervals = _within("/intervals", _each(_interval), members["intervals"])
    certificate = Certificate(Claim(plant, uncertainty, performance, loops, gamma), intervals)
    # The digest of what was read, so that white space and the form of numbers do not matter.
    if members["digest"] != certificate.to_document()["digest"]:
        _refuse("the document was changed: its digest does not fit its content", "/digest")
    return certificate


def _plant(value: object) -> Plant:
    kind = value.get("kind") if isinstance(value, dict) else None
    if kind == "parallel":
        members = _members(value, "kind n process interaction")
        n = members["n"]
        if not isinstance(n, int) or isinstance(n, bool):
            _refuse("must be an integer", "/n")
        return ParallelPlant(
            n,
            _within("/process", _transfer_function, members["process"]),
            _within("/interaction", _transfer_function, members["interaction"]),
        )
    if kind == "matrix":
        members = _members(value, "kind elements")
        return MatrixPlant(
            _within("/elements", _each(_each(_transfer_function)), members["elements"])
        )
    if kind == "mixed":
        return _mixed(value)
    return _refuse('must be "parallel", "matrix" or "mixed"', "/kind")


def _mixed(value: object) -> MixedPlant:
    members = _members(value, "kind plant outputs inputs shared")
    plant = _within("/plant", _plant, members["plant"])
    if isinstance(plant, MixedPlant):
        _refuse('must be "parallel" or "matrix"', "/plant/kind")
    if not isinstance(members["shared"], bool):
        _refuse("must be true or false", "/shared")
    outputs, inputs = (
        _within(f"/{name}", _each(_each(_number)), members[name]) for name in ("outputs", "inputs")
    )
    loops = len(outputs)
    for name, rows, shape in (("outputs", outputs, (loops, plant.n)),
                              ("inputs", inputs, (plant.n, loops))):  # fmt: skip
        if not loops or len(rows) != shape[0]:
            _refuse(f"must have {shape[0] or 1} rows", f"/{name}")
        for index, row in enumerate(rows):
            if len(row) != shape[1]:
                _refuse(f"must have {shape[1]} entries", f"/{name}/{index}")
    if not members["shared"]:
        own = [[float(each == loop) for loop in range(loops)] for each in range(plant.n)]
        if list(map(list, inputs)) != own:
            _refuse("must be true where loops do not have an input each", "/shared")
    return MixedPlant(plant, outputs, inputs, members["shared"])


def _transfer_function(value: object) -> TransferFunction:
    members = _members(value, "num den dead_time")
    return TransferFunction(
        _within("/num", _each(_number), members["num"]),
        _within("/den", _each(_number), members["den"]),
        _within("/dead_time", _number, members["dead_time"]),
    )


def _uncertainty(value: object) -> Uncertainty:
    names = "weight structure"
    if isinstance(value, dict) and "outputs" in value:  # written only where they err
        names += " outputs"
    members = _members(value, names)
    if members["structure"] not in list(Structure):
        _refuse('must be "diagonal" or "full"', "/structure")
    weight = _within("/weight", _weight, members["weight"])
    outputs = None
    if "outputs" in members:
        outputs = Uncertainty(_within("/outputs", _weight, members["outputs"]))
    return Uncertainty(weight, Structure(members["structure"]), outputs)


def _weight(value: object) -> TransferFunction | tuple[TransferFunction, ...]:
    """Return one weight, or a list where each input or output has its own."""
    if isinstance(value, list):
        return _each(_transfer_function)(value)
    return _transfer_function(value)


def _performance(value: object) -> Performance:
    names = "max_peak offset tau_p"
    if isinstance(value, dict) and "output_scale" in value:  # written only where it is given
        names += " output_scale"
    members = _members(value, names)
    scales = members.pop("output_scale", None)
    if scales is not None:
        scales = _within("/output_scale", _each(_number), scales)
    numbers = {name: _within(f"/{name}", _number, v) for name, v in members.items()}
    return Performance(**numbers, output_scale=scales)


def _loop(value: object) -> Controller:
    names = "gain integral_time derivative_time"
    if isinstance(value, dict) and "filter_time" in value:  # written only where it is given
        names += " filter_time"
    members = _members(value, names)
    gain = _within("/gain", _number, members.pop("gain"))
    times = (
        None if time is None and name != "filter_time" else _within(f"/{name}", _number, time)
        for name, time in members.items()
    )
    return Controller(gain, *times)


def _interval(value: object) -> ProvenInterval:
    members = _members(value, "low high scales")
    high = members["high"]
    return ProvenInterval(
        Interval(
            _within("/low", _number, members["low"]),
            math.inf if high is None else _within("/high", _number, high),
        ),
        _within("/scales", _each(_number), members["scales"]),
    )


def _members(value: object, names: str) -> dict[str, Any]:
    """Return the members of an object that has exactly the given ones, in the given order."""
    if not isinstance(value, dict):
        _refuse("must be an object")
    wanted = names.split()
    for name in wanted:
        if name not in value:
            _refuse("is missing", f"/{name}")
    for name in value:
        if name not in wanted:
            escaped = name.replace("~", "~0").replace("/", "~1")
            _refuse("is unknown", f"/{escaped}")
    return {name: value[name] for name in wanted}


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        _refuse("must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        _refuse("must be a finite number")
    return number


def _each(read: Callable[[object], T]) -> Callable[[object], tuple[T, ...]]:
    def read_all(value: object) -> tuple[T, ...]:
        if not isinstance(value, list):
            _refuse("must be an array")
        return tuple(_within(f"/{index}", read, item) for index, item in enumerate(value))

    return read_all


def _within(prefix: str, read: Callable[[object], T], value: object) -> T:
    try:
        return read(value)
    except InvalidInputError as error:
        raise error.within(prefix) from None


def _refuse(message: str, field: str = "") -> NoReturn:
    raise InvalidInputError(message, field)


def _without_duplicates(pairs: list[tuple[str, object]]) -> dict[str, object]:
    members = dict(pairs)
    if len(members) < len(pairs):
        _refuse("an object names a member twice")
    return members


def _no_constant(name: str) -> NoReturn:
    _refuse(f"{name} is not JSON")
