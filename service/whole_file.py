"""Files written in one piece: there whole, or as they were before."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO

__all__ = ["replace"]


def replace(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file in one piece.

    Parameters
    ----------
    path : Path
        The file; what it held is lost when the new content is complete, and not before.
    write : callable
        Writes the content to a binary file.

    """
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        with suppress(FileNotFoundError):
            Path(name).unlink()
        raise
