"""A job that has to be stopped keeps the result that it told before."""

from __future__ import annotations

import asyncio

import pytest

from service.jobs.engine import Engine
from service.jobs.records import JobStatus, Outcome

SPENT = -4.99  # seconds: with the overtime next to nothing, for the actor has to begin


class Overdue:
    """An actor that tells a result, or none, and computes until it is stopped."""

    def __init__(self, engine: Engine, result: str | None) -> None:
        self.actor = self
        self._engine = engine
        self._result = result
        self._stopped = asyncio.Event()

    async def solve(self, call: str, *_: str) -> Outcome:
        """Return nothing, when stopped."""
        if self._result is not None:
            message = {"call": call, "result": self._result, "best": 2.8}
            self._engine._on_event((0.0, message))  # noqa: SLF001 - as Dask calls it
        await self._stopped.wait()
        return Outcome(JobStatus.CANCELLED)

    async def stop(self, _: str) -> None:
        """Stop."""
        self._stopped.set()


@pytest.mark.parametrize("result", ['{"tau_p":2.8}', None])
def test_what_was_told_before_the_time_was_over_is_the_result(
    monkeypatch: pytest.MonkeyPatch, result: str | None
) -> None:
    """The settings stand, though what was to follow them did not end; else the error says why."""
    engine = Engine(None, workers=0, on_idle=lambda: None, security=None)
    monkeypatch.setattr(engine, "_client", object())

    async def run() -> Outcome:
        monkeypatch.setattr(engine, "_solvers", {"one": Overdue(engine, result)})
        return await engine.run("tunings", "{}", SPENT, lambda *_: None)

    outcome = asyncio.run(run())
    assert outcome.status is JobStatus.TIMED_OUT
    assert (outcome.result, outcome.best) == (result, None if result is None else 2.8)
    assert (outcome.error is None) is (result is not None)
