"""The limit: known answers, invariances, and controllers that are checked by other means."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import control
import numpy as np
import pytest
from ctrlsys import ab13md

from solver.limits import search
from solver.limits.basis import Basis
from solver.limits.building import Building
from solver.limits.ending import EnoughError
from solver.limits.lower_bound import Limitation, lower_bound, unlimited
from solver.limits.multivariable import multivariable_limit
from solver.limits.natural_units import NaturalUnits, in_natural_units
from solver.limits.realisation import reducible
from solver.limits.record import Limit, LimitStatus, Realised
from solver.limits.search import Found, LimitSearch
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.mode_controller import ModeController
from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
from solver.model.state_space import MAX_STATES, StateSpace
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure
from solver.robustness.analysis import analyse
from solver.robustness.centralised import analyse_centralised
from solver.robustness.record import GuaranteeStatus

UNCERTAINTY = Uncertainty.from_error(0.2, 1.0)
COLUMN = MatrixPlant(
    [
        [TransferFunction([0.878], [75, 1]), TransferFunction([-0.864], [75, 1])],
        [TransferFunction([-1.082], [75, 1]), TransferFunction([1.096], [75, 1])],
    ]
)
RIGHT = ParallelPlant(1, TransferFunction([-3, 1], [100, 1]), TransferFunction([0], [1]))
SEED = first_order(2, 1.0, 100.0, 0.949)
INTEGRATING = ParallelPlant(
    2, TransferFunction([1], [100, 1, 0]), TransferFunction([0.5], [100, 1, 0])
)


@functools.cache
def coarse(
    plant: Plant,
    performance: Performance = Performance(),  # noqa: B008 - frozen
    uncertainty: Uncertainty = UNCERTAINTY,
) -> Found:
    """Return what the first of the bases reaches: a tenth of the work, a few per cent above."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("POLES_PER_DECADE", "MATRIX_POLES"):
            patch.setattr(search, name, getattr(search, name)[:1])
        found = LimitSearch(plant, uncertainty, performance).run()
    assert found is not None
    return found


@functools.cache
def limit(plant: Plant, performance: Performance = Performance()) -> Limit:  # noqa: B008 - frozen
    """The limit under the uncertainty of the literature."""
    return multivariable_limit(plant, UNCERTAINTY, performance)


def test_published_plant_can_be_held_in_a_quarter_of_the_time() -> None:
    """SLH's parallel plant: single PI loops reach 18.4, the limit is below 5.4, and one is built.

    A D-K iteration in a narrower basis stalls at 5.5.
    """
    found = limit(SEED)
    assert found.status is LimitStatus.FOUND
    assert found.value is not None
    assert found.value < 4.6
    assert found.realised is not None
    assert found.value <= found.realised.tau_p < 5.4
    peaks = found.realised.robustness.peaks
    assert peaks is not None
    assert 0.99 < peaks.robust_performance.value <= 1
    assert found.lower_bound.value < found.value


def test_controller_of_many_states_near_the_limit_is_proven() -> None:
    """Its mu is bounded over all frequencies."""
    realised = limit(SEED).realised
    assert realised is not None
    guarantee = realised.robustness.guarantee
    assert guarantee is not None
    assert guarantee.status is GuaranteeStatus.PROVEN
    assert guarantee.level < 1 + 2e-4


@pytest.mark.parametrize(
    ("plant", "performance", "own"),
    [
        # Convex steps by cvxpy and Clarabel in a basis of triple poles up to 200 rad, peaks at
        # 4000 frequencies: 0.76666, 2.7155.
        (first_order(1, 1.0, 100.0, 0.0), Performance(), 0.76666),
        (first_order(2, 1.0, 10.0, 0.9), Performance(offset=0.1), 2.7155),
    ],
)
def test_value_is_that_of_other_bases(plant: Plant, performance: Performance, own: float) -> None:
    """What another basis and another solver reach is not passed over by more than two per cent."""
    found = LimitSearch(plant, UNCERTAINTY, performance).run()
    assert found is not None
    assert 0.98 * own < found.tau_p < 1.02 * own


