"""Files written in one piece: there whole, or as they were before."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import IO

__all__ = ["replace", "replace_text"]

_READABLE = 0o666  # less what the user's umask takes: results are the user's own files


def replace(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file in one piece; one that was there keeps its permissions, and links stay links.

    Parameters
    ----------
    path : Path
        The file; what it held is lost when the new content is complete, and not before. What is
        no regular file, as a pipe, is written to as it is.
    write : callable
        Writes the content to a binary file.

    """
    if path.exists() and not path.is_file():
        with path.open("wb") as file:
            write(file)
        return
    path = path.resolve()
    new = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    descriptor = os.open(new, os.O_CREAT | os.O_EXCL | os.O_WRONLY, _READABLE)
    try:
        with os.fdopen(descriptor, "wb") as file:
            if path.exists():
                os.fchmod(descriptor, path.stat().st_mode & 0o7777)
            write(file)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except BaseException:
        with suppress(FileNotFoundError):
            new.unlink()
        raise


def replace_text(path: Path, text: str) -> None:
    """Write a text in one piece, as UTF-8."""
    replace(path, lambda file: file.write(text.encode()))
