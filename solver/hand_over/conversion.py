"""Settings in the law of a control system, rounded as they are typed, and what they then are.

Zeros and gain of the loop are kept; where the system fixes the filter, or permits a range only,
the filter changes and is said to. What comes back beside the typed values is the controller that
they make, in the units of the model: that one is to be analysed, not the one before rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from solver.hand_over.law import FilterEntry, Form, GainEntry, IntegralEntry
from solver.model.controllers import Controller, IdealForm, ParallelForm
from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST

if TYPE_CHECKING:
    from solver.hand_over.law import Law

__all__ = ["MAX_DIGITS", "Scales", "Typed", "typed"]

MAX_DIGITS = 12  # what decimal text and a double both hold, with room for the arithmetic between
STEPS_DOWN = 30  # last digits: three roundings of half a unit, where the first digit is 1
SAME = 1e-9  # relative difference of filter times that rounding makes


@dataclass(frozen=True, kw_only=True)
class Scales:
    """What one unit of the model is in the units of the control system.

    `gain`: gain in per cent of span per per cent of span over that of the model, output span over
    input span. `time`: typed units of time in one of the model's.
    """

    gain: float = 1.0
    time: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Typed:
    """What is typed for one loop.

    Parameters
    ----------
    gain : float
        Gain or proportional band; negative only where the law is signed.
    integral, derivative, filter : float or None
        As the law has them; None where nothing is typed: no such action, or a fixed filter.
    reverse : bool
        Whether the output falls when the measurement rises.
    controller : Controller
        What the typed values make, in the units of the model.
    notes : tuple of str
        What is not as it was asked.

    """

    gain: float
    integral: float | None
    derivative: float | None
    filter: float | None
    reverse: bool
    controller: Controller
    notes: tuple[str, ...]


def typed(loop: Controller, law: Law, *, scales: Scales, digits: int) -> Typed:
    """Return what is typed for `loop` under `law`, with so many significant digits.

    Raises
    ------
    InvalidInputError
        The law has no such controller.

    """
    fitted, notes = _fitted(loop, law)
    values = _rounded(_values(fitted, law, scales), digits)
    values, made = _made(values, law, scales, digits, reverse=loop.gain > 0)
    _check_range(made)
    sign = -1.0 if law.signed and loop.gain < 0 else 1.0
    sums = sign if law.form is Form.PARALLEL else 1.0
    return Typed(
        gain=sign * values.gain,
        integral=None if values.integral is None else sums * values.integral,
        derivative=None if values.derivative is None else sums * values.derivative,
        filter=None if law.has_fixed_filter else values.filter,
        reverse=loop.gain > 0,
        controller=made,
        notes=notes,
    )


def _check_range(made: Controller) -> None:
    """Refuse what no request could take back."""
    for name in ("gain", "integral_time", "derivative_time", "filter_time"):
        value = getattr(made, name)
        least = 0.0 if name == "gain" else 1 / LARGEST
        if value is not None and not least <= abs(value) <= LARGEST:
            message = f"as typed it would be {value:.4g}; choose other units"
            raise InvalidInputError(message, f"/{name}")


def _made(
    values: _Values, law: Law, scales: Scales, digits: int, *, reverse: bool
) -> tuple[_Values, Controller]:
    """Return typed values that make a controller, and that controller.

    Rounding may make a double root complex: then the derivative time goes down by its last digit.
    """
    for _ in range(STEPS_DOWN):
        try:
            return values, _controller(values, law, scales, reverse=reverse)
        except InvalidInputError:
            if values.derivative is None:
                raise
            values = replace(values, derivative=_less(values.derivative, digits))
    return values, _controller(values, law, scales, reverse=reverse)


@dataclass(frozen=True, kw_only=True)
class _Values:
    """Settings as the law has them, the gain without its sign, the filter even where fixed."""

    gain: float
    integral: float | None
    derivative: float | None
    filter: float | None


def _fitted(loop: Controller, law: Law) -> tuple[Controller, tuple[str, ...]]:
    """Return the controller with a filter that the law has, and what that changed."""
    if loop.derivative_time is None:
        if loop.lag_time and law.filter is not FilterEntry.MEASUREMENT:
            message = "this law has a filter for its derivative only: filter the measurement"
            raise InvalidInputError(message, "/filter_time")
        return loop, ()
    if law.filter is FilterEntry.MEASUREMENT or law.lowest is None or law.highest is None:
        return loop, ()
    try:
        ratio = _ratio(loop, law)
    except InvalidInputError:  # no ideal form with this filter
        ratio = math.inf
    nearest = min(max(ratio, law.lowest), law.highest)
    if math.isclose(ratio, nearest, rel_tol=SAME):
        return loop, ()
    lag = _lag(loop, law, nearest)
    changed = 100 * (lag / loop.lag_time - 1)
    note = (
        f"the filter time becomes {lag:.4g} instead of {loop.lag_time:.4g} ({changed:+.0f} %): "
        f"the system {'fixes it' if law.has_fixed_filter else 'permits no other'}"
    )
    return Controller(loop.gain, loop.integral_time, loop.derivative_time, lag), (note,)


def _ratio(loop: Controller, law: Law) -> float:
    """Return T_f/T_d in the law's form."""
    if law.form is Form.CASCADE:
        return loop.lag_time / (loop.derivative_time or math.nan)
    derivative = loop.to_ideal().derivative_time
    return loop.lag_time / derivative if derivative else math.inf


