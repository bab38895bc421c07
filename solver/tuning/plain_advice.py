"""Sentences that an operator understands, each made from numbers of the result."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from collections.abc import Iterator

    from solver.tuning.beside import AsFound, SettingsTolerance
    from solver.tuning.record import Tuning
    from solver.tuning.specification import Specification

__all__ = ["plain_advice"]

LOWER_HURTS = 1e-3  # of mu above 1, from which lower gains are said not to be safer


def plain_advice(specification: Specification, tuning: Tuning) -> tuple[str, ...]:
    """Return what the numbers of a result mean for whoever uses the settings."""
    found: list[str] = []
    if tuning.as_found is not None:
        found += _beside_today(specification, tuning, tuning.as_found)
    if tuning.settings_tolerance is not None and tuning.demand_met:
        found += _lower_gains(tuning.settings_tolerance)
    return tuple(found)


def _beside_today(specification: Specification, tuning: Tuning, today: AsFound) -> Iterator[str]:
    """Say what today's settings do."""
    if specification.objective is Objective.MU:
        if today.peaks is not None and tuning.peaks is not None:
            before, now = today.peaks.robust_performance, tuning.peaks.robust_performance
            yield (
                f"Today's settings have a peak of mu of {before.value:.4g}; these have "
                f"{now.value:.4g}."
            )
            return
    elif today.tau_p is not None and tuning.tau_p is not None:
        share = 100 * (1 - tuning.tau_p / today.tau_p)
        word = f"{share:.3g} % less" if share >= 0 else f"{-share:.3g} % more"
        yield (
            f"Today's settings keep the demand from tau_P = {today.tau_p:.4g} on; these from "
            f"{tuning.tau_p:.4g} on, {word}."
        )
        return
    if today.reason is not None:
        yield f"Today's settings do not keep the demand at any tau_P: {today.reason}."


def _lower_gains(near: SettingsTolerance) -> Iterator[str]:
    """Say that lower gains are not safer, where they are not."""
    mu = near.lower_gains
    if mu is None:
        yield "Lower gains are not safer here: with all gains 5 % lower the loops are unstable."
    elif mu > 1 + LOWER_HURTS:
        yield (
            f"Lower gains are not safer here: with all gains 5 % lower mu reaches {mu:.4g} at this "
            "tau_P."
        )
