"""PI and PID controllers in cascade form, and their ideal (ISA) and parallel forms.

Cascade form, derivative action over one decade (Skogestad, Lundstrom and Hovd 1989, eq. 26)::

    c(s) = k (1 + tau_I s)/(tau_I s) (1 + tau_D s)/(1 + 0.1 tau_D s)

The three forms below are the same transfer function, filter included, so a conversion is exact
or it does not exist.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["DERIVATIVE_FILTER", "Controller", "IdealForm", "ParallelForm"]

DERIVATIVE_FILTER = 0.1  # filter time constant over tau_D, SLH eq. 26


@dataclass(frozen=True)
class IdealForm:
    """Ideal (ISA) form K (1 + 1/(T_i s) + T_d s/(1 + T_f s)); all times in the caller's unit."""

    gain: float
    integral_time: float
    derivative_time: float = 0.0
    filter_time: float = 0.0


@dataclass(frozen=True)
class ParallelForm:
    """Parallel form K_p + K_i/s + K_d s/(1 + T_f s)."""

    proportional_gain: float
    integral_gain: float
    derivative_gain: float = 0.0
    filter_time: float = 0.0


@dataclass(frozen=True)
class Controller:
    """A PI or PID controller in cascade form.

    Parameters
    ----------
    gain : float
        k, not zero; negative for a process with negative gain.
    integral_time : float
        tau_I > 0.
    derivative_time : float or None
        tau_D > 0, or None for PI.

    """

    gain: float
    integral_time: float
    derivative_time: float | None = None

    def __post_init__(self) -> None:
        if not 0 < abs(self.gain) <= LARGEST:
            message = f"the gain must be finite, not zero and at most {LARGEST:g} in magnitude"
            raise InvalidInputError(message, "/gain")
        if not 0 < self.integral_time <= LARGEST:
            message = f"the integral time must be positive and at most {LARGEST:g}"
            raise InvalidInputError(message, "/integral_time")
        if self.derivative_time is not None and not 0 < self.derivative_time <= LARGEST:
            message = f"the derivative time must be positive and at most {LARGEST:g}, or absent"
            raise InvalidInputError(message, "/derivative_time")

    def __call__(self, s: ArrayLike) -> NDArray[np.complex128] | complex:
        """Value at the complex points `s`, any shape, s != 0."""
        points: NDArray[np.complex128] = np.asarray(s, dtype=np.complex128)
        value: NDArray[np.complex128] = self.gain + self.gain / (self.integral_time * points)
        if self.derivative_time is not None:
            lead = self.derivative_time * points
            value = value * (1 + lead) / (1 + DERIVATIVE_FILTER * lead)
        return complex(value) if value.ndim == 0 else value

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response at `omega` > 0 (rad per time unit), (k,) complex."""
        return np.atleast_1d(self(1j * np.asarray(omega, dtype=float)))

    def to_ideal(self) -> IdealForm:
        """Return the ideal form of the same controller.

        Raises
        ------
        InvalidInputError
            tau_I < 0.1 tau_D: the derivative time of the ideal form would be negative.

        """
        if self.derivative_time is None:
            return IdealForm(self.gain, self.integral_time)
        filter_time = DERIVATIVE_FILTER * self.derivative_time
        # Equal coefficients of 1, s, s^2 in the two numerators over tau_I s (1 + T_f s).
        integral_time = self.integral_time + self.derivative_time - filter_time
        derivative_time = self.integral_time * self.derivative_time / integral_time - filter_time
        if derivative_time < 0:
            message = (
                "no ideal form: it exists for integral_time >= "
                f"{DERIVATIVE_FILTER:g} derivative_time only"
            )
            raise InvalidInputError(message, "/integral_time")
        gain = self.gain * integral_time / self.integral_time
        return IdealForm(gain, integral_time, derivative_time, filter_time)

    def to_parallel(self) -> ParallelForm:
        """Return the parallel form of the same controller.

        Raises
        ------
        InvalidInputError
            As `to_ideal`.

        """
        ideal = self.to_ideal()
        return ParallelForm(
            ideal.gain,
            ideal.gain / ideal.integral_time,
            ideal.gain * ideal.derivative_time,
            ideal.filter_time,
        )

    @classmethod
    def from_ideal(cls, ideal: IdealForm) -> Controller:
        """Return the cascade form of an ideal controller.

        With a derivative the filter must be the cascade form's own: of the two cascade
        controllers that share gain, integral and derivative time, `ideal.filter_time` selects
        the one; zero selects the one with the smaller derivative time and its filter.

        Raises
        ------
        InvalidInputError
            No cascade form exists: T_d > 0.225 T_i, or a filter that it cannot have.

        """
        if not ideal.integral_time > 0:
            message = "the integral time must be positive"
            raise InvalidInputError(message, "/integral_time")
        if not (ideal.derivative_time >= 0 and ideal.filter_time >= 0):
            message = "the derivative and filter times must not be negative"
            raise InvalidInputError(message, "/derivative_time")
        if ideal.derivative_time == 0 and ideal.filter_time == 0:
            return cls(ideal.gain, ideal.integral_time)
        rest = 1 - DERIVATIVE_FILTER
        # tau_D solves rest tau_D^2 - rest T_i tau_D + T_i T_d = 0, from `to_ideal`.
        discriminant = 1 - 4 * ideal.derivative_time / (rest * ideal.integral_time)
        if discriminant < -1e-12:  # rounding of an exact double root
            message = f"no cascade form: derivative_time must be at most {rest / 4:g} integral_time"
            raise InvalidInputError(message, "/derivative_time")
        root = math.sqrt(max(discriminant, 0.0))
        roots = [ideal.integral_time * (1 - root) / 2, ideal.integral_time * (1 + root) / 2]
        roots = [value for value in roots if value > 0]
        if ideal.filter_time > 0:
            wanted = ideal.filter_time / DERIVATIVE_FILTER
            # A filter known to 6 digits is enough to tell the two roots from each other.
            roots = [value for value in roots if math.isclose(value, wanted, rel_tol=1e-6)]
            if not roots:
                message = (
                    "no cascade form has this filter_time; leave it zero for the cascade form's own"
                )
                raise InvalidInputError(message, "/filter_time")
        derivative_time = roots[0]
        integral_time = ideal.integral_time - rest * derivative_time
        gain = ideal.gain * integral_time / ideal.integral_time
        return cls(gain, integral_time, derivative_time)

    @classmethod
    def from_parallel(cls, parallel: ParallelForm) -> Controller:
        """Return the cascade form of a parallel controller.

        Raises
        ------
        InvalidInputError
            A zero proportional or integral gain, gains of different sign, or as `from_ideal`.

        """
        if parallel.proportional_gain == 0 or parallel.integral_gain == 0:
            message = "no cascade form: proportional and integral gain must not be zero"
            raise InvalidInputError(message, "/integral_gain")
        integral_time = parallel.proportional_gain / parallel.integral_gain
        derivative_time = parallel.derivative_gain / parallel.proportional_gain
        if integral_time < 0 or derivative_time < 0:
            message = "no cascade form: the gains must have the same sign"
            raise InvalidInputError(message, "/proportional_gain")
        return cls.from_ideal(
            IdealForm(
                parallel.proportional_gain, integral_time, derivative_time, parallel.filter_time
            )
        )
