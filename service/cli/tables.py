"""Results as tables for people: settings in three forms, peaks, search, what asymmetry buys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.schemas import TuningResult
from service.schemas.peaks import Peaks
from service.schemas.tunings import SearchSummary
from service.wording import forms, number, optimality_text, units_text
from solver.model.controllers import Controller

if TYPE_CHECKING:  # a tuning need not wait for them
    from service.analyses.robustness import RobustnessResult
    from service.schemas.margins import LoopMargins

__all__ = ["robustness_table", "side_by_side", "tuning_table"]

_CURVES = (
    ("robust performance", "robust_performance", "at most 1: demand met"),
    ("robust stability", "robust_stability", "below 1: always stable"),
    ("nominal performance", "nominal_performance", "(without uncertainty)"),
)
_OPTIMA = 5  # local optima worth a line; all of them are in the JSON result


def tuning_table(result: TuningResult) -> RenderableType:
    """Return a tuning as text and tables."""
    parts: list[RenderableType] = [Text(_headline(result), style="bold")]
    if result.loops:
        parts.append(Text())
        parts += _forms(
            [(units_text(group), result.loops[group[0]].build()) for group in result.groups]
        )
    if result.peaks is not None:
        parts.append(_peaks(result.peaks))
    if result.comparison is not None:
        parts.append(
            Text(
                f"What asymmetry buys: {_objective(result)} instead of "
                f"{number(result.comparison.identical_value)} with identical settings, "
                f"{number(result.comparison.gain_percent)} % less."
            )
        )
    optimality = optimality_text(result.optimality)
    if optimality is not None:
        parts.append(Text(optimality))
    if result.integrity is not None:
        parts.append(Text(f"{result.integrity[0].upper()}{result.integrity[1:]}."))
    parts += _proof(result.certificate)
    parts.append(Text(_search(result.search)))
    parts += [Text(f"Warning: {warning}", style="yellow") for warning in result.warnings]
    return Group(*parts)


def robustness_table(result: RobustnessResult) -> RenderableType:
    """Return an analysis as text and tables."""
    parts: list[RenderableType] = []
    if result.nominally_stable:
        parts.append(Text("Nominally stable.", style="bold"))
    else:
        poles = result.unstable_poles
        parts.append(
            Text(
                f"Unstable: {poles} closed-loop pole{'s' * (poles != 1)} in the right half plane.",
                style="bold red",
            )
        )
    if result.peaks is not None:
        parts.append(_peaks(result.peaks))
    if result.lower_bound is not None:
        bound = number(result.lower_bound.value)
        parts.append(Text(f"A plant in the set reaches {bound}: the lower bound of that peak."))
    if result.uncertainty_scaling is not None:
        factor = number(result.uncertainty_scaling)
        parts.append(Text(f"All plants stay stable up to {factor} times the uncertainty."))
    parts += _proof(result.certificate)
    if result.margins:
        parts.append(_margins(result.margins))
    parts += [Text(f"Warning: {warning}", style="yellow") for warning in result.warnings]
    return Group(*parts)


def side_by_side(results: Mapping[str, TuningResult]) -> RenderableType:
    """Return several tunings of the same plant, a column each, settings in cascade form."""
    table = Table("", box=SIMPLE_HEAD)
    for name in results:
        table.add_column(name, justify="right")
    columns = list(results.values())
    table.add_row("closed-loop time constant τP", *(number(result.tau_p) for result in columns))
    for index in range(max(len(result.loops) for result in columns)):
        for symbol, name in (("k", "gain"), ("τI", "integral_time"), ("τD", "derivative_time")):
            values = [_setting(result, index, name) for result in columns]
            if any(value is not None for value in values):
                table.add_row(
                    f"loop {index + 1}: {name.replace('_', ' ')} {symbol}", *map(number, values)
                )
    for title, name, _ in _CURVES:
        table.add_row(
            f"peak of μ, {title}",
            *(
                number(None if result.peaks is None else getattr(result.peaks, name).value)
                for result in columns
            ),
        )
    return table


def _setting(result: TuningResult, index: int, name: str) -> float | None:
    if index >= len(result.loops):
        return None
    value: float | None = getattr(result.loops[index], name)
    return value


def _headline(result: TuningResult) -> str:
    if result.status == "infeasible":
        where = "" if result.omega is None else f" (at {number(result.omega)} rad per time unit)"
        return f"Infeasible: {result.reason or 'no settings meet the demand'}{where}"
    ended = {"optimal": "Optimal", "time_limit": "Time limit reached; the best so far"}
    if not result.loops:
        return f"{ended[result.status]}: nothing found yet."
    return f"{ended[result.status]}: {_objective(result)}"


def _objective(result: TuningResult) -> str:
    if result.objective == "tau_p":
        return f"closed-loop time constant τP = {number(result.tau_p)}"
    peak = None if result.peaks is None else result.peaks.robust_performance.value
    return f"peak of μ = {number(peak)} at τP = {number(result.tau_p)}"


def _search(search: SearchSummary) -> str:
    optima = search.local_optima
    listed = ", ".join(f"{number(each.value)} ({each.count}x)" for each in optima[:_OPTIMA])
    more = f" and {len(optima) - _OPTIMA} more" if len(optima) > _OPTIMA else ""
    return (
        f"{search.starts} starts in {search.elapsed_seconds:.2f} s, seed {search.seed}; "
        f"local optima: {listed or 'none'}{more}"
    )


def _forms(loops: Sequence[tuple[str, Controller]]) -> Iterator[RenderableType]:
    """Yield a formula and a table for each form; the same controllers in all of them."""
    for form in forms([controller for _, controller in loops]):
        table = Table("loop", box=SIMPLE_HEAD)
        for symbol in form.symbols:
            table.add_column(symbol, justify="right")
        for (name, _), row in zip(loops, form.rows, strict=True):
            table.add_row(name, *([row] if isinstance(row, str) else map(number, row)))
        yield Text(f"{form.name.capitalize()} form: {form.formula}")
        yield table


def _proof(certificate: Mapping[str, Any] | None) -> Iterator[RenderableType]:
    if certificate is not None:
        yield Text(
            f"Proven: stable, and μ of robust performance at most {certificate['gamma']:.6g} at "
            f"every frequency ({len(certificate['intervals'])} intervals)."
        )


def _margins(margins: Sequence[LoopMargins]) -> Table:
    table = Table("margins", "others", box=SIMPLE_HEAD)
    for heading in ("gain", "phase (°)", "delay", "Ms", "Mt", "bandwidth"):
        table.add_column(heading, justify="right")
    for loop in margins:
        for others, each in (("open", loop.alone), ("closed", loop.together)):
            if each is None:
                table.add_row(f"loop {units_text(loop.units)}", others, "unstable")
                continue
            table.add_row(
                f"loop {units_text(loop.units)}",
                others,
                number(each.gain_increase),
                number(each.phase_margin),
                number(each.delay_margin),
                number(each.sensitivity.value),
                number(each.complementary_sensitivity.value),
                number(each.bandwidth),
            )
    return table


def _peaks(peaks: Peaks) -> Table:
    table = Table("peak of μ", box=SIMPLE_HEAD)
    table.add_column("value", justify="right")
    table.add_column("ω (rad/time)", justify="right")
    table.add_column("over the whole set of plants")
    for title, name, meaning in _CURVES:
        peak = getattr(peaks, name)
        table.add_row(title, number(peak.value), number(peak.omega), meaning)
    return table
