"""How a search for the limit is told that it has gone on for long enough."""

__all__ = ["EnoughError"]


class EnoughError(Exception):
    """Raised by a `tick`: the search ends, and what it has found so far is its result."""
