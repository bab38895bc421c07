"""The control law of a loop in time: PI or PID with set-point weights, or proportional alone.

In Laplace transforms, with the cascade form of Skogestad, Lundstrom and Hovd (1989), eq. 26,
written as P + I/s + D s/(1 + T_f s), and set-point weights as in Astrom and Hagglund, Advanced
PID Control (2006), section 11.3::

    v = P (b r - y) + I/s (r - y) + D s/(1 + T_f s) (c r - y)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST
from solver.model.validation import instance, settle_reals

__all__ = ["Limits", "Loop"]

TRACE = 1e-7  # of a simulation: a derivative that is over then is seen by nobody


@dataclass(frozen=True)
class Loop:
    """A closed loop: the cascade form of `Controller`, with more freedom in time.

    Parameters
    ----------
    gain : float
        k, not zero; negative for a process with negative gain.
    integral_time : float or None
        tau_I > 0, None for a controller without integral action.
    derivative_time : float or None
        tau_D > 0, None for a controller without derivative action.
    setpoint_weight, derivative_weight : float
        b and c above; 1 is error feedback, as in the frequency domain analyses.
    filter_time : float or None
        tau_F > 0, None for that of `Controller`.

    """

    gain: float
    integral_time: float | None = None
    derivative_time: float | None = None
    setpoint_weight: float = 1.0
    derivative_weight: float = 1.0
    filter_time: float | None = None

    def __post_init__(self) -> None:
        weights = ("setpoint_weight", "derivative_weight")
        times = ("integral_time", "derivative_time", "filter_time")
        settle_reals(self, "gain", *weights, optional=times)
        _ = self.controller  # the cascade form checks its own parameters
        for name in weights:
            if not 0 <= getattr(self, name) <= 1:
                message = "a set-point weight lies in 0..1"
                raise InvalidInputError(message, f"/{name}")

    @classmethod
    def of(cls, controller: Controller) -> Loop:
        """Return the loop with error feedback through `controller`."""
        instance(controller, Controller, "")
        return cls(
            controller.gain,
            controller.integral_time,
            controller.derivative_time,
            filter_time=controller.filter_time,
        )

    def without_traces(self, duration: float) -> Loop:
        """Return the loop without derivative action that is over before anything can be seen.

        Where a search lets the derivative time vanish, it and its filter end at times that no
        valve follows, and that a simulation would spend nearly all its steps on.
        """
        slowest = max(self.derivative_time or 0.0, self.lag_time)
        if slowest > TRACE * duration:
            return self
        return replace(self, derivative_time=None, filter_time=None)

    @property
    def controller(self) -> Controller:
        """The controller that error feedback through this loop is."""
        return Controller(self.gain, self.integral_time, self.derivative_time, self.filter_time)

    @property
    def lag_time(self) -> float:
        """T_f, the default filled in; zero without a filter."""
        return self.controller.lag_time

    @property
    def integral_gain(self) -> float:
        """Return I above."""
        return 0.0 if self.integral_time is None else self.gain / self.integral_time

    @property
    def proportional_gain(self) -> float:
        """Return P above."""
        lead = (self.derivative_time or 0.0) - self.lag_time
        return self.gain + self.integral_gain * lead

    @property
    def derivative_gain(self) -> float:
        """Return D above; negative where there is no ideal form."""
        own = self.gain * (self.derivative_time or 0.0)
        return own - self.proportional_gain * self.lag_time


@dataclass(frozen=True)
class Limits:
    """Limits of an input, as deviations from its resting value, with anti-windup.

    Parameters
    ----------
    low, high : float
        low <= 0 <= high, low < high: the simulation starts at rest between them.
    tracking_time : float or None
        T_t > 0 of the back-calculation: the integrator is driven by (limited input - wanted
        input)/T_t. None: the integral time, or with derivative action the geometric mean of
        integral and derivative time (Astrom and Hagglund, section 3.5).

    """

    low: float
    high: float
    tracking_time: float | None = None

    def __post_init__(self) -> None:
        settle_reals(self, "low", "high", optional=("tracking_time",))
        if not (-LARGEST <= self.low <= 0 <= self.high <= LARGEST and self.low < self.high):
            message = "limits must satisfy low <= 0 <= high and low < high"
            raise InvalidInputError(message, "/low")
        if self.tracking_time is not None and not 0 < self.tracking_time <= LARGEST:
            message = "the tracking time must be positive"
            raise InvalidInputError(message, "/tracking_time")

    def tracking_time_for(self, loop: Loop) -> float:
        """Return T_t for a loop with integral action."""
        if self.tracking_time is not None:
            return self.tracking_time
        integral_time = loop.integral_time or 1.0
        if loop.derivative_time is None:
            return integral_time
        return math.sqrt(integral_time * loop.derivative_time)
