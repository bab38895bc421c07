"""``mutune robustness``: given loop settings, in this process."""

from __future__ import annotations

from pathlib import Path

from service.analyses.robustness import RobustnessRequest, RobustnessResult
from service.cli.analysis import answer
from service.cli.outcomes import ExitCode, reported
from service.cli.tables import robustness_table
from service.computing import robustness

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
    return answer(
        path, RobustnessRequest, robustness, RobustnessResult, robustness_table, as_json=as_json
    )
