"""Plants drawn at random are found again, with errors as large as stated."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import Lag, lag, moves, record, respond

from solver.identification.beginning import starts
from solver.identification.colour import Colour
from solver.identification.elements import ElementKind
from solver.identification.equality import test_equality as units_equality
from solver.identification.identify import identify
from solver.identification.job import Job
from solver.identification.noise import covariance
from solver.identification.problem import PlantStructure, Start, limits, matrix_rows
from solver.identification.record import Record
from solver.identification.row_fit import fit_row
from solver.identification.selection import Allowed, begin, select
from solver.model.errors import UnsupportedPlantError
from solver.model.plants import ParallelPlant

EXAMPLES = Path(__file__).parents[3] / "examples"


def heaters(name):
    """Return a record of the two-heater kit."""
    table = np.loadtxt(EXAMPLES / f"two_heaters_{name}.csv", delimiter=",", skiprows=1)
    signals = dict(zip(("H1", "H2", "T1", "T2"), table[:, 1:].T, strict=True))
    inputs = {key: signals[key] for key in ("H1", "H2")}
    return Record(table[:, 0], inputs, {key: signals[key] for key in ("T1", "T2")}, name)


def fitted(one, order=None):
    """Return the first row's fit."""
    row = matrix_rows([one], starts([one], PlantStructure.MATRIX))[0]
    return fit_row(row, Allowed(order), limits([one]))


@pytest.mark.parametrize("second", [False, True])
def test_intervals_hold_the_truth(second):
    """95 of 100 parameters of two elements lie in their own intervals, or more."""
    hits = total = 0
    for seed in range(16):
        generator = np.random.default_rng(seed)
        truth = [lag(generator, second=second) for _ in range(2)]
        fit = fitted(record([truth], generator), 2 if second else 1)
        shapes = []
        for e in truth:
            b = e.first + e.second
            ratio = [4 * e.first * e.second / b**2] if second else []
            shapes += [np.log(b), *ratio, e.dead_time]
        wanted = np.array([*shapes, *(e.gain for e in truth)])
        errors = np.sqrt(np.diag(fit.covariance.matrix)) * fit.covariance.quantile
        hits += int(np.count_nonzero(np.abs(fit.parameters - wanted) <= errors))
        total += wanted.size
    assert hits >= 0.95 * total


def test_noiseless_record_gives_the_plant_itself():
    """Nothing but rounding stands between record and plant."""
    generator = np.random.default_rng(7)
    truth = [[Lag(2, 20, 0, 3.3), Lag(-1, 35, 12, 7.1)], [Lag(0.7, 50, 0, 5), Lag(1.5, 15, 4, 0.5)]]
    found = identify([record(truth, generator, noise=0.0)])
    omega = np.geomspace(1e-3, 1, 50)
    G = found.plant.response(omega)
    for i, row in enumerate(truth):
        for j, e in enumerate(row):
            s = 1j * omega
            exact = e.gain * np.exp(-e.dead_time * s) / ((e.first * s + 1) * (e.second * s + 1))
            assert G[:, i, j] == pytest.approx(exact, rel=2e-3)


def test_units_change_nothing():
    """Time in other units, inputs and outputs in others: the same plant in those."""
    one = heaters("steps")
    other = Record(
        60e3 * one.time - 5e6,
        {"H1": 1e-5 * one.inputs["H1"], "H2": 1e4 * one.inputs["H2"]},
        {"T1": 1e6 * one.outputs["T1"] + 3, "T2": 1e-4 * one.outputs["T2"]},
    )
    first, second = identify([one]), identify([other])
    omega = np.geomspace(1e-3, 0.1, 9)
    scale = np.array([[1e6 / 1e-5, 1e6 / 1e4], [1e-4 / 1e-5, 1e-4 / 1e4]])
    G = first.plant.response(omega)
    # An element that noise hides is the same as far as its row can tell.
    close = 0.01 * np.max(np.abs(G), axis=(0, 2))[:, None]
    assert np.all(np.abs(second.plant.response(omega / 60e3) / scale - G) < close)
    for a, b in zip(first.predictions, second.predictions, strict=True):
        assert a.normalised_fit == pytest.approx(b.normalised_fit, abs=0.01)


