"""What would cost too much is refused before it is computed, with what to reduce."""

from __future__ import annotations

import re
from typing import Any

import httpx
import pytest
from samples import ROBUSTNESS

from service.effort import different_loops, of_different_loops, of_readings, refuse
from service.http.routes import common
from service.problems import EffortError
from solver.model.controllers import Controller
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty

LIMITS: dict[str, Any] = {"seconds": 30.0, "memory": 700e6}


def _of_units(n: int, different: int) -> dict[str, Any]:
    """Return a robustness request of n units with so many different settings."""
    loops = [{"gain": 1 + 1e-4 * (unit % different), "integral_time": 100} for unit in range(n)]
    plant = {**ROBUSTNESS["plant"], "n": n, "interaction": 0.5 / n}
    return {**ROBUSTNESS, "plant": plant, "loops": loops}


@pytest.mark.parametrize("n", [100, 1000])
def test_loops_that_differ_are_counted_before_the_work(client: httpx.Client, n: int) -> None:
    """Refused at once, in every analysis that computes mu of them, with how many are possible."""
    request = _of_units(n, n)
    forms = request | {"target": {"form": "ideal", "digits": 3}}
    for path, body in (("/v1/robustness", request), ("/v1/controller-forms", forms)):
        response = client.post(path, json=body)
        problem = response.json()
        assert (response.status_code, problem["type"]) == (422, "urn:mutune:problem:too-much-work")
        assert problem["errors"][0]["pointer"] == "/loops"
        assert f"{n} loops that differ" in problem["detail"]
        assert re.search(r"at most \d\d may differ", problem["detail"])


def test_the_number_that_is_named_is_accepted_and_one_more_is_not() -> None:
    """What the words promise holds, for time and for memory."""
    for limits, most in ((LIMITS, 58), ({**LIMITS, "memory": 400e6}, 36)):
        refuse(of_different_loops(most), **limits)
        with pytest.raises(EffortError, match=f"at most {most} may differ"):
            refuse(of_different_loops(most + 1), **limits)


def test_equal_loops_cost_nothing_more() -> None:
    """10,000 units with two settings are two loops; unlike permitted errors make them differ."""
    loops = tuple(Controller(1.0 + unit % 2, 10.0) for unit in range(10_000))
    plant, uncertainty = first_order(10_000, 1.0, 10.0, 1e-5), Uncertainty.from_error(0.2, 1.0)
    refuse(different_loops(plant, loops, uncertainty, Performance(tau_p=10.0)), **LIMITS)
    scaled = Performance(tau_p=10.0, output_scale=tuple(range(1, 10_001)))
    with pytest.raises(EffortError, match="10000 loops"):
        refuse(different_loops(plant, loops, uncertainty, scaled), **LIMITS)


def test_readings_are_counted_before_the_work() -> None:
    """Long records of many signals are refused with how long they may be; short ones are not."""
    refuse(of_readings(1500, 100), **LIMITS)
    with pytest.raises(EffortError, match="at most 1500 here"):
        refuse(of_readings(1501, 100), **LIMITS)


def _drives(points: int) -> dict[str, Any]:
    drive = {"proportional_gain": 1.0, "integral_gain": 0.5}
    load = {"num": [1.0], "den": [1.0, 0.1], "dead_time": 0.0}
    return {"load": load, "drives": [drive] * 5, "scenario": {"points": points}}


def test_long_answer_comes_in_parts_and_whole(client: httpx.Client) -> None:
    """Compressed or not, it is the same; without a length before it, since it is not one piece."""
    plain = client.post(
        "/v1/parallel-drives", json=_drives(2000), headers={"Accept-Encoding": "identity"}
    )
    assert "content-length" not in plain.headers
    packed = client.post("/v1/parallel-drives", json=_drives(2000))
    assert packed.headers["content-encoding"] == "gzip"
    assert packed.json() == plain.json()


def test_long_answers_have_so_much_room_and_no_more(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An answer for which there is no room is 503 with a time to come back; short ones go on."""
    monkeypatch.setattr(common, "_ROOM", 100_000)
    refused = client.post("/v1/parallel-drives", json=_drives(5000))
    assert refused.status_code == 503
    assert int(refused.headers["retry-after"]) >= 1
    assert client.post("/v1/parallel-drives", json=_drives(10)).status_code == 200


def test_line_without_an_end_is_refused_before_it_is_all_there(client: httpx.Client) -> None:
    """A body of lines that has none is read to the limit of a line, not to that of a batch."""
    response = client.post(
        "/v1/batches",
        content=b" " * 3_000_000,
        headers={"Content-Type": "application/x-ndjson"},
    )
    assert response.status_code == 422
    assert "a line has at most 1000000 bytes" in response.json()["detail"]
