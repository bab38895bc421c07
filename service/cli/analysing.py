"""An analysis of the request in a file, in this process."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from service import registry
from service.analysis import compute
from service.cli.handing_on import in_unit, requested
from service.cli.interruption import Stopping
from service.cli.outcomes import ExitCode, read_input, reported
from service.loop_tags import tags_of
from service.problems import NumbersError
from service.schemas.parsing import Fault, RequestError

if TYPE_CHECKING:
    from collections.abc import Callable

    from service.analysis import Analysis
    from solver.tuning.record import Progress

__all__ = ["analyse_file"]


@reported
def analyse_file(name: str, path: Path, *, as_json: bool, time_unit: str | None = None) -> ExitCode:
    """Analyse the request in `path` and print the result.

    Parameters
    ----------
    name : str
        Name of the analysis's module.
    path : Path
        File with a request, or with what ``mutune tune --json`` printed; ``-``: standard input.
    as_json : bool
        Print the JSON result alone, instead of tables.
    time_unit : str or None
        Name of the unit of time, instead of the request's.

    Returns
    -------
    ExitCode
        BAD_INPUT where the request is at fault, or holds numbers too far apart; INFEASIBLE where
        the analysis fails, as of unstable loops; INTERRUPTED after Ctrl-C, which of long work
        keeps what was found; else DONE.

    """
    analysis = registry.load(name)
    request = in_unit(requested(analysis.request, read_input(path)), time_unit)
    stopping = Stopping()
    try:
        document = compute(_followed(analysis, stopping), request)
    except (ArithmeticError, np.linalg.LinAlgError):
        raise RequestError((Fault("", NumbersError().detail),)) from None
    result = analysis.result.model_validate(document)
    if as_json:
        print(json.dumps(document, allow_nan=False))  # noqa: T201 - the output asked for
    else:
        from service.cli.console import show  # noqa: PLC0415 - needed for people alone

        # One entry may be for all loops: it names none of them.
        several = len(request.instruments or ())
        tags = tags_of(request, several) if several > 1 else ()
        show(analysis.table(result), request.time_unit, tags)
    if stopping.wanted:
        return ExitCode.INTERRUPTED
    failed = analysis.fails is not None and analysis.fails(result)
    return ExitCode.INFEASIBLE if failed else ExitCode.DONE


def _followed(analysis: Analysis[Any, Any], stopping: Stopping) -> Callable[[Any], dict[str, Any]]:
    """Return the computation; of long work with its progress, and with Ctrl-C keeping the best."""
    work = analysis.job
    if work is None:
        return analysis.compute

    def followed(request: Any) -> dict[str, Any]:  # noqa: ANN401 - of any analysis
        console = Console(stderr=True)
        columns = BarColumn(), TimeElapsedColumn()
        with stopping, Bar(*columns, console=console, transient=True,
                           disable=not console.is_terminal) as bar:  # fmt: skip
            task = bar.add_task(analysis.name, total=1.0)

            def on_progress(progress: Progress) -> bool:
                stopping.has_result = stopping.has_result or progress.best is not None
                bar.update(task, completed=progress.fraction)
                return stopping.wanted

            return work.compute(request, on_progress)

    return followed
