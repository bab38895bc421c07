"""Static decoupling: the book's examples, Taylor coefficients, detuning, stability, warnings."""

from typing import Any

import numpy as np
import pytest

from solver.interaction.decoupled_loops import DecoupledLoops
from solver.interaction.decoupling import Decoupling, DecouplingSpecification, _peaks, decouple
from solver.interaction.loop_shape import RobustnessLimits
from solver.interaction.pi_design import DesignStatus
from solver.model.controllers import ParallelForm
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction

ROSENBROCK = MatrixPlant(
    [
        [TransferFunction([1], [1, 1]), TransferFunction([2], [1, 3])],
        [TransferFunction([1], [1, 1]), TransferFunction([1], [1, 1])],
    ]
)
WOOD_BERRY = MatrixPlant(
    [
        [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
        [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
    ]
)


@pytest.fixture(scope="module")
def wood_berry() -> Decoupling:
    """Wood and Berry's column with the default limits."""
    return decouple(DecouplingSpecification(WOOD_BERRY))


def test_example_11_5() -> None:
    """Astrom and Hagglund, Example 11.5: D, kappa_12 = 4/3, kappa_21 = 0, k_I2 limit 0.23."""
    result = decouple(DecouplingSpecification(ROSENBROCK, max_index=0.5))
    np.testing.assert_allclose(result.decoupler, [[3, -2], [-3, 3]])
    np.testing.assert_allclose(result.kappa, [[-7 / 3, 4 / 3], [0, -1]], atol=1e-14)
    first, second = result.loops
    assert first.gains is not None
    assert second.gains is not None
    assert first.status is DesignStatus.OPTIMAL
    assert first.gains.integral_gain == pytest.approx(0.3420, abs=5e-5)
    # The printed formula, 0.5/(kappa_12 Ms1 Ms2), gives 0.146; the printed 0.23 is without Ms2.
    assert first.sensitivity is not None
    assert 0.5 / (result.kappa[0, 1] * first.sensitivity.value) == pytest.approx(0.23, abs=5e-3)
    # The peak itself permits more than the estimate: the loops' bandwidths are unlike.
    assert second.status is DesignStatus.DETUNED
    assert second.gains.integral_gain == pytest.approx(0.326, abs=5e-3)
    assert result.closed_loop is not None
    assert result.closed_loop.stable
    assert 0.98 * 0.5 <= result.closed_loop.exact_peaks[0, 1] <= 0.5


def test_example_11_5_peak_of_h12() -> None:
    """The book reads 0.26 off its figure; its own settings give 0.371 (0.353 with H_bar)."""
    gains = (ParallelForm(0.2975, 0.3420), ParallelForm(0.23, 0.23))
    D = np.array([[3.0, -2.0], [-3.0, 3.0]])
    omega = np.geomspace(1e-3, 1e3, 20_000)
    loops = DecoupledLoops(ROSENBROCK, D, gains, (0.0, 0.0))
    assert np.max(np.abs(loops.approximate(omega)[:, 0, 1])) == pytest.approx(0.371, abs=5e-4)
    assert np.max(np.abs(loops.exact(omega)[:, 0, 1])) == pytest.approx(0.353, abs=5e-4)
    with_weights = DecoupledLoops(ROSENBROCK, D, gains, (1.0, 1.0))
    assert np.max(np.abs(with_weights.exact(omega)[:, 0, 1])) > 0.45


def test_example_11_6(wood_berry: Decoupling) -> None:
    """Wood and Berry's column: Q'(0), settings and indices beside the printed ones."""
    result = wood_berry
    exact = [[-11.3409, -12.3329], [-0.518045, -16.8953]]
    np.testing.assert_allclose(result.kappa, exact, rtol=1e-5)
    printed = [[-11.7, -12.31], [-0.5138, -17.3]]
    np.testing.assert_allclose(result.kappa, printed, rtol=0.035)
    settings = [
        (loop.gains.proportional_gain, loop.gains.integral_gain)
        for loop in result.loops
        if loop.gains is not None
    ]
    np.testing.assert_allclose(settings, [[2.348, 1.538], [0.586, 0.298]], rtol=0.007)
    assert result.closed_loop is not None
    assert result.closed_loop.stable
    indices = result.closed_loop.indices
    assert indices[0, 1] == pytest.approx(5.8, abs=0.1)
    assert indices[1, 0] == pytest.approx(1.26, abs=0.02)
    warning, fragile = result.warnings
    assert "17.1% in the inputs" in fragile
    assert "says 5.88, the true peak is 0.433" in warning


@pytest.mark.parametrize("bound", [2.0, 1.0, 0.3, 0.05])
def test_detuning_goes_by_the_exact_peaks(wood_berry: Decoupling, bound: float) -> None:
    """No peak off the diagonal exceeds the bound, and a loop is slowed down for that alone."""
    result = decouple(DecouplingSpecification(WOOD_BERRY, max_index=bound))
    assert result.closed_loop is not None
    assert result.closed_loop.stable
    others = np.where(np.eye(2, dtype=bool), 0, result.closed_loop.exact_peaks)
    assert np.max(others) <= bound
    for loop, design in enumerate(result.loops):
        assert design.gains is not None
        optimum = wood_berry.loops[loop].gains
        assert optimum is not None
        at_optimum = design.gains.integral_gain >= optimum.integral_gain * (1 - 1e-6)
        assert at_optimum or np.max(others[:, loop]) >= 0.97 * bound
    if bound == 1.0:
        # The estimate cut this to 0.05 although its peak was 0.43.
        second = result.loops[1].gains
        assert second is not None
        assert second.integral_gain > 0.25


def test_given_settings_are_analysed() -> None:
    """The book's own settings of Example 11.5: status given, peak of h12 as on the figure."""
    gains = (ParallelForm(0.2975, 0.3420), ParallelForm(0.23, 0.23))
    result = decouple(DecouplingSpecification(ROSENBROCK, gains=gains))
    assert [loop.status for loop in result.loops] == [DesignStatus.GIVEN] * 2
    assert tuple(loop.gains for loop in result.loops) == gains
    assert result.closed_loop is not None
    assert result.closed_loop.stable
    assert result.closed_loop.exact_peaks[0, 1] == pytest.approx(0.353, abs=5e-4)
    first = result.loops[0]
    assert first.sensitivity is not None
    assert max(first.sensitivity.value, 1.0) == pytest.approx(1.6, abs=2e-3)


def test_given_settings_that_are_unstable_are_said() -> None:
    """Ten times the gains of Wood and Berry's loops: unstable alone and together, and finite."""
    gains = (ParallelForm(23.0, 15.0), ParallelForm(5.9, 3.0))
    result = decouple(DecouplingSpecification(WOOD_BERRY, gains=gains))
    assert result.closed_loop is not None
    assert not result.closed_loop.stable
    assert [loop.sensitivity for loop in result.loops] == [None, None]
    assert any("Loop 1 is unstable" in warning for warning in result.warnings)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"gains": (ParallelForm(1, 1),)}, "/gains"),
        ({"gains": (ParallelForm(1, 1), ParallelForm(1, -1))}, "/gains/1/integral_gain"),
        ({"gains": (ParallelForm(1, 0), ParallelForm(1, 1))}, "/gains/0/integral_gain"),
        ({"gains": (ParallelForm(1, 1),) * 2, "max_index": 1.0}, "/max_index"),
    ],
)
def test_given_settings_are_checked(changes: dict[str, Any], field: str) -> None:
    """One PI a loop with positive integral gain, and no wish to detune them."""
    with pytest.raises(InvalidInputError) as error:
        DecouplingSpecification(WOOD_BERRY, **changes)
    assert error.value.field == field


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1e3, 1e6])
def test_units_change_nothing(wood_berry: Decoupling, unit: float) -> None:
    """Settings follow the units of time and outputs; those of inputs are in the decoupler."""

    def scaled(time: float, of_output: float, of_input: float) -> MatrixPlant:
        rows = []
        for r in range(2):
            row = []
            for c in range(2):
                element = WOOD_BERRY.element(r, c)
                factor = (of_output if r else 1) / (of_input if c else 1)
                num = [factor * value for value in element.num]
                den = [element.den[0] * time, element.den[1]]
                row.append(TransferFunction(num, den, element.dead_time * time))
            rows.append(row)
        return MatrixPlant(rows)

    for time, plant in (
        (unit, scaled(unit, 1, 1)),
        (1, scaled(1, unit, 1)),
        (1, scaled(1, 1, unit)),
    ):
        result = decouple(DecouplingSpecification(plant))
        assert result.closed_loop is not None
        for mine, theirs in zip(result.loops, wood_berry.loops, strict=True):
            assert mine.gains is not None
            assert theirs.gains is not None
            assert mine.gains.integral_gain * time == pytest.approx(
                theirs.gains.integral_gain, rel=1e-6
            )
            assert mine.gains.proportional_gain == pytest.approx(
                theirs.gains.proportional_gain, rel=1e-5
            )


