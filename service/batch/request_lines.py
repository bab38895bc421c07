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
from service.schemas import Fault, RequestError, computation, parse_batch_tuning

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from service.schemas import TuningRequest

__all__ = ["Item", "batch_digest", "read_items"]

_MARK = b"\xef\xbb\xbf"
_COMMENTS = (b"#", b"//")


@dataclass(frozen=True, slots=True)
class Item:
    """A request of a batch; a hundred thousand of them fit in memory as text.

    Attributes
    ----------
    line : int
        Its line in the file, from 1.
    digest : str
        Of the request as it is computed: equal requests, equal digests, whatever their spelling.
    request : str
        JSON text of what of it has a say in the result, with all defaults; the line itself where
        that is at fault.
    time_limit : float
        Seconds that it may take.
    record : mapping
        What else the request says: title, unit of time, id, labels.
    faults : tuple of Fault
        What is wrong with the line.
    error : str or None
        The same as the JSON text of a problem.

    """

    line: int
    digest: str
    request: str
    time_limit: float = 0.0
    record: Mapping[str, Any] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    error: str | None = None

    @property
    def fields(self) -> dict[str, Any]:
        """The request as JSON values; what there is of one that is at fault."""
        try:
            value = json.loads(self.request)
        except ValueError:
            return {}
        return value | dict(self.record) if isinstance(value, dict) else {}

    @property
    def identity(self) -> dict[str, Any]:
        """What of the request comes back with the result."""
        return {name: self.record[name] for name in ("id", "labels") if name in self.record}


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
        given = line.decode(errors="replace")
        return Item(number, _digest(line), given, faults=error.faults, error=problem)
    text = computation(request)
    return Item(
        number, _digest(text.encode()), text, request.search.time_limit, record=request.record()
    )


def _parsed(line: bytes) -> TuningRequest:
    if line.startswith(_COMMENTS):
        message = "a line holds a request and nothing else; JSON knows no comments"
        raise RequestError((Fault("", message),), is_json=False)
    return parse_batch_tuning(line)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
