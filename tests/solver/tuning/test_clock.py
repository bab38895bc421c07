"""Progress of a running tuning."""

import pytest

from solver.tuning import clock as module
from solver.tuning.clock import Clock
from solver.tuning.record import Progress


def test_a_value_on_offer_is_told_before_anything_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """What works it out ticks too: whoever stops the tuning then knows that something was found."""
    monkeypatch.setattr(module, "PROGRESS_INTERVAL", -1.0)  # every tick is told
    told: list[Progress] = []
    clock = Clock(None, told.append, float)

    def value() -> float:
        clock.tick()
        return 3.0

    clock.offer(value)
    clock.tick()
    assert [each.best for each in told] == [3.0]
