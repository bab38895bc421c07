"""Typed and moved settings in words."""

from __future__ import annotations

from archived import published

from service.settings_wording import range_rows, resolution_text, together_text
from solver.tuning.beside import (
    PriceOfResolution,
    SettingMove,
    SettingRange,
    SettingsTolerance,
)

NEAR = SettingsTolerance(
    tau_p=20.0,
    mu=1.0,
    alone=(SettingRange(1, "gain", 22.8, None, 23.0),),
    together=(SettingMove(0, "gain", 0.01), SettingMove(1, "integral_time", -1e-5)),
    lower_gains=1.03,
)


def test_price_of_typed_numbers_says_which_is_which() -> None:
    """The typed tau_P comes first, that of exact settings second."""
    result = published(resolution=PriceOfResolution(18.446, 18.581, 1.0, 1.0)).result
    assert resolution_text(result) == (
        "These are the numbers to type in: τP = 18.581 instead of 18.446 with any digits."
    )
    assert resolution_text(published().result) is None


def test_ranges_and_joint_moves_name_loops_and_settings() -> None:
    """An open side is a dash; what hardly moves is not named."""
    result = published(settings_tolerance=NEAR).result
    assert range_rows(result) == [("loop 2, gain", "-", "22.8", "23")]
    assert together_text(result) == "Together it takes no more than: gain of loop 1 +1 %."
    assert together_text(published().result) is None
