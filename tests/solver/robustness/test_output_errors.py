"""Errors of the outputs beside those of the inputs: (I + w_O Delta_O) G (I + w_I Delta_I)."""

import json

import numpy as np
import pytest
from scipy.optimize import minimize

from solver.certificate.record import Certificate, Claim
from solver.certificate.search import CertificateFailure, Obstacle, certify
from solver.certificate.verify import Verdict, verify
from solver.limits.multivariable import multivariable_limit
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.mu.scaling import sweep
from solver.robustness.analysis import analyse
from solver.robustness.axis import proven_peaks
from solver.robustness.record import GuaranteeStatus
from solver.robustness.subset_peaks import peaks
from solver.robustness.subsets import Subsets
from solver.simulation.worst_actuators import worst_actuators
from solver.tuning.specification import Arrangement, Objective, Specification
from solver.tuning.tuner import tune

SEED = first_order(2, 1.0, 100.0, 0.949)
SETTINGS = (Controller(47.66, 101.2), Controller(18.90, 2.361))


def _errors(epsilon, theta, of_outputs, theta_of_outputs):
    inputs = Uncertainty.from_error(epsilon, theta)
    outputs = Uncertainty.from_error(of_outputs, theta_of_outputs)
    return Uncertainty(inputs.weight, outputs=outputs)


def _lag(gain, lag, dead_time=0.0):
    return TransferFunction((gain,), (lag, 1.0), dead_time)


WOOD_BERRY = MatrixPlant(
    [
        [_lag(12.8, 16.7, 1.0), _lag(-18.9, 21.0, 3.0)],
        [_lag(6.6, 10.9, 7.0), _lag(-19.4, 14.4, 3.0)],
    ]
)


def _at(plant, loops, uncertainty, performance, omega):
    """Return G, C, w_I, w_O, w_P and the permitted errors at one frequency."""
    n, at = plant.n, np.array([omega])
    G = np.array([[plant.element(r, c).response(at)[0] for c in range(n)] for r in range(n)])
    C = np.diag([loop.response(at)[0] for loop in loops])
    w_I = np.diag(uncertainty.responses(at, range(n))[0])
    w_O = np.diag(uncertainty.outputs.responses(at, range(n))[0])
    E = np.diag(performance.output_scale or (1.0,) * n)
    return G, C, w_I, w_O, performance.weight.response(at)[0], E


def _mu_by_definition(plant, loops, uncertainty, performance, omega):
    """Return min over D of sigma_max(D N D^-1) of N written down from the signals of the loop."""
    G, C, w_I, w_O, w_P, E = _at(plant, loops, uncertainty, performance, omega)
    n = len(G)
    identity = np.eye(n)
    S = np.linalg.inv(identity + G @ C)
    of_y = np.hstack([S @ G, S, S @ E])
    before_error = np.hstack([S @ G, S - identity, (S - identity) @ E])
    N = np.vstack([-w_I @ C @ of_y, w_O @ before_error, w_P * np.linalg.inv(E) @ of_y])

    def bound(y):
        d = np.append(np.exp(y), np.ones(n))
        return np.linalg.norm(d[:, None] * N / d, 2)

    y = np.zeros(2 * n)
    for _ in range(200):  # Osborne
        for i in range(2 * n):
            d = np.append(np.exp(y), np.ones(n))
            square = np.abs(d[:, None] * N / d) ** 2
            into, out = square[i].sum() - square[i, i], square[:, i].sum() - square[i, i]
            y[i] += 0.25 * np.log(out / into)
    for method in ("Nelder-Mead", "Powell", "Nelder-Mead"):
        found = minimize(bound, y, method=method, tol=1e-12, options={"maxfev": 6000})
        y = found.x if found.fun < bound(y) else y
    return bound(y)


