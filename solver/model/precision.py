"""The working precision of ball arithmetic, which belongs to the whole process.

python-flint keeps it in one place for all threads. Two that set and restore it side by side
would compute with each other's, and could leave it changed for good; so one waits for the other.
"""

from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

from flint import ctx

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["working_precision"]

_TURN = threading.RLock()


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """Compute with `bits` of precision inside, and as before outside; one thread at a time."""
    with _TURN:
        before = ctx.prec
        ctx.prec = bits
        try:
            yield
        finally:
            ctx.prec = before
