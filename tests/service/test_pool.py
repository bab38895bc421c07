"""Computations within a request: their JSON, their time limit, the death of their process."""

from __future__ import annotations

import asyncio
import json
import os
import time
from pathlib import Path
from typing import Any

import pytest
from real import PATIENCE

from service.jobs import pool as pool_module
from service.jobs.pool import Pool, to_json
from service.problems import (
    AnalysisMemoryError,
    AnalysisTimeoutError,
    NumbersError,
    UnavailableError,
)


def doubled(number: float) -> dict[str, Any]:
    return {"doubled": 2 * number, "process": os.getpid()}


def overflowing() -> dict[str, Any]:
    return {"value": 10.0**400}


def endless() -> dict[str, Any]:
    time.sleep(600)
    return {}


def dying() -> dict[str, Any]:
    os._exit(1)


def greedy() -> dict[str, Any]:
    blocks = [b"x" * 10_000_000 for _ in range(500)]
    return {"bytes": sum(map(len, blocks))}


def held(end: str) -> dict[str, Any]:
    while not Path(end).exists():
        time.sleep(0.02)
    return {"held": True}


def test_numbers_out_of_range_are_the_fault_of_the_request() -> None:
    """An overflow is a problem with a name; infinity or NaN never become text."""
    with pytest.raises(NumbersError):
        to_json(overflowing, (), {})
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json(doubled, (float("nan"),), {})


def test_what_hangs_or_dies_is_replaced() -> None:
    """The next computation of the same pool of one has its result, from another process."""

    async def run() -> list[dict[str, Any]]:
        pool = Pool(
            1, time_limit=300.0, memory_limit=10**9
        )  # the kernels may have to be compiled first
        hasty = Pool(1, time_limit=0.5, memory_limit=10**9)
        try:
            found = [json.loads(await pool.run("", doubled, 2.0))]
            with pytest.raises(UnavailableError):
                await pool.run("", dying)
            found.append(json.loads(await pool.run("", doubled, 3.0)))
            with pytest.raises(AnalysisTimeoutError):
                await hasty.run("", endless)
        finally:
            await pool.close()
            await hasty.close()
        return found

    first, second = asyncio.run(run())
    assert (first["doubled"], second["doubled"]) == (4.0, 6.0)
    assert first["process"] != second["process"]
    assert os.getpid() not in {first["process"], second["process"]}


def test_what_takes_too_much_memory_is_ended_and_says_so() -> None:
    """It is killed long before it has what it wants; the next computation has its result."""

    async def run() -> bytes:
        pool = Pool(1, time_limit=300.0, memory_limit=800_000_000)
        try:
            await pool.run("", doubled, 1.0)  # the process is there
            with pytest.raises(AnalysisMemoryError, match="800 MB"):
                await pool.run("", greedy)
            return await pool.run("", doubled, 2.0)
        finally:
            await pool.close()

    assert json.loads(asyncio.run(run()))["doubled"] == 4.0


def test_who_asks_for_little_does_not_wait_for_those_who_ask_for_much(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Behind two computations that have no end yet a short one has its result; all end well."""
    monkeypatch.setattr(pool_module, "_QUICK", 1.0)
    end = tmp_path / "end"

    async def run() -> list[bytes]:
        pool = Pool(1, time_limit=PATIENCE, memory_limit=10**9)
        try:
            await pool.run("", doubled, 1.0)
            waiting = [asyncio.create_task(pool.run("", held, str(end))) for _ in range(2)]
            await asyncio.sleep(0)  # they come first
            short = await pool.run("", dict, {"short": True})  # which needs no import
            assert not any(each.done() for each in waiting)
            end.touch()
            return [short, *await asyncio.gather(*waiting)]
        finally:
            await pool.close()

    short, *others = asyncio.run(run())
    assert json.loads(short) == {"short": True}
    assert [json.loads(each) for each in others] == [{"held": True}] * 2


def test_computation_that_nobody_waits_for_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cancelled in either lane, it leaves its process to the next one."""
    monkeypatch.setattr(pool_module, "_QUICK", 0.2)

    async def run() -> bytes:
        pool = Pool(1, time_limit=300.0, memory_limit=10**9)
        try:
            await pool.run("", doubled, 1.0)
            for patience in (0.1, 0.6):
                leaving = asyncio.create_task(pool.run("", endless))
                await asyncio.sleep(patience)
                leaving.cancel()
                await asyncio.gather(leaving, return_exceptions=True)
            return await pool.run("", doubled, 2.0)
        finally:
            await pool.close()

    assert json.loads(asyncio.run(run()))["doubled"] == 4.0