CASES = {
    "seed": (SEED, SETTINGS, _errors(0.2, 1, 0.05, 0.5), Performance(tau_p=18.446)),
    "unlike errors": (
        SEED, SETTINGS, _errors([0.2, 0.1], 1, [0.02, 0.05], 0.5),
        Performance(tau_p=18.446, output_scale=(1.0, 3.0)),
    ),
    "dead time": (
        WOOD_BERRY, (Controller(0.375, 8.29), Controller(-0.075, 23.6)),
        _errors(0.1, 0.5, 0.05, 0.5), Performance(tau_p=20.0),
    ),
    "one loop": (
        first_order(1, 1.0, 10.0, 0.0, 1.0), (Controller(2.0, 8.0, 0.3),),
        _errors(0.2, 1, 0.05, 0.5), Performance(tau_p=8.0),
    ),
    "P control": (
        WOOD_BERRY, (Controller(0.1, None), Controller(-0.02, None)),
        _errors(0.1, 0.5, 0.05, 0.5), Performance(tau_p=20.0, offset=0.5),
    ),
    "integrators": (
        MatrixPlant(
            [
                [TransferFunction((1.0,), (1.0, 0.0)), TransferFunction((0.3,), (1.0, 0.0))],
                [_lag(0.2, 5.0), _lag(1.0, 5.0)],
            ]
        ),
        (Controller(0.3, 10.0), Controller(0.8, 5.0)),
        _errors(0.2, 1, 0.05, 0.5), Performance(tau_p=20.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_peak_is_that_of_the_definition_and_is_proven_attained_and_certified(case):
    """N written down from the signals has the peak; a perturbation attains it; it is proven."""
    plant, loops, uncertainty, performance = case
    found = analyse(plant, uncertainty, performance, loops, certificate=True)
    peak = found.peaks.robust_performance
    expected = _mu_by_definition(plant, loops, uncertainty, performance, peak.omega)
    assert peak.value == pytest.approx(expected, rel=1e-6)
    assert found.guarantee.status is GuaranteeStatus.PROVEN
    assert found.lower_bound.value == pytest.approx(peak.value, rel=1e-3)
    document = json.dumps(found.certificate.to_document())
    assert verify(document).verdict is Verdict.PROVEN


def test_the_worst_case_attains_mu_in_the_perturbed_loop():
    """With both perturbations in the loop, sigma_max(w_P E^-1 S_p E) is the lower bound."""
    plant, loops, uncertainty, performance = CASES["unlike errors"]
    worst = analyse(plant, uncertainty, performance, loops).worst_case
    G, C, w_I, w_O, w_P, E = _at(plant, loops, uncertainty, performance, worst.omega)
    deltas = [
        np.diag([entry.value for entry in part.entries])
        for part in (worst.uncertainty, worst.outputs)
    ]
    identity = np.eye(2)
    G_p = (identity + w_O @ deltas[1]) @ G @ (identity + w_I @ deltas[0])
    S_p = np.linalg.inv(identity + G_p @ C)
    attained = np.linalg.norm(w_P * np.linalg.inv(E) @ S_p @ E, 2)
    assert attained == pytest.approx(worst.mu, rel=1e-6)
    assert all(abs(entry.value) == pytest.approx(1 / worst.mu) for entry in worst.outputs.entries)


def test_groups_split_as_the_whole_matrix_does():
    """Four units in two groups have the peaks of the same plant as a matrix; 300 are as fast."""
    parallel = first_order(4, 1.0, 30.0, 0.3, 0.5)
    matrix = MatrixPlant(parallel.rows)
    loops = (Controller(3.0, 20.0),) * 2 + (Controller(2.0, 25.0),) * 2
    uncertainty, performance = (
        _errors(0.1, 0.5, [0.03, 0.03, 0.06, 0.06], 0.3),
        Performance(tau_p=30.0),
    )
    one, other = (analyse(each, uncertainty, performance, loops) for each in (parallel, matrix))
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        values = [getattr(each.peaks, name).value for each in (one, other)]
        assert values[0] == pytest.approx(values[1], rel=1e-6)
    many = first_order(300, 1.0, 10.0, 0.5, 1.0)
    found = analyse(
        many, _errors(0.1, 0.5, 0.05, 0.5), Performance(tau_p=200.0), (Controller(0.1, 8.0),) * 300
    )
    assert found.guarantee.status is GuaranteeStatus.PROVEN
    assert found.lower_bound.value == pytest.approx(found.peaks.robust_performance.value, rel=1e-3)


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_units_change_nothing(size):
    """Outputs, inputs and time in other units give the same peak at the frequency in them."""
    plant, loops, uncertainty, performance = CASES["dead time"]
    before = analyse(plant, uncertainty, performance, loops).peaks.robust_performance
    rows = [
        [
            TransferFunction(
                tuple(c * size ** (1 - 2 * r) for c in element.num), element.den, element.dead_time
            )
            for element in row
        ]
        for r, row in enumerate(plant.rows)
    ]
    scaled = tuple(
        Controller(loop.gain / size ** (1 - 2 * r), loop.integral_time)
        for r, loop in enumerate(loops)
    )
    demand = Performance(tau_p=20.0, output_scale=(size, 1 / size))
    after = analyse(MatrixPlant(rows), uncertainty, demand, scaled).peaks.robust_performance
    assert after.value == pytest.approx(before.value, rel=1e-6)
    assert after.omega == pytest.approx(before.omega, rel=1e-2)


def test_small_errors_of_outputs_cost_nothing_and_large_ones_more():
    """tau_P grows from that of known outputs with their errors; each result keeps mu <= 1."""
    taus = []
    for of_outputs, theta in ((1e-6, 1e-6), (0.05, 0.5), (0.2, 1.0)):
        found = tune(Specification(SEED, _errors(0.2, 1, of_outputs, theta), Performance()))
        taus.append(found.tau_p)
        assert found.guarantee.status is GuaranteeStatus.PROVEN
        assert found.peaks.robust_performance.value <= 1 + 1e-6
    assert taus[0] == pytest.approx(18.446, rel=1e-3)
    assert taus[0] < taus[1] < taus[2]


def test_an_error_of_the_outputs_that_forbids_all_is_named():
    """With 105 % at steady state no settings exist, and the reason names the outputs."""
    found = tune(Specification(SEED, _errors(0.2, 1, 1.05, 0.5), Performance()))
    assert found.status == "infeasible"
    assert "of the outputs is 105 %" in found.reason


def test_sets_in_service_are_judged_with_the_errors_of_their_outputs():
    """The peaks of many sets at once are those that the proof finds for each set by itself."""
    plant = first_order(4, 1.0, 30.0, 0.3, 0.5)
    loops = (Controller(3.0, 20.0),) * 2 + (Controller(2.0, 25.0),) * 2
    of_groups = _errors([0.1, 0.2], 0.5, [0.03, 0.06], 0.3)
    performance, counts = Performance(tau_p=30.0), np.array([[2.0, 1.0], [0.0, 2.0], [1.0, 0.0]])
    subsets = Subsets(plant, (loops[0], loops[2]), counts)
    omega = np.geomspace(1e-5, 1e3, 200)
    stability, robust = peaks(subsets, of_groups, performance, omega)
    uncertainty = of_groups.of_units((0, 0, 1, 1))
    for row, units in enumerate(((0, 1, 2), (2, 3), (0,))):
        own = uncertainty.of_units(units)
        axis = proven_peaks(plant.part(units), own, performance, [loops[unit] for unit in units])
        assert stability[row].value == pytest.approx(axis.peaks.robust_stability.value, rel=1e-4)
        assert robust[row].value == pytest.approx(axis.peaks.robust_performance.value, rel=1e-4)


def test_a_certificate_says_what_errs_and_no_more_than_is_so():
    """The document holds the outputs' weight; another weight does not fit; a low level fails."""
    plant, loops, uncertainty, performance = CASES["seed"]
    found = analyse(plant, uncertainty, performance, loops, certificate=True)
    document = found.certificate.to_document()
    assert document["uncertainty"]["outputs"]["num"] == [0.5, 0.05]
    without = {**document, "uncertainty": {**document["uncertainty"]}}
    del without["uncertainty"]["outputs"]
    assert verify(json.dumps(without)).verdict is Verdict.MALFORMED
    worse = Certificate(
        Claim(plant, _errors(0.2, 1, 0.1, 0.5), performance, loops, found.certificate.claim.gamma),
        found.certificate.intervals,
    )
    assert verify(json.dumps(worse.to_document())).verdict is Verdict.UNPROVEN
    level = 0.99 * found.peaks.robust_performance.value
    refused = certify(Claim(plant, uncertainty, performance, loops, level))
    assert isinstance(refused, CertificateFailure)
    assert refused.obstacle is Obstacle.EXCEEDED


def test_what_does_not_take_them_refuses_them_by_name():
    """A full block, a chain of outputs, unfitting lists, and analyses for known outputs."""
    inputs, outputs = Uncertainty.from_error(0.2, 1), Uncertainty.from_error(0.05, 0.5)
    both = Uncertainty(inputs.weight, outputs=outputs)
    performance = Performance(tau_p=20.0)
    full = Uncertainty(outputs.weight, Structure.FULL)
    refusals = {
        "/outputs": lambda: Uncertainty(inputs.weight, Structure.FULL, outputs),
        "/outputs/structure": lambda: Uncertainty(inputs.weight, outputs=full),
        "/outputs/outputs": lambda: Uncertainty(inputs.weight, outputs=both),
        "/uncertainty/outputs": lambda: analyse(
            SEED, _errors(0.2, 1, [0.1, 0.1, 0.1], 1), performance, SETTINGS
        ),
        "/search/optimality_gap": lambda: Specification(
            SEED, both, Performance(), arrangement=Arrangement.IDENTICAL, optimality_gap=True
        ),
    }
    for field, refused in refusals.items():
        with pytest.raises(InvalidInputError) as caught:
            refused()
        assert caught.value.field == field
    for analysis in (
        lambda: multivariable_limit(SEED, both, Performance()),
        lambda: worst_actuators(SEED, SETTINGS, both, performance),
    ):
        with pytest.raises(InvalidInputError) as caught:
            analysis()
        assert caught.value.field == "/uncertainty/outputs"


def test_objective_mu_takes_them():
    """At a given tau_P the least peak found is proven and below that of the published settings."""
    uncertainty, performance = _errors(0.2, 1, 0.05, 0.5), Performance(tau_p=19.0)
    found = tune(Specification(SEED, uncertainty, performance, objective=Objective.MU))
    published = analyse(SEED, uncertainty, performance, SETTINGS)
    assert found.peaks.robust_performance.value < published.peaks.robust_performance.value
    assert found.guarantee.status is GuaranteeStatus.PROVEN


def test_errors_of_outputs_need_no_kernels_of_their_own():
    """Arrays in another order in memory would be a kernel's other type: a minute of compiling."""
    of_outputs = _errors(0.2, 1.0, 0.05, 1.0)
    proven_peaks(SEED, Uncertainty.from_error(0.2, 1.0), Performance(tau_p=30), SETTINGS)
    known = set(sweep.signatures)
    proven_peaks(SEED, of_outputs, Performance(tau_p=30), SETTINGS)
    assert set(sweep.signatures) == known
