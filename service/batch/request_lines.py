"""The lines of a batch: a request each, as people and programs write them.

A byte order mark, Windows line ends, blank lines and a missing last line end are let pass. Every
fault names its line of the file.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from service.problems import describe
from service.schemas import Fault, RequestError, canonical, computation, parse_tuning_request

if TYPE_CHECKING:
    from collections.abc import Iterator

    from service.schemas import TuningRequest

__all__ = ["Item", "batch_digest", "read_items"]

_MARK = b"\xef\xbb\xbf"
_COMMENTS = (b"#", b"//")


@dataclass(frozen=True)
class Item:
    """A request of a batch.

    Attributes
    ----------
    line : int
        Its line in the file, from 1.
    digest : str
        Of the request as it is computed: equal requests, equal digests, whatever their spelling.
    request : str
        JSON text of the request with all defaults; empty where the line is at fault.
    time_limit : float
        Seconds that it may take.
    faults : tuple of Fault
        What is wrong with the line.
    error : str or None
        The same as the JSON text of a problem.
    fields : dict
        The request as JSON values.
    identity : dict
        What of it comes back with the result.

    """

    line: int
    digest: str
    request: str = ""
    time_limit: float = 0.0
    faults: tuple[Fault, ...] = ()
    error: str | None = None
    fields: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)
    identity: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)


def read_items(content: bytes) -> list[Item]:
    """Return the requests in the lines of a file.

    Parameters
    ----------
    content : bytes
        The file.

    """
    return [_item(number, line) for number, line in _lines(content)]


def batch_digest(items: list[Item]) -> str:
    """Return the digest of a whole batch: of its requests, in their order."""
    return _digest(",".join(item.digest for item in items).encode())


def _lines(content: bytes) -> Iterator[tuple[int, bytes]]:
    for number, line in enumerate(content.removeprefix(_MARK).split(b"\n"), 1):
        if text := line.strip():
            yield number, text


def _item(number: int, line: bytes) -> Item:
    try:
        request = _parsed(line)
    except RequestError as error:
        problem = json.dumps(describe(error))
        fields = _fields(line)
        return Item(number, _digest(line), faults=error.faults, error=problem, fields=fields)
    text = computation(request)
    return Item(
        number,
        _digest(text.encode()),
        text,
        request.search.time_limit,
        fields=json.loads(canonical(request)),
        identity=request.identity(),
    )


def _parsed(line: bytes) -> TuningRequest:
    if line.startswith(_COMMENTS):
        message = "a line holds a request and nothing else; JSON knows no comments"
        raise RequestError((Fault("", message),), is_json=False)
    return parse_tuning_request(line)


def _fields(line: bytes) -> dict[str, Any]:
    """Return what a faulty request holds, as far as it is an object at all."""
    try:
        value = json.loads(line)
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {}


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
