"""Results as tables for people: settings, peaks, search, what different settings gain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal

from service.beyond import comparison_table
from service.model_wording import tolerance_lines
from service.printing import (
    CURVES,
    Grid,
    Line,
    Part,
    form_parts,
    peaks_grid,
    proof_lines,
    warning_lines,
)
from service.schemas import TuningResult
from service.schemas.alternatives import Alternatives
from service.schemas.settings_nearby import SettingsTolerance
from service.schemas.tunings import Comparison, SearchSummary
from service.settings_wording import range_rows, resolution_text, together_text, tolerance_text
from service.wording import NO_LESS, demand_rows, number, optimality_text, spread_lines
from solver.model.loop_names import units_text

__all__ = ["side_by_side", "tuning_table"]

_OPTIMA = 5  # local optima worth a line; all of them are in the JSON result


def tuning_table(result: TuningResult, *, interrupted: bool = False) -> list[Part]:
    """Return a tuning as lines and grids; `interrupted`: it was not time that ended it."""
    good = result.status in {"optimal", "local"} and result.demand_met is not False
    style: Literal["strong", "alarm"] = "strong" if good else "alarm"
    parts: list[Part] = [Line(_headline(result, interrupted=interrupted), style)]
    tolerance = tolerance_lines(result.model_tolerance)
    parts += [line for line in tolerance if line.style != "plain"]
    if result.loops:
        parts.append(Line())
        parts += form_parts(
            [(units_text(group), result.loops[group[0]].build()) for group in result.groups]
        )
    if result.peaks is not None:
        parts.append(peaks_grid(result.peaks))
    if result.comparison is not None:
        parts.append(Line(_bought(result, result.comparison)))
    parts += _scenarios(result)
    if result.demands:
        parts.append(Grid(("demand", "limit", "value", ""), demand_rows(result)))
    if result.as_found is not None and result.loops:
        parts.append(_beside_today(result))
    if result.limit is not None:
        parts += _others(result.limit, result.objective)
    typed = resolution_text(result)
    if typed is not None:
        parts.append(Line(typed))
    if result.settings_tolerance is not None:
        parts += _ranges(result, result.settings_tolerance)
    parts += [Line(text) for text in _sentences(result)]
    parts += [Line(sentence) for sentence in result.advice]
    parts += proof_lines(result.certificate, result.guarantee)
    parts += [line for line in tolerance if line.style == "plain"]
    parts.append(Line(_search(result.search)))
    return [*parts, *warning_lines(result.warnings)]


def _others(found: Alternatives, objective: str) -> Iterator[Part]:
    """Yield what other kinds of controllers could do."""
    yield from map(Line, found.verdict.splitlines())
    if any(each.value is not None for each in found.alternatives):
        bound = found.lower_bound
        least = None if bound is None else bound.value
        yield Grid(*comparison_table(found.alternatives, objective, found.limit, least))


def _beside_today(result: TuningResult) -> Grid:
    """Return peaks and tau_P of today's settings beside those that were found."""
    today = result.as_found
    assert today is not None  # noqa: S101 - for the type checker
    rows = [("least time constant τP", number(today.tau_p), number(result.tau_p))]
    for title, name, _ in CURVES:
        before, now = (
            number(None if peaks is None else getattr(peaks, name).value)
            for peaks in (today.peaks, result.peaks)
        )
        rows.append((f"peak of μ, {title}", before, now))
    return Grid(("", "today", "found"), rows)


def _ranges(result: TuningResult, near: SettingsTolerance) -> list[Part]:
    """Return how far settings may be moved."""
    parts: list[Part] = [
        Line(tolerance_text(near)),
        Grid(("", "least", "now", "most"), range_rows(result)),
    ]
    together = together_text(result)
    return parts if together is None else [*parts, Line(together)]


def _scenarios(result: TuningResult) -> list[Part]:
    """Return what the settings make of further plants."""
    parts: list[Part] = [scenarios_grid(result)] if result.scenarios else []
    parts += [Line(text) for text in spread_lines(result)]
    return parts


