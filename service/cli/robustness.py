"""``mutune robustness``: given loop settings, in this process."""

from __future__ import annotations

import json
from pathlib import Path

from rich.console import Console
from solver.robustness import analyse

from service.cli.outcomes import ExitCode, read_input, reported
from service.cli.tables import robustness_table
from service.schemas import RobustnessRequest, RobustnessResult, robustness_to_json
from service.schemas.parsing import parse

__all__ = ["analyse_file"]


@reported
def analyse_file(path: Path, *, as_json: bool) -> ExitCode:
    """Analyse the settings in `path` and print the result.

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
    request = parse(RobustnessRequest, read_input(path))
    task = request.build()
    document = robustness_to_json(
        analyse(task.plant, task.uncertainty, task.performance, task.loops, task.omega)
    )
    if as_json:
        print(json.dumps(document, allow_nan=False))  # noqa: T201 - the output asked for
    else:
        result = RobustnessResult.model_validate(document)
        Console().print(robustness_table(result, request.loops))
    return ExitCode.DONE
