"""Units and loops by their numbers, counted from 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["loops_text", "units_text"]


def units_text(units: Sequence[int]) -> str:
    """Return units, given from 0, counted from 1: ``1``, ``1-25`` or ``1, 3``."""
    if len(units) > 1 and list(units) == list(range(units[0], units[0] + len(units))):
        return f"{units[0] + 1}-{units[-1] + 1}"
    return ", ".join(str(unit + 1) for unit in units)


def loops_text(units: Sequence[int]) -> str:
    """Return ``loop 1`` or ``loops 1-25``."""
    return f"loop{'s' * (len(units) > 1)} {units_text(units)}"
