"""Parameters with what the record tells of them, and in words what it cannot tell."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.elements import ElementKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.identification.elements import Element
    from solver.identification.row_fit import RowFit

__all__ = ["Estimate", "FittedElement", "fitted_elements"]

HARDLY_TOLD = 0.35  # relative standard error of a time constant beyond which it is a guess
AT_BOUND = 0.02  # of the logarithm's range
BOUND_TOGETHER = 0.95  # correlation at which one parameter answers for the other
SETTLED = 4.0  # sums of time constants after which a step has said all
CLEAR = 20.0  # standard deviations of the noise that a test's effect should have
DRAWS = 2000


@dataclass(frozen=True)
class Estimate:
    """A parameter.

    Attributes
    ----------
    name : str
        gain, velocity_gain, zero_gain, time_constant, first_time_constant, second_time_constant,
        natural_period, damping_ratio, dead_time.
    value : float
        Estimate.
    standard_error : float or None
        None where the record says nothing.
    low, high : float or None
        Interval that holds the true value in 95 of 100 records or more, if the form is right; None
        without one.

    """

    name: str
    value: float
    standard_error: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class FittedElement:
    """An element of the plant as the record tells it.

    Attributes
    ----------
    output, input : str
        Names.
    element : Element
        Form and numbers.
    estimates : tuple of Estimate
        Its parameters.
    untold : tuple of str
        What the record cannot tell, in words.
    test : str or None
        Which test would tell it.

    """

    output: str
    input: str
    element: Element
    estimates: tuple[Estimate, ...]
    untold: tuple[str, ...]
    test: str | None


def fitted_elements(
    fit: RowFit, output: str, inputs: tuple[str, ...], seed: int = 0
) -> tuple[FittedElement, ...]:
    """Return the elements of a row with their parameters, in the inputs' order."""
    drawn = fit.draws(DRAWS, np.random.default_rng(seed))
    found: list[FittedElement] = []
    for name, element, (shapes, gains) in zip(inputs, fit.elements, fit.places(), strict=True):
        fixed = len(found) in fit.limits.fixed
        estimates = _estimates(fit, element, drawn, [] if fixed else shapes, gains)
        untold, test = _untold(fit, element, estimates, (shapes, gains), name, fixed=fixed)
        if not fixed and _is_longest(fit, element):
            estimates = tuple(_without_range(one) for one in estimates)
        found.append(FittedElement(output, name, element, estimates, untold, test))
    return tuple(found)


def _estimates(
    fit: RowFit,
    element: Element,
    drawn: NDArray[np.float64],
    shapes: list[int],
    gains: list[int],
) -> tuple[Estimate, ...]:
    kind = element.kind
    errors = np.sqrt(np.diag(fit.covariance.matrix))
    q = fit.covariance.quantile
    found: list[Estimate] = []
    for index, (place, value) in enumerate(zip(gains, element.gains, strict=True)):
        name = "zero_gain" if index else "velocity_gain" if kind.integrating else "gain"
        error = float(errors[place])
        found.append(_estimate(name, value, error, value - q * error, value + q * error))
    names = dict(zip(kind.shape_names, shapes, strict=True)) if shapes else {}
    if "log_lag" in names:
        place = names["log_lag"]
        error = float(errors[place])
        low, high = (_exp(math.log(element.lag) + sign * q * error) for sign in (-1, 1))
        name = "time_constant_sum" if "ratio" in names else "time_constant"
        found.append(_estimate(name, element.lag, element.lag * error, low, high))
    if "ratio" in names and np.ptp(drawn[:, names["log_lag"]]) > 0:
        ratio, lag = drawn[:, names["ratio"]], np.exp(drawn[:, names["log_lag"]])
        now = element.shape[1]
        if kind is ElementKind.RESONANT and now > 1:
            found.append(_from_draws("damping_ratio", now**-0.5, ratio**-0.5))
            found.append(_from_draws("natural_period", math.pi * element.lag * now**0.5,
                                     math.pi * lag * ratio**0.5))  # fmt: skip
        else:
            root, here = np.sqrt(np.maximum(1 - ratio, 0)), math.sqrt(max(1 - now, 0))
            for name, sign in (("first_time_constant", 1), ("second_time_constant", -1)):
                found.append(
                    _from_draws(
                        name, element.lag / 2 * (1 + sign * here), lag / 2 * (1 + sign * root)
                    )
                )
    if "dead_time" in names:
        error = float(errors[names["dead_time"]])
        value = element.dead_time
        found.append(
            _estimate("dead_time", value, error, max(value - q * error, 0.0), value + q * error)
        )
    return tuple(found)


def _is_longest(fit: RowFit, element: Element) -> bool:
    """Whether the lag is as long as the record can tell, so that it may be any longer one."""
    kind = element.kind
    if "log_lag" not in kind.shape_names or kind.integrating:
        return False
    bounds = math.log(fit.limits.shortest), math.log(fit.limits.longest)
    return bool(element.shape[0] > bounds[1] - AT_BOUND * (bounds[1] - bounds[0]))


def _without_range(one: Estimate) -> Estimate:
    """Return an estimate without its interval, where that is of the longest lag and no other."""
    if one.name == "dead_time":
        return one
    return Estimate(one.name, one.value, None, None, None)


