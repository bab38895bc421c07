"""What can go wrong with settings that were found, in sentences, the most serious first.

Every sentence is made from numbers that are computed here from the settings and the request, or
stand in the result.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from service.loop_tags import tagged, tags_of
from service.schemas.model_tolerance import ModelTolerance as Archived
from service.schemas.sheet import Topic
from service.sheet.naming import instrument_of, loops_name
from service.sheet.responses import MOST_STEPS, SHOWN, Moves, steps_of
from service.tuned import RequestedTuning
from service.wording import NO_LESS, in_symbols, number
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.subsystems import interchangeable, subsystem
from solver.robustness.axis import proven_peaks
from solver.robustness.model_tolerance import ModelTolerance as Computed
from solver.robustness.record import Peaks, Robustness
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.loops import Loop
from solver.simulation.step_response import step_response
from solver.stability.closed_loop import is_stable

__all__ = ["Level", "Said", "risks"]

ModelTolerance = Computed | Archived  # the result has them where the request asked for them
Level = Literal["good", "note", "warning", "bad"]
_ORDER: tuple[Level, ...] = ("bad", "warning", "note", "good")
_MET = 1 + 1e-6  # a tuning ends at mu = 1, to rounding
_TIGHT = 0.05  # an error of the model that is soon made
_FAR = 0.5  # one that is not
_NEAR = 0.995  # of the highest mu: frequencies that decide too
_WORTH_IT = 2.0  # per cent, below which a plant does not feel the difference
_OVERSHOOTS = 0.3  # of a set-point step: worth a word
_PLENTY = 10.0  # times the demand's time constant in which a loop in service alone is looked at
_TOLD = "Identical settings suffice"  # in advice, and here in the user's unit
_DIGITS = (2, 3, 4, 5)
_KEPT = 1.01  # of the peak of mu: what rounded settings may cost


@dataclass(frozen=True)
class Said:
    """A sentence, what it is about, and how serious it is."""

    topic: Topic
    level: Level
    text: str


def risks(
    tuned: RequestedTuning, robustness: Robustness, moved: Sequence[Moves]
) -> tuple[Said, ...]:
    """Return what can go wrong.

    Parameters
    ----------
    tuned : RequestedTuning
        Settings that are nominally stable.
    robustness : Robustness
        Of these settings, with the demand at the `tau_p` found.
    moved : sequence of Moves
        Their responses.

    """
    found = [
        *_demand(tuned, robustness),
        *(Said("note", "warning", _sentence(text, tuned)) for text in tuned.result.warnings),
        *_manual(tuned),
        *_model(tuned.result.model_tolerance or robustness.model_tolerance),
        *_stability(tuned, robustness),
        *_saturation(tuned, moved),
        *_speed(tuned, robustness),
        *_settings(tuned),
        *_as_found(tuned),
        *_identical(tuned),
        *(
            Said("note", "note", _sentence(text, tuned))
            for text in tuned.result.advice
            if not text.startswith(_TOLD)
        ),
    ]
    return tuple(sorted(found, key=lambda said: _ORDER.index(said.level)))


def _sentence(text: str, tuned: RequestedTuning) -> str:
    """Return a sentence of the solver with the symbols, unit and tags that people read."""
    text = in_symbols(text.removesuffix("."), tuned.unit)
    named = tagged(text, tags_of(tuned.request, tuned.plant.n))
    first = named[:1].upper() if named[:1].isascii() else named[:1]
    return f"{first}{named[1:]}."


def _demand(tuned: RequestedTuning, robustness: Robustness) -> Iterator[Said]:
    assert robustness.peaks is not None  # noqa: S101 - for the type checker: the loops are stable
    peak = robustness.peaks.robust_performance.value
    if peak > _MET:
        yield Said(
            "demand", "bad",
            f"The demand is not met for every plant within the uncertainty: μ reaches "
            f"{number(peak)}, above 1.",
        )  # fmt: skip
    for outcome in tuned.result.demands:
        if not outcome.met:
            yield Said(
                "demand", "bad",
                f"The demand {outcome.name.replace('_', ' ')} is not met: {number(outcome.value)} "
                f"instead of {number(outcome.limit)}.",
            )  # fmt: skip


def _manual(tuned: RequestedTuning) -> Iterator[Said]:
    """Say what happens with one loop of each kind in manual."""
    plant, loops = tuned.plant, tuned.loops
    if plant.n == 1:
        return
    kinds = interchangeable(plant, loops, tuned.uncertainty, tuned.performance.output_scale)
    for kind in kinds[:SHOWN]:
        rest = [unit for unit in range(plant.n) if unit != kind[0]]
        name = loops_name(tuned, kind)
        name = f"one of {name}" if len(kind) > 1 else name
        others = f"the other {'loop' if len(rest) == 1 else 'loops'}"
        stays, keeps, are = ("stays", "keeps", "is") if len(rest) == 1 else ("stay", "keep", "are")
        part, remaining = subsystem(plant, loops, rest)
        if not is_stable(part, remaining):
            yield Said(
                "manual", "bad",
                f"With {name} in manual {others} {are} unstable: put {others} in manual first.",
            )  # fmt: skip
            continue
        peaks = proven_peaks(
            part,
            tuned.uncertainty.of_units(rest),
            tuned.performance.of_units(rest),
            remaining,
        ).peaks
        text, level = _with_the_rest(peaks, others, stays, keeps)
        found = _worst_overshoot(tuned, rest)
        if found is not None:
            who, overshoot = found
            level = level if overshoot < _OVERSHOOTS or level != "good" else "note"
            text += f"; {who} then overshoots a set-point step by {100 * overshoot:.0f} %"
        yield Said("manual", level, f"With {name} in manual {text}.")
    if len(kinds) > SHOWN:
        yield Said(
            "manual", "note",
            f"{len(kinds) - SHOWN} more loops are not told one by one here: the analysis of loops "
            "out of service has all sets.",
        )  # fmt: skip


def _with_the_rest(peaks: Peaks, others: str, stays: str, keeps: str) -> tuple[str, Level]:
    stability, robust = peaks.robust_stability.value, peaks.robust_performance.value
    if stability > _MET:
        but = "but not for every plant within the uncertainty"
        return f"{others} {stays} stable, {but} (μ = {_above_one(stability)})", "warning"
    safe = f"{others} {stays} stable for every plant within the uncertainty"
    if robust <= _MET:
        return f"{safe} and {keeps} the demand (μ = {number(robust, 3)})", "good"
    return f"{safe}, but slower than the demand (μ = {_above_one(robust)})", "note"


def _above_one(value: float) -> str:
    """Return a value above 1 with as many digits as show that."""
    short = number(value, 3)
    return short if float(short) > 1 else number(value, 7)


def _worst_overshoot(tuned: RequestedTuning, rest: Sequence[int]) -> tuple[str, float] | None:
    """Return which of the loops left overshoots most after a set-point step of its own."""
    part, remaining = subsystem(tuned.plant, tuned.loops, rest)
    assert tuned.result.tau_p is not None  # noqa: S101 - for the type checker: there are settings
    found: list[tuple[float, int]] = []
    duration = _PLENTY * tuned.result.tau_p
    closed = tuple(Loop.of(loop).without_traces(duration) for loop in remaining)
    if steps_of(part, duration) > MOST_STEPS:
        return None
    for kind in interchangeable(part, remaining)[:SHOWN]:
        step = Step(StepKind.SETPOINT, kind[0], 0.0, 1.0)
        try:
            response = step_response(Experiment(part, closed, (step,), duration), of=kind[0])
        except InvalidInputError:
            return None
        measured = response.responses[0].metrics.set_point
        if measured is not None and measured.overshoot is not None:
            found.append((measured.overshoot, rest[kind[0]]))
    if not found:
        return None
    overshoot, unit = max(found)
    return (loops_name(tuned, (unit,)), overshoot) if overshoot > _TIGHT else None


def _model(tolerances: Sequence[ModelTolerance]) -> Iterator[Said]:
    """Say how wrong the model itself may be."""
    demand = _least((each, each.demand or ()) for each in tolerances)
    stability = _least((each, each.stability) for each in tolerances)
    if demand is None and stability is None:
        return
    costs = []
    for found, what in ((demand, "the demand"), (stability, "stability")):
        if found is not None and abs(found[0]) <= _FAR:
            costs.append(f"{_per_cent(found[0])} in the {_parameter(found[1])} costs {what}")
    if not costs:
        yield Said(
            "model", "good",
            f"No parameter of the model, wrong alone by less than {100 * _FAR:.0f} %, costs the "
            "demand or stability.",
        )  # fmt: skip
        return
    level: Level = "note"
    if demand is not None and abs(demand[0]) < _TIGHT:
        level = "warning"
    if stability is not None and abs(stability[0]) < _TIGHT:
        level = "bad"
    yield Said(
        "model", level,
        "The guarantee is for the plant as given and the errors of its inputs. Of the model itself "
        f"an error of {', of '.join(costs)}.",
    )  # fmt: skip


def _least(
    sides: Iterable[tuple[ModelTolerance, Sequence[float | None]]],
) -> tuple[float, ModelTolerance] | None:
    """Return the smallest error that costs something, and of what."""
    known = [(side, each) for each, pair in sides for side in pair if side is not None]
    return min(known, key=lambda one: abs(one[0]), default=None)


def _per_cent(share: float) -> str:
    return f"{float(f'{100 * share:.2g}'):+g} %".replace("-", "\u2212")


def _parameter(tolerance: ModelTolerance) -> str:
    name = tolerance.parameter.replace("_", " ")
    if tolerance.element is None:
        return name
    return f"{name} of element {tolerance.element[0] + 1},{tolerance.element[1] + 1}"


def _stability(tuned: RequestedTuning, robustness: Robustness) -> Iterator[Said]:
    factor = robustness.uncertainty_scaling
    if factor is not None:
        level: Level = "good" if factor >= 1 else "bad"
        yield Said(
            "stability", level,
            f"Every plant stays stable up to {number(factor, 3)} times the errors that were given.",
        )  # fmt: skip
    guarantee = tuned.result.guarantee
    if guarantee is None:
        return
    if guarantee.status == "proven":
        every = " of every scenario" if len(tuned.result.scenarios or ()) > 1 else ""
        yield Said(
            "stability", "good",
            f"Proven over all frequencies{every}: μ is nowhere above {number(guarantee.level, 6)}.",
        )  # fmt: skip
    else:
        yield Said(
            "stability", "note",
            f"Not proven over all frequencies: {in_symbols(guarantee.reason or '', tuned.unit)}. "
            "The peaks were sought on a fine grid and refined.",
        )  # fmt: skip


def _saturation(tuned: RequestedTuning, moved: Sequence[Moves]) -> Iterator[Said]:
    steps = [each for each in moved if each.kind is StepKind.SETPOINT]
    unknown = [each for each in steps if instrument_of(tuned, each.units[0]).input_span is None]
    if unknown:
        most = max(unknown, key=lambda each: each.given.measured.input_peak)
        signals = instrument_of(tuned, most.units[0])
        peak = _with_unit(most.given.measured.input_peak, signals.input_unit)
        most_of_all = ", more than any other loop's" if len(unknown) > 1 else ""
        yield Said(
            "saturation", "note",
            f"{_stepped(tuned, most)} moves its input by up to {peak}{most_of_all}. Give the spans "
            "of the signals to compare this with the valve's range.",
        )  # fmt: skip
    for each in steps:
        if each not in unknown:
            yield _saturated(tuned, each)


def _saturated(tuned: RequestedTuning, each: Moves) -> Said:
    """Say what a valve that rests at mid range makes of a set-point step."""
    signals = instrument_of(tuned, each.units[0])
    assert signals.input_span is not None  # noqa: S101 - for the type checker: it is known
    share = each.given.measured.input_peak / signals.input_span
    largest = _with_unit(each.size * 0.5 / share, signals.output_unit)
    text = (
        f"{_stepped(tuned, each)} asks for up to {_plain(100 * share)} % of the range of its "
        f"valve. From mid range steps up to {largest} stay within it"
    )
    if each.limited is None:
        return Said("saturation", "good", f"{text}.")
    time = each.limited.measured.settling_time
    if time is None:
        text += "; at its limits the loop does not settle in the time shown. Ramp set points."
        return Said("saturation", "warning", text)
    text += f"; at its limits the loop settles in {number(time, 3)} {tuned.unit}. Ramp set points."
    return Said("saturation", "note", text)


def _plain(value: float) -> str:
    """Return a positive number with three digits, or all of those before the point."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def _stepped(tuned: RequestedTuning, each: Moves) -> str:
    unit = instrument_of(tuned, each.units[0]).output_unit
    return f"A set-point step of {_with_unit(each.size, unit)} on {loops_name(tuned, each.units)}"