@pytest.mark.parametrize(("used", "other"), [("steps", "random"), ("random", "steps")])
def test_each_record_of_the_two_heaters_predicts_the_other(used, other):
    """75 per cent of normalised fit in every output, and no time that the record cannot tell."""
    one = heaters(used)
    found = identify([one], validation=[heaters(other)])
    assert len(found.predictions) == 4
    assert min(p.normalised_fit for p in found.predictions) > 75
    assert [p.kept_back for p in found.predictions] == [False, False, True, True]
    for element in found.elements:
        assert element.element.lag <= one.span / 2
        assert element.element.dead_time <= one.span / 10
    told = [words for element in found.elements for words in element.untold]
    assert any("gain / time constant" in words for words in told)
    assert found.begins == (Start.HELD if used == "steps" else Start.FROM_ZERO,)


def test_record_with_few_samples_is_not_read_for_rare_forms():
    """Every fifth sample of the steps predicts the other record as all of them do, with lags."""
    every = heaters("steps")
    few = Record(every.time[::5], *({name: values[::5] for name, values in signals.items()}
                                    for signals in (every.inputs, every.outputs)))  # fmt: skip
    found = identify([few], validation=[heaters("random")])
    assert min(p.normalised_fit for p in found.predictions if p.kept_back) > 80
    assert {e.element.kind for e in found.elements} <= {ElementKind.FIRST, ElementKind.SECOND}


def test_two_heaters_are_not_identical_units():
    """One heater is stronger than the other, and the record shows it."""
    found = identify([heaters("steps")], structure=PlantStructure.PARALLEL)
    assert isinstance(found.plant, ParallelPlant)
    assert not found.equality.plausible
    assert any("differ by more than noise" in words for words in found.advice)


def parallel_record(seed, gains=(2.0, 2.0), n=2):
    """Return a record of parallel units with given own gains."""
    own = [Lag(gain, 20, 0, 3) for gain in gains]
    other = Lag(0.8, 25, 0, 4)
    plant = [[own[i] if i == j else other for j in range(n)] for i in range(n)]
    return record(plant, np.random.default_rng(seed))


def test_identical_units_are_held_for_identical():
    """At 5 per cent few of 12 records of equal units are held for unequal; unequal ones are."""
    equality = []
    for seed in range(12):
        one = parallel_record(seed)
        (row,) = Job.of([one], PlantStructure.PARALLEL, drift=False).rows()
        equality.append(units_equality(fit_row(row, Allowed(1), limits([one]))))
    assert sum(not found.plausible for found in equality) <= 3
    whole = identify([parallel_record(0)], structure=PlantStructure.PARALLEL, allowed=Allowed(1))
    assert whole.equality == equality[0]
    unequal = identify([parallel_record(1, (2.0, 2.2))], structure=PlantStructure.PARALLEL)
    assert unequal.equality.probability < 1e-3


def test_spikes_change_little():
    """Readings far off their neighbours are left out and counted."""
    generator = np.random.default_rng(2)
    clean = record([[Lag(2, 20, 0, 3)]], generator)
    spiky = clean.outputs["y0"].copy()
    at = generator.choice(600, 12, replace=False)
    spiky[at] += generator.choice([-1, 1], 12) * 50.0
    found = identify([Record(clean.time, clean.inputs, {"y0": spiky})])
    assert found.predictions[0].spikes == 12
    gain = found.elements[0].estimates[0]
    assert gain.low < 2 < gain.high
    assert gain.high - gain.low < 0.2


def test_unknown_start_is_seen_where_the_record_begins_quietly():
    """An output that moves before any input does has not been at rest."""
    generator = np.random.default_rng(4)
    time = np.arange(600.0)
    u = np.where(time < 40, 0.0, moves(generator, 600))
    y = (
        respond(Lag(2, 30, 0, 4), time, u)
        + 5 * np.exp(-time / 30)
        + 0.05 * generator.standard_normal(600)
    )
    found = identify([Record(time, {"u": u}, {"y": y})])
    lag_ = found.elements[0].estimates[1]
    assert lag_.low < 30 < lag_.high
    assert found.predictions[0].normalised_fit > 90


