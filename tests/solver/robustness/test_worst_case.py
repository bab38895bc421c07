"""The worst case of a loop: exact for small and symmetric plants, true in the full plant."""

import cmath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.robustness.curves import LoopAnalysis
from solver.robustness.worst_case import (
    DiagonalPerturbation,
    Entry,
    RankOnePerturbation,
    WorstCase,
    all_pass,
    lower_bounds,
    worst_case,
)

DIAGONAL = Uncertainty.from_error(0.2, 1)
FULL = Uncertainty.from_error(0.2, 1, Structure.FULL)
FAST, SLOW = Controller(46.3, 101), Controller(22.8, 3.15)
EQUAL = Controller(39.7, 65.1)


def matrix_plant(n: int) -> MatrixPlant:
    """Diagonally dominant lags without any symmetry."""
    generator = np.random.default_rng(n)
    return MatrixPlant(
        [
            [
                TransferFunction(
                    [1.0 if row == column else generator.uniform(-0.4, 0.4)],
                    [generator.uniform(50, 200), 1],
                )
                for column in range(n)
            ]
            for row in range(n)
        ]
    )


OMEGA = np.geomspace(1e-4, 1e3, 50)
CASES = {
    "published": (first_order(2, 1, 100, 0.949), (FAST, SLOW), DIAGONAL, 19),
    "identical": (first_order(2, 1, 100, 0.949), (EQUAL,) * 2, DIAGONAL, 26),
    "five identical": (first_order(5, 1, 100, 0.6), (EQUAL,) * 5, DIAGONAL, 26),
    "three and two": (
        first_order(5, 1, 100, -0.2),
        (EQUAL, SLOW, EQUAL, SLOW, EQUAL),
        DIAGONAL,
        26,
    ),
    "three and two, full": (
        first_order(5, 1, 100, -0.2),
        (EQUAL, SLOW, EQUAL, SLOW, EQUAL),
        FULL,
        26,
    ),
    "dead time": (
        first_order(3, 1, 100, 0.6, 1.0),
        (Controller(20, 65), Controller(10, 20), Controller(15, 30)),
        DIAGONAL,
        26,
    ),
    "one": (first_order(1, 1, 100, 0), (EQUAL,), DIAGONAL, 20),
    "matrix": (matrix_plant(3), (FAST, Controller(10, 50), FAST), DIAGONAL, 30),
    "matrix, equal loops": (matrix_plant(5), (Controller(10, 50),) * 5, DIAGONAL, 30),
}
EXACT = set(CASES) - {"dead time", "matrix"}  # three blocks, or at most two groups


def loop_of(
    plant: Plant, loops: tuple[Controller, ...], uncertainty: Uncertainty, tau_p: float
) -> LoopAnalysis:
    """The analysis of a case."""
    blocks, controllers = group_loops(plant, loops, uncertainty)
    return LoopAnalysis(blocks, controllers, uncertainty, Performance(tau_p=tau_p))


