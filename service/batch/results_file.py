"""Where a batch puts its results: complete lines in order, and a journal of what came early.

Each result is on disk as soon as it is there. The file of results grows in the order of the
requests; what is done while an earlier request is still being computed waits in a journal beside
it. A run that was stopped, however, goes on from both. A table is written from the journal in one
piece at the end.

Nothing that is not of this very batch is ever written to or cut: an existing file is continued only
where every line in it carries the digest of the request in its place.
"""

from __future__ import annotations

import errno
import json
import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

from filelock import FileLock, Timeout

from service.batch.request_lines import Item, batch_digest
from service.schemas import Fault, RequestError
from service.whole_file import replace

__all__ = ["ResultsFile", "opened"]

Finish = Callable[[IO[bytes], Iterator[dict[str, Any]]], None]


class ResultsFile:
    """Results of a batch, each written as soon as it is known.

    Parameters
    ----------
    items : sequence of Item
        The requests.
    journal : binary file
        Open for reading and appending; holds what cannot be written in order yet.
    output : binary file or None
        Where results go in order; None: to the journal alone.

    """

    def __init__(self, items: Sequence[Item], journal: IO[bytes], output: IO[bytes] | None) -> None:
        self._items = items
        self._journal = journal
        self._output = output
        self._written = 0  # lines of the output
        self._places: dict[int, int] = {}  # where the journal holds a result
        self._done: set[int] = set()
        self.kinds: Counter[str] = Counter()  # statuses of the results, "error" among them

    @property
    def done(self) -> set[int]:
        """Indices of the requests whose results are kept."""
        return self._done

    def add(self, index: int, content: str, kind: str) -> None:
        """Keep the result of a request.

        Parameters
        ----------
        index : int
            Its place in the batch.
        content : str
            Members of its JSON object, as ``"result": {...}``.
        kind : str
            Status of the result, or ``"error"``.

        """
        line = (_start(index, self._items[index]) + content + "}\n").encode()
        self._count(index, kind)
        if self._output is not None and index == self._written:
            self._append(line)
            self._catch_up()
            self._output.flush()  # what is written survives this process
            return
        self._journal.seek(0, os.SEEK_END)
        self._places[index] = self._journal.tell()
        self._journal.write(line)
        self._journal.flush()

    def entries(self) -> Iterator[dict[str, Any]]:
        """Yield the results that the journal holds, in the order of the requests."""
        for index in sorted(self._places):
            yield json.loads(self._line_at(self._places[index]))

    def resume(self, kinds: Sequence[str], journal: bytes) -> None:
        """Take over what an earlier run has left.

        Parameters
        ----------
        kinds : sequence of str
            Of the results that the output holds already.
        journal : bytes
            Whole lines of the journal, without its first one.

        """
        for index, kind in enumerate(kinds):
            self._count(index, kind)
        self._written = len(kinds)
        place = self._journal.tell() - len(journal)
        for line in journal.splitlines(keepends=True):
            entry = json.loads(line)
            if entry["index"] >= self._written:
                self._places[entry["index"]] = place
                self._count(entry["index"], _kind(entry))
            place += len(line)
        if self._output is not None:
            self._catch_up()
            self._output.flush()

    def _count(self, index: int, kind: str) -> None:
        self._done.add(index)
        self.kinds[kind] += 1

    def _catch_up(self) -> None:
        while self._written in self._places:
            self._append(self._line_at(self._places.pop(self._written)))

    def _append(self, line: bytes) -> None:
        if self._output is not None:
            self._output.write(line)
            self._written += 1

    def _line_at(self, place: int) -> bytes:
        self._journal.seek(place)
        return self._journal.readline()


@contextmanager
def opened(
    path: Path | None, items: list[Item], stream: IO[bytes], finish: Finish | None = None
) -> Iterator[ResultsFile]:
    """Open the results of a batch and hold them against other runs.

    Parameters
    ----------
    path : Path or None
        The file; None: `stream`.
    items : list of Item
        The requests.
    stream : binary file
        Standard output.
    finish : callable or None
        Writes all results as a table to a file; None: results are lines of JSON.

    Raises
    ------
    RequestError
        The file holds something else, or another run writes to it.

    """
    if path is not None:
        with _file(path, items, finish) as results:
            yield results
        return
    with tempfile.TemporaryFile() as journal:
        results = ResultsFile(items, journal, None if finish else stream)
        yield results
        if finish is not None and len(results.done) == len(items):
            finish(stream, results.entries())


