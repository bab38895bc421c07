"""Parallel drives (Astrom and Hagglund, section 11.4): free integrators, remedy, simulation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from solver.interaction.drive_simulation import DriveExperiment, DriveScenario, simulate_drives
from solver.interaction.parallel_drives import (
    Drive,
    ParallelDrives,
    analyse_drives,
    mended_model,
    original_model,
)
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.transfer_function import TransferFunction

J, DAMPING = 1.0, 0.1
SHAFT = TransferFunction([1], [J, DAMPING])
PI = Drive(1.0, 0.5)
TWO_MOTORS = ParallelDrives(SHAFT, [PI, PI])


def test_two_motors_have_one_free_mode() -> None:
    """Two PI motors: one integrator mode is neither controllable nor observable."""
    analysis = analyse_drives(TWO_MOTORS)
    assert (analysis.uncontrollable_modes, analysis.unobservable_modes) == (1, 1)
    np.testing.assert_allclose(np.abs(analysis.effort_drifts), [[np.sqrt(0.5)] * 2])
    assert np.sum(analysis.effort_drifts) == pytest.approx(0, abs=1e-12)
    assert analysis.stable
    assert "Units 1 and 2" in analysis.text
    assert analysis.remedy is not None
    assert analysis.remedy.hidden_modes == 0
    assert analysis.remedy.shares == (0.5, 0.5)
    # The remedy keeps all other poles: J s^2 + (D + K1 + K2) s + KI1 + KI2.
    expected = np.sort_complex(np.roots([J, DAMPING + 2, 1.0]))
    np.testing.assert_allclose(np.sort_complex(analysis.remedy.poles), expected, atol=1e-12)


@pytest.mark.parametrize("count", [2, 3, 7])
def test_n_integrators_leave_n_minus_one_free(count: int) -> None:
    """Different gains change nothing: all differences but none of the sum are free."""
    drives = [Drive(0.3 * i, 0.1 * i * i) for i in range(1, count + 1)]
    analysis = analyse_drives(ParallelDrives(SHAFT, [*drives, Drive(2.0)]))
    assert analysis.unobservable_modes == count - 1
    assert analysis.uncontrollable_modes == count - 1
    assert analysis.effort_drifts.shape == (count - 1, count + 1)
    np.testing.assert_allclose(analysis.effort_drifts.sum(axis=1), 0, atol=1e-9)
    np.testing.assert_allclose(analysis.effort_drifts[:, -1], 0, atol=1e-9)
    assert analysis.remedy is not None
    assert analysis.remedy.hidden_modes == 0


@pytest.mark.parametrize("units", [1e-6, 1.0, 1e6])
def test_the_rank_does_not_depend_on_units(units: float) -> None:
    """A stiff shaft in awkward units has the same free mode."""
    shaft = TransferFunction([1], [units, 0.1 * units])
    analysis = analyse_drives(ParallelDrives(shaft, [Drive(units, 0.5 * units)] * 2))
    assert (analysis.uncontrollable_modes, analysis.unobservable_modes) == (1, 1)


def test_one_integrator_is_sound() -> None:
    """The book's alternative: one PI motor beside a proportional one."""
    analysis = analyse_drives(ParallelDrives(SHAFT, [PI, Drive(1.0)]))
    assert (analysis.uncontrollable_modes, analysis.unobservable_modes) == (0, 0)
    assert analysis.effort_drifts.shape == (0, 2)
    assert "alone" in analysis.text


def test_proportional_control_shares_the_load_as_the_gains() -> None:
    """Eqs. 11.11 and 11.12: time constant J/(D + K1 + K2), offset, M1/M2 = K1/K2."""
    K1, K2 = 3.0, 1.0
    system = ParallelDrives(SHAFT, [Drive(K1), Drive(K2)])
    analysis = analyse_drives(system)
    assert analysis.remedy is None
    np.testing.assert_allclose(analysis.poles, [-(DAMPING + K1 + K2) / J])
    simulation = simulate_drives(DriveExperiment(system))
    assert simulation.mended is None
    response = simulation.original
    total = DAMPING + K1 + K2
    before = response.time < 10
    expected = (K1 + K2) / total * (1 - np.exp(-total / J * response.time[before]))
    np.testing.assert_allclose(response.output[before], expected, atol=1e-12)
    assert response.output[-1] == pytest.approx((K1 + K2 - 1) / total)
    np.testing.assert_allclose(response.shares_at_end, [0.75, 0.25])


