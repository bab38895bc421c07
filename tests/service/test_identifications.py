"""Identification over HTTP and from files, by the real solver."""

import hashlib
import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from samples import altered
from typer.testing import CliRunner

from service.analyses.identify import EXAMPLE, IdentificationResult
from service.analyses.identify.models import IdentificationJob
from service.cli.commands import app
from service.schemas import TuningRequest
from service.schemas.parsing import parse

PATH = "/v1/identifications"
EXAMPLES = Path(__file__).parents[2] / "examples"
WAIT = {"Prefer": "wait=60"}
HEATERS = (
    "--inputs", "Heater 1,Heater 2", "--outputs", "Temperature 1,Temperature 2",
)  # fmt: skip


def mutune(*arguments):
    """Run a command."""
    return CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)


def test_plant_and_uncertainty_are_as_a_tuning_takes_them(client: httpx.Client) -> None:
    """The valve's gain of 2, lag of 5 and dead time of 1, each in its interval."""
    response = client.post(PATH, json=EXAMPLE, headers=WAIT)
    assert response.status_code == 200
    job = IdentificationJob.model_validate(response.json())
    assert job.links.self == f"{PATH}/{job.id}"
    assert response.headers["Location"] == job.links.self
    result = job.result
    assert result is not None
    for one, truth in zip(result.elements[0].estimates, (2, 5, 1), strict=True):
        assert one.low is not None
        assert one.high is not None
        assert one.low < truth < one.high
    uncertainty = result.uncertainty.model_dump()
    document = {"plant": result.plant, "uncertainty": uncertainty, "controller": {"kind": "PI"}}
    assert parse(TuningRequest, json.dumps(document)).build().plant.n == 1


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/records", [], "/records"),
        ("/records/0/time/3", 1.0, "/records/0/time/3"),
        ("/records/0/inputs/valve/7", 1e13, "/records/0/inputs/valve/7"),
        ("/records/0/inputs/valve/0", None, "/records/0/inputs/valve/0"),
        ("/records/0/inputs/valve", [1.0] * 40, "/records/0/inputs/valve"),
        ("/records/0/outputs/temperature", [1.0] * 39, "/records/0/outputs/temperature"),
        ("/records/0/use", "validate", "/records/0/use"),
        ("/structure", "diagonal", "/structure"),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """Bad input is a 422 problem that names the value."""
    response = client.post(PATH, json=altered(EXAMPLE, pointer, value))
    assert response.status_code == 422
    assert [error["pointer"] for error in response.json()["errors"]] == [blamed]


def test_faults_of_a_later_record_are_told_of_it(client: httpx.Client) -> None:
    """Records kept for validation are counted as they stand in the request."""
    good = EXAMPLE["records"][0]
    still = altered(good, "/inputs/valve", [1.0] * 40)
    body = {**EXAMPLE, "records": [{**good, "use": "validate"}, still]}
    (error,) = client.post(PATH, json=body).json()["errors"]
    assert error["pointer"] == "/records/1/inputs/valve"


def test_job_is_found_at_its_own_resource_alone(client: httpx.Client) -> None:
    """It is no tuning and no limit, and not in the list of tunings; ended, it can be deleted."""
    job = client.post(PATH, json=EXAMPLE, headers=WAIT).json()
    for other in ("tunings", "limits"):
        assert client.get(f"/v1/{other}/{job['id']}").status_code == 404
        assert client.delete(f"/v1/{other}/{job['id']}?forget=true").status_code == 404
    listed = client.get("/v1/tunings").json()["items"]
    assert job["id"] not in {each["id"] for each in listed}
    assert client.get(f"{PATH}/{job['id']}").json() == job
    assert "event: done" in client.get(f"{PATH}/{job['id']}/events").text
    assert client.delete(f"{PATH}/{job['id']}?forget=true").json() == job
    assert client.get(f"{PATH}/{job['id']}").status_code == 404


