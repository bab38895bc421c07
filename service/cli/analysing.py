"""An analysis of the request in a file, in this process."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from service import registry
from service.analysis import compute
from service.cli.outcomes import ExitCode, read_input, reported
from service.problems import NumbersError
from service.schemas.parsing import Fault, RequestError, parse

__all__ = ["analyse_file"]


@reported
def analyse_file(name: str, path: Path, *, as_json: bool) -> ExitCode:
    """Analyse the request in `path` and print the result.

    Parameters
    ----------
    name : str
        Name of the analysis's module.
    path : Path
        Request file, or ``-`` for standard input.
    as_json : bool
        Print the JSON result alone, instead of tables.

    Returns
    -------
    ExitCode
        BAD_INPUT where the request is at fault, or holds numbers too far apart; INFEASIBLE where
        the analysis fails, as of unstable loops; else DONE.

    """
    analysis = registry.load(name)
    request = parse(analysis.request, read_input(path))
    try:
        document = compute(analysis.compute, request)
    except (ArithmeticError, np.linalg.LinAlgError):
        raise RequestError((Fault("", NumbersError().detail),)) from None
    result = analysis.result.model_validate(document)
    if as_json:
        print(json.dumps(document, allow_nan=False))  # noqa: T201 - the output asked for
    else:
        from service.cli.console import show  # noqa: PLC0415 - needed for people alone

        show(analysis.table(result))
    failed = analysis.fails is not None and analysis.fails(result)
    return ExitCode.INFEASIBLE if failed else ExitCode.DONE