@pytest.mark.parametrize("plant", [WOOD_BERRY, ROSENBROCK, first_order(3, 2, 10, -0.3, 1)])
def test_kappa_is_the_derivative_of_q(plant: MatrixPlant | ParallelPlant) -> None:
    """Taylor coefficients against a central difference of Q on the imaginary axis."""
    result = decouple(DecouplingSpecification(plant, max_index=0.5))
    h = 1e-5
    Q = plant.response([h])[0] @ result.decoupler
    np.testing.assert_allclose(Q.imag / h, result.kappa, atol=1e-7)
    np.testing.assert_allclose(Q.real, np.eye(plant.n), atol=1e-7)


def test_parallel_units_of_equal_dynamics_are_decoupled_at_all_frequencies() -> None:
    """Common dynamics: kappa is diagonal, H_bar too, and all loops are alike."""
    result = decouple(DecouplingSpecification(first_order(4, 1, 10, 0.3, 1)))
    np.testing.assert_array_equal(result.kappa, np.diag(np.diag(result.kappa)))
    assert len(set(result.loops)) == 1
    assert result.closed_loop is not None
    off = result.closed_loop.exact[:, ~np.eye(4, dtype=bool)]
    np.testing.assert_allclose(off, 0, atol=1e-14)


def test_parallel_design_is_that_of_the_same_matrix() -> None:
    """The design for all units at once equals the design of each loop of the matrix."""
    plant = ParallelPlant(3, TransferFunction([2], [10, 1], 1), TransferFunction([0.5], [4, 1], 2))
    dense = MatrixPlant([[plant.element(r, c) for c in range(3)] for r in range(3)])
    alike = decouple(DecouplingSpecification(plant)).loops
    each = decouple(DecouplingSpecification(dense)).loops
    for first, second in zip(alike, each, strict=True):
        assert first.gains is not None
        assert second.gains is not None
        assert first.gains.integral_gain == pytest.approx(second.gains.integral_gain, rel=1e-9)


