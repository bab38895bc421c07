"""Limits and full controllers where the permitted errors of the outputs differ."""

from __future__ import annotations

import numpy as np
import pytest
from ctrlsys import ab13md

from solver.limits import search, structure_search
from solver.limits.manual import loops_in_manual
from solver.limits.multivariable import multivariable_limit
from solver.limits.structure_search import structured_controllers
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.mode_controller import ModeController
from solver.model.plants import MatrixPlant, first_order
from solver.model.state_space import StateSpace
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.centralised import analyse_centralised

UNCERTAINTY = Uncertainty.from_error(0.2, 1.0)
ERRORS = (0.5, 2.0)
UNITS = first_order(2, 1.0, 10.0, 0.3)


def mu_by_ab13md(plant, controller, tau_p: float) -> float:
    """Peak of mu with the permitted errors where the demand has them, in S itself."""
    sizes, kinds = np.array([1, 1, 2], dtype=np.int32), np.array([2, 2, 2], dtype=np.int32)
    E = np.diag(ERRORS)
    if isinstance(controller, ModeController):
        controller = controller.full(2)
    peak = 0.0
    for omega in np.geomspace(1e-3, 1e2, 300):
        G, C = plant.response([omega])[0], controller.response([omega])[0]
        S = np.linalg.inv(np.eye(2) + G @ C)
        s = 1j * omega
        w_I = 0.2 * (5 * s + 1) / (0.5 * s + 1)
        w_P = 0.5 * (tau_p * s + 1) / (tau_p * s)
        D = np.linalg.inv(E)
        N = np.block([[w_I * C @ S @ G, w_I * C @ S @ E], [w_P * D @ S @ G, w_P * D @ S @ E]])
        peak = max(peak, ab13md(np.asfortranarray(N), sizes, kinds)[0])
    return peak


def test_the_limit_and_its_controller_are_those_of_the_plant_as_given(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Parallel units of unlike spans: the controller acts on their own outputs, mu by AB13MD."""
    for name in ("POLES_PER_DECADE", "MATRIX_POLES"):
        monkeypatch.setattr(search, name, (1.0,))  # a tenth of the work
    demand = Performance(tau_p=3.0, output_scale=ERRORS)
    found = multivariable_limit(UNITS, UNCERTAINTY, demand)
    assert found.realised is not None
    controller, peaks = found.realised.controller, found.realised.robustness.peaks
    assert peaks is not None
    assert found.value is not None
    peak = peaks.robust_performance.value
    assert found.lower_bound.value < found.value <= peak
    assert mu_by_ab13md(UNITS, controller, 3.0) == pytest.approx(peak, rel=1e-3)
    again = analyse_centralised(UNITS, UNCERTAINTY, demand, controller, cross_check=True)
    assert again.peaks is not None
    assert again.peaks.robust_performance.value == pytest.approx(peak, rel=1e-6)
    assert again.cross_check is not None
    assert again.cross_check.agree


def test_full_controllers_of_every_form_are_taken_as_they_act() -> None:
    """Modes, state space and transfer matrix of identical loops: the peak of the loops."""
    demand = Performance(tau_p=20.0, output_scale=ERRORS)
    loops = (Controller(2.0, 8.0),) * 2
    expected = analyse(UNITS, UNCERTAINTY, demand, loops).peaks
    assert expected is not None
    peak = expected.robust_performance.value
    part = StateSpace([[0.0]], [[1.0]], [[0.25]], [[2.0]])
    modes = ModeController(part, part)
    pi, none = TransferFunction([16.0, 2.0], [8.0, 0.0]), TransferFunction([0.0], [1.0])
    for controller in (modes, modes.full(2), MatrixPlant([[pi, none], [none, pi]])):
        found = analyse_centralised(UNITS, UNCERTAINTY, demand, controller).peaks
        assert found is not None
        assert found.robust_performance.value == pytest.approx(peak, rel=1e-6)
        assert mu_by_ab13md(UNITS, controller, 20.0) == pytest.approx(peak, rel=1e-3)


def test_structures_are_those_of_the_plant_as_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """A decoupler on outputs of unlike spans: the value is that of its controller, by AB13MD."""
    monkeypatch.setattr(structure_search, "STARTS", 1)
    demand = Performance(tau_p=6.0, output_scale=ERRORS)
    found = structured_controllers(UNITS, UNCERTAINTY, demand).found
    assert found
    for each in found:
        mu = mu_by_ab13md(UNITS, each.controller, 6.0)
        assert mu == pytest.approx(each.value, rel=1e-3)
        W = each.mixing[0]
        high = each.controller.D / np.abs(each.controller.D).max()
        gains = [gain for _, gain, _ in each.settings]
        if each.settings[0][2] is not None:
            through = W * gains
            assert high == pytest.approx(through / np.abs(through).max(), rel=1e-9)


def test_too_many_units_of_unlike_spans_are_refused_by_name() -> None:
    """They are no parallel units any more; as a matrix they would be too many."""
    demand = Performance(output_scale=(1.0,) * 6 + (2.0,))
    plant = first_order(7, 1.0, 10.0, 0.1)
    with pytest.raises(InvalidInputError, match="up to 6 outputs") as error:
        multivariable_limit(plant, UNCERTAINTY, demand)
    assert error.value.field == "/performance/output_scale"
    part = StateSpace([[0.0]], [[1.0]], [[0.25]], [[2.0]])
    demand = Performance(tau_p=20.0, output_scale=(1.0,) * 10 + (2.0,))
    with pytest.raises(InvalidInputError, match="up to 10 outputs") as error:
        analyse_centralised(
            first_order(11, 1.0, 10.0, 0.1), UNCERTAINTY, demand, ModeController(part, part)
        )
    assert error.value.field == "/performance/output_scale"


def test_a_loop_in_manual_leaves_the_others_their_permitted_errors() -> None:
    """Three single loops, the worst in manual: the two others with their own errors."""
    plant = first_order(3, 1.0, 10.0, 0.2, 0.5)
    errors = (1.0, 2.0, 5.0)
    loops = (Controller(2.0, 8.0), Controller(1.5, 8.0), Controller(1.0, 9.0))
    demand = Performance(tau_p=20.0, output_scale=errors)
    worst = loops_in_manual(plant, UNCERTAINTY, demand, loops)
    assert worst is not None
    peaks = []
    for unit in range(3):
        left = [each for each in range(3) if each != unit]
        others = Performance(tau_p=20.0, output_scale=tuple(errors[each] for each in left))
        found = analyse(plant.part(left), UNCERTAINTY, others, [loops[each] for each in left]).peaks
        assert found is not None
        peaks.append(found.robust_performance.value)
    assert worst.peak == pytest.approx(max(peaks), rel=1e-6)
    assert worst.unit == int(np.argmax(peaks))
