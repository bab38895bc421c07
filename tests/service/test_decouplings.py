"""Decouplings over HTTP, by the real solver."""

import json
from pathlib import Path

import httpx
import pytest
from samples import altered

from service.analyses.decouple import DecouplingResult

PATH = "/v1/decouplings"
EXAMPLES = Path(__file__).parents[2] / "examples"
ROSENBROCK = json.loads((EXAMPLES / "decoupling_rosenbrock.json").read_text())
WOOD_BERRY = json.loads((EXAMPLES / "decoupling_wood_berry.json").read_text())


def test_rosenbrock(client: httpx.Client) -> None:
    """Astrom and Hagglund, Example 11.5, as the example file asks for it."""
    response = client.post(PATH, json=ROSENBROCK)
    assert response.status_code == 200
    result = DecouplingResult.model_validate(response.json())
    assert result.kappa[0][1] == pytest.approx(4 / 3)
    first, second = result.loops
    assert first.gains is not None
    assert first.gains.proportional_gain == pytest.approx(0.2975, abs=5e-5)
    assert second.status == "detuned"
    assert result.closed_loop is not None
    assert result.closed_loop.stable
    assert len(result.closed_loop.exact) == len(result.closed_loop.omega)


def test_frequencies_and_weights_are_the_callers(client: httpx.Client) -> None:
    """omega and set_point_weights reach the solver."""
    request = {**WOOD_BERRY, "omega": [0.01, 0.1], "set_point_weights": [1.0, 0.5]}
    result = DecouplingResult.model_validate(client.post(PATH, json=request).json())
    assert result.closed_loop is not None
    assert result.closed_loop.omega == [0.01, 0.1]
    assert result.set_point_weights == [1.0, 0.5]
    peaks = result.closed_loop.exact_peaks
    assert max(peaks[0][1] or 0, peaks[1][0] or 0) <= 1


def test_unbounded_loop_says_what_to_do(client: httpx.Client) -> None:
    """Without an index Rosenbrock's second loop has no finite optimum: a status and a warning."""
    result = DecouplingResult.model_validate(
        client.post(PATH, json=altered(ROSENBROCK, "/max_index", None)).json()
    )
    assert result.loops[1].status == "unbounded"
    assert result.closed_loop is None
    assert "max_index" in result.warnings[0]


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/plant/elements/0/1/num", [1.0], "/plant"),
        ("/plant/elements/0/0/den", [1.0, 0.0], "/plant"),
        ("/plant/elements/0/0/den", [1.0, -1.0], "/plant"),
        ("/limits/max_sensitivity", 1.0, "/limits/max_sensitivity"),
        ("/limits/max_peak", 2.0, "/limits/max_peak"),
        ("/max_index", 0, "/max_index"),
        ("/set_point_weights", [0.0], "/set_point_weights"),
        ("/set_point_weights", [0.0, 2.0], "/set_point_weights/1"),
        ("/omega", [2.0, 1.0], "/omega/1"),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """Bad input is a 422 problem that names the field."""
    request = altered(ROSENBROCK, pointer, value)
    if pointer == "/plant/elements/0/1/num":  # 1/(s+3) times 3: the gain becomes singular
        request = altered(request, "/plant/elements/0/1/den", [1.0, 1.0])
    response = client.post(PATH, json=request)
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == blamed


def test_own_settings_are_analysed(client: httpx.Client) -> None:
    """Given gains come back with their peaks, status given; a sign that is wrong is refused."""
    own = [{"proportional_gain": 0.2975, "integral_gain": 0.342}] * 2
    request = {**altered(ROSENBROCK, "/max_index", None), "gains": own}
    result = DecouplingResult.model_validate(client.post(PATH, json=request).json())
    assert [loop.status for loop in result.loops] == ["given", "given"]
    assert result.closed_loop is not None
    wrong = {**request, "gains": [own[0], {"proportional_gain": 1.0, "integral_gain": -1.0}]}
    problem = client.post(PATH, json=wrong)
    assert problem.status_code == 422
    assert "/gains/1/integral_gain" in problem.text
