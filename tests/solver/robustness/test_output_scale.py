"""Permitted errors of the outputs: sigma_max(w_P E^-1 S E)."""

from __future__ import annotations

import json

import numpy as np
import pytest

from solver.certificate.record import Claim
from solver.certificate.search import certify
from solver.certificate.verify import verify
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.mu.structure import sigma_max
from solver.robustness.analysis import analyse
from solver.robustness.curves import LoopAnalysis
from solver.robustness.integrity import service_classes
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

UNCERTAINTY = Uncertainty.from_error(0.1, 0.5)
LOOPS = (Controller(0.44, 19.4), Controller(-0.0272, 3.55))


def wood_berry(unit: float = 1.0) -> MatrixPlant:
    """Wood and Berry's column, its second output in a unit `unit` times as small."""

    def element(gain: float, lag: float, delay: float) -> TransferFunction:
        return TransferFunction((gain,), (lag, 1.0), delay)

    return MatrixPlant(
        [
            [element(12.8, 16.7, 1), element(-18.9, 21, 3)],
            [element(6.6 * unit, 10.9, 7), element(-19.4 * unit, 14.4, 3)],
        ]
    )


def four() -> ParallelPlant:
    """Four units, unlike permitted errors below."""
    return first_order(4, 1.0, 10.0, 0.4, 1.0)


def as_matrix(plant: ParallelPlant, errors: tuple[float, ...]) -> MatrixPlant:
    """Return E^-1 G, entry by entry."""
    return MatrixPlant(
        [
            [
                TransferFunction(
                    tuple(c / errors[row] for c in plant.element(row, column).num),
                    plant.element(row, column).den,
                    plant.element(row, column).dead_time,
                )
                for column in range(plant.n)
            ]
            for row in range(plant.n)
        ]
    )


@pytest.mark.parametrize("unit", [1e-6, 100.0, 1e6])
def test_units_of_an_output_do_not_matter_with_its_permitted_error(unit: float) -> None:
    """An output in another unit gives the same peaks when its permitted error is in that unit."""
    loops = (LOOPS[0], Controller(LOOPS[1].gain / unit, 3.55))
    plain = analyse(wood_berry(), UNCERTAINTY, Performance(tau_p=10.0), LOOPS)
    scaled = analyse(
        wood_berry(unit), UNCERTAINTY, Performance(tau_p=10.0, output_scale=(1.0, unit)), loops
    )
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        value = getattr(scaled.peaks, name).value
        assert value == pytest.approx(getattr(plain.peaks, name).value, rel=1e-6)
    assert scaled.guarantee.reason is None
    assert scaled.lower_bound.value == pytest.approx(plain.lower_bound.value, rel=1e-4)


def test_an_analysis_is_that_of_outputs_divided_by_their_permitted_errors() -> None:
    """A parallel plant with unlike permitted errors agrees with E^-1 G under C E, of all loops."""
    errors = (1.0, 1.0, 3.0, 3.0)
    loops = (Controller(1.5, 9.0),) * 2 + (Controller(0.9, 9.0),) + (Controller(1.5, 9.0),)
    scaled = [Controller(c.gain * e, 9.0) for c, e in zip(loops, errors, strict=True)]
    own = analyse(four(), UNCERTAINTY, Performance(tau_p=15.0, output_scale=errors), loops)
    other = analyse(as_matrix(four(), errors), UNCERTAINTY, Performance(tau_p=15.0), scaled)
    assert own.peaks.robust_performance.value == pytest.approx(
        other.peaks.robust_performance.value, rel=1e-6
    )
    assert own.peaks.nominal_performance.value == pytest.approx(
        other.peaks.nominal_performance.value, rel=1e-6
    )
    plain = analyse(four(), UNCERTAINTY, Performance(tau_p=15.0), loops)
    assert plain.peaks.robust_performance.value != pytest.approx(
        own.peaks.robust_performance.value, rel=1e-3
    )


def test_nominal_performance_is_the_norm_of_the_scaled_sensitivity() -> None:
    """sigma_max(w_P E^-1 S E) from the full matrices, by its definition."""
    errors = (1.0, 5.0, 5.0, 0.2)
    loops = (Controller(1.5, 9.0),) * 3 + (Controller(0.5, 9.0),)
    demand = Performance(tau_p=15.0, output_scale=errors)
    analysis = LoopAnalysis(*group_loops(four(), loops, UNCERTAINTY, errors), UNCERTAINTY, demand)
    assert [block.multiplicity for block in analysis.blocks.blocks] == [1, 1]
    omega = np.geomspace(1e-3, 10, 20)
    C = np.stack([loop.response(omega) for loop in loops], axis=1)
    S = np.linalg.inv(np.eye(4) + four().response(omega) * C[:, None, :])
    e = np.array(errors)
    expected = demand.magnitude(omega) * sigma_max(S * e / e[:, None])
    assert analysis.nominal_performance(omega) == pytest.approx(expected, rel=1e-9)


def test_equal_permitted_errors_change_nothing() -> None:
    """Only the ratios matter."""
    loops = (Controller(1.5, 9.0),) * 4
    plain = analyse(four(), UNCERTAINTY, Performance(tau_p=15.0), loops)
    alike = analyse(four(), UNCERTAINTY, Performance(tau_p=15.0, output_scale=(7.0,) * 4), loops)
    assert plain.peaks == alike.peaks


