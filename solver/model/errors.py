"""The exceptions of the solver: few, and each names what the caller can mend."""

__all__ = ["Cancelled", "InvalidInputError", "MutuneError", "UnsupportedPlantError"]


class MutuneError(Exception):
    """Base of every exception that `solver` raises on purpose."""


class InvalidInputError(MutuneError, ValueError):
    """A value that the mathematics cannot accept.

    Parameters
    ----------
    message : str
        What is wrong and what would be accepted.
    field : str
        JSON pointer of the faulty value, relative to the object that raised (``"/den"``).

    """

    def __init__(self, message: str, field: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.field = field

    def __reduce__(self) -> tuple[type["InvalidInputError"], tuple[str, str]]:
        """Keep both arguments when the exception crosses a process boundary."""
        return type(self), (self.message, self.field)

    def within(self, prefix: str) -> "InvalidInputError":
        """Return the same error with its pointer below `prefix`."""
        return type(self)(self.message, prefix + self.field)


class UnsupportedPlantError(InvalidInputError):
    """A well-formed plant that the methods here do not cover, such as an open-loop unstable one."""


class Cancelled(MutuneError):  # noqa: N818 - a request obeyed, not an error
    """Raised by a progress callback to stop a computation; the solver lets it pass."""
