"""The OpenAPI document, and the pages around it."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fake_tune import BROKEN
from samples import tuning

import service.http.openapi
from service.schemas.batches import BatchLine

COMMITTED = Path(__file__).parents[2] / "openapi" / "openapi.json"


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    """Return the OpenAPI document."""
    result: dict[str, Any] = json.loads(service.http.openapi.text())
    return result


def test_committed_document_is_that_of_the_app() -> None:
    """openapi/openapi.json is up to date (python -m service.http.openapi openapi/openapi.json)."""
    assert COMMITTED.read_text(encoding="utf-8") == service.http.openapi.text()


def test_served_document_is_the_same(client: httpx.Client, document: dict[str, Any]) -> None:
    """/openapi.json serves it."""
    assert client.get("/openapi.json").json() == document


def test_every_field_is_described_with_an_example(document: dict[str, Any]) -> None:
    """Each property of each schema has a description and examples, its own or its schema's."""
    schemas = document["components"]["schemas"]
    lacking = [
        f"{name}.{field}"
        for name, schema in schemas.items()
        for field, content in schema.get("properties", {}).items()
        if not {"description", "examples"} <= _with_target(content, schemas).keys()
    ]
    assert not lacking, lacking


def _with_target(content: dict[str, Any], schemas: dict[str, Any]) -> dict[str, Any]:
    target = schemas.get(content.get("$ref", "").rpartition("/")[2], {})
    return {**target, **content}


def test_every_number_of_a_request_has_a_unit(document: dict[str, Any]) -> None:
    """Each numeric field that a caller sends names its unit."""
    schemas = document["components"]["schemas"]
    sent = {name for name in schemas if schemas[name].get("additionalProperties") is False}
    lacking = [
        f"{name}.{field}"
        for name in sent
        for field, content in schemas[name]["properties"].items()
        if _is_numeric(content) and "x-unit" not in json.dumps(content)
    ]
    assert not lacking, lacking


def _is_numeric(content: dict[str, Any]) -> bool:
    return any(part.get("type") in {"number", "integer"} for part in _parts(content))


def _parts(content: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield content
    for part in [*content.get("anyOf", []), *content.get("prefixItems", [])]:
        yield from _parts(part)
    if isinstance(content.get("items"), dict):
        yield from _parts(content["items"])


def test_every_reference_resolves(document: dict[str, Any]) -> None:
    """Each $ref points at a component."""
    text = json.dumps(document)
    names = {part.split('"')[0] for part in text.split('"#/components/schemas/')[1:]}
    assert names <= document["components"]["schemas"].keys()


def test_docs_need_nothing_from_elsewhere(client: httpx.Client) -> None:
    """The page of the documentation loads its own host's files only."""
    page = client.get("/docs")
    assert page.status_code == 200
    assert "//" not in page.text.replace("<!doctype", "")
    for path in (
        "/docs/assets/swagger-ui-bundle.js",
        "/docs/assets/swagger-ui.css",
        "/favicon.ico",
    ):
        assert client.get(path).status_code == 200


def test_health_readiness_and_metrics(client: httpx.Client) -> None:
    """The operator's resources answer."""
    assert client.get("/healthz").json() == {"status": "ok"}
    client.post("/v1/tunings", json={}).json()
    text = client.get("/metrics").text
    assert "mutune_http_request_seconds_count" in text
    assert 'route="/v1/tunings"' in text


def test_every_answer_has_an_id_and_security_headers(client: httpx.Client) -> None:
    """A sane X-Request-Id comes back, another is replaced; security headers are always there."""
    given = client.get("/healthz", headers={"X-Request-Id": "mine-1"})
    assert given.headers["x-request-id"] == "mine-1"
    made = client.get("/nothing", headers={"X-Request-Id": "a b\tc"})
    assert made.headers["x-request-id"] != "a b\tc"
    assert made.headers["x-content-type-options"] == "nosniff"
    assert "default-src 'none'" in made.headers["content-security-policy"]


def test_names_of_operations_stay(document: dict[str, Any]) -> None:
    """Clients that are generated have functions of these names: new ones may come, none go."""
    names = {
        operation["operationId"]
        for operations in document["paths"].values()
        for operation in operations.values()
    }
    assert names >= {
        "delete_batch", "delete_tuning", "follow_tuning", "get_batch", "get_figures",
        "get_report", "get_results", "get_tuning", "healthz", "list_batches", "list_controllers",
        "list_tunings", "metrics", "post_batch", "post_controller_forms", "post_decoupling",
        "post_figures_robustness", "post_identify", "post_integrity", "post_interaction",
        "post_limit", "post_parallel_drives", "post_physical_model", "post_relay_experiment",
        "post_robustness", "post_step_response", "post_tuning", "readyz",
    }  # fmt: skip


def test_lines_of_results_are_typed(client: httpx.Client, document: dict[str, Any]) -> None:
    """What comes validates as what the document says of each line; lines may be sent likewise."""
    content = document["paths"]["/v1/batches/{batch_id}/results"]["get"]["responses"]["200"]
    schema = content["content"]["application/x-ndjson"]["schema"]
    assert schema == {"$ref": "#/components/schemas/BatchLine"}
    sent = document["paths"]["/v1/batches"]["post"]["requestBody"]["content"]
    assert sent["application/x-ndjson"]["schema"] == {
        "$ref": "#/components/schemas/BatchTuningRequest"
    }
    body = {"tunings": [tuning(71), tuning(BROKEN)]}
    links = client.post("/v1/batches", json=body).json()["links"]
    lines = client.get(links["results"]).text.splitlines()
    found = [BatchLine.model_validate_json(line) for line in lines]
    assert [line.index for line in found] == [0, 1]
    assert found[0].result is not None
    assert found[1].error is not None
