"""Computations within a request: their JSON, their time limit, the death of their process."""

from __future__ import annotations

import asyncio
import json
import os
import time
from typing import Any

import pytest

from service.jobs.pool import Pool, to_json
from service.problems import AnalysisTimeoutError, NumbersError, UnavailableError


def doubled(number: float) -> dict[str, Any]:
    return {"doubled": 2 * number, "process": os.getpid()}


def overflowing() -> dict[str, Any]:
    return {"value": 10.0**400}


def endless() -> dict[str, Any]:
    time.sleep(600)
    return {}


def dying() -> dict[str, Any]:
    os._exit(1)


def test_numbers_out_of_range_are_the_fault_of_the_request() -> None:
    """An overflow is a problem with a name; infinity or NaN never become text."""
    with pytest.raises(NumbersError):
        to_json(overflowing, (), {})
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json(doubled, (float("nan"),), {})


def test_what_hangs_or_dies_is_replaced() -> None:
    """The next computation of the same pool of one has its result, from another process."""

    async def run() -> list[dict[str, Any]]:
        pool = Pool(1, 300.0)  # the kernels may have to be compiled first
        hasty = Pool(1, 0.5)
        try:
            found = [json.loads(await pool.run(doubled, 2.0))]
            with pytest.raises(UnavailableError):
                await pool.run(dying)
            found.append(json.loads(await pool.run(doubled, 3.0)))
            with pytest.raises(AnalysisTimeoutError):
                await hasty.run(endless)
        finally:
            await pool.close()
            await hasty.close()
        return found

    first, second = asyncio.run(run())
    assert (first["doubled"], second["doubled"]) == (4.0, 6.0)
    assert first["process"] != second["process"]
    assert os.getpid() not in {first["process"], second["process"]}
