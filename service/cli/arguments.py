"""Arguments that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.batch.formats import Rows, SettingsForm, TableFormat

__all__ = [
    "AsJson",
    "FormOption",
    "Input",
    "RowsOption",
    "Scheduler",
    "TableFormatOption",
    "TimeUnit",
]

Input = Annotated[
    Path,
    typer.Argument(metavar="FILE.json", help="Request file; - reads standard input."),
]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON and nothing else on stdout.")
]
TimeUnit = Annotated[
    str | None,
    typer.Option("--time-unit", metavar="UNIT", help="Name of the unit of time, as min."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        envvar="MUTUNE_SCHEDULER", metavar="tcp://...", help="Dask scheduler to work with."
    ),
]
TableFormatOption = Annotated[
    TableFormat, typer.Option("--format", help="Lines of JSON, or a table.")
]
RowsOption = Annotated[Rows, typer.Option("--rows", help="What a row of a table stands for.")]
FormOption = Annotated[SettingsForm, typer.Option(help="Form of the settings in a table.")]
