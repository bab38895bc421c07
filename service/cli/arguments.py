"""Arguments that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["AsJson", "Input", "Scheduler"]

Input = Annotated[
    Path,
    typer.Argument(metavar="FILE.json", help="Request file; - reads standard input."),
]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON and nothing else on stdout.")
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        envvar="MUTUNE_SCHEDULER", metavar="tcp://...", help="Dask scheduler to work with."
    ),
]