def bounds(analysis: LoopAnalysis) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper bounds over frequency."""
    lower = lower_bounds(
        analysis.blocks,
        analysis.controllers,
        analysis.uncertainty,
        analysis.performance,
        omega=OMEGA,
        scales=analysis.scales(OMEGA),
    )
    return lower, analysis.robust_performance(OMEGA)


def worst(analysis: LoopAnalysis, omega: NDArray[np.float64] = OMEGA) -> WorstCase:
    """The worst case over `omega`."""
    return worst_case(
        analysis.blocks,
        analysis.controllers,
        analysis.uncertainty,
        analysis.performance,
        omega=omega,
        scales=analysis.scales(omega),
    )


def by_unit(entries: tuple[Entry, ...], n: int, omega: float) -> NDArray[np.complex128]:
    """Values of the interpolating systems at `omega`, unit by unit."""
    values = np.full(n, np.nan, dtype=complex)
    for entry in entries:
        values[list(entry.units)] = entry.transfer(1j * omega)
    return values


def uncertain_block(case: WorstCase, n: int) -> NDArray[np.complex128]:
    """Delta_I at the worst frequency, from the interpolating systems."""
    if isinstance(case.uncertainty, DiagonalPerturbation):
        return np.diag(by_unit(case.uncertainty.entries, n, case.omega))
    return outer(case.uncertainty, n, case.omega)


def outer(perturbation: RankOnePerturbation, n: int, omega: float) -> NDArray[np.complex128]:
    """Value of a rank-one block."""
    return np.outer(by_unit(perturbation.left, n, omega), by_unit(perturbation.right, n, omega))


@pytest.mark.parametrize("name", CASES)
def test_never_above_the_upper_bound_and_exact_where_promised(name: str) -> None:
    """The bounds meet to 1e-6 at every frequency for n = 2 and for one or two groups."""
    analysis = loop_of(*CASES[name])
    lower, upper = bounds(analysis)
    assert np.all(lower <= upper * (1 + 1e-9))
    if name in EXACT:
        assert lower == pytest.approx(upper, rel=1e-6)
    case = worst(analysis)
    assert case.mu == pytest.approx(np.max(lower), rel=1e-12)
    assert case.gap == pytest.approx(1 - case.mu / case.upper_bound, abs=1e-12)
    assert case.warning is None


@pytest.mark.parametrize("name", CASES)
def test_the_perturbed_plant_performs_as_stated(name: str) -> None:
    """In the full plant, the stable perturbation of size 1/mu takes w_P S to mu."""
    plant, loops, uncertainty, tau_p = CASES[name]
    case = worst(loop_of(*CASES[name]))
    n, s = plant.n, 1j * case.omega
    G = plant.response([case.omega])[0]
    C = np.diag([loop(s) for loop in loops])
    Delta = uncertain_block(case, n)
    assert np.linalg.norm(Delta, 2) == pytest.approx(1 / case.mu, rel=1e-9)
    perturbed = np.linalg.inv(np.eye(n) + G @ (np.eye(n) + uncertainty.weight(s) * Delta) @ C)
    weighted = Performance(tau_p=tau_p).weight(s) * perturbed
    assert np.linalg.norm(weighted, 2) == pytest.approx(case.mu, rel=1e-9)
    closing = outer(case.performance, n, case.omega)
    assert np.linalg.norm(closing, 2) == pytest.approx(1 / case.mu, rel=1e-9)
    assert np.linalg.svd(np.eye(n) - weighted @ closing, compute_uv=False)[-1] < 1e-9


def test_a_thousand_units_in_two_groups_are_exact() -> None:
    """The perturbation takes few values and attains mu of all 1000 inputs."""
    loops = (Controller(1, 65.1),) * 301 + (Controller(2, 20),) * 699
    analysis = loop_of(first_order(1000, 1, 100, 0.06), loops, DIAGONAL, 26)
    lower, upper = bounds(analysis)
    assert lower == pytest.approx(upper, rel=1e-6)
    case = worst(analysis)
    assert isinstance(case.uncertainty, DiagonalPerturbation)
    assert len(case.uncertainty.entries) <= 6
    units = sorted(unit for entry in case.uncertainty.entries for unit in entry.units)
    assert units == list(range(1000))


@pytest.mark.parametrize("seed", range(12))
def test_two_groups_of_any_size_are_exact(seed: int) -> None:
    """Random plants and settings, odd and even groups: the bounds meet to 1e-6."""
    generator = np.random.default_rng(seed)
    sizes = generator.integers(1, 8, 2)
    n = int(sizes.sum())
    interaction = generator.uniform(-0.8 / (n - 1), 0.9)
    plant = first_order(n, 1, generator.uniform(5, 100), interaction, generator.choice([0, 0.5]))
    first, second = (
        Controller(10 ** generator.uniform(-1, 1), 10 ** generator.uniform(0.5, 2))
        for _ in range(2)
    )
    loops = (first,) * int(sizes[0]) + (second,) * int(sizes[1])
    structure = Structure.FULL if seed % 3 == 2 else Structure.DIAGONAL
    lower, upper = bounds(loop_of(plant, loops, Uncertainty.from_error(0.2, 1, structure), 30))
    assert lower == pytest.approx(upper, rel=1e-6)


def test_symmetric_settings_may_have_an_asymmetric_worst_case() -> None:
    """Two identical loops: where sum and difference are both active, the inputs err apart."""
    analysis, omega = loop_of(*CASES["identical"]), np.array([0.1])
    case = worst(analysis, omega)
    assert isinstance(case.uncertainty, DiagonalPerturbation)
    first, second = (entry.value for entry in case.uncertainty.entries)
    assert abs(first - second) > 1
    assert case.mu == pytest.approx(analysis.robust_performance(omega)[0], rel=1e-6)


def test_published_peak() -> None:
    """SLH's settings at tau_P = 19: mu is 1.00034840 at 0.0314362, from below as from above."""
    case = worst(loop_of(*CASES["published"]), np.array([0.031436181846]))
    assert case.mu == pytest.approx(1.0003484015698523, rel=1e-9)


