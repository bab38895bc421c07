"""Results in words: numbers, loops and the forms of a controller, as every view shows them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from service.schemas.peaks import Guarantee, Peaks
from service.schemas.tunings import TuningResult
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError

__all__ = [
    "NO_LESS",
    "OBJECTIVES",
    "TIME_UNIT",
    "Form",
    "forms",
    "guarantee_text",
    "headline",
    "in_symbols",
    "number",
    "optimality_text",
    "peak_rows",
    "spread_lines",
    "unit_of",
]

NO_LESS = 1e-6  # relative differences below this come from rounding: not worth a number
_OWN_TIME = re.compile(r"τP = \d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\d.]*[\d/])")
TIME_UNIT = "time unit"  # what the caller's unit of time is called where it has no name
OBJECTIVES = {"tau_p": "closed-loop time constant τP", "mu": "peak of μ"}
_PEAKS = (
    ("robust performance", "robust_performance"),
    ("robust stability", "robust_stability"),
    ("nominal performance", "nominal_performance"),
)


def number(value: float | None, digits: int = 5) -> str:
    """Return `value` with so many significant digits, a dash for none, a sign for infinity."""
    if value is None:
        return "-"
    return f"{value:.{digits}g}" if math.isfinite(value) else f"{'-' * (value < 0)}∞"


def in_symbols(text: str, unit: str) -> str:
    """Return a sentence of the solver with the symbols and the unit of time that people read."""
    text = re.sub(r"\btau_P\b", "τP", text)
    text = re.sub(r"\bomega_B\b", "ωB", text)
    text = re.sub(r"\bomega\b", "ω", text)
    text = re.sub(r"\bmu\b", "μ", text)
    text = _OWN_TIME.sub(rf"\g<0> {unit}", text)
    return text.replace("rad per time unit", f"rad/{unit}")


def headline(result: TuningResult, unit: str | None = TIME_UNIT) -> str:
    """Return in one sentence what was found, or why nothing was; None: the unit is put in later."""
    rate, after = ("rad/time", "") if unit is None else (f"rad/{unit}", f" {unit}")
    after += "s" * (unit == TIME_UNIT)
    if not result.loops:
        where = f" (at ω = {number(result.omega)} {rate})" if result.omega else ""
        reason = result.reason or "none were found"
        told = reason if unit is None else in_symbols(reason, unit)
        return f"No settings: {told}{where}."
    found = f"Closed-loop time constant τP = {number(result.tau_p)}{after}"
    if result.objective == "mu" and result.peaks is not None:
        peak = result.peaks.robust_performance.value
        found = f"Peak of μ = {number(peak)} at τP = {number(result.tau_p)}{after}"
    ended = {"local": ", the best beside the given settings",
             "time_limit": ", the best up to the time limit"}.get(result.status, "")  # fmt: skip
    unmet = "The demand is not met. " if result.demand_met is False else ""
    return f"{unmet}{found}{ended}."


def guarantee_text(guarantee: Guarantee | None) -> str:
    """Say what is proven over all frequencies; nothing where nothing was to be."""
    if guarantee is None:
        return ""
    if guarantee.status == "proven":
        return f"Proven: mu is at most {number(guarantee.level)} at every frequency."
    return f"Not proven over all frequencies: {guarantee.reason}."


def demand_rows(result: TuningResult) -> list[tuple[str, ...]]:
    """Return name, limit and value of each demand, and whether it binds."""
    return [
        (
            each.name.replace("_", " "), number(each.limit), number(each.value),
            ("binds" if each.active else "met") if each.met else "not met",
        )
        for each in result.demands
    ]  # fmt: skip


def spread_lines(result: TuningResult) -> list[str]:
    """Return the worst plant of a spread, and what is proven of all; nothing without one."""
    if result.spread is None:
        return []
    errors = ", ".join(
        f"{name} {100 * error:+.3g} %" for name, error in result.spread.worst.items()
    )
    said = [f"Spread: worst of {result.spread.plants} plants beside the corners: {errors}."]
    proof = result.spread.proof
    if proof is not None:
        told = f"not all plants of it are proven: {proof.reason}."
        if proof.reason is None:
            told = f"mu is proven to be at most {proof.level:.6g} for every plant of it."
        said.append(f"Spread: {told}")
    return said


def optimality_text(result: TuningResult) -> str | None:
    """Return in one sentence how far the least possible value is; None if not asked."""
    proof = result.optimality
    if proof is None:
        return None
    sought = "τP" if result.objective == "tau_p" else "peak of μ"
    if not proof.lower_bound:
        return f"How far from the least possible {sought}: nothing was proven in the time."
    ended = "" if proof.status == "reached" else " in the time"
    gap = proof.gap or 0.0
    least = f"{number(proof.lower_bound)}, {100 * gap:.3g} % less than here"
    return (
        f"Proven{ended}: no settings in such groups and within the bounds reach a {sought} below "
        f"{least if gap >= NO_LESS else 'the one here'}."
    )


def peak_rows(peaks: Peaks | None) -> list[tuple[str, str, str]]:
    """Return name, height and frequency of each peak of mu."""
    if peaks is None:
        return []
    found = [(name, getattr(peaks, field)) for name, field in _PEAKS]
    return [
        (name, "-" if peak.value is None else f"{peak.value:.5f}", number(peak.omega))
        for name, peak in found
    ]


@dataclass(frozen=True)
class Form:
    """A form of the controller law: its name, formula, symbols, and a row of values a setting.

    A row is a message, instead of values, where the setting does not exist in this form.
    """

    name: str
    formula: str
    symbols: tuple[str, ...]
    rows: tuple[tuple[float | None, ...] | str, ...]


_FORMULAS = {
    "cascade": ("k (1 + τI s)/(τI s)", "k (1 + τI s)/(τI s) (1 + τD s)/(1 + τF s)"),
    "ideal": ("K (1 + 1/(Ti s))", "K (1 + 1/(Ti s) + Td s/(1 + Tf s))"),
    "parallel": ("Kp + Ki/s", "Kp + Ki/s + Kd s/(1 + Tf s)"),
}
_SYMBOLS = {
    "cascade": ("k", "τI", "τD", "τF"),
    "ideal": ("K", "Ti", "Td", "Tf"),
    "parallel": ("Kp", "Ki", "Kd", "Tf"),
}


def unit_of(symbol: str, unit: str) -> str:
    """Return the unit of a symbol of a form, after a comma, or nothing for a gain."""
    named = {"Ki": f"1/{unit}", "Kd": unit}
    if symbol in named or symbol[0] in "τT":
        return f", {named.get(symbol, unit)}"
    return ""


def forms(controllers: Sequence[Controller]) -> tuple[Form, ...]:
    """Return the same controllers in cascade, ideal and parallel form."""
    derivative = any(controller.lag_time for controller in controllers)
    found = []
    for name, values in (
        ("cascade", _cascade),
        ("ideal", _ideal),
        ("parallel", _parallel),
    ):
        symbols = _SYMBOLS[name] if derivative else _SYMBOLS[name][:2]
        rows: list[tuple[float | None, ...] | str] = []
        for controller in controllers:
            try:
                rows.append(values(controller)[: len(symbols)])
            except InvalidInputError as error:
                rows.append(error.message)
        found.append(Form(name, _FORMULAS[name][derivative], symbols, tuple(rows)))
    return tuple(found)


def _cascade(controller: Controller) -> tuple[float | None, ...]:
    lag = controller.lag_time or None
    return controller.gain, controller.integral_time, controller.derivative_time, lag


def _ideal(controller: Controller) -> tuple[float | None, ...]:
    ideal = controller.to_ideal()
    return ideal.gain, ideal.integral_time, ideal.derivative_time, ideal.filter_time


def _parallel(controller: Controller) -> tuple[float | None, ...]:
    sums = controller.to_parallel()
    return sums.proportional_gain, sums.integral_gain, sums.derivative_gain, sums.filter_time