def test_a_basis_that_holds_no_controller_does_not_end_the_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nearly singular plants have none in the first basis, but in the next (a = -0.49999)."""
    task, asked = LimitSearch(SEED, UNCERTAINTY, Performance()), []

    def with_basis(basis: Basis, before: Found | None) -> Found | None:
        asked.append((basis.size, before))
        return None if len(asked) == 1 else coarse(SEED)

    monkeypatch.setattr(task, "_with_basis", with_basis)
    assert task.run() is coarse(SEED)
    assert [before for _, before in asked] == [None, None, coarse(SEED)]
    assert asked[0][0] < asked[1][0]


def test_mu_is_below_that_of_alternating_steps() -> None:
    """mu at tau_P = 4 lies below the 1.072 of D-K iteration in a small basis."""
    performance = Performance(tau_p=4.0)
    found = coarse(SEED, performance)
    assert found.tau_p == 4.0
    assert lower_bound(SEED, UNCERTAINTY, performance).value < found.mu < 1.072


def test_without_interaction_all_plants_have_the_limit_of_one_loop() -> None:
    """a = 0 gives the single loop's limit for any number of units, alike or written as a matrix."""
    one, many = (coarse(first_order(n, 1.0, 100.0, 0.0)).tau_p for n in (1, 1000))
    lag, none = TransferFunction([1], [100, 1]), TransferFunction([0], [1])
    assert many == pytest.approx(one, rel=1e-3)
    assert coarse(MatrixPlant([[lag, none], [none, lag]])).tau_p == pytest.approx(one, rel=1e-2)


def test_a_plant_has_one_limit_however_it_is_written() -> None:
    """Two modes with one scale, and a matrix with a scale for each unit."""
    performance = Performance(tau_p=3.0)
    plant = first_order(2, 1.0, 10.0, 0.5)
    matrix = MatrixPlant(plant.rows)
    found = coarse(matrix, performance).mu
    assert found == pytest.approx(coarse(plant, performance).mu, rel=1e-2)


def test_the_limit_scales_with_the_unit_of_time_and_of_the_signals() -> None:
    """The same plant in seconds, its outputs in per mille; a matrix in units of 1e-6 and 1e6."""
    found = coarse(first_order(2, 1.0, 10.0, 0.5, 1.0)).tau_p
    in_seconds = Uncertainty.from_error(0.2, 60.0)
    scaled = coarse(first_order(2, 1000.0, 600.0, 0.5, 60.0), Performance(), in_seconds)
    assert scaled.tau_p == pytest.approx(60 * found, rel=1e-2)  # another path to the same basis
    demand = Performance(tau_p=10.0)
    for factor in (1e-6, 1e6):
        rows = [[TransferFunction([factor * e.num[0]], e.den) for e in row] for row in COLUMN.rows]
        assert coarse(MatrixPlant(rows), demand).mu == pytest.approx(
            coarse(COLUMN, demand).mu, rel=1e-3
        )


def _level(time: float, inputs: tuple[float, float], outputs: float) -> MatrixPlant:
    """One input integrates, with a dead time towards the second output; in any units."""
    rows = (([1], [1, 0], 0), ([0.5], [3, 1], 0)), (([0.3], [1, 0], 1), ([-2], [4, 1], 0))
    return MatrixPlant(
        [
            [
                TransferFunction([num[0] * unit * outputs], [den[0] * time, den[1]], delay * time)
                for (num, den, delay), unit in zip(row, inputs, strict=True)
            ]
            for row in rows
        ]
    )


UNITS = [(1e-3, (1, 1), 1), (60, (1e-6, 1e6), 1), (1e4, (1e6, 1e-6), 1e3)]


@pytest.mark.parametrize(("time", "inputs", "outputs"), UNITS)
def test_a_plant_in_any_units_is_one_in_natural_units(
    time: float, inputs: tuple[float, float], outputs: float
) -> None:
    """What is searched is the same to rounding, so the answer is; its controller comes back."""
    demand = Performance(tau_p=2.0)
    here = in_natural_units(_level(1, (1, 1), 1), UNCERTAINTY, demand)
    given = Uncertainty.from_error(0.2, time)
    there = in_natural_units(_level(time, inputs, outputs), given, Performance(tau_p=2 * time))
    assert there.time == pytest.approx(time * here.time, rel=1e-12)
    assert there.performance.tau_p == pytest.approx(here.performance.tau_p, rel=1e-12)
    omega = np.geomspace(1e-3, 1e3, 20)
    assert there.plant.response(omega) == pytest.approx(here.plant.response(omega), rel=1e-9)
    assert there.uncertainty.magnitude(omega) == pytest.approx(
        here.uncertainty.magnitude(omega), rel=1e-9
    )
    controller = StateSpace([[-0.3, 0.1], [0, 0]], np.eye(2), [[1, 2], [0.5, -1]], np.eye(2))
    back = there.given_back(controller)
    loop = _level(time, inputs, outputs).response(omega / there.time) @ back.response(
        omega / there.time
    )
    assert loop == pytest.approx(here.plant.response(omega) @ controller.response(omega), rel=1e-9)