def test_unbounded_loop_has_no_closed_loop() -> None:
    """Rosenbrock's second loop is first order: without an index it has no finite optimum."""
    result = decouple(DecouplingSpecification(ROSENBROCK))
    assert result.loops[1].status is DesignStatus.UNBOUNDED
    assert result.closed_loop is None
    assert "max_index" in result.warnings[0]


def test_interaction_that_stays_below_its_bound_limits_no_gain() -> None:
    """Rosenbrock's second loop disturbs the first by less than 5 however high its gain."""
    result = decouple(DecouplingSpecification(ROSENBROCK, max_index=5.0))
    assert result.loops[1].status is DesignStatus.UNBOUNDED
    assert "Nor does max_index" in result.warnings[0]


def test_large_relative_gains_are_warned_of() -> None:
    """SLH section 4.2: a = 0.949 has relative gains 10.06 and -9.06; a decoupler is dangerous."""
    result = decouple(DecouplingSpecification(first_order(2, 1, 100, 0.949, 1)))
    assert result.input_error_gain == pytest.approx((1 + 0.949**2) / (1 - 0.949**2), rel=1e-6)
    assert "dangerous" in result.warnings[0]


def test_input_error_gain_is_what_an_input_error_does(wood_berry: Decoupling) -> None:
    """P (I + Delta) P^-1 has a diagonal that changes by up to that factor times the error."""
    P = WOOD_BERRY.static_gain()
    worst = max(
        np.max(np.abs(np.diag(P @ np.diag([1 + d1, 1 + d2]) @ np.linalg.inv(P)) - 1))
        for d1 in (-0.01, 0.01)
        for d2 in (-0.01, 0.01)
    )
    assert wood_berry.input_error_gain >= worst / 0.01 - 1e-9


