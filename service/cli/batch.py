"""``mutune batch``: many requests on the service's engine, results in lines or as a table."""

from __future__ import annotations

import asyncio
import json
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from service.batch.formats import Rows, SettingsForm, TableFormat
from service.batch.request_lines import Item, read_items
from service.batch.results_file import opened
from service.batch.runner import NoWorkersError, Run
from service.batch.sweep import Variation, expand
from service.batch.table import writer
from service.cli.outcomes import ExitCode, read_input, reported, say
from service.schemas import Fault, RequestError, TuningRequest, parse_tuning_request
from service.trade_off import Collected
from service.whole_file import replace_text
from service.wording import TIME_UNIT

__all__ = ["batch_file", "check_file", "sweep_file"]

Entries = Iterator[dict[str, Any]]
Through = Callable[[list[Item], Entries], Entries]

_EVERY = 10.0  # seconds between lines of progress where there is no terminal


@reported
def batch_file(
    requests: Path,
    *,
    results: Path | None,
    scheduler: str | None,
    format_: TableFormat = TableFormat.NDJSON,
    each: Rows = Rows.REQUEST,
    form: SettingsForm = SettingsForm.CASCADE,
    curves: bool = True,
) -> ExitCode:
    """Tune every line of `requests`; write a line or rows for each, in the same order.

    A run that was stopped goes on where it was when it is repeated.

    Parameters
    ----------
    requests : Path
        A request a line (NDJSON), or ``-`` for standard input.
    results : Path or None
        Where to write; None: standard output.
    scheduler : str or None
        Address of a Dask scheduler; None: processes on this machine.
    format_ : TableFormat
        Lines of JSON, or a table.
    each : Rows
        What a row of a table stands for.
    form : SettingsForm
        Form of the settings in a table.
    curves : bool
        Whether results keep their curves over frequency, most of their size.

    Returns
    -------
    ExitCode
        BAD_INPUT where any line ended with an error, else DONE.

    """
    if results is not None and _same_file(requests, results):
        message = f"{results} is the file of requests; name another file for the results"
        raise RequestError((Fault("", message),))
    items = read_items(read_input(requests))
    if results is not None:
        _name_faults(requests, items)
    return _run_items(
        items,
        results=results,
        scheduler=scheduler,
        format_=format_,
        each=each,
        form=form,
        curves=curves,
    )


@reported
def sweep_file(
    request: Path,
    vary: list[str],
    *,
    results: Path | None,
    scheduler: str | None,
    format_: TableFormat = TableFormat.CSV,
    each: Rows = Rows.REQUEST,
    form: SettingsForm = SettingsForm.CASCADE,
    figure: Path | None = None,
) -> ExitCode:
    """Tune the request in a file with some of its fields varied.

    Parameters
    ----------
    request : Path
        Request file, or ``-`` for standard input.
    vary : list of str
        Fields and values, as ``plant.interaction=0.5:0.99:50``.
    results, scheduler, format_, each, form
        As for `batch_file`.
    figure : Path or None
        HTML file to write: the time constants reached over the varied field.

    Returns
    -------
    ExitCode
        BAD_INPUT where any point ended with an error, else DONE.

    """
    variations = [Variation.of(text) for text in vary]
    content = read_input(request)
    finish = None
    if figure is not None:
        finish = _drawing(figure, parse_tuning_request(content), variations, format_)
    if results is not None and _same_file(request, results):
        message = f"{results} is the file of the request; name another file for the results"
        raise RequestError((Fault("", message),))
    return _run_items(
        expand(content, variations),
        results=results,
        scheduler=scheduler,
        format_=format_,
        each=each,
        form=form,
        curves=False,
        also=finish,
    )


def _drawing(
    path: Path, request: TuningRequest, variations: list[Variation], format_: TableFormat
) -> Through:
    """Return what takes a look at the results on their way into a table, and draws them.

    Raises
    ------
    RequestError
        There is no figure of that.

    """
    if format_ is TableFormat.NDJSON or request.objective != "tau_p":
        message = "--figure goes with the objective tau_p and a table: --format csv or parquet"
        raise RequestError((Fault("", message),))
    collected = Collected(variations)

    def through(items: list[Item], entries: Entries) -> Entries:
        for entry in entries:
            item = items[entry["index"]]
            if not item.faults:
                collected.add(item.fields, entry.get("result"))
            yield entry
        from service.figures.document import page  # noqa: PLC0415 - imports Plotly
        from service.figures.search import trade_off  # noqa: PLC0415

        drawn = trade_off(collected.trade_off(), request.time_unit or TIME_UNIT)
        replace_text(path, page(drawn))

    return through