def scenarios_grid(result: TuningResult) -> Grid:
    """Return a row for each scenario, the one that decides marked."""
    rows = [
        (
            each.name,
            ", ".join(str(unit + 1) for unit in each.in_service),
            str(each.sets),
            number(each.tau_p),
            number(each.peaks.robust_performance.value),
            "proven" if each.guarantee.status == "proven" else "not proven",
            "decides" if each.name == result.active else "",
        )
        for each in result.scenarios
    ]
    heads = ("scenario", "worst with units", "sets", "tau_p alone", "peak of mu", "", "")
    return Grid(heads, rows, left=frozenset({0, 1, 5, 6}))


def _bought(result: TuningResult, comparison: Comparison) -> str:
    identical, percent = number(comparison.identical_value), comparison.gain_percent
    if percent is None or percent < 100 * NO_LESS:
        return f"Different settings gain nothing: identical settings reach {identical} too."
    return (
        f"What different settings gain: {_objective(result)} instead of {identical} with identical "
        f"settings, {number(percent)} % less."
    )


_SETTINGS = (
    ("k", "gain"),
    ("τI", "integral_time"),
    ("τD", "derivative_time"),
    ("τF", "filter_time"),
)


def side_by_side(results: Mapping[str, TuningResult]) -> Grid:
    """Return several tunings of the same plant, a column each, settings in cascade form."""
    columns = list(results.values())
    rows = [("closed-loop time constant τP", *(number(result.tau_p) for result in columns))]
    for index in range(max(len(result.loops) for result in columns)):
        for symbol, name in _SETTINGS:
            values = [_setting(result, index, name) for result in columns]
            if any(value is not None for value in values):
                head = f"loop {index + 1}: {name.replace('_', ' ')} {symbol}"
                rows.append((head, *map(number, values)))
    for title, name, _ in CURVES:
        peaks = [
            number(None if result.peaks is None else getattr(result.peaks, name).value)
            for result in columns
        ]
        rows.append((f"peak of μ, {title}", *peaks))
    return Grid(("", *results), rows)


def _setting(result: TuningResult, index: int, name: str) -> float | None:
    if index >= len(result.loops):
        return None
    value: float | None = getattr(result.loops[index], name)
    return value


def _headline(result: TuningResult, *, interrupted: bool) -> str:
    if result.status == "infeasible":
        where = "" if result.omega is None else f" (at {number(result.omega)} rad per time unit)"
        return f"Infeasible: {result.reason or 'no settings meet the demand'}{where}"
    ended = {
        "optimal": "Optimal",
        "local": "Local optimum beside the given settings",
        "time_limit": f"{'Interrupted' if interrupted else 'Time limit reached'}; the best so far",
    }
    if not result.loops:
        why = "" if result.reason is None else f" ({result.reason})"
        return f"{ended[result.status]}: nothing found yet{why}."
    unmet = "" if result.demand_met is not False else "Demand not met. "
    return f"{unmet}{ended[result.status]}: {_objective(result)}"


def _objective(result: TuningResult) -> str:
    if result.objective == "tau_p":
        return f"closed-loop time constant τP = {number(result.tau_p)}"
    peak = None if result.peaks is None else result.peaks.robust_performance.value
    return f"peak of μ = {number(peak)} at τP = {number(result.tau_p)}"


def _search(search: SearchSummary) -> str:
    optima = search.local_optima
    listed = ", ".join(
        f"{number(each.value)} ({f'{each.count}x' if each.count else 'from another'})"
        for each in optima[:_OPTIMA]
    )
    more = f" and {len(optima) - _OPTIMA} more" if len(optima) > _OPTIMA else ""
    return (
        f"{search.starts} starts in {search.elapsed_seconds:.2f} s, seed {search.seed}; "
        f"local optima: {listed or 'none'}{more}"
    )


def _sentences(result: TuningResult) -> Iterator[str]:
    """Yield how good the settings are among others, and what happens with loops in manual."""
    optimality = optimality_text(result)
    if optimality is not None:
        yield optimality
    if result.integrity is not None:
        yield f"{result.integrity[0].upper()}{result.integrity[1:]}."
