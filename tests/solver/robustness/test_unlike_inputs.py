"""An uncertainty of its own for each input: w_I,i on row i of N_RP."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from solver.certificate.reading import read_certificate
from solver.certificate.record import Certificate, Claim
from solver.certificate.search import certify
from solver.certificate.verify import verify
from solver.limits.multivariable import multivariable_limit
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.mu.sdp import upper_bound
from solver.mu.structure import BlockStructure
from solver.robustness.analysis import analyse
from solver.robustness.axis import proven_peaks
from solver.robustness.curves import LoopAnalysis
from solver.robustness.integrity import service_classes
from solver.simulation.worst_actuators import worst_actuators
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

PLANT = first_order(2, 1.0, 100.0, 0.949)
LOOPS = (Controller(46.3, 101.0), Controller(22.8, 3.15))
UNLIKE = Uncertainty.from_error([0.2, 0.1], [1.0, 2.5])
DEMAND = Performance(tau_p=25.0)
OMEGA = np.geomspace(1e-4, 1e2, 41)


def dense(plant, loops, uncertainty, performance, omega):
    """N_RP as it is written, from numpy alone."""
    G = plant.response(omega)
    n = plant.n
    C = np.stack([np.diag([c.response(w)[0] for c in loops]) for w in omega])
    w_I = np.stack(
        [np.diag([uncertainty.weight_of(i).response(w)[0] for i in range(n)]) for w in omega]
    )
    S = np.linalg.inv(np.eye(n) + G @ C)
    w_P = performance.weight.response(omega)[:, None, None]
    upper = np.concatenate([w_I @ C @ S @ G, w_I @ C @ S], axis=2)
    return np.concatenate([upper, np.concatenate([w_P * S @ G, w_P * S], axis=2)], axis=1)


def bound(plant, loops, uncertainty, performance=DEMAND, omega=OMEGA):
    """The bound of mu of robust performance at `omega` after reduction."""
    analysis = LoopAnalysis(
        *group_loops(plant, loops, uncertainty, performance.output_scale), uncertainty, performance
    )
    return analysis.robust_performance(omega)


@pytest.mark.parametrize("structure", list(Structure))
@pytest.mark.parametrize(
    ("loops", "errors"),
    [
        ([LOOPS[0]] * 4, [0.2, 0.1, 0.2, 0.1]),
        ([LOOPS[0], LOOPS[0], LOOPS[1], LOOPS[1]], [0.3, 0.1, 0.3, 0.3]),
        ([LOOPS[0]] * 4, [0.2, 0.2, 0.2, 0.05]),
    ],
)
def test_reduction_equals_a_semidefinite_program_of_all_channels(loops, errors, structure):
    """Groups split by their errors: the bound is that of eight channels, by other code."""
    plant = first_order(4, 1.0, 100.0, 0.6, 1.0)
    loops = [replace(loop, gain=loop.gain / 4) for loop in loops]
    uncertainty = Uncertainty.from_error(errors, [1.0, 1.0, 1.0, 2.0], structure)
    omega = OMEGA[::6]
    scales = (0,) * 4 if structure is Structure.FULL else (0, 1, 2, 3)
    N = dense(plant, loops, uncertainty, DEMAND, omega)
    whole = upper_bound(N, BlockStructure(scales, 4)).mu
    assert bound(plant, loops, uncertainty, omega=omega) == pytest.approx(whole, rel=1e-6)


def test_equal_entries_are_one_for_all():
    """A list of equal errors changes nothing."""
    one, each = Uncertainty.from_error(0.2, 1), Uncertainty.from_error([0.2, 0.2], 1)
    assert (bound(PLANT, LOOPS, one) == bound(PLANT, LOOPS, each)).all()


def test_order_of_the_units_does_not_matter():
    """Loops and errors permuted together give the same mu."""
    plant = first_order(3, 1.0, 50.0, 0.3, 0.5)
    loops = [Controller(9, 40), Controller(5, 10), Controller(9, 40)]
    errors = [0.3, 0.1, 0.2]
    there = bound(plant, loops, Uncertainty.from_error(errors, 1))
    back = bound(plant, loops[::-1], Uncertainty.from_error(errors[::-1], 1))
    assert there == pytest.approx(back, rel=1e-9)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_units_of_an_input_do_not_matter(unit):
    """A valve in other units, its controller with it: mu and the peaks stay."""
    elements = [[PLANT.element(r, c) for c in range(2)] for r in range(2)]
    scaled = [
        [
            TransferFunction([k * (unit if c else 1) for k in e.num], e.den)
            for c, e in enumerate(row)
        ]
        for row in elements
    ]
    loops = (LOOPS[0], replace(LOOPS[1], gain=LOOPS[1].gain / unit))
    there = proven_peaks(MatrixPlant(elements), UNLIKE, DEMAND, LOOPS)
    here = proven_peaks(MatrixPlant(scaled), UNLIKE, DEMAND, loops)
    value = here.peaks.robust_performance.value
    assert value == pytest.approx(there.peaks.robust_performance.value, rel=1e-6)
    assert str(here.guarantee.status) == str(there.guarantee.status) == "proven"


def test_bound_is_attained_by_valves_within_their_own_errors():
    """With two units the bound is mu: the worst valves err by their own weights, and reach it."""
    found = analyse(PLANT, UNLIKE, DEMAND, LOOPS)
    top = found.peaks.robust_performance
    assert found.lower_bound.value == pytest.approx(top.value, rel=1e-6)
    omega = np.array([found.worst_case.omega])
    actuators = worst_actuators(PLANT, LOOPS, UNLIKE, DEMAND).functions
    for unit, valve in enumerate(actuators):
        error = np.abs(valve.response(omega) - 1)
        most = np.abs(UNLIKE.weight_of(unit).response(omega)) / found.worst_case.mu
        assert error == pytest.approx(most, rel=0.02)


def test_certificate_holds_the_weights_and_is_verified():
    """The document of a certificate has a weight an input, and survives a round trip."""
    level = 1.001 * proven_peaks(PLANT, UNLIKE, DEMAND, LOOPS).peaks.robust_performance.value
    found = certify(Claim(PLANT, UNLIKE, DEMAND, LOOPS, level))
    assert isinstance(found, Certificate)
    text = json.dumps(found.to_document())
    assert read_certificate(text) == found
    assert verify(text).ok
    swapped = replace(found.claim, uncertainty=Uncertainty.from_error([0.1, 0.2], [2.5, 1.0]))
    other = replace(found, claim=swapped).to_document()
    assert not verify(json.dumps(other)).ok


def test_loops_out_of_service_keep_their_own_errors():
    """Each kind of set has the peak of that subplant with its inputs' own errors."""
    plant = first_order(3, 1.0, 50.0, 0.3, 0.5)
    loops = [Controller(9, 40)] * 3
    uncertainty = Uncertainty.from_error([0.3, 0.1, 0.1], 1)
    classes = service_classes(plant, uncertainty, DEMAND, loops)
    assert [(each.in_service, each.subsets) for each in classes] == [
        ((1, 2), 1), ((1, 1), 2), ((0, 2), 1), ((1, 0), 1), ((0, 1), 2),
    ]  # fmt: skip
    part = first_order(2, 1.0, 50.0, 0.3, 0.5)
    alone = proven_peaks(part, Uncertainty.from_error([0.3, 0.1], 1), DEMAND, loops[:2])
    assert classes[1].robust_performance.value == alone.peaks.robust_performance.value


