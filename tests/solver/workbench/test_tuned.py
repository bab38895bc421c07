"""Tuning by keywords, and what scripts ask of the result."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import mutune
from mutune import InvalidInputError

PLANT = mutune.first_order(2, gain=1, time_constant=100, interaction=0.949)
USUAL = mutune.Uncertainty.from_error(0.2, 1)


@pytest.fixture(scope="module")
def tuned():
    """The published example, with its proof."""
    return mutune.tune(
        PLANT, USUAL, controller="PI", starts=2, certificate=True, model_tolerance=True
    )


@pytest.fixture(scope="module")
def infeasible():
    """Inputs that may err by more than all."""
    return mutune.tune(PLANT, mutune.Uncertainty.from_error(1.5, 1), arrangement="identical")


def test_keywords_and_specification_are_one_task(tuned):
    """The same digits, whichever way it is asked."""
    task = mutune.Specification(
        PLANT, USUAL, mutune.Performance(max_peak=2), kind="PI", starts=2, certificate=True,
        model_tolerance=True,
    )  # fmt: skip
    again = mutune.tune(task)
    assert again == tuned
    assert hash(again) == hash(tuned)
    assert tuned.specification == task


def test_keywords_are_not_lost_beside_a_specification():
    """Nor is a word that nobody knows."""
    task = mutune.Specification(PLANT, USUAL, mutune.Performance())
    for extra in ({"max_peak": 3}, {"uncertainty": USUAL}, {"seed": 0}):
        with pytest.raises(InvalidInputError) as error:
            mutune.tune(task, **extra)
        assert error.value.field == f"/{next(iter(extra))}"
    for word in ("kind", "performance", "max_peaks"):
        with pytest.raises(TypeError):
            mutune.tune(PLANT, USUAL, **{word: "PI"})
    with pytest.raises(InvalidInputError) as error:
        mutune.tune(PLANT)
    assert error.value.field == "/uncertainty"


def test_it_prints_in_about_eight_lines(tuned, infeasible):
    """And its repr in one."""
    assert 4 <= len(str(tuned).splitlines()) <= 8
    assert f"tau_p {tuned.tau_p:.6g}" in str(tuned)
    assert "% in interaction the demand is lost" in str(tuned)
    assert len(repr(tuned)) < 100
    assert "infeasible" in str(infeasible)
    assert infeasible.tuning.reason in str(infeasible)
    assert len(repr(tuned.simulate(setpoint={0: 1}, duration=10))) < 100


def test_infeasible_outcomes_sort_and_raise(tuned, infeasible):
    """A sweep takes its least tau_p without a special case."""
    assert tuned.ok
    assert not infeasible.ok
    assert infeasible.tau_p == infeasible.mu == math.inf
    assert infeasible.tuning.tau_p is None
    assert min([infeasible, tuned], key=lambda each: each.tau_p) is tuned
    assert tuned.raise_if_infeasible() is tuned
    for use in (
        infeasible.raise_if_infeasible,
        lambda: infeasible.margins,
        lambda: infeasible.simulate(setpoint={0: 1}, duration=1),
        infeasible.plot_mu,
    ):
        with pytest.raises(mutune.InfeasibleError, match=r".+"):
            use()


def test_a_demand_that_mu_exceeds_is_not_ok():
    """The objective mu may end with settings that miss the demand; they say so."""
    missed = mutune.tune(PLANT, USUAL, objective="mu", tau_p=1.0, arrangement="identical", starts=1)
    assert missed.loops
    assert missed.mu > 1
    assert not missed.ok
    assert "NOT met" in str(missed)


def test_margins_come_by_unit(tuned):
    """The unit is the index, whatever shares its settings."""
    alike = mutune.tune(PLANT, USUAL, arrangement="identical", starts=1)
    assert len(alike.margins) == 2
    assert alike.margins[0] == alike.margins[1]
    for unit, each in enumerate(tuned.margins):
        assert unit in each.units
    fast = min(tuned.loops, key=lambda loop: loop.integral_time)
    assert tuned.margins[tuned.loops.index(fast)].units == (tuned.loops.index(fast),)


def test_responses_come_by_unit(tuned):
    """Rows are units; the stepped one follows, the other returns."""
    response = tuned.simulate(setpoint={1: 2}, duration=1500)
    assert response.y.shape == response.u.shape == response.r.shape == (2, 501)
    assert response.time.shape == (501,)
    assert response.y[:, -1] == pytest.approx([0, 2], abs=0.02)
    assert response.r[:, -1].tolist() == [0, 2]
    assert response.metrics[1].set_point is not None
    both = tuned.simulate(load={0: 1, 1: 1}, duration=100, samples=11)
    assert both.y.shape == (2, 11)
    worst = tuned.simulate(setpoint={1: 2}, duration=1500, worst_case=True)
    assert not np.allclose(worst.y, response.y)
    with pytest.raises(ValueError, match="read-only"):
        response.y[0, 0] = 1


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"duration": 1}, "/setpoint"),
        ({"setpoint": {}, "duration": 1}, "/setpoint"),
        ({"setpoint": {0: 0}, "duration": 1}, "/setpoint"),
        ({"setpoint": {2: 1}, "duration": 1}, "/setpoint/2"),
        ({"setpoint": {-1: 1}, "duration": 1}, "/setpoint/-1"),
        ({"setpoint": {True: 1}, "duration": 1}, "/setpoint"),
        ({"load": {0: "1"}, "duration": 1}, "/load/0"),
        ({"load": [1, 0], "duration": 1}, "/load"),
        ({"load": {0: 1}, "duration": 0}, "/duration"),
        ({"load": {0: 1}, "duration": 1, "samples": 2.5}, "/samples"),
        ({"load": {0: 1}, "duration": 1, "worst_case": "no"}, "/worst_case"),
    ],
)
def test_faulty_simulations_name_the_field(tuned, given, field):
    """Nothing is simulated by mistake."""
    with pytest.raises(InvalidInputError) as error:
        tuned.simulate(**given)
    assert error.value.field == field


def test_outcomes_are_compared_within_a_tolerance(tuned, infeasible):
    """Settings, objective and status count."""
    loops = tuple(replace(loop, gain=loop.gain * (1 + 1e-9)) for loop in tuned.loops)
    near = mutune.Tuned(tuned.specification, replace(tuned.tuning, loops=loops))
    assert near != tuned
    assert near.isclose(tuned)
    assert not near.isclose(tuned, rtol=1e-12)
    assert not tuned.isclose(infeasible)
    assert infeasible.isclose(infeasible)


@pytest.mark.parametrize("which", ["tuned", "infeasible"])
def test_a_file_holds_the_outcome_and_its_task(which, request, tmp_path):
    """What is read equals what was written, the proof included, and can be tuned again."""
    original = request.getfixturevalue(which)
    path = tmp_path / "result.json"
    original.save(path)
    found = mutune.load(path)
    assert found == original
    assert found.specification == original.specification
    assert "NaN" not in path.read_text()
    assert "Infinity" not in path.read_text()
    if original.tuning.certificate is not None:
        assert mutune.check(found.tuning.certificate).ok


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda text: text[:-20], ""),
        (lambda text: text[:0] + "[]", "/format"),
        (lambda text: text.replace("mutune-result", "other"), "/format"),
        (lambda text: text.replace('"version": 1', '"version": 2', 1), "/version"),
        (lambda text: text.replace('"type": "Uncertainty"', '"type": "Path"'),
         "/specification/uncertainty/type"),
        (lambda text: text.replace('"value": "independent"', '"value": "all"'),
         "/specification/arrangement"),
        (lambda text: text.replace('"n": 2', '"n": true'), "/specification/plant/n"),
        (lambda text: text.replace('"n": 2', '"m": 2'), "/specification/plant"),
    ],
)  # fmt: skip
def test_an_altered_file_is_refused(tuned, tmp_path, change, field):
    """A file makes no other class, and no record that its checks would refuse."""
    path = tmp_path / "result.json"
    tuned.save(path)
    changed = change(path.read_text())
    assert changed != path.read_text()
    path.write_text(changed)
    with pytest.raises(InvalidInputError) as error:
        mutune.load(path)
    assert error.value.field == field


def test_mu_is_drawn_on_given_axes(tuned):
    """Three curves and the level, and the axes come back."""
    figure = pytest.importorskip("matplotlib.figure").Figure()
    ax = figure.subplots()
    assert tuned.plot_mu(ax) is ax
    labels = [line.get_label() for line in ax.get_lines()]
    assert labels[:3] == ["robust performance", "robust stability", "nominal performance"]
    assert json.dumps(ax.get_lines()[0].get_ydata().max()) == json.dumps(
        tuned.tuning.curves.robust_performance.max()
    )