def test_integrators_are_recognised():
    """A level that rises as long as its valve is open."""
    generator = np.random.default_rng(5)
    found = identify([record([[Lag(0.1, np.inf, 0, 6)]], generator, noise=0.05)])
    assert found.elements[0].element.kind is ElementKind.INTEGRATOR
    gain = found.elements[0].estimates[0]
    assert gain.name == "velocity_gain"
    assert gain.low < 0.1 < gain.high


def test_inverse_response_is_recognised():
    """Two lags against each other."""
    generator = np.random.default_rng(6)
    time = np.arange(800.0)
    u = moves(generator, 800)
    y = respond(Lag(3, 30, 0, 0), time, u) + respond(Lag(-1.5, 6, 0, 0), time, u)
    found = identify([Record(time, {"u": u}, {"y": y + 0.02 * generator.standard_normal(800)})])
    # 3/(30 s + 1) - 1.5/(6 s + 1) has its zero at s = 1.5/27.
    assert found.plant.elements[0].zeros[0] == pytest.approx(1.5 / 27, rel=0.1)


def test_no_effect_is_said_to_be_none():
    """An input without effect gets no time constants, and an interval for its gain around zero."""
    generator = np.random.default_rng(8)
    plant = [[Lag(2, 20, 0, 3), Lag(0, 10, 0, 0)], [Lag(0.5, 30, 0, 2), Lag(1, 12, 0, 1)]]
    found = identify([record(plant, generator)])
    silent = found.elements[1]
    assert [e.name for e in silent.estimates] == ["gain"]
    assert silent.estimates[0].low < 0 < silent.estimates[0].high
    assert "no effect of u1 is seen" in silent.untold[0]
    assert "step of u1" in silent.test


def test_effect_whose_gain_is_told_is_seen():
    """Outputs that wander far predict no block kept back; a gain away from zero is an effect."""
    generator = np.random.default_rng(3)
    plant = [[Lag(0.06, np.inf, 26, 1), Lag(-0.1, np.inf, 21, 3)]]
    wandering = record(plant, generator, noise=0.3)
    row, box = matrix_rows([wandering], [Start.HELD])[0], limits([wandering])
    solved, unseen = select(row, Allowed(2, integrating=True), box)
    told = covariance(row, solved, replace(box, fixed={j: solved.shapes[j] for j in unseen}))
    errors = np.sqrt(np.diag(told.matrix))[-len(solved.gains) :]
    for index in unseen:
        assert abs(solved.gains[index]) <= told.quantile * errors[index]


def test_gaps_and_other_sampling_are_no_hindrance():
    """An output that is read at every fifth sample only."""
    generator = np.random.default_rng(9)
    clean = record([[Lag(2, 20, 0, 3)]], generator, count=1500)
    y = np.where(np.arange(1500) % 5, np.nan, clean.outputs["y0"])
    found = identify([Record.with_gaps(clean.time, clean.inputs, {"y0": y})])
    for estimate, truth in zip(found.elements[0].estimates, (2, 20, 3), strict=True):
        assert estimate.low < truth < estimate.high


def test_runaway_is_refused():
    """An unstable plant's record is no record of a plant that these forms describe."""
    time = np.arange(300.0)
    u = moves(np.random.default_rng(1), 300)
    y = np.exp(time / 20) + u
    with pytest.raises(UnsupportedPlantError, match="runs away"):
        identify([Record(time, {"u": u}, {"y": y})])