def _with_unit(value: float, unit: str | None) -> str:
    return f"{number(value, 3)} {unit}" if unit else number(value, 3)


def _speed(tuned: RequestedTuning, robustness: Robustness) -> Iterator[Said]:
    """Say what keeps the loops from being faster."""
    binding = [outcome.name for outcome in tuned.result.demands if outcome.active]
    for name in binding:
        yield Said("speed", "note", f"The demand {name.replace('_', ' ')} limits the speed.")
    assert robustness.peaks is not None  # noqa: S101 - for the type checker: the loops are stable
    curves, top = robustness.curves, robustness.peaks.robust_performance
    if curves is None or tuned.result.objective != "tau_p" or top.value < _NEAR:
        return
    values = np.asarray(curves.robust_performance)
    place = int(np.flatnonzero(values >= _NEAR * top.value)[-1])
    alone = float(curves.nominal_performance[place])
    err = "inputs" if tuned.uncertainty.outputs is None else "inputs and outputs"
    yield Said(
        "speed", "note",
        f"What limits the speed: at {number(float(curves.omega[place]), 3)} rad/{tuned.unit}, the "
        f"highest frequency where μ is at 1, exact {err} would leave it at {number(alone, 2)}; "
        f"the errors of the {err} cost the rest.",
    )  # fmt: skip


