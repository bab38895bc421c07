"""Numbers that a controller accepts: so many significant digits, or steps of a given size."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST
from solver.model.validation import integer, real, settle

__all__ = ["Resolution"]

MAX_DIGITS = 8  # more say nothing that a controller's own arithmetic keeps
TRIFLE = Decimal("1e-12")  # relative: steps off a number of the lattice


@dataclass(frozen=True)
class Resolution:
    """The numbers that may be typed in, as magnitudes.

    Parameters
    ----------
    digits : int or None
        Significant digits of every setting, 1..8; instead of steps.
    gain, time : float or None
        Steps of the gain (input unit per output unit) and of the times (time unit); None: any
        number.

    """

    digits: int | None = None
    gain: float | None = None
    time: float | None = None

    def __post_init__(self) -> None:
        steps = [name for name in ("gain", "time") if getattr(self, name) is not None]
        if (self.digits is None) is (not steps):
            message = "give the number of digits, or steps of gain and time"
            raise InvalidInputError(message, "")
        if self.digits is not None:
            settle(self, digits=integer(self.digits, "/digits"))
            if not 1 <= self.digits <= MAX_DIGITS:
                message = f"the number of digits must lie in 1..{MAX_DIGITS}"
                raise InvalidInputError(message, "/digits")
        for name in steps:
            step = real(getattr(self, name), f"/{name}")
            settle(self, **{name: step})
            if not 1 / LARGEST <= step <= LARGEST:
                message = f"a step must lie in {1 / LARGEST:g}..{LARGEST:g}"
                raise InvalidInputError(message, f"/{name}")

    def limits(self, parameter: str) -> bool:
        """Whether this setting is limited at all."""
        return self._step(parameter, Decimal(1)) is not None

    def below(self, parameter: str, value: Decimal, *, strictly: bool = False) -> Decimal | None:
        """Return the next number at or below a magnitude > 0; None: there is none above 0."""
        if strictly:
            value *= 1 - TRIFLE
        step = self._step(parameter, value)
        if step is None:
            return value
        found = (value / step).to_integral_value(ROUND_FLOOR) * step
        return found if found > 0 else None

    def above(self, parameter: str, value: Decimal, *, strictly: bool = False) -> Decimal:
        """Return the next number at or above a magnitude > 0."""
        if strictly:
            value *= 1 + TRIFLE
        step = self._step(parameter, value)
        if step is None:
            return value
        return (value / step).to_integral_value(ROUND_CEILING) * step

    def _step(self, parameter: str, value: Decimal) -> Decimal | None:
        if self.digits is not None:
            return Decimal(1).scaleb(value.adjusted() - self.digits + 1)
        step = self.gain if parameter == "gain" else self.time
        return None if step is None else Decimal(repr(step))