def _closed_loop_poles(k: float, k_I: float) -> np.ndarray:
    """Poles of Rosenbrock's decoupled system with equal loops, from a state-space model."""
    # States: 1/(s+1) u1, 1/(s+3) 2 u2, 1/(s+1) u2; outputs x1 + x2, x1 + x3.
    A = np.diag([-1.0, -3.0, -1.0])
    B = np.array([[1.0, 0.0], [0.0, 2.0], [0.0, 1.0]])
    C = np.array([[1.0, 1.0, 0.0], [1.0, 0.0, 1.0]])
    D = np.array([[3.0, -2.0], [-3.0, 3.0]])
    top = np.hstack([A - k * B @ D @ C, k_I * B @ D])
    bottom = np.hstack([-C, np.zeros((2, 2))])
    return np.linalg.eigvals(np.vstack([top, bottom]))


@pytest.mark.parametrize("k", [0.05, 0.3, 0.8, 1.2, 3.0])
@pytest.mark.parametrize("k_I", [0.001, 0.3, 0.8, 2.0])
def test_stability_is_that_of_the_poles(k: float, k_I: float) -> None:
    """The winding number of det(I + Q C) agrees with the eigenvalues."""
    loops = DecoupledLoops(
        ROSENBROCK, np.array([[3.0, -2.0], [-3.0, 3.0]]), (ParallelForm(k, k_I),) * 2, (0.0, 0.0)
    )
    stable = bool(np.all(_closed_loop_poles(k, k_I).real < 0))
    assert loops.is_stable() is stable


def test_loops_that_are_unstable_together_are_warned_of() -> None:
    """Strong dynamic interaction: each decoupled loop is sound, together they are not."""
    plant = MatrixPlant(
        [
            [TransferFunction([1], [10, 1], 0.5), TransferFunction([0.9], [1, 1], 0.5)],
            [TransferFunction([0.9], [1, 1], 0.5), TransferFunction([1], [10, 1], 0.5)],
        ]
    )
    result = decouple(DecouplingSpecification(plant, RobustnessLimits(3.0, 3.0)))
    assert result.closed_loop is not None
    assert not result.closed_loop.stable
    assert any("unstable together" in warning for warning in result.warnings)


def test_given_frequencies_and_weights_are_used() -> None:
    """Curves at the caller's frequencies; b multiplies the proportional part of H_bar."""
    omega = np.array([0.01, 0.1])
    result = decouple(
        DecouplingSpecification(WOOD_BERRY, set_point_weights=(1.0, 0.5), omega=omega)
    )
    assert result.closed_loop is not None
    np.testing.assert_array_equal(result.closed_loop.omega, omega)
    assert result.closed_loop.exact.shape == (2, 2, 2)
    assert result.set_point_weights == (1.0, 0.5)


LAG = TransferFunction([1], [1, 1])


@pytest.mark.parametrize(
    ("plant", "error", "field"),
    [
        (MatrixPlant([[LAG, LAG], [LAG, LAG]]), InvalidInputError, "/plant"),
        (first_order(2, 1, 10, 1), InvalidInputError, "/plant"),
        (MatrixPlant([[TransferFunction([1], [1, 0])]]), UnsupportedPlantError, "/plant"),
        (MatrixPlant([[TransferFunction([1], [1, -1])]]), UnsupportedPlantError, "/plant"),
        (first_order(11, 1, 10, 0.1), InvalidInputError, "/plant/n"),
    ],
)
def test_plants_that_cannot_be_decoupled(
    plant: MatrixPlant | ParallelPlant, error: type[InvalidInputError], field: str
) -> None:
    """Singular, integrating, unstable and very large plants are refused by field."""
    with pytest.raises(error) as caught:
        DecouplingSpecification(plant)
    assert caught.value.field == field


