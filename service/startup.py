"""What keeps a process from starting, for the command line; imports nothing."""

from __future__ import annotations

__all__ = ["CannotStartError"]


class CannotStartError(Exception):
    """Something that the process needs is not there or does not fit; the message is one line."""
