"""``mutune decouple``: a static decoupler and its loops, in this process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.analyses.decouple import DecouplingRequest, DecouplingResult, decoupling_to_json
from service.cli.analysis import answer, matrix_table
from service.cli.outcomes import ExitCode, reported
from service.wording import number
from solver.interaction.decoupling import decouple

__all__ = ["decouple_file"]


@reported
def decouple_file(path: Path, *, as_json: bool) -> ExitCode:
    """Decouple the plant in `path` and print the result.

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
    return answer(path, DecouplingRequest, _compute, DecouplingResult, _shown, as_json=as_json)


def _compute(request: DecouplingRequest) -> dict[str, Any]:
    return decoupling_to_json(decouple(request.build()))


def _shown(result: DecouplingResult) -> RenderableType:
    parts: list[RenderableType] = [
        matrix_table("Decoupler u = D u'", result.decoupler, "input", "controller"),
        _loops(result),
    ]
    if result.closed_loop is not None:
        stable = "stable" if result.closed_loop.stable else "UNSTABLE"
        parts += [
            matrix_table("Interaction index", result.closed_loop.indices, "output", "set point"),
            matrix_table("Peak of |H|", result.closed_loop.exact_peaks, "output", "set point"),
            Text(f"The loops together are {stable}."),
        ]
    parts += [Text(f"Warning: {warning}", style="yellow") for warning in result.warnings]
    return Group(*parts)


def _loops(result: DecouplingResult) -> RenderableType:
    table = Table("Loop", box=SIMPLE_HEAD)
    for heading in ("Kp", "Ki", "b", "Ms", "Mt", "design", "greatest Ki"):
        table.add_column(heading, justify="right")
    for index, (loop, weight) in enumerate(
        zip(result.loops, result.set_point_weights, strict=True)
    ):
        table.add_row(
            str(index + 1),
            number(None if loop.gains is None else loop.gains.proportional_gain),
            number(None if loop.gains is None else loop.gains.integral_gain),
            number(weight),
            number(None if loop.sensitivity is None else loop.sensitivity.value),
            number(None if loop.complementary is None else loop.complementary.value),
            loop.status,
            number(loop.greatest_integral_gain),
        )
    return table
