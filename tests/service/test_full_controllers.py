"""Full controllers in requests of robustness and step response, and mutune verify --sdp."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from service.analyses.robustness import ANALYSIS as ROBUSTNESS
from service.analyses.robustness import RobustnessRequest, RobustnessResult
from service.analyses.step_response import ANALYSIS as STEPS
from service.analyses.step_response import StepResponseRequest
from service.cli.commands import app
from solver.certificate.record import Certificate, Claim
from solver.certificate.search import certify
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty

PLANT = {
    "kind": "first_order",
    "n": 2,
    "gain": 1.0,
    "time_constant": 100.0,
    "interaction": 0.9,
    "dead_time": 1.0,
}
WEIGHTS = {"uncertainty": {"epsilon": 0.2, "theta": 1.0}, "performance": {"tau_p": 30.0}}
STEP = {"steps": [{"kind": "setpoint", "unit": 0, "time": 0.0, "size": 1.0}], "duration": 150.0}
LOOPS = [{"gain": 20.0, "integral_time": 100.0}, {"gain": 10.0, "integral_time": 20.0}]
ZERO = {"num": [0.0], "den": [1.0]}
TRANSFER = {
    "kind": "transfer_matrix",
    "elements": [
        [{"num": [2000.0, 20.0], "den": [100.0, 0.0]}, ZERO],
        [ZERO, {"num": [200.0, 10.0], "den": [20.0, 0.0]}],
    ],
}
STATE_SPACE = {
    "kind": "state_space",
    "A": [[0.0, 0.0], [0.0, 0.0]],
    "B": [[1.0, 0.0], [0.0, 1.0]],
    "C": [[0.2, 0.0], [0.0, 0.5]],
    "D": [[20.0, 0.0], [0.0, 10.0]],
}
ONE = {"A": [[0.0]], "B": [[1.0]], "C": [[0.2]], "D": [[20.0]]}
MODES = {"kind": "modes", "total": ONE, "difference": ONE}


def robustness(**request: Any) -> dict[str, Any]:
    """Result of a robustness request, by way of JSON."""
    text = json.dumps({"plant": PLANT, **WEIGHTS, **request})
    document = ROBUSTNESS.compute(RobustnessRequest.model_validate_json(text))
    return json.loads(json.dumps(document))


def steps(**request: Any) -> list[dict[str, Any]]:
    """Responses to a step request, by way of JSON."""
    text = json.dumps({"plant": PLANT, **STEP, **request})
    answer: list[dict[str, Any]] = STEPS.compute(StepResponseRequest.model_validate_json(text))[
        "responses"
    ]
    return answer


@pytest.mark.parametrize("controller", [TRANSFER, STATE_SPACE], ids=["transfer", "state space"])
def test_a_diagonal_controller_is_the_loops_that_it_holds(controller: dict[str, Any]) -> None:
    """The same peaks and the same responses, written as loops or as a matrix."""
    loops, full = robustness(loops=LOOPS), robustness(controller=controller)
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        assert full["peaks"][name]["value"] == pytest.approx(
            loops["peaks"][name]["value"], rel=1e-6
        )
    for one, other in zip(steps(loops=LOOPS), steps(controller=controller), strict=True):
        assert np.allclose(one["output"], other["output"], atol=1e-9)
        assert np.allclose(one["input"], other["input"], atol=1e-9)


def test_equal_controllers_of_sum_and_difference_are_identical_loops() -> None:
    """Mode control with one controller for both is that controller in every loop."""
    loops = [LOOPS[0]] * 2
    expected = robustness(loops=loops)["peaks"]["robust_performance"]["value"]
    found = robustness(controller=MODES)["peaks"]["robust_performance"]["value"]
    assert found == pytest.approx(expected, rel=1e-6)
    for one, other in zip(steps(controller=MODES), steps(loops=loops)[:2], strict=True):
        assert np.allclose(one["output"], other["output"], atol=1e-9)


def test_a_result_of_a_full_controller_has_its_tables() -> None:
    """It is read and printed as other results are; what is for loops alone is empty."""
    result = RobustnessResult.model_validate(robustness(controller=STATE_SPACE))
    assert result.guarantee is not None
    assert result.margins == []
    assert result.worst_case is None
    assert ROBUSTNESS.table(result)


@pytest.mark.parametrize("controller", [TRANSFER, STATE_SPACE, MODES], ids=lambda c: c["kind"])
def test_the_bound_under_a_full_controller_is_checked_by_programs(
    controller: dict[str, Any],
) -> None:
    """Both bounds at the peak are given and printed; without being asked for, neither is."""
    document = robustness(controller=controller, method="sdp")
    result = RobustnessResult.model_validate(document)
    assert result.cross_check is not None
    assert result.peaks is not None
    assert result.cross_check.agree
    assert result.cross_check.sdp == pytest.approx(result.peaks.robust_performance.value, rel=1e-5)
    assert any("semidefinite" in str(part) for part in ROBUSTNESS.table(result))
    assert robustness(controller=controller)["cross_check"] is None


def test_an_unstable_full_controller_is_called_so() -> None:
    """A hundred times the gain: no peaks, the poles counted."""
    fast = {**STATE_SPACE, "D": [[2000.0, 0.0], [0.0, 1000.0]]}
    result = robustness(controller=fast)
    assert not result["nominally_stable"]
    assert result["unstable_poles"] > 0
    assert result["peaks"] is None


@pytest.mark.parametrize(
    ("request_", "field"),
    [
        ({"controller": STATE_SPACE, "loops": LOOPS}, "/loops"),
        ({"controller": STATE_SPACE, "omega": [0.1]}, "/omega"),
        ({"controller": {**STATE_SPACE, "B": [[1.0], [0.0]]}}, "/controller/B"),
        ({"controller": {"kind": "transfer_matrix", "elements": [[ZERO]]}}, "/controller"),
        ({}, "/loops"),
    ],
)
def test_what_does_not_fit_is_named(request_: dict[str, Any], field: str) -> None:
    """The pointer is that of the field at fault."""
    with pytest.raises(InvalidInputError) as caught:
        robustness(**request_)
    assert caught.value.field == field


def test_a_controller_with_dead_time_is_not_simulated() -> None:
    """Robustness takes it; a step response says which element has no state space."""
    late = {"num": [1.0], "den": [10.0, 0.0], "dead_time": 1.0}
    elements = [[late, ZERO], [ZERO, late]]
    controller = {"kind": "transfer_matrix", "elements": elements}
    assert robustness(controller=controller)["peaks"] is not None
    with pytest.raises(InvalidInputError) as caught:
        steps(controller=controller)
    assert caught.value.field == "/controller/elements/0/0/dead_time"


def test_verify_recomputes_the_peaks_by_semidefinite_programming(tmp_path) -> None:
    """Proof and programs agree, and the programs' bounds are printed."""
    claim = Claim(
        plant=first_order(2, 1.0, 100.0, 0.949),
        uncertainty=Uncertainty.from_error(0.2, 1.0),
        performance=Performance(tau_p=19.0),
        loops=(Controller(46.3, 101.0), Controller(22.8, 3.15)),
        gamma=1.01,
    )
    certificate = certify(claim)
    assert isinstance(certificate, Certificate)
    path = tmp_path / "certificate.json"
    path.write_text(json.dumps(certificate.to_document()))
    found = CliRunner().invoke(app, ["verify", "--sdp", str(path)])
    assert found.exit_code == 0, found.output
    assert "by semidefinite programming" in found.output
    assert "They agree" in found.output