def _settings(tuned: RequestedTuning) -> Iterator[Said]:
    """Say how many digits of the settings matter."""
    given = None
    for digits in _DIGITS:
        rounded = tuple(_rounded(loop, digits) for loop in tuned.loops)
        if not is_stable(tuned.plant, rounded):
            continue
        peak = proven_peaks(
            tuned.plant, tuned.uncertainty, tuned.performance, rounded
        ).peaks.robust_performance.value
        given = given or _peak(tuned)
        if peak <= _KEPT * given:
            level: Level = "good" if digits <= 3 else "warning"
            more = "" if peak < _MET else "; a resolution in the request keeps it at 1 or below"
            yield Said(
                "settings", level,
                f"{('Two', 'Three', 'Four', 'Five')[digits - 2]} digits of the settings are "
                f"enough to within 1 % of μ: so rounded, it is {number(peak, 4)}{more}.",
            )  # fmt: skip
            return
    yield Said("settings", "bad", "The settings must be kept to more than five digits.")


def _peak(tuned: RequestedTuning) -> float:
    peaks = tuned.result.peaks
    value = None if peaks is None else peaks.robust_performance.value
    return math.inf if value is None else value


def _rounded(loop: Controller, digits: int) -> Controller:
    def short(value: float | None) -> float | None:
        return None if value is None else float(f"{value:.{digits}g}")

    return replace(
        loop,
        gain=float(f"{loop.gain:.{digits}g}"),
        integral_time=short(loop.integral_time),
        derivative_time=short(loop.derivative_time),
        filter_time=short(loop.filter_time),
    )


def _as_found(tuned: RequestedTuning) -> Iterator[Said]:
    """Doubt a model on which today's settings, which run, are unstable."""
    found = tuned.result.as_found
    if found is not None and not found.nominally_stable:
        yield Said(
            "model", "warning", "As found the loops are unstable on this model: is it right?"
        )


def _identical(tuned: RequestedTuning) -> Iterator[Said]:
    comparison = tuned.result.comparison
    if comparison is None or comparison.gain_percent is None or len(tuned.settings) < 2:
        return
    percent = comparison.gain_percent
    if percent < _WORTH_IT:
        unit = f" {tuned.unit}" if tuned.result.objective == "tau_p" else ""
        yield Said(
            "identical", "note",
            f"Identical settings would do: they reach {number(comparison.identical_value)}{unit}, "
            + ("no more." if percent < 100 * NO_LESS else f"{percent:.2g} % more."),
        )  # fmt: skip