def test_two_motor_drift_and_its_cure() -> None:
    """Figures 11.10 and 11.13: a pulse of area 3 leaves M1 - M2 = K_I 3; cured, M1 = M2."""
    scenario = DriveScenario(pulse=3.0, pulse_duration=1.0, end=80.0)
    simulation = simulate_drives(DriveExperiment(TWO_MOTORS, scenario))
    before, after = simulation.original, simulation.mended
    assert after is not None
    np.testing.assert_allclose(before.shares_before_pulse, [0.5, 0.5], atol=1e-6)
    total = 1 + DAMPING  # load torque and damping at the set point
    drift = PI.integral_gain * 3.0
    np.testing.assert_allclose(
        before.efforts[-1], [(total + drift) / 2, (total - drift) / 2], atol=1e-6
    )
    assert before.efforts[-1, 1] < 0  # the second motor brakes
    np.testing.assert_allclose(after.efforts[-1], [total / 2, total / 2], atol=1e-6)
    assert before.output[-1] == pytest.approx(1, abs=1e-6)
    assert after.output[-1] == pytest.approx(1, abs=1e-6)
    # The common output answers set point and load as before.
    early = before.time < 20
    np.testing.assert_allclose(after.output[early], before.output[early], atol=1e-9)


def test_chosen_shares_are_kept() -> None:
    """After all disturbances each unit carries the share asked for."""
    shares = (0.2, 0.5, 0.3)
    system = ParallelDrives(SHAFT, [PI, Drive(0.5, 0.2), Drive(0.0, 1.0)], shares)
    simulation = simulate_drives(DriveExperiment(system, DriveScenario(end=100.0)))
    assert simulation.mended is not None
    np.testing.assert_allclose(simulation.mended.shares_at_end, shares, atol=1e-8)
    assert np.max(np.abs(simulation.original.shares_at_end - shares)) > 0.05


def test_default_shares_follow_the_gains() -> None:
    """Proportional gains, or integral gains where no unit has a proportional one."""
    assert ParallelDrives(SHAFT, [Drive(3, 1), Drive(1, 1)]).shares == (0.75, 0.25)
    assert ParallelDrives(SHAFT, [Drive(0, 3), Drive(0, 1)]).shares == (0.75, 0.25)


def test_response_agrees_with_numerical_integration() -> None:
    """A second-order load, three units, every event: solve_ivp at 1e-10 agrees."""
    load = TransferFunction([1, 2], [1, 0.8, 2])
    system = ParallelDrives(load, [PI, Drive(0.4, 0.3), Drive(0.2)], (0.5, 0.25, 0.25))
    scenario = DriveScenario(
        set_point=1.0,
        load=0.5,
        load_time=5.0,
        pulse=0.7,
        pulse_unit=0,
        pulse_time=9.0,
        pulse_duration=2.0,
        end=15.0,
        points=61,
    )
    for model, response in (
        (original_model(system), simulate_drives(DriveExperiment(system, scenario)).original),
        (mended_model(system), simulate_drives(DriveExperiment(system, scenario)).mended),
    ):
        assert response is not None
        x, start = np.zeros(len(model.A)), 0.0
        for end, v in (
            (5.0, [1, 0, 0, 0, 0]),
            (9.0, [1, 0.5, 0, 0, 0]),
            (11.0, [1, 0.5, 0.7, 0, 0]),
            (15.0, [1, 0.5, 0, 0, 0]),
        ):
            forced = model.B @ np.array(v)
            solution = solve_ivp(
                lambda _, z, A=model.A, f=forced: A @ z + f,
                (start, end),
                x,
                rtol=1e-10,
                atol=1e-12,
            )
            x, start = solution.y[:, -1], end
            index = int(np.flatnonzero(np.isclose(response.time, end))[0])
            expected = model.C @ x + model.D @ np.array(v)
            np.testing.assert_allclose(response.output[index], expected[0], atol=1e-8)
            np.testing.assert_allclose(response.efforts[index], expected[1:], atol=1e-8)


def test_unstable_loop_is_cut_off() -> None:
    """A response without bound ends with a flag, not with infinities."""
    load = TransferFunction([1], [1, 3, 3, 1])
    system = ParallelDrives(load, [Drive(100, 1), Drive(100, 1)])
    assert not analyse_drives(system).stable
    response = simulate_drives(DriveExperiment(system, DriveScenario(end=100.0))).original
    assert not response.bounded
    assert np.all(np.isfinite(response.output))
    assert np.all(np.isnan(response.shares_at_end))


def test_explosive_loop_is_cut_off() -> None:
    """A loop that overflows within one step is cut off too."""
    load = TransferFunction([4.41, 0.001], [-0.001, 2.99, -0.001])
    system = ParallelDrives(load, [Drive(1e12, 1e3), Drive(9.0)])
    response = simulate_drives(DriveExperiment(system)).original
    assert not response.bounded
    assert np.all(np.isfinite(response.efforts))


def test_single_unit() -> None:
    """One unit: nothing to share; the pulse goes to it."""
    system = ParallelDrives(SHAFT, [PI])
    assert analyse_drives(system).unobservable_modes == 0
    assert simulate_drives(DriveExperiment(system)).original.bounded