def test_many_kinds_of_sets_are_sampled_with_their_own_errors():
    """Where peaks are sampled, they are those that the proof finds."""
    plant = first_order(6, 1.0, 50.0, 0.3, 0.5)
    loops = [Controller(4 + unit % 3, 40) for unit in range(6)]
    uncertainty = Uncertainty.from_error([0.3, 0.1, 0.2, 0.3, 0.1, 0.25], 1)
    classes = service_classes(plant, uncertainty, DEMAND, loops)
    assert len(classes) > 15
    groups = [(0, 3), (1, 4), (2,), (5,)]
    for each in classes[3::9]:
        units = [u for group, k in zip(groups, each.in_service, strict=True) for u in group[:k]]
        part = first_order(len(units), 1.0, 50.0, 0.3, 0.5)
        proven = proven_peaks(part, uncertainty.of_units(units), DEMAND, [loops[u] for u in units])
        value = proven.peaks.robust_performance.value
        assert each.robust_performance.value == pytest.approx(value, rel=1e-4)


def test_tuning_lies_between_those_of_the_errors():
    """A better valve on one unit helps, and less than better valves on both."""

    def best(epsilon):
        uncertainty = Uncertainty.from_error(epsilon, 1)
        task = Specification(
            PLANT, uncertainty, Performance(), arrangement=Arrangement.INDEPENDENT, starts=6
        )
        found = tune(task)
        assert found.peaks.robust_performance.value <= 1 + 1e-7
        return found.tau_p

    coarse, mixed, fine = best(0.2), best([0.2, 0.1]), best(0.1)
    assert fine < mixed < coarse
    assert mixed == pytest.approx(best([0.1, 0.2]), rel=1e-4)


def test_many_units_in_groups_by_their_errors():
    """300 units, a third with worse valves: best finds settings for the two kinds."""
    plant = first_order(300, 1.0, 100.0, 0.002)
    uncertainty = Uncertainty.from_error([0.3] * 100 + [0.1] * 200, 1)
    found = tune(
        Specification(plant, uncertainty, Performance(), arrangement=Arrangement.BEST, starts=3)
    )
    assert len(found.loops) == 300
    assert len(found.groups) in (1, 2)
    assert found.peaks.robust_performance.value <= 1 + 1e-7


@pytest.mark.parametrize(
    ("epsilon", "theta", "field"),
    [([0.2, 0.1], [1.0], "/theta"), ([], 1.0, "/epsilon"), ([0.2, -1.0], 1.0, "/epsilon/1")],
)
def test_lists_that_do_not_fit_are_refused(epsilon, theta, field):
    """The pointer tells which entry."""
    with pytest.raises(InvalidInputError) as caught:
        Uncertainty.from_error(epsilon, theta)
    assert caught.value.field == field


def test_a_list_for_another_plant_is_refused():
    """Not one an input."""
    with pytest.raises(InvalidInputError, match="2 uncertainties for a plant of 3 inputs"):
        analyse(first_order(3, 1, 10, 0.1), UNLIKE, DEMAND, [LOOPS[0]] * 3)
    with pytest.raises(InvalidInputError, match="inputs of one uncertainty"):
        multivariable_limit(PLANT, UNLIKE, Performance())