def _estimate(name: str, value: float, error: float, low: float, high: float) -> Estimate:
    if not math.isfinite(error):
        return Estimate(name, value, None, None, None)
    return Estimate(name, value, error, low, high)


def _from_draws(name: str, value: float, drawn: NDArray[np.float64]) -> Estimate:
    low, high = np.quantile(drawn, [0.025, 0.975])
    return Estimate(
        name, value, float(np.std(drawn)), min(float(low), value), max(float(high), value)
    )


def _exp(value: float) -> float:
    return math.exp(min(max(value, -27.0), 27.0))


def _untold(
    fit: RowFit,
    element: Element,
    estimates: tuple[Estimate, ...],
    places: tuple[list[int], list[int]],
    name: str,
    *,
    fixed: bool,
) -> tuple[tuple[str, ...], str | None]:
    words: list[str] = []
    kind = element.kind
    if kind is ElementKind.NONE:
        return (), None
    gain = estimates[0]
    unseen = fixed or gain.low is None or gain.high is None
    if fixed and gain.low is not None and gain.high is not None:
        words.append(
            f"no effect of {name} is seen beyond noise: with the lag and dead time of the "
            f"strongest element its gain lies between {gain.low:.3g} and {gain.high:.3g}"
        )
    elif unseen:
        words.append(f"the record says nothing of the gain of {name}")
    elif "log_lag" in kind.shape_names and not kind.integrating:
        words += _about_lag(fit, element, *places)
    dead = estimates[-1]
    if not fixed and (dead.low is None or dead.high is None):
        words.append("the record says nothing of the dead time")
    elif not unseen and dead.high - dead.low > max(element.lag, 4 * fit.limits.sample):  # type: ignore[operator]
        words.append(
            f"the dead time is told only to lie between {dead.low:.3g} and {dead.high:.3g}"
        )
    return tuple(words), _test(fit, element, name, unseen=unseen) if words else None


def _about_lag(fit: RowFit, element: Element, shapes: list[int], gains: list[int]) -> list[str]:
    matrix = fit.covariance.matrix
    error = math.sqrt(float(matrix[shapes[0], shapes[0]]))
    bounds = math.log(fit.limits.shortest), math.log(fit.limits.longest)
    margin = AT_BOUND * (bounds[1] - bounds[0])
    upper = _is_longest(fit, element)
    if element.shape[0] < bounds[0] + margin:
        return ["the lag is shorter than the samples resolve"]
    if upper or not error < HARDLY_TOLD:
        return [_ratio_alone(fit, element, shapes, gains, upper=upper)]
    error_gain = math.sqrt(float(matrix[gains[0], gains[0]]))
    product = error * error_gain
    together = abs(matrix[shapes[0], gains[0]]) / product if product > 0 else 0.0
    if together > BOUND_TOGETHER:
        words = (
            f"gain and time constant answer for each other (correlation {together:.2f}): "
            "their ratio is told better than either"
        )
        return [words]
    return []


def _ratio_alone(
    fit: RowFit, element: Element, shapes: list[int], gains: list[int], *, upper: bool
) -> str:
    matrix = fit.covariance.matrix
    gain, lag = element.gains[0], element.lag
    # Of log K/tau by the covariance of K and log tau.
    variance = matrix[gains[0], gains[0]] / gain**2
    if math.isfinite(float(matrix[shapes[0], shapes[0]])):
        variance += matrix[shapes[0], shapes[0]] - 2 * matrix[gains[0], shapes[0]] / gain
    error = math.sqrt(max(float(variance), 0.0)) if math.isfinite(float(variance)) else math.inf
    why = (
        f"the time constant is as long as the record can tell ({lag:.3g}) and may be longer"
        if upper
        else f"the time constant ({lag:.3g}) is hardly told"
    )
    if error < HARDLY_TOLD:
        ratio = f"{gain / lag:.3g} (+- {100 * error:.0f} %)"
        # The error is that of the gain alone where the lag stands at its bound: a longer lag has
        # a ratio of its own.
        of = "with that one" if upper else "what is told is"
        return f"{why}; {of} gain / time constant = {ratio}"
    return f"{why}, and so is the gain"


def _two_digits(value: float) -> str:
    """Return a positive value with two significant digits, 1200 and not 1.2e+03."""
    return f"{float(f'{value:.2g}'):g}"


def _test(fit: RowFit, element: Element, name: str, *, unseen: bool) -> str:
    """Return the test that would tell: which input, how large, how long."""
    longest = fit.limits.longest if unseen else max(element.lag, 5 * fit.limits.sample)
    hold = SETTLED * longest + element.dead_time
    noise = fit.covariance.noise
    gain = abs(element.gains[0]) * (hold / 2 if element.kind.integrating else 1.0)
    if unseen or gain == 0 or noise == 0:
        size = "as large as the plant permits"
    else:
        size = f"of at least {_two_digits(CLEAR * noise / gain)}"
    return (
        f"a step of {name} {size}, held for {_two_digits(hold)} or longer while the other inputs "
        "rest, and back again"
    )
