"""An analysis of the request in a file, in this process."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from service import registry
from service.analysis import compute
from service.cli.handing_on import in_unit, requested
from service.cli.outcomes import ExitCode, read_input, reported
from service.problems import NumbersError
from service.schemas.parsing import Fault, RequestError

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
        the analysis fails, as of unstable loops; else DONE.

    """
    analysis = registry.load(name)
    request = in_unit(requested(analysis.request, read_input(path)), time_unit)
    try:
        document = compute(analysis.compute, request)
    except (ArithmeticError, np.linalg.LinAlgError):
        raise RequestError((Fault("", NumbersError().detail),)) from None
    result = analysis.result.model_validate(document)
    if as_json:
        print(json.dumps(document, allow_nan=False))  # noqa: T201 - the output asked for
    else:
        from service.cli.console import show  # noqa: PLC0415 - needed for people alone

        show(analysis.table(result), request.time_unit)
    failed = analysis.fails is not None and analysis.fails(result)
    return ExitCode.INFEASIBLE if failed else ExitCode.DONE
