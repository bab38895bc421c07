"""``mutune batch``: many requests on the service's engine, one line of results a request."""

from __future__ import annotations

import asyncio
import hashlib
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from service.cli.outcomes import ExitCode, read_input, reported, say
from service.configuration import Configuration
from service.jobs.engine import Engine, EngineLostError, WorkerLostError
from service.jobs.records import JobStatus, Outcome
from service.problems import UnavailableError, describe
from service.schemas import Fault, RequestError, canonical, parse_tuning_request

__all__ = ["batch_file", "resume_at"]

_AHEAD = 1000  # results kept while an earlier line is still being computed
_RETRY = 1.0  # seconds before a task is sent again to a scheduler that went away


@dataclass(frozen=True)
class Item:
    """A line of the batch: its digest, and the request or what is wrong with it (JSON)."""

    digest: str
    request: str
    time_limit: float
    error: str | None = None


@reported
def batch_file(requests: Path, *, results: Path | None, scheduler: str | None) -> ExitCode:
    """Tune every line of `requests`; write a line a request, in the same order.

    A run that was stopped goes on where `results` ends when it is repeated.

    Parameters
    ----------
    requests : Path
        A request a line (NDJSON), or ``-`` for standard input.
    results : Path or None
        Where to write; None: standard output.
    scheduler : str or None
        Address of a Dask scheduler; None: processes on this machine.

    Returns
    -------
    ExitCode
        BAD_INPUT where any line ended with an error, else DONE.

    """
    items = [_item(line) for line in read_input(requests).splitlines()]
    kinds: Counter[str] = Counter()
    start = 0 if results is None else resume_at(results, items, kinds)
    try:
        with (
            nullcontext(sys.stdout.buffer) if results is None else results.open("ab") as output,
            _bar(start, len(items)) as advance,
        ):
            asyncio.run(_Batch(items, start, _writer(output, kinds, advance)).run(scheduler))
    except KeyboardInterrupt:
        hint = "" if results is None else " The same command does the rest."
        say(f"Interrupted: {kinds.total()} of {len(items)} done.{hint}")
        return ExitCode.INTERRUPTED
    say(f"{len(items)} requests: " + ", ".join(f"{n} {kind}" for kind, n in kinds.items()))
    return ExitCode.BAD_INPUT if kinds["error"] else ExitCode.DONE


def resume_at(path: Path, items: Sequence[Item], kinds: Counter[str]) -> int:
    """Return how many results `path` holds already; cut off a line that was not finished.

    Parameters
    ----------
    path : Path
        Results file; it need not exist.
    items : sequence of Item
        The batch.
    kinds : Counter
        Receives the kinds of the results found.

    Raises
    ------
    RequestError
        A line does not belong to these requests.

    """
    if not path.exists():
        return 0
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    for index, line in enumerate(whole.splitlines()):
        try:
            entry = json.loads(line)
            known = index < len(items) and entry["digest"] == items[index].digest
            kinds[_kind(entry)] += known
        except (ValueError, KeyError, TypeError):
            known = False
        if not known:
            detail = f"{path}: line {index + 1} is no result of these requests; name another file"
            raise RequestError((Fault("", detail),))
    if len(whole) < len(content):
        with path.open("r+b") as file:
            file.truncate(len(whole))
    return kinds.total()


class _Batch:
    """Runs the items from `start` on, as many at a time as the engine has workers."""

    def __init__(
        self, items: Sequence[Item], start: int, write: Callable[[int, Item, str], None]
    ) -> None:
        self._items = items
        self._next = start
        self._write = write
        self._written = start
        self._lines: dict[int, str] = {}
        self._wake = asyncio.Event()
        # Equal requests are computed once: the index that computes stands for the others.
        self._same: dict[str, list[int]] = {}

    async def run(self, scheduler: str | None) -> None:
        """Run to the end."""
        configuration = Configuration()
        engine = Engine(scheduler, configuration.workers, self._wake.set)
        await engine.start()
        running: set[asyncio.Task[None]] = set()
        try:
            while self._written < len(self._items):
                while len(running) < engine.workers and (index := self._take()) is not None:
                    task = asyncio.create_task(
                        self._solve(engine, index, configuration.max_attempts)
                    )
                    task.add_done_callback(lambda _task: self._wake.set())
                    running.add(task)
                await self._wake.wait()
                self._wake.clear()
                for task in [task for task in running if task.done()]:
                    running.remove(task)
                    task.result()
        finally:
            for task in running:
                task.cancel()
            await asyncio.gather(*running, return_exceptions=True)
            await engine.close()

    def _take(self) -> int | None:
        """Return the next item to be computed; settle those that need no computing."""
        while self._next < min(len(self._items), self._written + _AHEAD):
            index = self._next
            self._next += 1
            item = self._items[index]
            if item.error is not None:
                self._settle(index, f'"error": {item.error}')
            elif item.digest in self._same:
                self._same[item.digest].append(index)
            else:
                self._same[item.digest] = [index]
                return index
        if self._written == len(self._items):
            self._wake.set()
        return None

    async def _solve(self, engine: Engine, index: int, max_attempts: int) -> None:
        item = self._items[index]
        lost = 0
        while True:
            try:
                outcome = await engine.run(item.request, item.time_limit, _ignore)
            except WorkerLostError:
                lost += 1
                if lost < max_attempts:
                    continue
                detail = f"The worker process died in each of {lost} attempts."
                error = json.dumps(describe(UnavailableError(detail)))
                outcome = Outcome(JobStatus.FAILED, error=error)
            except EngineLostError:
                await asyncio.sleep(_RETRY)
                continue
            break
        for same in self._same.pop(item.digest):
            self._settle(same, _content(outcome))

    def _settle(self, index: int, content: str) -> None:
        """Write what is complete up to here, in order."""
        self._lines[index] = content
        while self._written in self._lines:
            content = self._lines.pop(self._written)
            self._write(self._written, self._items[self._written], content)
            self._written += 1


def _item(line: bytes) -> Item:
    try:
        request = parse_tuning_request(line)
    except RequestError as error:
        return Item(_digest(line), "", 0.0, json.dumps(describe(error)))
    text = canonical(request)
    return Item(_digest(text.encode()), text, request.search.time_limit)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _content(outcome: Outcome) -> str:
    if outcome.result is not None:
        return f'"result": {outcome.result}'
    if outcome.error is not None:
        return f'"error": {outcome.error}'
    detail = "The tuning was stopped from outside."
    return f'"error": {json.dumps(describe(UnavailableError(detail)))}'


def _kind(entry: Mapping[str, Mapping[str, str]]) -> str:
    return "error" if "error" in entry else entry["result"]["status"]


def _ignore(_fraction: float, _best: float | None) -> None:
    """Take no notice of a single item's progress."""


def _writer(
    output: BinaryIO, kinds: Counter[str], advance: Callable[[], None]
) -> Callable[[int, Item, str], None]:
    def write(index: int, item: Item, content: str) -> None:
        line = f'{{"index": {index}, "digest": "{item.digest}", {content}}}\n'
        output.write(line.encode())
        output.flush()  # what is written survives this process
        kinds[_kind(json.loads(line))] += 1
        advance()

    return write


@contextmanager
def _bar(start: int, total: int) -> Iterator[Callable[[], None]]:
    columns = (TextColumn("Batch"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=total, completed=start)
        yield lambda: bar.advance(task)