def test_actuators_are_what_multiplies_the_inputs() -> None:
    """An actuator is 1 + w_I delta, stable, and w_I's dead time is left out."""
    late = TransferFunction(DIAGONAL.weight.num, DIAGONAL.weight.den, dead_time=3)
    plant, loops, _, tau_p = CASES["published"]
    case = worst(loop_of(plant, loops, Uncertainty(late), tau_p))
    assert isinstance(case.uncertainty, DiagonalPerturbation)
    for entry, actuator in zip(case.uncertainty.entries, case.uncertainty.actuators, strict=True):
        assert actuator is not None
        assert actuator.dead_time == 0
        assert np.all(actuator.poles.real < 0)
        for omega in (0.01, case.omega, 3.0):
            s = 1j * omega
            expected = 1 + DIAGONAL.weight(s) * entry.transfer(s)
            assert actuator(s) == pytest.approx(expected, rel=1e-9)


def test_actuators_of_too_high_an_order_are_left_out() -> None:
    """A weight of the highest order leaves no room for the all-pass factor."""
    num, den = np.poly([-1.0] * 20) * 0.2, np.poly([-1.0] * 20)
    plant, loops, _, tau_p = CASES["published"]
    case = worst(loop_of(plant, loops, Uncertainty(TransferFunction(num, den)), tau_p))
    assert isinstance(case.uncertainty, DiagonalPerturbation)
    assert None in case.uncertainty.actuators


@given(
    magnitude=st.floats(1e-3, 1e3),
    phase=st.floats(-np.pi, np.pi),
    decade=st.floats(-25, 25),
)
def test_all_pass_interpolates(magnitude: float, phase: float, decade: float) -> None:
    """Any value at any frequency is met by a stable system of constant magnitude."""
    omega = 10**decade
    value = cmath.rect(magnitude, phase)
    system = all_pass(value, omega)
    assert abs(system(1j * omega) - value) <= 1.1e-6 * magnitude
    assert np.all(system.poles.real < 0)
    for other in (omega / 100, omega * 10):
        assert abs(system(1j * other)) == pytest.approx(magnitude, rel=1e-9)


@pytest.mark.parametrize("value", [2.0, -2.0, 2j, -2j, -2 + 1e-9j, -2 - 1e-9j, 2 + 1e-9j])
def test_all_pass_at_the_axes(value: complex) -> None:
    """Real values give constants, imaginary ones the corner at omega."""
    system = all_pass(complex(value), 0.1)
    assert abs(system(0.1j) - value) < 1e-8
    assert len(system.den) == (1 if abs(value.imag) < 1 else 2)


def test_disagreeing_bounds_are_reported() -> None:
    """Above 5 per cent the user is told both bounds and the frequency."""
    case = worst(loop_of(*CASES["published"]))
    apart = WorstCase(0.1, 0.9, 1.0, 0.1, case.uncertainty, case.performance)
    assert apart.warning is not None
    assert "10.0 %" in apart.warning
    assert "0.1" in apart.warning