def test_bad_options_are_refused() -> None:
    """Index and set-point weights out of range name their fields."""
    with pytest.raises(InvalidInputError) as index:
        DecouplingSpecification(WOOD_BERRY, max_index=0.0)
    assert index.value.field == "/max_index"
    with pytest.raises(InvalidInputError) as count:
        DecouplingSpecification(WOOD_BERRY, set_point_weights=(0.0,))
    assert count.value.field == "/set_point_weights"
    with pytest.raises(InvalidInputError) as weight:
        DecouplingSpecification(WOOD_BERRY, set_point_weights=(0.0, 1.5))
    assert weight.value.field == "/set_point_weights/1"


def _with_own(plant: MatrixPlant, *gains: float) -> Decoupling:
    own = tuple(ParallelForm(gain, gain / 10) for gain in gains)
    return decouple(DecouplingSpecification(plant, gains=own))


def test_loops_far_faster_than_the_plant_are_judged_where_they_end() -> None:
    """Lags without dead time stay stable with gains of 1e6; a dead time of 1e-3 forbids 1e5."""

    def lags(dead_time: float) -> MatrixPlant:
        parts = [[(1.0, 10.0), (0.3, 20.0)], [(0.2, 5.0), (1.0, 10.0)]]
        return MatrixPlant(
            [[TransferFunction([k], [T, 1], dead_time) for k, T in row] for row in parts]
        )

    for dead_time, gain, stable in ((0.0, 1e6, True), (1e-3, 1e3, True), (1e-3, 1e5, False)):
        closed_loop = _with_own(lags(dead_time), gain, gain).closed_loop
        assert closed_loop is not None
        assert closed_loop.stable is stable


@pytest.mark.parametrize("damping", [1e-2, 1e-4, 1e-6])
def test_a_resonance_is_judged_however_narrow(damping: float) -> None:
    """PI on 1/(s^2 + 2 z s + 1): by Routh, stable for 2 z (1 + k) > k_I."""
    resonant = TransferFunction([1], [1, 2 * damping, 1])
    none = TransferFunction([0], [1])
    plant = MatrixPlant([[resonant, none], [none, TransferFunction([1], [10, 1])]])
    for gain in (0.1, 20 * damping, 21 * damping):
        gains = (ParallelForm(gain, gain / 10), ParallelForm(1.0, 0.1))
        loops = DecoupledLoops(plant, np.eye(2), gains, (0.0, 0.0))
        assert loops.is_stable() is (2 * damping * (1 + gain) > gain / 10)


def test_loops_unstable_by_themselves_are_told_so_and_have_no_peaks() -> None:
    """No interaction is blamed, and no number stands for what does not exist."""
    result = _with_own(WOOD_BERRY, 1.0, 100.0)
    assert result.closed_loop is not None
    assert not result.closed_loop.stable
    assert np.isinf(result.closed_loop.exact_peaks).all()
    assert any("Loop 2 is unstable with its settings, even alone" in w for w in result.warnings)
    assert not any("interaction left" in warning for warning in result.warnings)


def test_interaction_that_is_not_there_has_no_peak() -> None:
    """Identical lags are decoupled at all frequencies: zero, not 1e-16."""
    result = decouple(DecouplingSpecification(first_order(3, 1, 1, 0.6, 1)))
    assert result.closed_loop is not None
    peaks = result.closed_loop.exact_peaks
    assert np.all(peaks[~np.eye(3, dtype=bool)] == 0)