@reported
def check_file(requests: Path) -> ExitCode:
    """Check every line of `requests` and compute nothing.

    Parameters
    ----------
    requests : Path
        A request a line (NDJSON), or ``-`` for standard input.

    Returns
    -------
    ExitCode
        BAD_INPUT where any line is at fault, else DONE.

    """
    items = read_items(read_input(requests))
    faulty = _name_faults(requests, items)
    distinct = len({item.digest for item in items})
    say(f"{len(items)} requests, {distinct} different, {faulty} with faults")
    return ExitCode.BAD_INPUT if faulty else ExitCode.DONE


def _run_items(
    items: list[Item],
    *,
    results: Path | None,
    scheduler: str | None,
    format_: TableFormat,
    each: Rows,
    form: SettingsForm,
    curves: bool,
    also: Through | None = None,
) -> ExitCode:
    """Tune the requests; the arguments are those of `batch_file`, `also` sees what a table gets."""
    finish = None if format_ is TableFormat.NDJSON else writer(format_, items, each=each, form=form)
    if finish is not None and also is not None:
        write = finish

        def finish(file: IO[bytes], entries: Entries) -> None:
            write(file, also(items, entries))

    with opened(results, items, sys.stdout.buffer, finish) as kept:
        already = len(kept.done)
        try:
            with _stops_in_good_order(), _progress(already, len(items)) as advance:

                def settle(index: int, content: str) -> None:
                    found = json.loads(f"{{{content}}}").get("result")
                    identity = items[index].identity
                    if found and (identity or not curves):
                        found |= identity | ({} if curves else {"curves": None})
                        content = f'"result": {json.dumps(found)}'
                    kept.add(index, content, found["status"] if found else "error")
                    advance(found is None)

                asyncio.run(Run(items, kept.done, settle, say).run(scheduler))
        except KeyboardInterrupt:
            hint = "" if results is None else " The same command does the rest."
            say(f"Interrupted: {len(kept.done)} of {len(items)} done.{hint}")
            return ExitCode.INTERRUPTED
        except NoWorkersError as error:
            say(f"error: {error}; {len(kept.done)} of {len(items)} done")
            return ExitCode.CANNOT_START
    kinds = sorted(kept.kinds.items(), key=lambda each: each[0] == "error")
    say(f"{len(items)} requests: " + ", ".join(f"{n} {kind}" for kind, n in kinds))
    return ExitCode.BAD_INPUT if kept.kinds["error"] else ExitCode.DONE


def _same_file(requests: Path, results: Path) -> bool:
    """Whether both are one file, by whatever path, link or spelling."""
    if str(requests) == "-":
        return False
    if requests.exists() and results.exists():
        return requests.samefile(results)
    return requests.resolve() == results.resolve()


def _name_faults(path: Path, items: Sequence[Item]) -> int:
    """Say which lines are at fault; return how many."""
    faulty = [item for item in items if item.faults]
    for item in faulty:
        for fault in item.faults:
            where = f" {fault.pointer}:" if fault.pointer else ""
            say(f"{path}:{item.line}:{where} {fault.detail}")
    return len(faulty)


@contextmanager
def _stops_in_good_order() -> Iterator[None]:
    """Let SIGTERM stop the run as Ctrl-C does."""
    before = signal.signal(signal.SIGTERM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _progress(start: int, total: int) -> Iterator[Callable[[bool], None]]:
    """Show what is done: a bar on a terminal, a line from time to time elsewhere."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _Lines(start, total).advance
        return
    columns = (TextColumn("Batch"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=total, completed=start)

        def advance(_is_error: bool) -> None:  # noqa: FBT001 - a callback
            bar.advance(task)

        yield advance


class _Lines:
    """Progress as lines of text: count, errors, rate, time left."""

    def __init__(self, start: int, total: int) -> None:
        self._start = self._done = start
        self._total = total
        self._errors = 0
        self._began = self._said = time.monotonic()

    def advance(self, is_error: bool) -> None:  # noqa: FBT001 - a callback
        """Count one more."""
        self._done += 1
        self._errors += is_error
        now = time.monotonic()
        if now - self._said < _EVERY or self._done == self._total:
            return
        self._said = now
        rate = (self._done - self._start) / (now - self._began)
        left = (self._total - self._done) / rate
        say(
            f"{self._done} of {self._total} done, {self._errors} errors, "
            f"{rate:.3g} a second, {_duration(left)} left"
        )


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min" if minutes > 1 else f"{60 * minutes + rest} s"
