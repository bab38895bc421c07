"""Settings beside those that were found, in words: typed ones, moved ones."""

from __future__ import annotations

from collections.abc import Sequence

from service.schemas.settings_nearby import SettingsTolerance
from service.schemas.tunings import TuningResult
from service.wording import number
from solver.model.loop_names import loops_text

__all__ = ["range_rows", "resolution_text", "together_text", "tolerance_text"]

_WORTH_NAMING = 0.05  # share of the greatest change in a joint move


def resolution_text(result: TuningResult) -> str | None:
    """Return in one sentence what typed numbers cost; None where any numbers may be typed."""
    price = result.resolution
    if price is None:
        return None
    if result.objective == "mu":
        pair = f"a peak of μ of {number(price.mu_rounded)} instead of {number(price.mu_exact)}"
    else:
        pair = f"τP = {number(price.tau_p_rounded)} instead of {number(price.tau_p_exact)}"
    return f"These are the numbers to type in: {pair} with any digits."


def tolerance_text(near: SettingsTolerance) -> str:
    """Return in one sentence what the ranges of the settings mean."""
    return (
        f"Each setting alone may be moved within its range before μ exceeds {number(near.mu)} at "
        f"τP = {number(near.tau_p)}."
    )


def together_text(result: TuningResult, names: Sequence[str] = ()) -> str | None:
    """Return in one sentence the joint move that hurts most; None where there is none nearby."""
    near = result.settings_tolerance
    if near is None or not near.together:
        return None
    moves = ", ".join(
        f"{each.parameter.replace('_', ' ')} of {_group(result, each.group, names)} "
        f"{100 * each.change:+.2g} %"
        for each in near.together
        if abs(each.change) >= _WORTH_NAMING * max(abs(other.change) for other in near.together)
    )
    return f"Together it takes no more than: {moves}."


def range_rows(
    result: TuningResult, names: Sequence[str] = (), unit: str | None = None
) -> list[tuple[str, ...]]:
    """Return name, lowest, present and highest value of each setting, groups called `names`.

    Times are said to be in `unit`, where it is given.
    """
    near = result.settings_tolerance
    rows: list[tuple[str, ...]] = []
    for each in near.alone if near else ():
        named = each.parameter.replace("_", " ")
        named += f", {unit}" if unit and each.parameter.endswith("_time") else ""
        numbers = number(each.low), number(each.value), number(each.high)
        rows.append((f"{_group(result, each.group, names)}, {named}", *numbers))
    return rows


def _group(result: TuningResult, group: int, names: Sequence[str]) -> str:
    return names[group] if names else loops_text(result.groups[group])