@pytest.mark.parametrize(
    ("build", "field"),
    [
        (lambda: Drive(-1.0), "/proportional_gain"),
        (lambda: Drive(1.0, float("nan")), "/integral_gain"),
        (lambda: ParallelDrives(TransferFunction([1], [1]), [PI]), "/load/num"),
        (lambda: ParallelDrives(TransferFunction([0], [1, 1]), [PI]), "/load/num"),
        (lambda: ParallelDrives(SHAFT, []), "/drives"),
        (lambda: ParallelDrives(SHAFT, [PI] * 101), "/drives"),
        (lambda: ParallelDrives(SHAFT, [Drive(0.0)]), "/drives"),
        (lambda: ParallelDrives(SHAFT, [PI], [0.5, 0.5]), "/shares"),
        (lambda: ParallelDrives(SHAFT, [PI, PI], [0.5, 0.6]), "/shares"),
        (lambda: ParallelDrives(SHAFT, [PI, PI], [1.5, -0.5]), "/shares/0"),
        (lambda: DriveScenario(load=float("inf")), "/load"),
        (lambda: DriveScenario(load_time=30.0), "/pulse_time"),
        (lambda: DriveScenario(pulse_duration=0.0), "/pulse_duration"),
        (lambda: DriveScenario(end=20.5), "/end"),
        (lambda: DriveScenario(points=5), "/points"),
        (
            lambda: simulate_drives(DriveExperiment(TWO_MOTORS, DriveScenario(pulse_unit=2))),
            "/scenario/pulse_unit",
        ),
    ],
)
def test_bad_input_names_its_field(build: object, field: str) -> None:
    """Every rule says which value breaks it."""
    assert callable(build)
    with pytest.raises(InvalidInputError) as caught:
        build()
    assert caught.value.field == field


def test_dead_time_is_refused() -> None:
    """The state-space test needs a rational load."""
    with pytest.raises(UnsupportedPlantError) as caught:
        ParallelDrives(TransferFunction([1], [1, 1], 0.5), [PI])
    assert caught.value.field == "/load/dead_time"


def test_biases_act_as_the_opposite_of_a_load() -> None:
    """Eq. 11.12: w = (G K w_sp + G (M_10 + M_20 - M_L))/(1 + G K)."""
    system = ParallelDrives(
        TransferFunction([1], [2, 0.5]), [Drive(1.0, bias=0.2), Drive(3.0, bias=0.1)]
    )
    steady = analyse_drives(system).steady
    assert steady is not None
    assert (steady.set_point, steady.load, steady.bias) == pytest.approx((8 / 9, -2 / 9, 0.6 / 9))
    assert steady.effort_ratios == pytest.approx((1, 3))
    response = simulate_drives(DriveExperiment(system)).original
    before = np.searchsorted(response.time, 10.0) - 1
    assert response.output[before] == pytest.approx(8 / 9 + 0.6 / 9, abs=1e-6)
    assert response.output[-1] == pytest.approx(8 / 9 + 0.6 / 9 - 2 / 9, abs=1e-6)
    beyond = response.efforts[-1] - [0.2, 0.1]
    assert beyond[1] / beyond[0] == pytest.approx(3)
    assert response.load[0] == 0


def test_all_integral_action_in_one_unit_is_the_other_remedy() -> None:
    """Nothing drifts, the common output is the same, and that unit takes up the steady load."""
    system = ParallelDrives(TransferFunction([1], [1, 0.1]), [Drive(1.0, 0.5), Drive(1.0, 0.3)])
    analysis = analyse_drives(system)
    assert analysis.alternative is not None
    assert [drive.integral_gain for drive in analysis.alternative.drives] == [0.8, 0.0]
    assert analyse_drives(analysis.alternative).uncontrollable_modes == 0
    found = simulate_drives(DriveExperiment(system, DriveScenario(pulse=0.0, end=200.0)))
    assert found.alternative is not None
    np.testing.assert_allclose(found.alternative.output, found.original.output, atol=1e-9)
    assert found.alternative.shares_at_end == pytest.approx([1, 0], abs=1e-6)


@pytest.mark.parametrize(("time", "effort"), [(1e4, 1.0), (1e-5, 1.0), (1.0, 1e6), (1e4, 1e-6)])
def test_units_of_time_and_effort_change_nothing(time: float, effort: float) -> None:
    """The same free modes, drifts, shares and outputs of a load of third order."""

    def found(time: float, effort: float):
        lags = [1.4e-3 * time**3, 0.07 * time**2, time, 0.1]
        load = TransferFunction([1 / effort], lags)
        drives = [Drive(p * effort, i * effort / time) for p, i in ((1, 0.5), (2, 0), (0.5, 0.2))]
        system = ParallelDrives(load, drives)
        scenario = DriveScenario(
            load=0.5 * effort, load_time=10 * time, pulse_time=20 * time, pulse_duration=time,
            end=40 * time, points=50,
        )  # fmt: skip
        return analyse_drives(system), simulate_drives(DriveExperiment(system, scenario)).original

    (usual, response), (other, scaled) = found(1.0, 1.0), found(time, effort)
    assert other.uncontrollable_modes == usual.uncontrollable_modes == 1
    assert other.unobservable_modes == usual.unobservable_modes == 1
    np.testing.assert_allclose(other.effort_drifts, usual.effort_drifts, atol=1e-7)
    np.testing.assert_allclose(scaled.output, response.output, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(scaled.shares_at_end, response.shares_at_end, rtol=1e-7)
