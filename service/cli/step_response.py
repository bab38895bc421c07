"""``mutune step-response``: responses of a plant and its loops over time, in this process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.analyses.step_response import (
    StepResponseRequest,
    StepResponseResult,
    step_response_to_json,
)
from service.cli.analysis import answer
from service.cli.outcomes import ExitCode, reported
from service.wording import number, units_text

__all__ = ["simulate_file"]

_ENDS = {
    "complete": "Simulated up to {}.",
    "bound": "Ended at {}: an output left its bound, the loops are unstable.",
    "step_limit": "Ended at {}: too many steps; simulate less long, or leave out a tiny dead time.",
}
# Nine columns in 80 characters: four digits, short headings.
_HEADINGS = ("rise", "settle", "over", "IAE", "ISE", "max |e|", "var u", "y end")


@reported
def simulate_file(path: Path, *, as_json: bool) -> ExitCode:
    """Simulate the request in `path` and print the result.

    Parameters
    ----------
    path : Path
        Request file, or ``-`` for standard input.
    as_json : bool
        Print the JSON result alone, instead of a table.

    Returns
    -------
    ExitCode
        BAD_INPUT where the request is at fault, else DONE.

    """
    return answer(path, StepResponseRequest, _compute, StepResponseResult, _shown, as_json=as_json)


def _compute(request: StepResponseRequest) -> dict[str, Any]:
    return step_response_to_json(request.build().simulate())


def _shown(result: StepResponseResult) -> RenderableType:
    headline = _ENDS[result.end].format(number(result.time[-1]))
    table = Table("unit", box=SIMPLE_HEAD)
    for heading in _HEADINGS:
        table.add_column(heading, justify="right")
    for response in result.responses:
        metrics = response.metrics
        reached = metrics.set_point
        values = (
            None if reached is None else reached.rise_time,
            None if reached is None else reached.settling_time,
            None if reached is None else reached.overshoot,
            metrics.absolute_error,
            metrics.squared_error,
            metrics.largest_error,
            metrics.input_variation,
            response.output[-1],
        )
        table.add_row(
            units_text(response.units),
            *("-" if value is None else f"{value:.4g}" for value in values),
        )
    return Group(Text(headline, style="bold"), table)
