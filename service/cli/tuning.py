"""``mutune tune``: one request, in this process."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

import solver.tuning.record
from service.cli.console import show
from service.cli.handing_on import in_unit
from service.cli.interruption import Stopping
from service.cli.outcomes import ExitCode, exit_code_of, read_input, reported, say
from service.cli.tables import tuning_table
from service.loop_tags import tags_of
from service.schemas import TuningRequest, TuningResult, parse_tuning_request
from service.tuned import RequestedTuning
from service.valves import finished
from service.whole_file import replace_text
from service.wording import TIME_UNIT, number
from solver.tuning.compiling import Compiling

__all__ = ["tune_file"]

_COMPILING = (
    "Compiling the numerical kernels, once after an installation: a minute or two that do not "
    "count against the time limit."
)


@reported
def tune_file(
    path: Path,
    *,
    as_json: bool,
    report: Path | None = None,
    optimality_gap: bool = False,
    time_unit: str | None = None,
    limit: bool = False,
) -> ExitCode:
    """Tune the request in `path`, print the result and write a report of it.

    Parameters
    ----------
    path : Path
        Request file, or ``-`` for standard input.
    as_json : bool
        Print the JSON result alone, instead of tables.
    report : Path or None
        HTML file to write.
    optimality_gap : bool
        Ask for the proof even if the request does not.
    time_unit : str or None
        Name of the unit of time, instead of the request's.
    limit : bool
        Ask for other kinds of controllers even if the request does not.

    Returns
    -------
    ExitCode
        As the status of the result says, INTERRUPTED after Ctrl-C; BAD_INPUT where the request is
        at fault.

    """
    request = parse_tuning_request(read_input(path))
    wanted = {"optimality_gap": optimality_gap, "limit": limit}
    search = request.search.model_copy(update={name: True for name in wanted if wanted[name]})
    request = request.model_copy(update={"search": search})
    request = in_unit(request, time_unit)
    with Stopping() as stopping:
        document = _tune(request, stopping)
    result = TuningResult.model_validate(document)
    if as_json:
        if stopping.wanted:
            say("Interrupted; this is the best so far.")
        # With the request: what reads this next, as `mutune robustness -`, knows the plant too.
        asked = request.model_dump(mode="json", exclude_unset=True)
        print(json.dumps({**document, "request": asked}, allow_nan=False))  # noqa: T201 - asked for
    else:
        tags = tags_of(request, request.build().plant.n)
        show(tuning_table(result, interrupted=stopping.wanted), request.time_unit, tags)
    if report is not None:
        from service.report.document import report_html  # noqa: PLC0415 - imports Plotly

        record = RequestedTuning(request, result, request.time_unit or TIME_UNIT)
        replace_text(report, report_html(record, datetime.now(UTC)))
    return ExitCode.INTERRUPTED if stopping.wanted else exit_code_of(result)


def _tune(request: TuningRequest, stopping: Stopping) -> dict[str, object]:
    from solver.tuning import tuner  # noqa: PLC0415 - compiled kernels, where tunings run alone

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[starts]} starts done, best {task.fields[best]}"),
        TimeElapsedColumn(),
    )
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("Tuning", total=1.0, starts=0, best=number(None))

        def on_progress(progress: solver.tuning.record.Progress) -> bool:
            stopping.has_result = progress.best is not None
            bar.update(
                task,
                completed=progress.fraction,
                starts=f"{progress.starts_done} of {progress.starts}",
                best=number(progress.best),
            )
            return stopping.wanted

        compiling = Compiling(lambda: console.print(_COMPILING))
        tuning = tuner.tune(request.build(), on_progress)
        bar.update(task, description="Other controllers")
        document = finished(request, tuning, lambda: stopping.wanted)
        del compiling
        return document | request.identity()
