"""Errors of the sensors over HTTP: tuning, analysis, report, sheet and what refuses them."""

import json
from datetime import UTC, datetime

import httpx
import pytest
from samples import ROBUSTNESS, TUNING, altered

from service.report.document import report_html
from service.schemas import parse_tuning_request
from service.sheet.document import loop_sheet
from service.tuned import RequestedTuning
from solver.certificate.verify import Verdict, verify
from solver.tuning.tuner import tune

OUTPUTS = {"epsilon": [0.05, 0.01], "theta": 0.1}


def test_an_analysis_has_the_worst_error_of_each_sensor(client: httpx.Client) -> None:
    """The peak is higher than with known outputs, attained, and its certificate is proven."""
    known = client.post("/v1/robustness", json=ROBUSTNESS).json()
    request = altered(ROBUSTNESS, "/uncertainty/outputs", OUTPUTS)
    found = client.post("/v1/robustness", json=request).json()
    peak = found["peaks"]["robust_performance"]["value"]
    assert peak > known["peaks"]["robust_performance"]["value"]
    assert known["worst_case"]["outputs"] is None
    entries = found["worst_case"]["outputs"]["entries"]
    assert [entry["units"] for entry in entries] == [[0], [1]]
    assert found["lower_bound"]["value"] == pytest.approx(peak, rel=1e-4)
    assert verify(json.dumps(found["certificate"])).verdict is Verdict.PROVEN


def test_a_tuning_with_them_is_told_on_every_surface() -> None:
    """tau_P is that of the table in the docs; report and sheet come, and name what errs."""
    document = {
        "plant": TUNING["plant"],
        "uncertainty": {"epsilon": 0.2, "theta": 1, "outputs": OUTPUTS},
        "controller": {"kind": "PI", "arrangement": "independent"},
    }
    request = parse_tuning_request(json.dumps(document).encode())
    record = RequestedTuning.of(request, tune(request.build()), "min")
    assert record.result.tau_p == pytest.approx(23.087, rel=1e-3)
    assert record.result.guarantee is not None
    assert record.result.guarantee.status == "proven"
    speed = [risk.text for risk in loop_sheet(record).risks if risk.topic == "speed"]
    assert any("errors of the inputs and outputs" in text for text in speed)
    page = report_html(record, datetime(2026, 1, 31, tzinfo=UTC))
    assert "error of the outputs" in page
    assert "of output 2" in page
    assert "error of the inputs" in page


@pytest.mark.parametrize(
    ("pointer", "value", "fault"),
    [
        (
            "/uncertainty/outputs",
            {"epsilon": [0.1, 0.1, 0.1], "theta": 1},
            "/uncertainty/outputs/epsilon",
        ),
        ("/uncertainty/outputs", {"epsilon": 0, "theta": 1}, "/uncertainty/outputs/epsilon"),
        ("/uncertainty/outputs", {"epsilon": 0.1, "teta": 1}, "/uncertainty/outputs/teta"),
        (
            "/uncertainty/outputs",
            {"epsilon": 0.1, "theta": 1, "structure": "full"},
            "/uncertainty/outputs/structure",
        ),
        (
            "/uncertainty/outputs",
            {"weight": {"num": [1], "den": [1, -1]}},
            "/uncertainty/outputs/weight/den",
        ),
        (
            "/uncertainty",
            {"epsilon": 0.2, "theta": 1, "structure": "full", "outputs": OUTPUTS},
            "/uncertainty/outputs",
        ),
    ],
)
def test_faults_are_told_by_their_pointer(
    client: httpx.Client, pointer: str, value: object, fault: str
) -> None:
    """Lists of wrong length, errors of 0, unknown fields, an unstable weight, a full block."""
    response = client.post("/v1/robustness", json=altered(ROBUSTNESS, pointer, value))
    assert response.status_code == 422
    assert fault in [error["pointer"] for error in response.json()["errors"]]
