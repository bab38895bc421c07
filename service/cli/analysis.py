"""What the commands that answer at once share: read, compute, print JSON or tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel
from rich.box import SIMPLE_HEAD
from rich.console import Console, RenderableType
from rich.table import Table

from service.cli.outcomes import ExitCode, read_input
from service.problems import NumbersError
from service.schemas.parsing import Fault, RequestError, parse
from service.wording import number

__all__ = ["answer", "matrix_table"]

_Request = TypeVar("_Request", bound=BaseModel)
_Result = TypeVar("_Result", bound=BaseModel)


def answer(
    path: Path,
    request: type[_Request],
    compute: Callable[[_Request], dict[str, Any]],
    result: type[_Result],
    shown: Callable[[_Result], RenderableType],
    *,
    as_json: bool,
) -> ExitCode:
    """Answer the request in a file.

    Parameters
    ----------
    path : Path
        Request file, or ``-`` for standard input.
    request, result : type
        Models of both.
    compute : callable
        From request to JSON values.
    shown : callable
        From result to what people read.
    as_json : bool
        Print the JSON result alone, instead of tables.

    Raises
    ------
    RequestError
        The file cannot be read, is not such a request, or holds numbers too far apart.

    """
    asked = parse(request, read_input(path))
    try:
        document = compute(asked)
    except (ArithmeticError, np.linalg.LinAlgError):
        raise RequestError((Fault("", NumbersError().detail),)) from None
    if as_json:
        print(json.dumps(document, allow_nan=False))  # noqa: T201 - the output asked for
    else:
        Console().print(shown(result.model_validate(document)))
    return ExitCode.DONE


def matrix_table(
    title: str, rows: Sequence[Sequence[float | None]], row_name: str, column_name: str
) -> Table:
    """Return a matrix as a table; rows and columns are counted from 1."""
    table = Table(title, box=SIMPLE_HEAD)
    for column in range(len(rows[0])):
        table.add_column(f"{column_name} {column + 1}", justify="right")
    for index, row in enumerate(rows):
        table.add_row(f"{row_name} {index + 1}", *map(number, row))
    return table
