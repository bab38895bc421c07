"""P, PI, PD and PID controllers in cascade form, and their ideal (ISA) and parallel forms.

Cascade form (Skogestad, Lundstrom and Hovd 1989, eq. 26, where tau_F = 0.1 tau_D)::

    c(s) = k (1 + tau_I s)/(tau_I s) (1 + tau_D s)/(1 + tau_F s)

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
from solver.model.validation import frequencies, instance, settle_reals

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["DERIVATIVE_FILTER", "Controller", "IdealForm", "ParallelForm"]

DERIVATIVE_FILTER = 0.1  # filter time constant over tau_D, SLH eq. 26


@dataclass(frozen=True)
class IdealForm:
    """Ideal (ISA) form K (1 + 1/(T_i s) + T_d s/(1 + T_f s)); all times in the caller's unit.

    `gain` K, `integral_time` T_i, None: no integral action; `derivative_time` T_d; `filter_time`
    T_f.
    """

    gain: float
    integral_time: float | None
    derivative_time: float = 0.0
    filter_time: float = 0.0

    def __post_init__(self) -> None:
        settle_reals(self, "gain", "derivative_time", "filter_time", optional=("integral_time",))
        _require_finite(self, "gain", "integral_time", "derivative_time", "filter_time")


@dataclass(frozen=True)
class ParallelForm:
    """Parallel form K_p + K_i/s + K_d s/(1 + T_f s).

    `proportional_gain` K_p, `integral_gain` K_i (per time unit), `derivative_gain` K_d (times time
    unit), `filter_time` T_f.
    """

    proportional_gain: float
    integral_gain: float
    derivative_gain: float = 0.0
    filter_time: float = 0.0

    def __post_init__(self) -> None:
        names = ("proportional_gain", "integral_gain", "derivative_gain", "filter_time")
        settle_reals(self, *names)
        _require_finite(self, *names)


@dataclass(frozen=True)
class Controller:
    """A controller in cascade form.

    Parameters
    ----------
    gain : float
        k, not zero; negative for a process with negative gain.
    integral_time : float or None
        tau_I > 0, or None for P and PD, without integral action.
    derivative_time : float or None
        tau_D > 0, or None for P and PI.
    filter_time : float or None
        tau_F > 0, or None: `DERIVATIVE_FILTER` tau_D, and no filter where there is no tau_D.

    """

    gain: float
    integral_time: float | None
    derivative_time: float | None = None
    filter_time: float | None = None

    def __post_init__(self) -> None:
        times = ("integral_time", "derivative_time", "filter_time")
        settle_reals(self, "gain", optional=times)
        if not 0 < abs(self.gain) <= LARGEST:
            message = f"the gain must be finite, not zero and at most {LARGEST:g} in magnitude"
            raise InvalidInputError(message, "/gain")
        for name in times:
            value = getattr(self, name)
            if value is not None and not 0 < value <= LARGEST:
                words = name.replace("_", " ")
                message = f"the {words} must be positive and at most {LARGEST:g}, or absent"
                raise InvalidInputError(message, f"/{name}")

    @property
    def lag_time(self) -> float:
        """Return tau_F, the default filled in; zero without a filter."""
        if self.filter_time is not None:
            return self.filter_time
        return DERIVATIVE_FILTER * (self.derivative_time or 0.0)

    @property
    def polynomials(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Numerator and denominator, descending in s (Skogestad, Lundstrom and Hovd, eq. 26)."""
        num, den = np.array([self.gain]), np.array([1.0])
        if self.integral_time is not None:
            num = np.polymul(num, [self.integral_time, 1.0])
            den = np.polymul(den, [self.integral_time, 0.0])
        if self.derivative_time is not None:
            num = np.polymul(num, [self.derivative_time, 1.0])
        if self.lag_time:
            den = np.polymul(den, [self.lag_time, 1.0])
        return tuple(num.tolist()), tuple(den.tolist())

    def __call__(self, s: ArrayLike) -> NDArray[np.complex128] | complex:
        """Value at the complex points `s`, any shape, s != 0."""
        points: NDArray[np.complex128] = np.asarray(s, dtype=np.complex128)
        value: NDArray[np.complex128] = np.full_like(points, self.gain)
        if self.integral_time is not None:
            value = value + self.gain / (self.integral_time * points)
        if self.derivative_time is not None:
            value = value * (1 + self.derivative_time * points)
        if self.lag_time:
            value = value / (1 + self.lag_time * points)
        return complex(value) if value.ndim == 0 else value

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response at `omega` > 0 (rad per time unit), (k,) complex."""
        return np.atleast_1d(self(1j * frequencies(omega)))

    def to_ideal(self) -> IdealForm:
        """Return the ideal form of the same controller.

        Raises
        ------
        InvalidInputError
            One of tau_I and tau_D is above tau_F and the other below it, or tau_I + tau_D is not
            above it: one of the ideal form's times would be negative.

        """
        lead, lag = self.derivative_time or 0.0, self.lag_time
        # Equal coefficients of 1, s, s^2 in the two numerators over tau_I s (1 + T_f s).
        if self.integral_time is None:
            integral_time, derivative_time, gain = None, lead - lag, self.gain
        else:
            integral_time = self.integral_time + lead - lag
            # T_d = tau_I tau_D/T_i - tau_F, as a product whose sign does not suffer from rounding.
            derivative_time = -1.0
            if integral_time > 0:
                derivative_time = (self.integral_time - lag) * (lead - lag) / integral_time
            gain = self.gain * integral_time / self.integral_time
        if derivative_time < 0:
            message = "no ideal form: one of its times would be negative"
            if self.filter_time is None:
                message = (
                    "no ideal form: it exists for integral_time >= "
                    f"{DERIVATIVE_FILTER:g} derivative_time only"
                )
            raise InvalidInputError(message, "/integral_time")
        return IdealForm(gain, integral_time, derivative_time, lag)

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
            0.0 if ideal.integral_time is None else ideal.gain / ideal.integral_time,
            ideal.gain * ideal.derivative_time,
            ideal.filter_time,
        )

    @classmethod
    def from_ideal(cls, ideal: IdealForm) -> Controller:
        """Return the cascade form of an ideal controller.

        tau_I and tau_D are two roots that may change places: tau_D is the smaller one, unless the
        filter is `DERIVATIVE_FILTER` times the other. A `filter_time` of zero stands for that
        filter of the smaller one.

        Raises
        ------
        InvalidInputError
            No cascade form exists: the derivative time is too long for the integral time.

        """
        instance(ideal, IdealForm, "")
        if ideal.integral_time is not None and not ideal.integral_time > 0:
            message = "the integral time must be positive"
            raise InvalidInputError(message, "/integral_time")
        if not (ideal.derivative_time >= 0 and ideal.filter_time >= 0):
            message = "the derivative and filter times must not be negative"
            raise InvalidInputError(message, "/derivative_time")
        if ideal.derivative_time == 0:
            return cls(ideal.gain, ideal.integral_time)
        if ideal.filter_time == 0:
            return cls._from_ideal_with_own_filter(ideal)
        if ideal.integral_time is None:
            lead = ideal.derivative_time + ideal.filter_time
            return cls(ideal.gain, None, lead, _own_filter(lead, ideal.filter_time))
        # tau_I + tau_D = T_i + T_f and tau_I tau_D = T_i (T_d + T_f), from `to_ideal`.
        total = ideal.integral_time + ideal.filter_time
        difference = ideal.integral_time - ideal.filter_time
        square = difference**2 - 4 * ideal.integral_time * ideal.derivative_time
        if square < -1e-12 * total**2:  # rounding of an exact double root
            message = (
                "no cascade form: derivative_time must be at most "
                "(integral_time - filter_time)^2/(4 integral_time)"
            )
            raise InvalidInputError(message, "/derivative_time")
        larger = (total + math.sqrt(max(square, 0.0))) / 2
        smaller = ideal.integral_time * (ideal.derivative_time + ideal.filter_time) / larger
        if _own_filter(larger, ideal.filter_time) is None:
            smaller, larger = larger, smaller
        gain = ideal.gain * larger / ideal.integral_time
        return cls(gain, larger, smaller, _own_filter(smaller, ideal.filter_time))

    @classmethod
    def _from_ideal_with_own_filter(cls, ideal: IdealForm) -> Controller:
        """Return the cascade form with tau_F = `DERIVATIVE_FILTER` tau_D."""
        rest = 1 - DERIVATIVE_FILTER
        if ideal.integral_time is None:
            return cls(ideal.gain, None, ideal.derivative_time / rest)
        # tau_D solves rest tau_D^2 - rest T_i tau_D + T_i T_d = 0, from `to_ideal`.
        discriminant = 1 - 4 * ideal.derivative_time / (rest * ideal.integral_time)
        if discriminant < -1e-12:  # rounding of an exact double root
            message = f"no cascade form: derivative_time must be at most {rest / 4:g} integral_time"
            raise InvalidInputError(message, "/derivative_time")
        root = math.sqrt(max(discriminant, 0.0))
        # The smaller root, as product over the larger one: no digits cancel.
        derivative_time = 2 * ideal.derivative_time / (rest * (1 + root))
        integral_time = ideal.integral_time - rest * derivative_time
        gain = ideal.gain * integral_time / ideal.integral_time
        return cls(gain, integral_time, derivative_time)

    @classmethod
    def from_parallel(cls, parallel: ParallelForm) -> Controller:
        """Return the cascade form of a parallel controller.

        Raises
        ------
        InvalidInputError
            No proportional gain, gains of different sign, or as `from_ideal`.

        """
        instance(parallel, ParallelForm, "")
        if parallel.proportional_gain == 0:
            message = "no cascade form: the proportional gain must not be zero"
            raise InvalidInputError(message, "/proportional_gain")
        integral_time = None
        if parallel.integral_gain != 0:
            integral_time = parallel.proportional_gain / parallel.integral_gain
        derivative_time = parallel.derivative_gain / parallel.proportional_gain
        if (integral_time is not None and integral_time < 0) or derivative_time < 0:
            message = "no cascade form: the gains must have the same sign"
            raise InvalidInputError(message, "/proportional_gain")
        return cls.from_ideal(
            IdealForm(
                parallel.proportional_gain, integral_time, derivative_time, parallel.filter_time
            )
        )


def _own_filter(derivative_time: float, filter_time: float) -> float | None:
    """Return the filter time, or None where it is the default one of `derivative_time`."""
    # A filter written with 6 digits is the default.
    own = math.isclose(filter_time, DERIVATIVE_FILTER * derivative_time, rel_tol=1e-6)
    return None if own else filter_time


def _require_finite(form: IdealForm | ParallelForm, *names: str) -> None:
    for name in names:
        value = getattr(form, name)
        if value is not None and not math.isfinite(value):
            message = "must be finite"
            raise InvalidInputError(message, f"/{name}")