def _lag(loop: Controller, law: Law, ratio: float) -> float:
    """Return the filter time that makes T_f/T_d = `ratio`, gain and zeros kept."""
    lead = loop.derivative_time or 0.0
    if law.form is Form.CASCADE:
        return ratio * lead
    if loop.integral_time is None:  # T_d = tau_D - T_f
        return ratio * lead / (1 + ratio)
    # With T_i = tau_I + tau_D - T_f and T_d = (tau_I - T_f)(tau_D - T_f)/T_i, T_f = ratio T_d is
    # T_f^2 - (tau_I + tau_D) T_f + tau_I tau_D ratio/(1 + ratio) = 0; its smaller root, below both.
    total = loop.integral_time + lead
    product = loop.integral_time * lead * ratio / (1 + ratio)
    return 2 * product / (total + math.sqrt(total**2 - 4 * product))


def _values(loop: Controller, law: Law, scales: Scales) -> _Values:
    """Return the settings of the law, unrounded."""
    gain, integral, derivative, lag = _times(loop, law)
    if law.form is Form.PARALLEL:
        gains = abs(gain) * scales.gain
        return _Values(
            gain=gains,
            integral=None if integral is None else gains / (integral * scales.time),
            derivative=None if derivative is None else gains * derivative * scales.time,
            filter=_filter(lag, derivative, law, scales),
        )
    gain = abs(gain) * scales.gain
    time = None if integral is None else integral * scales.time
    return _Values(
        gain=100 / gain if law.gain is GainEntry.PROPORTIONAL_BAND else gain,
        integral=1 / time if time is not None and law.integral is IntegralEntry.REPEATS else time,
        derivative=None if derivative is None else derivative * scales.time,
        filter=_filter(lag, derivative, law, scales),
    )


def _filter(lag: float, derivative: float | None, law: Law, scales: Scales) -> float | None:
    """Return the filter as the law has it."""
    if not lag:
        return None
    if law.filter in {FilterEntry.TIME, FilterEntry.MEASUREMENT} or derivative is None:
        return lag * scales.time
    if not derivative:
        message = "the filter cancels the derivative action: leave both times out"
        raise InvalidInputError(message, "/filter_time")
    return lag / derivative if law.filter is FilterEntry.RATIO else derivative / lag


def _times(loop: Controller, law: Law) -> tuple[float, float | None, float | None, float]:
    """Return K, T_i, T_d and T_f of the law's form, in the units of the model."""
    lead = loop.derivative_time
    if law.form is Form.CASCADE or lead is None:
        return loop.gain, loop.integral_time, lead, loop.lag_time
    if law.filter is FilterEntry.MEASUREMENT:
        # (1 + tau_I s)(1 + tau_D s)/(tau_I s) = (T_i/tau_I)(1 + 1/(T_i s) + T_d s)
        if loop.integral_time is None:
            return loop.gain, None, lead, loop.lag_time
        total = loop.integral_time + lead
        gain = loop.gain * total / loop.integral_time
        return gain, total, loop.integral_time * lead / total, loop.lag_time
    ideal = loop.to_ideal()
    return ideal.gain, ideal.integral_time, ideal.derivative_time, ideal.filter_time


def _rounded(values: _Values, digits: int) -> _Values:
    def at(value: float | None) -> float | None:
        return None if value is None else float(f"{value:.{digits}g}")

    return _Values(
        gain=float(f"{values.gain:.{digits}g}"),
        integral=at(values.integral),
        derivative=at(values.derivative),
        filter=at(values.filter),
    )


def _less(value: float | None, digits: int) -> float | None:
    """Return the next smaller value of so many digits."""
    if not value:
        return value
    step = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{value - step:.{digits}g}")


def _controller(values: _Values, law: Law, scales: Scales, *, reverse: bool) -> Controller:
    """Return what typed values make, in the units of the model."""
    gain = 100 / values.gain if law.gain is GainEntry.PROPORTIONAL_BAND else values.gain
    integral, derivative = values.integral, values.derivative
    if law.form is Form.PARALLEL:
        integral = None if integral is None else gain / integral
        derivative = None if derivative is None else derivative / gain
    elif law.integral is IntegralEntry.REPEATS and integral is not None:
        integral = 1 / integral
    lag = values.filter
    if law.has_fixed_filter and derivative is not None and law.lowest is not None:
        lag = law.lowest * derivative
    elif lag is not None and derivative is not None:
        if law.filter is FilterEntry.RATIO:
            lag *= derivative
        elif law.filter is FilterEntry.GAIN:
            lag = derivative / lag
    signed = (gain if reverse else -gain) / scales.gain
    integral = None if integral is None else integral / scales.time
    derivative = derivative / scales.time if derivative else None
    lag = None if lag is None else lag / scales.time
    if law.form is Form.CASCADE or derivative is None:
        return Controller(signed, integral, derivative, lag)
    if law.filter is FilterEntry.MEASUREMENT:
        return _two_zeros(signed, integral, derivative, lag)
    if law.form is Form.PARALLEL:
        integral_gain = 0.0 if integral is None else signed / integral
        parallel = ParallelForm(signed, integral_gain, signed * derivative, lag or 0.0)
        return Controller.from_parallel(parallel)
    return Controller.from_ideal(IdealForm(signed, integral, derivative, lag or 0.0))


def _two_zeros(
    gain: float, integral: float | None, derivative: float, lag: float | None
) -> Controller:
    """Return the cascade form of K (1 + 1/(T_i s) + T_d s)/(1 + T_f s)."""
    if integral is None:
        return Controller(gain, None, derivative, lag)
    square = integral * (integral - 4 * derivative)
    if square < 0:
        message = "no cascade form: derivative_time must be at most integral_time/4"
        raise InvalidInputError(message, "/derivative_time")
    larger = (integral + math.sqrt(square)) / 2
    smaller = integral * derivative / larger
    return Controller(gain * larger / integral, larger, smaller, lag)
