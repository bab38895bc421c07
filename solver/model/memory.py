"""How much is computed at once: long batches of matrices are cut, for the memory's sake."""

from __future__ import annotations

__all__ = ["MAX_ENTRIES", "batch_length"]

MAX_ENTRIES = 4_000_000  # complex numbers in one batch, 64 MB


def batch_length(entries: int) -> int:
    """Return how many items of so many complex numbers each are computed at once, at least one."""
    return max(MAX_ENTRIES // max(entries, 1), 1)
