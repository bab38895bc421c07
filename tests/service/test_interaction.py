"""Interaction analyses over HTTP, by the real solver."""

import json
from pathlib import Path

import httpx
import pytest
from samples import altered

from service.analyses.interaction.result import InteractionResult
from service.analyses.interaction.table import table
from service.printing import Line

PATH = "/v1/interaction"
EXAMPLES = Path(__file__).parents[2] / "examples"


def _example(name: str) -> dict[str, object]:
    document: dict[str, object] = json.loads((EXAMPLES / f"interaction_{name}.json").read_text())
    return document


ROSENBROCK = _example("rosenbrock")


def test_rosenbrock(client: httpx.Client) -> None:
    """Astrom and Hagglund, Example 11.3: index 3, zero at 1, effect of loop 2 on loop 1."""
    response = client.post(PATH, json=ROSENBROCK)
    assert response.status_code == 200
    result = InteractionResult.model_validate(response.json())
    assert result.bristol_index == pytest.approx(3)
    assert result.zeros.zeros[0].value.re == pytest.approx(1)
    assert result.recommended is not None
    assert result.recommended.inputs == [0, 1]
    assert result.effect is not None
    assert result.effect.stable == [True] * 4
    assert result.curves.relative_gains is not None
    assert len(result.curves.relative_gains) == len(result.curves.omega)


@pytest.mark.parametrize("name", ["stream_split", "cooled_reactors", "blending", "wood_berry"])
def test_examples_are_answered(client: httpx.Client, name: str) -> None:
    """Every example is a request that the schema and the solver accept."""
    response = client.post(PATH, json=_example(name))
    assert response.status_code == 200
    result = InteractionResult.model_validate(response.json())
    assert result.integral_controllability is not None
    assert result.integral_controllability.verdict == "guaranteed"


def test_thousands_of_units(client: httpx.Client) -> None:
    """Large parallel plants come without matrices, with their closed forms."""
    plant = {"kind": "first_order", "n": 5000, "gain": 1, "time_constant": 9, "interaction": 0.5}
    result = InteractionResult.model_validate(client.post(PATH, json={"plant": plant}).json())
    assert result.relative_gains is None
    assert result.parallel is not None
    assert result.parallel.own_relative_gain == pytest.approx(2, rel=1e-3)
    assert result.parallel.determinant == pytest.approx(0, abs=1e-300)


def test_singular_gain_is_a_status(client: httpx.Client) -> None:
    """Numbers that do not exist are null, not NaN, and the reason is a warning."""
    plant = {"kind": "first_order", "n": 2, "gain": 1, "time_constant": 9, "interaction": 1}
    response = client.post(PATH, json={"plant": plant})
    assert response.status_code == 200
    result = InteractionResult.model_validate(response.json())
    assert result.gain_status == "singular"
    assert result.relative_gains is None
    assert result.parallel is not None
    assert result.parallel.own_inverse is None
    assert "singular" in result.warnings[0]


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/plant/elements/0", [{"num": [1], "den": [1]}], "/plant/elements/0"),
        ("/plant/elements/1/0/den", [0, 0], "/plant/elements/1/0/den"),
        ("/plant/elements/1/0/num", [1, 2, 3], "/plant/elements/1/0/num"),
        ("/omega", [1.0, 1.0], "/omega/1"),
        ("/omega", [0.0], "/omega/0"),
        ("/effect/loop", 2, "/effect/loop"),
        ("/effect/other", 0, "/effect/other"),
        ("/effect/gains", [], "/effect/gains"),
        ("/effect/gains", [1e300], "/effect/gains/0"),
        ("/effect/controller/gain", 0, "/effect/controller/gain"),
        ("/effect/kind", "P", "/effect/kind"),
        ("/plant/elements/0/0/dead_time", 1.0, "/effect"),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """Bad input is a 422 problem that names the field."""
    response = client.post(PATH, json=altered(ROSENBROCK, pointer, value))
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == blamed


def test_headline_of_loops_that_act_through_the_others_does_not_contradict_them(
    client: httpx.Client,
) -> None:
    """[[0, 1], [1, 1]]: relative gains 0 and 1, yet no loop as numbered keeps its gain."""
    lag, none = {"num": [1], "den": [10, 1]}, {"num": [0], "den": [1]}
    plant = {"kind": "matrix", "elements": [[none, lag], [lag, lag]]}
    result = InteractionResult.model_validate(client.post(PATH, json={"plant": plant}).json())
    headline = table(result)[0]
    assert isinstance(headline, Line)
    assert "act through the others alone" in headline.text
    assert result.recommended is not None
    assert result.recommended.inputs == [1, 0]