def test_reduction_keeps_the_digits_that_scales_of_the_states_take() -> None:
    """A controller in all of its states is Q (I - G Q)^-1 where one input integrates."""
    units = in_natural_units(_level(1, (1, 1), 1), UNCERTAINTY, Performance())
    task = LimitSearch(units.plant, units.uncertainty, units.performance)
    basis = task._built_basis(search.BUILT_MATRIX_POLES[0])  # noqa: SLF001 - one stage of the search
    rng = np.random.default_rng(0)
    X = [0.03 * rng.normal(size=(basis.size, 2, 2))]
    found = Found(X, basis, 0.9, 0.9, task.omega, np.ones((task.omega.size, 2)))
    (part,) = reducible(task, found)
    whole = part.truncated(0.0)
    omega = np.geomspace(3.0, 30.0, 40)  # above its slow integrator, below what Pade leaves
    (own,), (G,) = task.youla, task.blocks.response(omega)
    Q = own.parameter(1j * omega, basis, X[0])
    exact = Q @ np.linalg.inv(np.eye(2) - G @ Q)
    gap = np.linalg.norm(whole.response(omega) - exact, axis=(1, 2))
    assert (gap < 3e-3 * np.linalg.norm(exact, axis=(1, 2))).all()


def test_inputs_of_unlike_units_are_searched_alike() -> None:
    """Valves in units of 1e6 and 1e-3 of each other's leave the frequencies of the search alone."""
    gains = np.array([[2.0, -0.7], [0.5, 1.5]])

    def searched(units: tuple[float, float]) -> tuple[float, float]:
        rows = [[TransferFunction([k], [10, 1]) for k in row] for row in gains * units]
        return LimitSearch(MatrixPlant(rows), UNCERTAINTY, Performance()).range

    assert searched((1e6, 1e-3)) == pytest.approx(searched((1.0, 1.0)), rel=1e-9)


def test_more_interaction_is_no_help() -> None:
    """The limit grows with a, and a dead time adds to it."""
    alone, together, late = (
        coarse(plant).tau_p
        for plant in (
            first_order(1, 1.0, 100.0, 0.0), SEED, first_order(2, 1.0, 100.0, 0.949, 1.0),
        )
    )  # fmt: skip
    assert alone < together < late - 1.0


