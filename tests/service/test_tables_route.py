"""Results as lines and tables over HTTP, the same as in a terminal."""

from __future__ import annotations

import json

import httpx
import pytest

from service import registry

WITH_JSON = {"Content-Type": "application/json"}


@pytest.mark.parametrize("name", ["robustness", "interaction", "controller_forms"])
def test_tables_are_those_of_the_command_line(client: httpx.Client, name: str) -> None:
    """The answer of an analysis, sent as it came, is told in the parts that its table gives."""
    analysis = registry.load(name)
    (example,) = analysis.request.model_json_schema()["examples"]
    answer = client.post(analysis.path, json=example)
    assert answer.status_code == 200
    told = client.post(
        f"/v1/tables/{analysis.resource}", content=answer.content, headers=WITH_JSON
    ).json()["parts"]
    wanted = analysis.table(analysis.result.model_validate_json(answer.content))
    assert len(told) == len(wanted) > 0
    for part, own in zip(told, wanted, strict=True):
        assert all(
            json.loads(json.dumps(value)) == json.loads(json.dumps(getattr(own, key)))
            for key, value in part.items()
        )


def test_tables_name_the_unit_that_is_asked_for(client: httpx.Client) -> None:
    """Delays and frequencies of the margins are told in the unit of the query."""
    analysis = registry.load("robustness")
    (example,) = analysis.request.model_json_schema()["examples"]
    answer = client.post(analysis.path, json=example)
    told = client.post(
        f"/v1/tables/{analysis.resource}",
        params={"unit": "h"},
        content=answer.content,
        headers=WITH_JSON,
    ).json()["parts"]
    heads = [head for part in told for head in part.get("heads", [])]
    assert {"ω (rad/h)", "delay, h", "bandwidth, rad/h"} <= set(heads)


def test_what_is_no_answer_is_refused(client: httpx.Client) -> None:
    """Another object is a bad request, an unknown analysis is not found."""
    assert client.post("/v1/tables/robustness", json={"peaks": 1}).status_code == 422
    assert client.post("/v1/tables/alchemy", json={}).status_code == 404