COLUMN = MatrixPlant(
    [
        [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
        [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
    ]
)


def test_a_dynamic_decoupler_leaves_no_interaction() -> None:
    """Q is diagonal at every frequency, its static gain 1, and the loops are those of their own."""
    found = decouple(DecouplingSpecification(COLUMN, dynamic=True))
    closed = found.closed_loop
    assert closed is not None
    assert closed.stable
    off = closed.process[:, [0, 1], [1, 0]]
    assert np.abs(off).max() < 1e-12 * np.abs(closed.process).max()
    np.testing.assert_allclose(closed.process[0].real, np.eye(2), atol=1e-3)
    np.testing.assert_allclose(closed.exact, closed.approximate, atol=1e-9)
    assert found.elements is not None
    assert [element.dead_time for element in found.elements] == [2, 4]


@pytest.mark.parametrize(
    ("first", "reason"),
    [
        (TransferFunction([1], [1, 1], 9), "prediction"),
        (TransferFunction([1], [1, 2, 1]), "derivatives"),
        (TransferFunction([-1, 1], [1, 2]), "right half plane"),
    ],
)
def test_a_dynamic_decoupler_that_cannot_be_built_is_refused(
    first: TransferFunction, reason: str
) -> None:
    """The reason is said, and that the static one remains."""
    cross, own = TransferFunction([0.5], [2, 1]), TransferFunction([1], [1, 1])
    plant = MatrixPlant([[first, cross], [cross, own]])
    with pytest.raises((InvalidInputError, UnsupportedPlantError), match=reason):
        decouple(DecouplingSpecification(plant, dynamic=True))


def test_slower_loops_are_those_of_example_11_6() -> None:
    """Integral gains over 4, proportional gains over 2, eq. (7.27)."""
    fast = decouple(DecouplingSpecification(COLUMN))
    slow = decouple(DecouplingSpecification(COLUMN, slower=4.0))
    for before, after in zip(fast.loops, slow.loops, strict=True):
        assert before.gains is not None
        assert after.gains is not None
        assert after.gains.integral_gain == before.gains.integral_gain / 4
        assert after.gains.proportional_gain == before.gains.proportional_gain / 2
    printed = [(1.174, 0.384), (0.293, 0.0745)]
    for design, (k, k_i) in zip(slow.loops, printed, strict=True):
        assert design.gains is not None
        assert design.gains.proportional_gain == pytest.approx(k, rel=1e-2)
        assert design.gains.integral_gain == pytest.approx(k_i, rel=1e-2)


def test_the_tolerated_input_error_is_where_the_loops_become_unstable() -> None:
    """Gains of the inputs off by a little less are stable, off by any signs; some phase is not."""
    found = decouple(DecouplingSpecification(COLUMN)).closed_loop
    assert found is not None
    tolerated = found.tolerated_input_error
    assert tolerated is not None
    D = np.linalg.inv(COLUMN.static_gain())
    design = decouple(DecouplingSpecification(COLUMN)).loops
    c = np.array([[d.gains.proportional_gain, d.gains.integral_gain] for d in design if d.gains])
    omega = np.geomspace(1e-2, 5, 3000)
    C = c[:, 0] - 1j * c[:, 1] / omega[:, None]
    K = D * C[:, None, :]
    P = COLUMN.response(omega)
    T = K @ np.linalg.solve(np.eye(2) + P @ K, P)
    # No diagonal perturbation of that size makes I + T Delta singular, one a little larger does.
    angles = np.exp(1j * np.linspace(0, 2 * np.pi, 181))
    least = np.inf
    for turn in angles:
        Delta = np.array([turn, 1.0])
        # For fixed relative phase the spectral radius of T Delta is what matters.
        least = min(least, 1 / np.abs(np.linalg.eigvals(T * Delta)).max())
    assert least == pytest.approx(tolerated, rel=2e-3)


@pytest.mark.parametrize("unit", [1e-12, 1e-6, 1e6])
def test_gains_in_any_unit_are_decoupled_alike(unit: float) -> None:
    """The decoupler takes the plant's gains away: the same loops, whatever the plant's units."""
    rows = [
        [TransferFunction([unit * e.num[0]], e.den, e.dead_time) for e in row]
        for row in WOOD_BERRY.rows
    ]
    own = (ParallelForm(1.0, 0.3), ParallelForm(0.5, 0.2))
    found = decouple(DecouplingSpecification(MatrixPlant(rows), gains=own)).closed_loop
    usual = decouple(DecouplingSpecification(WOOD_BERRY, gains=own)).closed_loop
    assert found is not None
    assert usual is not None
    assert found.stable
    np.testing.assert_allclose(found.exact_peaks, usual.exact_peaks, rtol=1e-6)


def test_derivative_action_makes_decoupled_loops_faster() -> None:
    """Behind the same decoupler and limits: more integral gain, and the peaks are kept."""
    pi = decouple(DecouplingSpecification(COLUMN, dynamic=True))
    pid = decouple(DecouplingSpecification(COLUMN, dynamic=True, derivative_times=(1.0, 1.5)))
    assert pid.closed_loop is not None
    assert pid.closed_loop.stable
    for before, after in zip(pi.loops, pid.loops, strict=True):
        assert before.gains is not None
        assert after.gains is not None
        assert after.gains.integral_gain > 1.1 * before.gains.integral_gain
    # The loop's own response is that of a PID controller in cascade form.
    omega = pid.closed_loop.omega
    q = pid.closed_loop.process[:, 0, 0]
    k, k_i = pid.loops[0].gains.proportional_gain, pid.loops[0].gains.integral_gain  # type: ignore[union-attr]
    c = (k - 1j * k_i / omega) * (1 + 1j * omega) / (1 + 0.1j * omega)
    c_bar = (-1j * k_i / omega) * (1 + 1j * omega) / (1 + 0.1j * omega)
    np.testing.assert_allclose(pid.closed_loop.exact[:, 0, 0], q * c_bar / (1 + q * c), rtol=1e-9)
    sensitivity = np.abs(1 / (1 + q * c))
    assert sensitivity.max() <= 1.6 * (1 + 1e-6)


def test_derivative_action_behind_a_static_decoupler_is_analysed_exactly() -> None:
    """The loops together are stable as encirclements with the lead say."""
    found = decouple(DecouplingSpecification(COLUMN, derivative_times=(0.5, 2.0), max_index=1.0))
    assert found.closed_loop is not None
    assert found.closed_loop.stable
    off = found.closed_loop.exact_peaks[[0, 1], [1, 0]]
    assert off.max() <= 1.0


def test_peaks_of_lightly_damped_plants_are_those_between_the_samples() -> None:
    """Not below what 100,000 points see: a parabola through three samples lost 3 per cent."""

    def light(gain: float, damping: float, omega: float) -> TransferFunction:
        return TransferFunction([gain], [omega**-2, 2 * damping / omega, 1])

    lag = TransferFunction([0.3], [2, 1])
    plant = MatrixPlant([[light(1, 0.003, 1), lag], [LAG, light(2, 0.01, 3)]])
    found = decouple(DecouplingSpecification(plant))
    assert found.closed_loop is not None
    gains = [loop.gains for loop in found.loops if loop.gains is not None]
    k = np.array([each.proportional_gain for each in gains])
    k_I = np.array([each.integral_gain for each in gains])
    omega = np.geomspace(0.3, 10, 100_000)
    Q, rates = plant.response(omega) @ found.decoupler, k_I / (1j * omega[:, None])
    loops, moved = k + rates, np.array(found.set_point_weights) * k + rates
    H = np.linalg.solve(np.eye(2) + Q * loops[:, None, :], Q * moved[:, None, :])
    seen = np.abs(H).max(axis=0)
    assert (found.closed_loop.exact_peaks >= seen * (1 - 1e-9)).all()
    assert found.closed_loop.exact_peaks[0, 1] == pytest.approx(seen[0, 1], rel=1e-4)


def test_peaks_of_many_elements_take_the_memory_of_one() -> None:
    """They are refined side by side, each at frequencies of its own."""
    asked = []

    def response(omega: np.ndarray) -> np.ndarray:
        asked.append(omega.size)
        place = np.arange(1.0, 37.0).reshape(6, 6)
        return 1 / (1 + (np.log(omega)[:, None, None] - place / 10) ** 2) + 0j

    np.testing.assert_allclose(_peaks(response, np.geomspace(1e-2, 1e2, 60)), 1, rtol=1e-6)
    assert max(asked) == 60