def test_peaks_between_few_points_do_not_make_a_plant_infeasible(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A search on a coarse grid goes on until no peak is left that every tau_P leaves above 1."""
    monkeypatch.setattr(search, "POINTS_PER_DECADE", 1.5)
    monkeypatch.setattr(search, "POLES_PER_DECADE", (1.5,))
    monkeypatch.setattr(search, "DENSER", 40)
    monkeypatch.setattr(search, "MAX_EXCHANGES", 1)
    plant = first_order(1, 1.0, 100.0, 0.0)
    found = LimitSearch(plant, UNCERTAINTY, Performance()).run()
    assert found is not None
    assert found.tau_p == pytest.approx(coarse(plant).tau_p, rel=0.05)
    monkeypatch.setattr(search, "LAST_EXCHANGE", 1)
    assert LimitSearch(plant, UNCERTAINTY, Performance()).run() is None  # what going on is for


@pytest.mark.parametrize("steps", [3, 100, 400])
def test_a_search_ends_within_a_step_with_the_best_so_far(steps: int) -> None:
    """Asked within Newton's method; where peaks between the points spoil the last one, earlier."""
    calls = iter(range(10**9))

    def tick() -> None:
        if next(calls) > steps:
            raise EnoughError

    task = LimitSearch(SEED, UNCERTAINTY, Performance(), tick)
    found = task.run()
    assert task.ended
    assert next(calls) < steps + 4  # it is not asked much longer
    assert (found is not None) == (steps > 3)
    if found is not None:
        bound = lower_bound(SEED, UNCERTAINTY, Performance()).value
        assert bound < found.tau_p < 6.0
        assert found.mu <= 1


INVERSE_RESPONSE = MatrixPlant(
    [
        [TransferFunction([-2, 1], [30, 11, 1]), TransferFunction([0.5], [10, 1])],
        [TransferFunction([-0.3], [4, 1]), TransferFunction([-1, 1], [16, 8, 1], 0.5)],
    ]
)


def test_a_slower_demand_is_asked_where_a_step_gains_nothing() -> None:
    """Where the uncertainty alone holds mu at its peak, a margin still comes of a larger tau_P."""
    task = LimitSearch(INVERSE_RESPONSE, UNCERTAINTY, Performance())
    basis = task._built_basis(search.BUILT_MATRIX_POLES[0])  # noqa: SLF001 - one stage of the search
    first = task._with_basis(basis, None)  # noqa: SLF001
    assert first is not None
    task.target = 0.95
    second = task._with_basis(basis, first)  # noqa: SLF001
    assert second is not None
    assert first.tau_p < second.tau_p < 1.5 * first.tau_p


def test_four_units_with_dead_times_of_their_own() -> None:
    """A plant of any shape: the search goes on to where a controller meets its claim."""
    rng = np.random.default_rng(0)
    gain = rng.normal(size=(4, 4)) + 2 * np.eye(4)
    plant = MatrixPlant(
        [
            [TransferFunction([k], [rng.uniform(5, 50), 1], rng.uniform(0, 2)) for k in row]
            for row in gain
        ]
    )
    demand = Performance(tau_p=20.0)
    state = search._State  # noqa: SLF001
    task = LimitSearch(plant, UNCERTAINTY, demand)
    basis = task._built_basis(1.0)  # noqa: SLF001
    here = state(task, basis, task.omega)
    X = [np.zeros((basis.size, 4, 4))]
    mu, v = here.measure(X, 20.0)
    after = here.measure(here.step(X, v, mu, 20.0, faster=False), 20.0)[0]
    assert lower_bound(plant, UNCERTAINTY, demand).value < after < 0.7 * mu


def test_single_loops_are_no_faster() -> None:
    """No PI setting in a wide grid passes the limit of one loop with a zero on the right."""
    plant = RIGHT
    found = limit(plant)
    assert found.value is not None
    performance = Performance(tau_p=found.value)
    for gain in np.geomspace(0.5, 50, 8):
        for integral_time in np.geomspace(10, 200, 8):
            peaks = analyse(
                plant, UNCERTAINTY, performance, [Controller(gain, integral_time)]
            ).peaks
            assert peaks is None or peaks.robust_performance.value > 1 - 1e-3


@pytest.mark.parametrize(
    "plant",
    [
        RIGHT,
        INTEGRATING,
        first_order(3, 1.0, 10.0, -0.45),
        first_order(1, 1.0, 1.0, 0.0, 3.0),
    ],
    ids=[
        "right-half-plane zero",
        "integrating",
        "near the lower limit",
        "mostly dead time",
    ],
)
def test_every_kind_of_plant_gets_a_controller_that_meets_its_claim(plant: Plant) -> None:
    """Value, lower bound and the built controller are in order; its own peak is at most 1."""
    found = limit(plant)
    assert found.value is not None
    assert found.lower_bound.value <= found.value
    assert found.realised is not None
    assert found.realised.tau_p >= found.value * (1 - 1e-3)
    assert found.realised.tau_p < 1.35 * found.value
    assert found.realised.robustness.nominally_stable
    peaks = found.realised.robustness.peaks
    assert peaks is not None
    assert peaks.robust_performance.value <= 1


def test_built_controller_is_checked_by_poles_and_ab13md() -> None:
    """The seed plant's controller: closed-loop poles by python-control, mu by SLICOT."""
    realised = limit(SEED).realised
    assert realised is not None
    assert isinstance(realised.controller, ModeController)
    K = realised.controller.full(2)
    assert np.count_nonzero(np.abs(K.poles) < 1e-9) == 2  # integral action in both directions
    gain = np.array([[1, 0.949], [0.949, 1]])
    _check(K, gain, 100.0, realised.tau_p)


def test_a_load_on_an_integrating_input_leaves_no_error() -> None:
    """The demand needs no integrator there, the plant has it; what is built has one too."""
    realised = limit(INTEGRATING).realised
    assert realised is not None
    assert isinstance(realised.controller, ModeController)
    for part in (realised.controller.total, realised.controller.difference):
        assert np.count_nonzero(part.poles == 0) == 1
        near, far = np.abs(part(np.array([1e-9 + 0j, 1e-10 + 0j])))[:, 0, 0]
        assert far == pytest.approx(10 * near, rel=1e-3)  # and it is seen in what the part puts out


def _reached(peak: float, omega: float) -> Realised:
    """A controller's claim, its peak of mu put in."""
    calm = StateSpace([[0.0]], [[1.0]], [[0.1]], [[1.0]])
    found = analyse_centralised(RIGHT, UNCERTAINTY, Performance(tau_p=1e3), calm, proof=False)
    assert found.peaks is not None
    peaks = replace(
        found.peaks,
        robust_performance=replace(found.peaks.robust_performance, value=peak, omega=omega),
    )
    return Realised(calm, 1, 1e3, replace(found, peaks=peaks))


@pytest.mark.parametrize("mended", [True, False])
def test_a_peak_that_a_reduction_leaves_between_the_frequencies_is_found(
    mended: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is looked at in the next reduction; a controller that keeps it is none."""
    given = RIGHT, UNCERTAINTY, Performance(tau_p=1e3)
    task = LimitSearch(*given)
    building = Building(*given, NaturalUnits(*given, 2.0, np.ones(1)), task)
    omega = np.geomspace(1e-3, 10, 9)
    basis = task._built_basis(1.0)  # noqa: SLF001
    found = Found([np.zeros((basis.size, 1, 1))], basis, 0.6, 1e3, omega, np.ones((9, 1)))
    looked_at = []

    def reduced(*given):
        looked_at.append(given[-1])
        return ()

    def analysed(*_):
        return _reached(0.6 if mended and len(looked_at) > 1 else 3.6e9, 0.123 / 2.0)

    monkeypatch.setattr(Building, "_reduced", reduced)
    monkeypatch.setattr(Building, "_analysed", analysed)
    built = building._built(found, [], 0.61)  # noqa: SLF001
    assert (built is not None) == mended
    assert np.diff(np.log(looked_at[0])).max() < 0.2 * math.log(10**0.5)  # between the nine too
    assert 0.123 not in looked_at[0]
    assert all(0.123 in each for each in looked_at[1:])


def test_a_search_that_is_ended_keeps_its_first_controller(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Large matrix plants get one with mu in hand before the best one is sought."""
    rows = [[TransferFunction([1.0 + 3.0 * (i == j)], [10, 1]) for j in range(4)] for i in range(4)]
    task = LimitSearch(MatrixPlant(rows), UNCERTAINTY, Performance())
    omega = np.geomspace(1e-3, 10, 9)
    first = Found([np.zeros((1, 4, 4))], task._built_basis(1.0), 1.0, 5.0, omega, np.ones((9, 4)))  # noqa: SLF001
    targets = []

    def with_basis(_basis: object, before: Found | None) -> Found | None:
        targets.append(task.target)
        return first if before is None else None

    monkeypatch.setattr(task, "_with_basis", with_basis)
    assert task.run(task.first()) is first
    assert targets[0] < 0.9 < targets[1]


def test_a_search_that_is_ended_has_built_its_first_controller(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where many seconds go by, something is built before the best is sought, and is returned."""
    rows = [[TransferFunction([1.0 + 3.0 * (i == j)], [10, 1]) for j in range(3)] for i in range(3)]
    over = []

    def tick() -> None:
        if over:
            raise EnoughError

    def run(_: LimitSearch, first: Found | None) -> Found | None:
        over.append(first)
        return first

    monkeypatch.setattr(LimitSearch, "run", run)
    found = multivariable_limit(MatrixPlant(rows), UNCERTAINTY, Performance(), tick=tick)
    assert over[0] is not None
    assert found.status is LimitStatus.TIME_LIMIT
    assert found.realised is not None
    assert found.realised.robustness.guarantee is not None
    assert found.realised.robustness.guarantee.status is GuaranteeStatus.PROVEN
    assert found.value == pytest.approx(found.realised.tau_p, rel=0.2)


def test_no_part_of_the_making_of_a_controller_keeps_an_end_waiting() -> None:
    """Asked within the reduction and the proof too, and ended at whichever point."""
    given = RIGHT, UNCERTAINTY, Performance()
    calls = iter(range(10**9))
    limit_of = functools.partial(multivariable_limit, *given)
    limit_of(tick=lambda: next(calls) and None)
    whole = next(calls)
    asked = []

    def tick() -> None:
        asked.append(len(asked))
        if len(asked) > whole - 2:
            raise EnoughError

    found = limit_of(tick=tick)
    assert found.status is LimitStatus.TIME_LIMIT
    assert found.value is not None
    assert len(asked) < whole + 2


def test_a_controller_on_its_way_may_have_more_states_than_a_request() -> None:
    """400 states are the most that is taken in; sums and series of them go beyond."""
    states = MAX_STATES // 2 + 1
    half = StateSpace(-np.eye(states), np.ones((states, 1)), np.ones((1, states)), [[0.0]])
    whole = half.beside(half)
    assert whole.states > MAX_STATES
    assert whole(np.array([1.0 + 0j]))[0, 0, 0] == pytest.approx(states)
    with pytest.raises(InvalidInputError, match="states"):
        analyse_centralised(RIGHT, UNCERTAINTY, Performance(tau_p=9.0), whole)


@functools.cache
def _column() -> Limit:
    return multivariable_limit(COLUMN, UNCERTAINTY, Performance(tau_p=10.0))


def test_poles_of_a_controller_that_runs_away_are_counted() -> None:
    """Integrators are none of them; of a mode controller both parts count."""
    calm = StateSpace([[0.0]], [[1.0]], [[0.1]], [[1.0]])
    wild = StateSpace([[0.0, 0.0], [0.0, 0.3]], [[1.0], [1.0]], [[0.1, 1.0]], [[1.0]])
    robustness = analyse_centralised(
        first_order(1, 1.0, 10.0, 0.0, 1.0),
        Uncertainty.from_error(0.2, 1),
        Performance(tau_p=20.0),
        calm,
    )
    for controller, number in ((calm, 0), (wild, 1), (ModeController(wild, wild), 2)):
        assert Realised(controller, 2, 20.0, robustness).unstable_poles == number


def test_column_is_held_below_one() -> None:
    """The column of SLH, eq. 3: 1.06 was published; ours is built, and is no more than 1."""
    found = _column()
    assert found.value is not None
    assert found.lower_bound.value < found.value < 1
    assert found.realised is not None
    K = found.realised.controller
    peaks = found.realised.robustness.peaks
    assert peaks is not None
    assert peaks.robust_performance.value <= 1
    gain = np.array([[0.878, -0.864], [-1.082, 1.096]])
    mu = _check(K, gain, 75.0, 10.0)
    assert mu == pytest.approx(peaks.robust_performance.value, rel=1e-3)


def _check(found, gain, lag, tau_p) -> float:
    """Peak of mu by AB13MD on a dense grid of a stable loop."""
    K = control.ss(found.A, found.B, found.C, found.D)
    G = control.ss(-np.eye(2) / lag, np.eye(2), gain / lag, np.zeros((2, 2)))
    loop = G * K
    assert control.feedback(loop, control.ss([], [], [], np.eye(2))).poles().real.max() < 0
    sizes, kinds = np.array([1, 1, 2], dtype=np.int32), np.array([2, 2, 2], dtype=np.int32)
    peak = 0.0
    for omega in np.geomspace(1e-4, 1e3, 700):
        s = 1j * omega
        g, c = gain / (lag * s + 1), K(s)
        S = np.linalg.inv(np.eye(2) + g @ c)
        w_I = 0.2 * (5 * s + 1) / (0.5 * s + 1)
        w_P = 0.5 * (tau_p * s + 1) / (tau_p * s)
        N = np.block([[w_I * c @ S @ g, w_I * c @ S], [w_P * S @ g, w_P * S]])
        peak = max(peak, ab13md(np.asfortranarray(N), sizes, kinds)[0])
    assert peak <= 1 + 1e-6
    return peak


@pytest.mark.parametrize(
    ("plant", "tau_p"),
    [(SEED, None), (INTEGRATING, None), (COLUMN, 10.0)],
    ids=["parallel", "integrating", "column"],
)
def test_semidefinite_programs_confirm_the_built_controllers(
    plant: Plant, tau_p: float | None
) -> None:
    """The bound at the peak by cvxpy and Clarabel; two units as the matrix that they are."""
    realised = (_column() if plant is COLUMN else limit(plant)).realised
    assert realised is not None
    found = analyse_centralised(
        plant, UNCERTAINTY, Performance(tau_p=realised.tau_p if tau_p is None else tau_p),
        realised.controller, proof=False, cross_check=True,
    )  # fmt: skip
    assert found.cross_check is not None
    assert found.peaks is not None
    assert found.cross_check.kernel == pytest.approx(found.peaks.robust_performance.value, rel=1e-9)
    assert found.cross_check.agree
    assert found.cross_check.sdp == pytest.approx(found.cross_check.kernel, rel=1e-6)


def test_lower_bound_names_what_limits() -> None:
    """Dead time, a zero in the right half plane, uncertainty; the point proves it."""
    dead = lower_bound(first_order(2, 1.0, 100.0, 0.9, 5.0), UNCERTAINTY, Performance())
    assert dead.limitation is Limitation.DEAD_TIME
    small = Uncertainty.from_error(0.01, 0.01)
    zero = lower_bound(RIGHT, small, Performance())
    assert zero.limitation is Limitation.ZERO
    # 1 = |w_P(z)| = (1/2) (1 + 1/(tau_P z)) at z = 1/3: no less than 3.
    assert zero.value > 3 * (1 - 1e-5)
    free = lower_bound(SEED, UNCERTAINTY, Performance())
    assert free.limitation is Limitation.UNCERTAINTY
    assert free.point is not None
    z = free.point
    w_I = abs(0.2 * (5 * z + 1) / (0.5 * z + 1))
    w_P = abs(0.5 * (1 + 1 / (free.value * z)))
    assert min(w_I, w_P) == pytest.approx(1, abs=1e-5)


def _random_plant(rng: np.random.Generator) -> MatrixPlant:
    """Stable, of one to three units: lags, dead times, zeros in the right half plane."""
    n = int(rng.integers(1, 4))
    gains = rng.normal(size=(n, n)) + 2 * np.eye(n)
    shared = float(rng.uniform(0, 2)) * rng.integers(0, 2)  # dead time of all elements
    lead = float(rng.uniform(0.5, 4)) * rng.integers(0, 2)  # a zero that all of them have
    return MatrixPlant(
        [
            [
                TransferFunction(
                    [-lead * gains[row, column], gains[row, column]],
                    np.polymul([rng.uniform(1, 10), 1], [rng.uniform(0.3, 3), 1]),
                    shared + float(rng.uniform(0, 1)) * rng.integers(0, 2),
                )
                for column in range(n)
            ]
            for row in range(n)
        ]
    )


@pytest.mark.parametrize("seed", range(12))
def test_no_stabilising_controller_passes_the_lower_bound(seed: int) -> None:
    """Controllers Q (I - G Q)^-1 of random stable Q, on random plants: as the bound says, or above.

    Q is any stable matrix with G(0) Q(0) = I, so all that integrates and stabilises is among these.
    """
    rng = np.random.default_rng(seed)
    plant = _random_plant(rng)
    n = plant.n
    P = np.linalg.inv(plant.static_gain())
    omega = np.geomspace(1e-4, 1e3, 250)
    s = 1j * omega
    G = plant.response(omega)
    w_I = UNCERTAINTY.magnitude(omega)[:, None, None]
    structure = BlockStructure(tuple(range(n)), n)
    for _ in range(6):
        performance = Performance(tau_p=float(10 ** rng.uniform(-1, 2)))
        bound = lower_bound(plant, UNCERTAINTY, performance)
        speed = 10 ** rng.uniform(-2, 1)
        lag = 1 / (s / speed + 1) ** int(rng.integers(1, 3))
        bends = [s / (s + 10 ** rng.uniform(-2, 1)) for _ in range(3)]
        Y = lag[:, None, None] * np.eye(n) + sum(
            (lag * bend)[:, None, None] * rng.normal(size=(n, n)) * 10 ** rng.uniform(-2, 0)
            for bend in bends
        )
        Q = P @ Y
        S = np.eye(n) - G @ Q
        w_P = performance.magnitude(omega)[:, None, None]
        N = np.block([[w_I * Q @ G, w_I * Q], [w_P * S @ G, w_P * S]])
        assert upper_bound(N, structure).mu.max() >= bound.value * (1 - 1e-3)  # the grid's own gap


def test_what_has_no_limit_says_so() -> None:
    """Uncertainty below 1 and no dead time: any tau_P can be had, and no number is given."""
    found = multivariable_limit(
        first_order(2, 1.0, 100.0, 0.5), Uncertainty.from_error(0.2, 0.0), Performance()
    )
    assert found.status is LimitStatus.UNLIMITED
    assert found.value is None
    assert found.reason is not None
    assert found.lower_bound.value == 0


@pytest.mark.parametrize(
    ("weight", "passes"),
    [
        # |w_I| = 5 within 2e-5 of 3000 rad: no logarithmic grid meets that.
        (TransferFunction([0.5, 0.3, 4.5e6], [1, 0.06, 9e6]), 3000.0),
        # It passes 1 beyond a thousand times its bends.
        (TransferFunction([1.0000001, 0.1], [1, 1]), math.sqrt(0.99 / 2.0000001e-7)),
    ],
)
def test_a_weight_that_passes_1_where_no_grid_looks_is_a_limit(
    weight: TransferFunction, passes: float
) -> None:
    """No loop is faster than the frequency at which |w_I| exceeds 1, however narrow or far."""
    plant, uncertainty = first_order(1, 1.0, 10.0, 0.0), Uncertainty(weight)
    assert not unlimited(plant, uncertainty)
    bound = lower_bound(plant, uncertainty, Performance())
    assert bound.point is not None
    z = bound.point
    w_I = np.polyval(weight.num, z) / np.polyval(weight.den, z)
    assert abs(w_I) >= 1
    assert abs(0.5 * (1 + 1 / (bound.value * z))) >= 1
    # |w_P(j omega)| = 1 where omega tau_P = 1/sqrt(3).
    assert 0.45 / math.sqrt(3) / passes < bound.value < 1.1 / math.sqrt(3) / passes


def test_a_zero_on_the_axis_is_a_bound() -> None:
    """A mode without response at 1 rad has S = 1 there: |w_P(j)| <= 1 takes tau_P = 1/sqrt(3)."""
    notch = ParallelPlant(1, TransferFunction([1, 0, 1], [1, 3, 3, 1]), TransferFunction([0], [1]))
    bound = lower_bound(notch, Uncertainty.from_error(0.2, 0.0), Performance())
    assert bound.value == pytest.approx(1 / math.sqrt(3), rel=1e-5)
    assert bound.limitation is Limitation.ZERO


def test_what_nothing_can_hold_is_infeasible() -> None:
    """|w_I| > 1 at all frequencies: no controller with integral action is robustly stable."""
    found = multivariable_limit(
        first_order(2, 1.0, 100.0, 0.5), Uncertainty.from_error(1.5, 1.0), Performance()
    )
    assert found.status is LimitStatus.INFEASIBLE
    assert found.value is None


def test_plants_that_are_not_covered_are_refused() -> None:
    """Singular, too large, or integrating in a way that no input explains."""
    performance = Performance()
    with pytest.raises(InvalidInputError, match="differences is singular"):
        multivariable_limit(first_order(2, 1.0, 10.0, 1.0), UNCERTAINTY, performance)
    unlike = [[TransferFunction([1.0], [lag, 1.0]) for lag in row] for row in ((10, 5), (3, 8))]
    with pytest.raises(InvalidInputError, match="static gain is singular"):
        multivariable_limit(MatrixPlant(unlike), UNCERTAINTY, performance)
    lag = TransferFunction([1.0], [1.0, 1.0])
    large = MatrixPlant([[lag] * 7] * 7)
    with pytest.raises(InvalidInputError, match="up to 6 units"):
        multivariable_limit(large, UNCERTAINTY, performance)
    row = MatrixPlant(
        [[TransferFunction([1.0], [1.0, 0.0]), TransferFunction([0.5], [1.0, 0.0])], [lag, lag]]
    )
    with pytest.raises((InvalidInputError, UnsupportedPlantError)):
        multivariable_limit(row, UNCERTAINTY, performance)
    with pytest.raises(UnsupportedPlantError):
        multivariable_limit(
            ParallelPlant(2, TransferFunction([1.0], [1.0, -1.0]), TransferFunction([0.0], [1.0])),
            UNCERTAINTY,
            performance,
        )


def test_full_block_uncertainty_is_no_easier() -> None:
    """Actuators that may err in concert: for a parallel plant the same problem."""
    full = Uncertainty.from_error(0.2, 1.0, Structure.FULL)
    performance = Performance()
    diagonal, concerted = (
        LimitSearch(SEED, uncertainty, performance) for uncertainty in (UNCERTAINTY, full)
    )
    assert concerted.blocks.blocks == diagonal.blocks.blocks
    assert concerted.blocks.n_scales == diagonal.blocks.n_scales == 1
    assert np.array_equal(concerted.omega, diagonal.omega)