def test_units_of_their_own_and_what_differs_in_words():
    """Each unit's gain comes back, the difference is told, and the plant is an alternative."""
    one = parallel_record(1, (2.0, 2.4))
    own = identify([one], structure="units", allowed=Allowed(1, integrating=False))
    assert own.equality is None
    assert own.cover.own is None
    assert [e.output for e in own.elements] == ["y0", "y0", "y1", "y1"]
    G = own.plant.response(np.array([1e-4]))[0].real
    assert pytest.approx(np.array([[2.0, 0.8], [0.8, 2.4]]), rel=0.06) == G
    generator = np.random.default_rng(0)
    drawn = own.draw(50, generator, own.cover.omega)
    assert drawn.shape == (50, own.cover.omega.size, 2, 2)
    assert np.median(np.abs(drawn[:, 0] - G), axis=0).max() < 0.1
    shared = identify([one], structure="parallel", allowed=Allowed(1, integrating=False))
    assert [a.name for a in shared.alternatives] == ["each unit its own"]
    told = next(words for words in shared.advice if "differ by more than noise" in words)
    assert "y0: gain -" in told
    assert "y1: gain +" in told
    # Less errs of the plant itself than of the plant and its units.
    weights = [
        np.abs(w.magnitude(shared.cover.omega)) for w in (shared.cover.own, shared.cover.weight)
    ]
    assert weights[0][0] < weights[1][0]


def test_each_record_is_an_alternative():
    """Two records of one plant are two plants beside the common one."""
    found = identify([heaters("steps"), heaters("random")])
    assert [a.name for a in found.alternatives] == ["record steps", "record random"]
    assert found.cover.own is not None


@pytest.mark.parametrize("seed", [0, 19, 20, 31])
def test_integrators_start_as_integrators(seed):
    """The fit is no worse than the true plant's; from lags it ended at up to five times that."""
    generator = np.random.default_rng(seed)
    row = [
        Lag(
            generator.choice([-1, 1]) * generator.uniform(0.02, 0.15),
            np.inf,
            generator.uniform(4, 40),
            generator.uniform(0, 15),
        )
        for _ in range(2)
    ]
    one = record([row, row], generator, noise=1.5)
    readings = matrix_rows([one], [Start.HELD])[0]
    kinds = [ElementKind.INTEGRATOR_LAG] * 2
    true = readings.solve(kinds, [(np.log(e.second), e.dead_time) for e in row])
    assert begin(readings, kinds, limits([one])).cost <= true.cost


def test_slow_disturbance_below_white_noise_widens_intervals():
    """By its own colour, from the sums over all pairs; an autoregression alone is too short."""
    generator = np.random.default_rng(0)
    count, keep, share = 400, np.exp(-1 / 30), 0.8
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    omega = (keep**apart + share * np.eye(count)) / (1 + share)
    time = np.arange(float(count))
    moved = moves(generator, count)
    noise = np.linalg.cholesky(omega) @ generator.standard_normal(count)
    one = Record(time, {"u": moved}, {"y": respond(Lag(1.0, 20.0, 0.0, 2.0), time, moved) + noise})
    row, box = matrix_rows([one], [Start.HELD])[0], limits([one])
    solved = row.solve([ElementKind.FIRST], [(np.log(20.0), 2.0)])
    plain = covariance(row, solved, box)
    widened = covariance(row, solved, box, [Colour(30.0, share)])
    assert np.all(np.diag(widened.matrix) > np.diag(plain.matrix))
    fixed = replace(box, fixed={0: solved.shapes[0]})
    gain = covariance(row, solved, fixed, [Colour(30.0, share)])
    left = solved.left[:, 0]
    exact = gain.noise * np.sqrt(left @ omega @ left) / (left @ left)
    assert np.sqrt(gain.matrix[-1, -1]) == pytest.approx(exact)


def test_no_interval_is_stated_for_a_gain_whose_lag_may_be_any_longer_one():
    """A lag of four records: neither it nor the gain is told, nor that their ratio is."""
    one = record([[Lag(2.0, 2400.0, 0.0, 5.0)]], np.random.default_rng(3), noise=0.005)
    element = identify([one], allowed=Allowed(1, integrating=False)).elements[0]
    told = {each.name: each for each in element.estimates}
    assert told["gain"].low is None
    assert told["time_constant"].high is None
    assert told["dead_time"].low is not None
    assert "may be longer; with that one gain / time constant" in element.untold[0]