def test_equal_request_of_another_kind_is_another_job(client: httpx.Client) -> None:
    """A key that was used for a limit is not good for the tuning of the same request."""
    plant = {"kind": "first_order", "n": 1, "gain": 1.0, "time_constant": 10.0, "interaction": 0.0}
    body = {"plant": plant, "uncertainty": {"epsilon": 0.2, "theta": 1.0}}
    headers = {"Idempotency-Key": "one key for two kinds"}
    limit = client.post("/v1/limits", json=body, headers=headers)
    assert limit.status_code == 202
    assert client.post("/v1/limits", json=body, headers=headers).json()["id"] == limit.json()["id"]
    assert client.post("/v1/tunings", json=body, headers=headers).status_code == 409
    longer = client.post("/v1/limits", json={**body, "search": {"time_limit": 86_400}})
    assert longer.status_code == 422  # a job that would be ended by force, without a result
    assert longer.json()["errors"][0]["pointer"] == "/search/time_limit"
    path = limit.json()["links"]["self"]
    assert client.delete(path).status_code in {200, 202}
    with httpx.Client(base_url=client.base_url, timeout=60) as patient:
        events = patient.get(f"{path}/events").text
    assert "event: done" in events
    assert client.get(path).json()["status"] == "cancelled"


def test_files_become_a_tuning_request(tmp_path: Path) -> None:
    """The file that is written can be sent as it stands; the other record is predicted."""
    target = tmp_path / "request.json"
    other = EXAMPLES / "two_heaters_random.csv"
    done = mutune(
        "identify", EXAMPLES / "two_heaters_steps.csv", *HEATERS, "--validate", other, "-o", target
    )
    assert done.exit_code == 0
    words = " ".join(done.stdout.split())
    assert "kept back" in words
    assert "may be longer; with that one gain / time constant" in words
    assert parse(TuningRequest, target.read_text()).build().plant.n == 2


def test_identical_units_from_a_file() -> None:
    """With --identical the plant has two transfer functions, and the test of equality is told."""
    done = mutune("identify", EXAMPLES / "two_heaters_steps.csv", *HEATERS, "--identical", "--json")
    result = IdentificationResult.model_validate_json(done.stdout)
    assert result.plant["kind"] == "parallel"
    assert result.equality is not None
    assert not result.equality.plausible


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((*HEATERS[:-1], "Temperature 3,Temperature 1"), "no column 'Temperature 3'"),
        (("--inputs", "Heater 1,", *HEATERS[2:]), "--inputs 'Heater 1,': a name is empty"),
        (("--time", "Heater 1", *HEATERS), "is named twice"),
        ((), "--inputs is missing; the columns of two_heaters_steps.csv: Time (s), Heater 1"),
    ],
)
def test_wrong_columns_are_bad_input(arguments: tuple[str, ...], words: str) -> None:
    """Exit code 2, and what is there."""
    done = mutune("identify", EXAMPLES / "two_heaters_steps.csv", *arguments)
    assert done.exit_code == 2
    assert words in done.stderr


def test_request_file_is_taken_as_by_every_analysis(tmp_path: Path) -> None:
    """The same request as over HTTP."""
    path = tmp_path / "request.json"
    path.write_text(json.dumps(EXAMPLE))
    done = mutune("identify", path, "--json")
    assert done.exit_code == 0
    IdentificationResult.model_validate_json(done.stdout)


def test_spread_goes_as_scenarios_and_the_origin_with_the_request(tmp_path: Path) -> None:
    """Each record is a scenario with its plant; the digests are those of the files."""
    target = tmp_path / "request.json"
    files = [EXAMPLES / f"two_heaters_{name}.csv" for name in ("steps", "random")]
    assert mutune("identify", *files, *HEATERS, "--scenarios", "-o", target).exit_code == 0
    request = parse(TuningRequest, target.read_text())
    assert [one.name for one in request.scenarios] == [
        "record two_heaters_steps", "record two_heaters_random",
    ]  # fmt: skip
    assert len(request.build().scenarios) == 2
    assert request.origin is not None
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]
    assert [record.digest for record in request.origin.records] == digests
    assert len(request.origin.fits) == 4
    assert request.origin.errors[0].source == "statistical error"


def test_digest_over_http_is_of_the_signals(client: httpx.Client) -> None:
    """The same signals have the same digest, others another."""

    def record(body: object) -> dict[str, Any]:
        answer = client.post(PATH, json=body, headers=WAIT).json()
        return dict(answer["result"]["origin"]["records"][0])

    first = record(EXAMPLE)
    changed = altered(EXAMPLE, "/records/0/outputs/temperature/3", 20.02)
    assert first["samples"] == 40
    assert record(EXAMPLE) == first
    assert record(changed)["digest"] != first["digest"]


def test_shared_and_own_units_exclude_each_other() -> None:
    """One structure is fitted."""
    done = mutune(
        "identify", EXAMPLES / "two_heaters_steps.csv", *HEATERS, "--identical", "--own-units"
    )
    assert done.exit_code == 2