def test_sets_of_loops_in_service_know_the_permitted_errors() -> None:
    """Each kind of set has the peak of its own units under their permitted errors."""
    errors = (1.0, 1.0, 4.0, 4.0)
    loops = (Controller(1.5, 9.0),) * 4
    demand = Performance(tau_p=15.0, output_scale=errors)
    kinds = {each.in_service: each for each in service_classes(four(), UNCERTAINTY, demand, loops)}
    assert set(kinds) >= {(2, 2), (2, 0), (1, 1)}
    two = analyse(
        first_order(2, 1.0, 10.0, 0.4, 1.0), UNCERTAINTY,
        Performance(tau_p=15.0, output_scale=(1.0, 4.0)), loops[:2],
    )  # fmt: skip
    found = kinds[1, 1].robust_performance
    assert found is not None
    assert found.value == pytest.approx(two.peaks.robust_performance.value, rel=1e-5)


@pytest.mark.parametrize("parallel", [True, False])
def test_certificates_claim_and_verify_permitted_errors(parallel: bool) -> None:
    """A certificate is proven for the permitted errors it states, and for no others."""
    if parallel:
        plant, errors = four(), (1.0, 1.0, 3.0, 3.0)
        loops = (Controller(1.0, 9.0),) * 3 + (Controller(0.5, 9.0),)
    else:
        plant, errors, loops = (
            wood_berry(100.0),
            (1.0, 100.0),
            (LOOPS[0], Controller(-2.7e-4, 3.55)),
        )
    demand = Performance(tau_p=15.0, output_scale=errors)
    peak = analyse(plant, UNCERTAINTY, demand, loops).peaks.robust_performance.value
    certificate = certify(Claim(plant, UNCERTAINTY, demand, loops, 1.01 * peak))
    document = certificate.to_document()
    assert document["performance"]["output_scale"] == list(errors)
    assert verify(json.dumps(document)).ok
    assert verify(json.dumps(document | {"performance": {}})).field == "/performance/max_peak"
    low = certify(Claim(plant, UNCERTAINTY, demand, loops, 0.98 * peak))
    assert low.mu > 0.98 * peak


def test_tuning_is_invariant_to_units_with_permitted_errors() -> None:
    """Wood and Berry's column with an output in hundredths: the same tau_P when scaled."""
    found = [
        tune(Specification(wood_berry(unit), UNCERTAINTY, Performance(output_scale=scale)))
        for unit, scale in ((1.0, None), (100.0, (1.0, 100.0)))
    ]
    assert found[0].tau_p == pytest.approx(9.88, abs=0.005)
    assert found[1].tau_p == pytest.approx(found[0].tau_p, rel=1e-5)
    assert found[1].loops[1].gain == pytest.approx(found[0].loops[1].gain / 100, rel=1e-3)
    assert not found[1].warnings


def test_units_with_unlike_permitted_errors_do_not_change_places() -> None:
    """Two units, the second's error being free: its settings are found for it, not for the first.

    The tuning of E^-1 G as a matrix plant finds the same.
    """
    plant, errors = first_order(2, 1.0, 10.0, 0.8, 1.0), (1.0, 20.0)
    own = tune(Specification(plant, UNCERTAINTY, Performance(output_scale=errors)))
    other = tune(Specification(as_matrix(plant, errors), UNCERTAINTY, Performance()))
    assert own.tau_p == pytest.approx(other.tau_p, rel=1e-4)
    peak = analyse(
        plant, UNCERTAINTY, Performance(tau_p=own.tau_p, output_scale=errors), own.loops
    ).peaks.robust_performance.value
    assert peak == pytest.approx(1.0, abs=1e-4)


def test_identical_settings_serve_unlike_permitted_errors() -> None:
    """One controller for all units, whose outputs may err unlike."""
    errors = (1.0, 3.0, 3.0)
    plant = first_order(3, 1.0, 10.0, 0.4, 1.0)
    found = tune(
        Specification(
            plant, UNCERTAINTY, Performance(output_scale=errors), arrangement=Arrangement.IDENTICAL
        )
    )
    assert len(set(found.loops)) == 1
    peak = analyse(
        plant, UNCERTAINTY, Performance(tau_p=found.tau_p, output_scale=errors), found.loops
    ).peaks.robust_performance.value
    assert peak == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(
    ("scale", "field"),
    [
        ((1.0,), "/performance/output_scale"),
        ((1.0, 2.0, 3.0), "/performance/output_scale"),
        ((), "/performance/output_scale"),
    ],
)
def test_permitted_errors_fit_the_plant(scale: tuple[float, ...], field: str) -> None:
    """One a loop, else it is refused by name."""
    for ask in (
        lambda: analyse(
            wood_berry(), UNCERTAINTY, Performance(tau_p=9.0, output_scale=scale), LOOPS
        ),
        lambda: Specification(wood_berry(), UNCERTAINTY, Performance(output_scale=scale)),
    ):
        with pytest.raises(InvalidInputError) as caught:
            ask()
        assert caught.value.field == field


@pytest.mark.parametrize(
    ("scale", "field"),
    [
        ((1.0, 0.0), "/output_scale/1"),
        ((-1.0, 1.0), "/output_scale/0"),
        ((1.0, float("nan")), "/output_scale/1"),
        ((1.0, float("inf")), "/output_scale/1"),
        ((1.0, 1e-13), "/output_scale"),
    ],
)
def test_permitted_errors_are_positive_and_comparable(scale: tuple[float, ...], field: str) -> None:
    """Zero, negative, infinite or incomparable ones are refused by name."""
    with pytest.raises(InvalidInputError) as caught:
        Performance(output_scale=scale)
    assert caught.value.field == field


def test_errors_in_concert_have_no_permitted_errors() -> None:
    """Full-block uncertainty compares inputs, whose units the permitted errors do not tell."""
    full = Uncertainty.from_error(0.1, 0.5, "full")
    with pytest.raises(InvalidInputError, match="diagonal"):
        Specification(wood_berry(), full, Performance(output_scale=(1.0, 2.0)))
    Specification(wood_berry(), full, Performance(output_scale=(2.0, 2.0)))
