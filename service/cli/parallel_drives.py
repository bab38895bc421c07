"""``mutune parallel-drives``: units with integral action on one load, in this process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.analyses.parallel_drives import (
    ParallelDrivesRequest,
    ParallelDrivesResult,
    parallel_drives_to_json,
)
from service.cli.analysis import answer
from service.cli.outcomes import ExitCode, reported
from service.wording import number
from solver.interaction.drive_simulation import simulate_drives
from solver.interaction.parallel_drives import analyse_drives

__all__ = ["analyse_file"]


@reported
def analyse_file(path: Path, *, as_json: bool) -> ExitCode:
    """Analyse the units in `path` and print the result.

    Parameters
    ----------
    path : Path
        Request file, or ``-`` for standard input.
    as_json : bool
        Print the JSON result alone, instead of tables.

    Returns
    -------
    ExitCode
        BAD_INPUT where the request is at fault, else DONE.

    """
    return answer(
        path, ParallelDrivesRequest, _compute, ParallelDrivesResult, _shown, as_json=as_json
    )


def _compute(request: ParallelDrivesRequest) -> dict[str, Any]:
    experiment = request.build()
    return parallel_drives_to_json(analyse_drives(experiment.system), simulate_drives(experiment))


def _shown(result: ParallelDrivesResult) -> RenderableType:
    analysis, simulation = result.analysis, result.simulation
    parts: list[RenderableType] = [Text(analysis.text, style="bold")]
    if not analysis.stable:
        parts.append(Text("The loop is unstable.", style="bold red"))
    if analysis.remedy is not None:
        parts.append(Text(analysis.remedy.text))
    table = Table("Share of the effort", box=SIMPLE_HEAD)
    for heading in ("before the pulse", "at the end", "at the end, mended"):
        table.add_column(heading, justify="right")
    before, after = simulation.original, simulation.mended
    for index in range(len(before.shares_at_end)):
        table.add_row(
            f"unit {index + 1}",
            number(before.shares_before_pulse[index]),
            number(before.shares_at_end[index]),
            number(None if after is None else after.shares_at_end[index]),
        )
    return Group(*parts, table)
