"""``mutune integrity``: loops in manual and gains turned down, in this process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.analyses.integrity import (
    Detuning,
    IntegrityRequest,
    IntegrityResult,
    integrity_to_json,
)
from service.cli.analysis import answer
from service.cli.outcomes import ExitCode, reported
from service.schemas.peaks import Peak
from service.wording import number, units_text
from solver.robustness.integrity import integrity

__all__ = ["analyse_file"]

_SHOWN = 15  # kinds of sets worth a line; all of them are in the JSON result


@reported
def analyse_file(path: Path, *, as_json: bool) -> ExitCode:
    """Analyse the loops in `path` with any of them in manual and print the result.

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
    return answer(path, IntegrityRequest, _compute, IntegrityResult, _shown, as_json=as_json)


def _compute(request: IntegrityRequest) -> dict[str, Any]:
    task = request.build()
    return integrity_to_json(integrity(task.plant, task.uncertainty, task.performance, task.loops))


def _shown(result: IntegrityResult) -> RenderableType:
    style = "bold" if result.stable else "bold red"
    parts: list[RenderableType] = [Text(result.summary.capitalize() + ".", style=style)]
    table = Table(box=SIMPLE_HEAD)
    for group in result.groups:
        table.add_column(f"in service of {units_text(group)}", justify="right")
    for heading in ("sets", "stable", "robust stability", "robust performance"):
        table.add_column(heading, justify="right")
    for kind in result.classes[:_SHOWN]:
        table.add_row(
            *map(str, kind.in_service),
            f"{kind.subsets:,}" if kind.subsets < 10**9 else f"{float(kind.subsets):.2g}",
            "yes" if kind.nominally_stable else "no",
            _peak(kind.robust_stability),
            _peak(kind.robust_performance),
        )
    parts.append(table)
    hidden = len(result.classes) - _SHOWN
    if hidden > 0:
        parts.append(Text(f"{hidden} more kinds of sets are in the JSON result (--json)."))
    if result.detuning is not None:
        parts.append(Text(_detuned(result.detuning)))
    if result.controllability is not None:
        verdict = result.controllability.verdict
        parts.append(Text(f"Decentralised integral control with any gains reduced: {verdict}."))
    return Group(*parts)


def _peak(peak: Peak | None) -> str:
    return "-" if peak is None else number(peak.value)


def _detuned(detuning: Detuning) -> str:
    factors = ", ".join(f"{factor:g}" for factor in detuning.factors)
    alike = ", the loops of a group alike" if detuning.by_group else ""
    found = "none" if detuning.unstable == 0 else str(detuning.unstable)
    text = (
        f"Gains times {factors}{alike}: of {detuning.combinations} combinations {found} unstable."
    )
    if detuning.example is not None:
        text += f" One is ({', '.join(f'{factor:g}' for factor in detuning.example)})."
    return text