@contextmanager
def _file(path: Path, items: list[Item], finish: Finish | None) -> Iterator[ResultsFile]:
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path.parent))
    beside, lock = (path.with_name(path.name + suffix) for suffix in (".journal", ".lock"))
    with ExitStack() as stack:
        try:
            stack.enter_context(FileLock(lock, timeout=0))
        except Timeout:
            message = f"another batch writes to {path}; wait for it, or name another file"
            raise RequestError((Fault("", message),)) from None
        stack.callback(lock.unlink, missing_ok=True)  # while it is held: whoever waits looks again
        whole, kinds = _whole_lines(path, items) if finish is None else (0, [])
        journal = stack.enter_context(_journal(beside, items))
        early = journal.read()
        if finish is not None and path.exists():
            message = f"{path} exists; name another file, or remove it"
            raise RequestError((Fault("", message),))
        output = None
        if finish is None:
            output = stack.enter_context(path.open("r+b" if whole else "w+b"))
            output.seek(whole)
            output.truncate()
        results = ResultsFile(items, journal, output)
        results.resume(kinds, early)
        yield results
        if len(results.done) == len(items):
            if finish is not None:
                replace(path, lambda file: finish(file, results.entries()))
            beside.unlink()


@contextmanager
def _journal(path: Path, items: list[Item]) -> Iterator[IO[bytes]]:
    """Open the journal of a batch behind its first line; one that holds nothing more goes again.

    Raises
    ------
    RequestError
        It is of another batch.

    """
    header = json.dumps({"batch": batch_digest(items), "requests": len(items)}).encode() + b"\n"
    with path.open("a+b") as file:
        file.seek(0)
        content = file.read()
        if content and not content.startswith(header):
            message = f"{path} is of another batch: finish that one, or name another file"
            raise RequestError((Fault("", message),))
        if not content:
            file.write(header)
            file.flush()
        else:
            file.truncate(content.rfind(b"\n") + 1)  # a line torn by a power cut
        file.seek(len(header))
        try:
            yield file
        finally:
            file.flush()
            if path.exists() and path.stat().st_size == len(header):
                path.unlink()


def _whole_lines(path: Path, items: Sequence[Item]) -> tuple[int, list[str]]:
    """Return where the whole lines of an existing file of results end, and the kind of each.

    Raises
    ------
    RequestError
        The file is not of this batch.

    """
    kinds: list[str] = []
    if not path.exists():
        return 0, kinds
    end, rest = 0, b""
    with path.open("rb") as file:
        for index, line in enumerate(file):
            if not line.endswith(b"\n"):
                rest = line
                break
            kind = _kind_at(line, index, items[index]) if index < len(items) else None
            if kind is None:
                raise _strange(path, index)
            kinds.append(kind)
            end += len(line)
    index = len(kinds)
    start = _start(index, items[index]).encode() if index < len(items) else b""
    # After whole lines of this batch any beginning of the next one is its own; a file that has
    # none must show at least the digest.
    torn = rest.startswith(start) or (kinds and start.startswith(rest))
    if rest and not (start and torn):
        raise _strange(path, index)
    return end, kinds


def _strange(path: Path, index: int) -> RequestError:
    message = f"{path}: line {index + 1} is no result of these requests; name another file"
    return RequestError((Fault("", message),))


def _start(index: int, item: Item) -> str:
    """Return how the line of a result begins."""
    return f'{{"index": {index}, "digest": "{item.digest}", '


def _kind_at(line: bytes, index: int, item: Item) -> str | None:
    """Return the kind of a result, None where the line is not the result of `item`."""
    try:
        entry = json.loads(line)
        if (entry["index"], entry["digest"]) == (index, item.digest):
            return _kind(entry)
    except (ValueError, KeyError, TypeError):
        pass
    return None


def _kind(entry: Mapping[str, Any]) -> str:
    """Return the status of a result, or ``"error"``."""
    return "error" if "error" in entry else str(entry["result"]["status"])
