"""Robustness analyses over HTTP, by the real solver."""

import httpx
import pytest
from samples import ROBUSTNESS, altered

from service.analyses.robustness import RobustnessResult

PATH = "/v1/robustness"


def test_published_settings_have_their_peak(client: httpx.Client) -> None:
    """Skogestad, Lundstrom and Hovd (1989): settings rounded there, peak 1.00035 at 0.0314."""
    response = client.post(PATH, json=ROBUSTNESS)
    assert response.status_code == 200
    result = RobustnessResult.model_validate(response.json())
    assert result.nominally_stable
    assert result.peaks is not None
    assert result.peaks.robust_performance.value == pytest.approx(1.0003484, rel=1e-6)
    assert result.peaks.robust_performance.omega == pytest.approx(0.0314362, rel=1e-3)


def test_worst_case_and_margins_come_with_the_analysis(client: httpx.Client) -> None:
    """The bounds meet, the perturbation can be simulated, each loop has its margins."""
    result = RobustnessResult.model_validate(client.post(PATH, json=ROBUSTNESS).json())
    assert result.worst_case is not None
    assert result.worst_case.gap is not None
    assert result.worst_case.gap < 1e-6
    assert result.lower_bound is not None
    assert result.lower_bound.value == pytest.approx(1.0003484, rel=1e-6)
    entries = result.worst_case.uncertainty.entries
    assert entries is not None
    assert [entry.units for entry in entries] == [[0], [1]]
    assert result.uncertainty_scaling == pytest.approx(1 / 0.5434143, rel=1e-6)
    assert [row.units for row in result.margins] == [[0], [1]]
    first = result.margins[0].alone
    assert first is not None
    assert first.gain_increase is None
    assert first.phase_margin == pytest.approx(90.01, abs=0.01)


def test_worst_case_of_a_full_block_has_rank_one(client: httpx.Client) -> None:
    """Actuators whose errors depend on each other: a column and a row in place of a diagonal."""
    request = altered(ROBUSTNESS, "/uncertainty/structure", "full")
    result = RobustnessResult.model_validate(client.post(PATH, json=request).json())
    assert result.worst_case is not None
    assert result.worst_case.uncertainty.entries is None
    assert result.worst_case.uncertainty.left is not None
    assert result.worst_case.uncertainty.right is not None


def test_unstable_loops_have_no_peaks(client: httpx.Client) -> None:
    """Where the nominal loop is unstable there is no mu: null, not NaN."""
    request = altered(ROBUSTNESS, "/loops/0/gain", -46.3)
    result = client.post(PATH, json=request).json()
    assert result["nominally_stable"] is False
    assert result["peaks"] is None
    assert result["margins"][0]["together"] is None


def test_given_frequencies_are_those_of_the_curves(client: httpx.Client) -> None:
    """The curves can be had at the caller's frequencies."""
    request = {**ROBUSTNESS, "omega": [0.01, 0.1, 1.0]}
    curves = client.post(PATH, json=request).json()["curves"]
    assert curves["omega"] == [0.01, 0.1, 1.0]
    assert len(curves["robust_performance"]) == 3


@pytest.mark.parametrize(
    ("pointer", "value", "blamed"),
    [
        ("/performance", {}, "/performance/tau_p"),
        ("/loops", [ROBUSTNESS["loops"][0]], "/loops"),
        ("/loops/1/gain", 0, "/loops/1/gain"),
        ("/loops/1/integral_time", 0, "/loops/1/integral_time"),
        ("/loops/1/kind", "PI", "/loops/1/kind"),
        ("/omega", [0.0], "/omega/0"),
        ("/omega", [1.0, 2.0, 2.0], "/omega/2"),
        ("/omega", [], "/omega"),
        ("/uncertainty/epsilon", [0.2, 0.1, 0.1], "/uncertainty/epsilon"),
        ("/uncertainty/theta", [1.0], "/uncertainty/theta"),
    ],
)
def test_fault_is_named_by_its_pointer(
    client: httpx.Client, pointer: str, value: object, blamed: str
) -> None:
    """Bad input is a 422 problem that names the field."""
    response = client.post(PATH, json=altered(ROBUSTNESS, pointer, value))
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"] == blamed


def test_each_input_may_have_its_own_uncertainty(client: httpx.Client) -> None:
    """Lists of errors, one an input; equal entries are one for all."""

    def peak(epsilon: object) -> float:
        request = altered(ROBUSTNESS, "/uncertainty/epsilon", epsilon)
        answer = client.post(PATH, json=request)
        assert answer.status_code == 200
        return float(answer.json()["peaks"]["robust_performance"]["value"])

    assert peak([0.2, 0.2]) == peak(0.2)
    assert peak([0.1, 0.1]) < peak([0.2, 0.1]) < peak(0.2)


def test_second_method_gives_its_own_bound(client: httpx.Client) -> None:
    """method: sdp adds the bound at the peak by semidefinite programming."""
    answer = client.post(PATH, json={**ROBUSTNESS, "method": "sdp"}).json()
    result = RobustnessResult.model_validate(answer)
    assert result.peaks is not None
    assert result.cross_check is not None
    assert result.cross_check.agree
    assert result.cross_check.sdp == pytest.approx(result.peaks.robust_performance.value, rel=1e-5)
    assert client.post(PATH, json=ROBUSTNESS).json().get("cross_check") is None
