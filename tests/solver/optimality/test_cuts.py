"""Cuts hold for every controller, and exclude no box that holds good settings."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from zoo import COLUMN, SLH, THREE, interactions

from solver.model.blocks import reduce
from solver.model.plants import first_order
from solver.model.weights import Performance, Structure, Uncertainty
from solver.mu.scaling import sweep
from solver.optimality.bound import BranchAndBound
from solver.optimality.conditions import Conditions, robust_limits
from solver.optimality.cuts import NU, cuts
from solver.optimality.infeasibility import least_weights
from solver.optimality.samples import samples
from solver.optimality.settings_box import Demand, weighted
from solver.tuning.goals import MuGoal, TauGoal
from solver.tuning.objective import FORBIDDEN, LoopObjective
from solver.tuning.search import Freedom, GroupingSearch
from solver.tuning.specification import ControllerKind, Specification

OMEGA = np.geomspace(1e-3, 20, 12)


@st.composite
def loops(draw, mu=False):
    """A plant with at most three different PI, or one PID, as an objective on `OMEGA`."""
    which = draw(st.integers(0, 9))
    if which == 0:
        plant, groups = COLUMN, ((0,), (1,))
    elif which == 1:
        plant = THREE
        groups = draw(st.sampled_from([((0, 1, 2),), ((0, 2), (1,)), ((2,), (0,), (1,))]))
    elif which == 2:
        plant = first_order(6, 1, draw(st.floats(1, 100)), draw(interactions(-0.19, 0.99)), 0.5)
        groups = ((0,), (1, 2), (3, 4, 5))
    else:
        n = draw(st.integers(1, 50))
        low = -0.99 / (n - 1) if n > 1 else 0.0
        plant = first_order(
            n, draw(st.sampled_from([1.0, -2.0])), draw(st.floats(1, 100)),
            draw(interactions(low, 0.99)), draw(st.sampled_from([0.0, 1.5])),
        )  # fmt: skip
        first = draw(st.integers(1, n))
        groups = (tuple(range(first)), tuple(range(first, n)))[: 1 + (first < n)]
    structure = draw(st.sampled_from(list(Structure)))
    demand = Performance(draw(st.floats(1.5, 3)), draw(st.sampled_from([0.0, 0.1])))
    uncertainty = Uncertainty.from_error(0.2, 1, structure)
    signs = np.array([math.copysign(1, plant.element(g[0], g[0]).static_gain) for g in groups])
    kind = ControllerKind.PI
    if len(groups) == 1 and draw(st.booleans()):
        kind = ControllerKind.PID
    goal = TauGoal(demand)
    if mu:
        goal = MuGoal(demand.with_tau_p(draw(st.floats(0.5, 200))))
    return LoopObjective(
        reduce(plant, groups, uncertainty), uncertainty, goal, kind, signs, OMEGA,
    )  # fmt: skip


def responses(objective, theta):
    return np.stack([c.response(objective.omega) for c in objective.controllers(theta)], axis=-1)


def cut_at(objective, theta):
    """The cuts of all frequencies made at `theta`, the controllers there and the plant."""
    blocks, omega, c = objective.blocks, objective.omega, responses(objective, theta)
    G, u = blocks.packed(omega), objective.uncertainty.magnitude(omega) ** 2
    demanded = np.exp(np.clip(objective.levels(theta, omega), -10, 20))
    y = np.zeros((omega.size, blocks.n_scales))
    rows = blocks.squared(objective.uncertainty, omega)
    sweep(G, c, rows, demanded, blocks.layout, all_free=True, nu=NU, cold=True, y=y)
    return cuts(c, G, u, demanded, blocks.layout, np.exp(y)), c, G


def both_sides(above, norm, c):
    """Both forms of a cut at the controllers, each (k,)."""
    psi = np.ones((c.shape[0], 1))
    for j in range(c.shape[1]):
        psi = np.concatenate([psi, psi * c[:, j : j + 1]], axis=1)
    return [np.einsum("ki,kij,kj->k", psi.conj(), form, psi).real for form in (above, norm)]


def right_side(cut, c):
    """The level that a cut permits the controllers."""
    level, length = both_sides(*cut[:2], c)
    return level / length


settings_near = st.lists(st.floats(-2, 2), min_size=6, max_size=6)


@settings(max_examples=60, deadline=None)
@given(loops(), settings_near, settings_near)
def test_a_cut_holds_for_all_settings(objective, here, there):
    """No settings have a level above the right side of a cut made elsewhere (hence the proof)."""
    middle = np.array([2.0, 3.0, 0.0] if objective.per_controller == 3 else [2.0, 3.0] * 3)
    size = objective.per_controller * objective.signs.size
    theta, other = (middle[:size] + np.array(x)[:size] for x in (here, there))
    cut, c, G = cut_at(objective, theta)
    there = responses(objective, other)
    reach = (1 + np.abs(c).sum(axis=1)) * (1 + np.abs(there).sum(axis=1))
    room = 1e-11 * (1 + reach * (1 + np.abs(G).sum(axis=(1, 2)))) ** 2
    elsewhere = np.exp(objective.levels(other, OMEGA))
    level, length = both_sides(*cut[:2], there)
    # Where the terms of zeta nearly cancel, rounding is that of the terms, as the proof takes it.
    longest = both_sides(*map(np.abs, cut[:2]), np.abs(there))[1]
    assert (level + room * longest >= elsewhere * (1 - 1e-9) * length).all()


@pytest.mark.parametrize(
    ("groups", "loops"),
    [
        (((0, 1),), [40, 60]),
        (((0,), (1,)), [47.65, 101.2, 18.9, 2.36]),
        (((0,), (1,)), [40, 60] * 2),
    ],
)
@pytest.mark.parametrize("structure", list(Structure))
def test_a_cut_is_sharp_where_it_is_made(groups, loops, structure):
    """At its own settings its right side is the level, also where eigenvalues meet."""
    uncertainty = Uncertainty.from_error(0.2, 1, structure)
    objective = LoopObjective(
        reduce(SLH, groups, uncertainty), uncertainty,
        TauGoal(Performance()), ControllerKind.PI, np.ones(len(groups)), OMEGA,
    )  # fmt: skip
    theta = np.log(loops)
    cut, c, _ = cut_at(objective, theta)
    assert np.log(right_side(cut, c)) == pytest.approx(objective.levels(theta, OMEGA), abs=2e-3)


def test_a_cut_stays_sharp_along_the_strong_direction():
    """A gain that is half as high again takes it off the level by little, at 40 : 1."""
    objective = LoopObjective(
        reduce(SLH, ((0,), (1,))), Uncertainty.from_error(0.2, 1), TauGoal(Performance()),
        ControllerKind.PI, np.ones(2), np.array([0.03]),
    )  # fmt: skip
    omega = objective.omega
    here, there = np.log([[47.65, 101.2, 18.9, 2.36], [70, 101.2, 18.9, 2.36]])
    cut, _, _ = cut_at(objective, here)
    true = objective.levels(there, omega)
    assert np.log(right_side(cut, responses(objective, there))) == pytest.approx(true, abs=0.1)


@settings(max_examples=40, deadline=None)
@given(loops() | loops(mu=True), settings_near, st.lists(st.floats(0, 1), min_size=6, max_size=6),
       st.floats(0.01, 1), st.floats(0, 5))  # fmt: skip
def test_no_settings_in_a_box_are_better_than_its_bound(objective, at, within, width, target):
    """The bound of a box is at most the value of any settings in it, frequency by frequency."""
    per = objective.per_controller
    size = per * objective.signs.size
    middle = [2.0, -1.0, 0.0] if per == 3 else [2.0, -1.0] * 3
    low = np.array(middle)[:size] + np.array(at)[:size]
    point = low + width * np.array(within)[:size]
    v = np.exp(point)  # k, k/tau_I and tau_D
    settings = v.reshape(-1, per).copy()
    settings[:, 1] = settings[:, 0] / settings[:, 1]
    theta = np.log(settings).ravel()
    level = objective.levels(theta, OMEGA)
    value = objective.goal.attained(level, OMEGA)
    value = np.where(level <= FORBIDDEN, np.inf, value).max()
    known = samples(objective.blocks, objective.uncertainty, 1j * OMEGA)
    asked = objective.goal.performance
    demand = Demand(asked.max_peak, asked.offset, asked.tau_p or 0.0)
    if asked.tau_p is None:
        target += 1
    else:
        value, target = value / 2, 0.4 * target - 1.4
        known = replace(known, u=known.u * math.exp(-2 * target))
    conditions = Conditions(
        objective.blocks, known, demand, objective.signs, target, np.zeros((0, size))
    )
    found = conditions.examine(np.exp(low), np.exp(low + width), conditions.all_points, -math.inf)
    assert found.s <= max(value, -60) + 1e-7 * (1 + (value > 5)) or found.s == -math.inf
    if found.split is not None:
        # What was cut off is excluded at the target.
        inside = (found.low <= v * (1 + 1e-9)).all() and (v <= found.high * (1 + 1e-9)).all()
        assert inside or value >= target


def excludes(w, a, b):
    """Whether the weighted sum of conditions b + a e >= 0 is negative over the box of e."""
    places = np.array(list(product((-1, 0, 1), repeat=a.shape[1])))
    return weighted(w, b[:, None] + a @ places.T, np.empty(len(places)))[0] < 0


def test_weights_are_those_of_a_linear_program():
    """The least value is the one that HiGHS finds, as the best of the worst conditions."""
    rng = np.random.default_rng(4)
    for _ in range(50):
        size = int(rng.integers(2, 5))
        a, b = rng.standard_normal((40, size)), rng.standard_normal(40)
        w, e = least_weights(a, b)
        best = linprog(
            np.append(np.zeros(size), -1.0), np.column_stack([-a, np.ones(40)]), b,
            bounds=[(-1, 1)] * size + [(None, None)],
        ).x[-1]  # fmt: skip
        assert w @ b + np.abs(w @ a).sum() == pytest.approx(best, abs=1e-8)
        assert (b + a @ e).min() == pytest.approx(best, abs=1e-8)


def test_conditions_with_a_common_point_are_never_excluded():
    """Linear conditions that a point of the box meets have no proof of the contrary."""
    rng = np.random.default_rng(5)
    for _ in range(200):
        size = int(rng.integers(2, 5))
        a = rng.standard_normal((30, size)) * np.exp(rng.standard_normal((30, 1)))
        point = rng.uniform(-1, 1, size)
        b = -a @ point + rng.exponential(1e-9, 30)
        w, _ = least_weights(a, b)
        assert not excludes(w, a, b)
        assert w.sum() == pytest.approx(1)


def test_conditions_without_a_common_point_are_excluded():
    """e_1 >= 1/2 + t and e_1 <= 1/2 - t, among many that hold, have none."""
    rng = np.random.default_rng(6)
    for _ in range(50):
        a, b = rng.standard_normal((40, 3)), np.full(40, 10.0)
        a[7], b[7] = (1, 0, 0), -0.5 - 1e-6
        a[8], b[8] = (-1, 0, 0), 0.5 - 1e-6
        w, _ = least_weights(a, b)
        assert excludes(w, a, b)


@settings(max_examples=40, deadline=None)
@given(loops(), st.lists(st.floats(-3, 6), min_size=6, max_size=6))
def test_no_robustly_stable_settings_are_beyond_the_limits(objective, theta):
    """A gain or k/tau_I above its limit leaves no level at one of the frequencies."""
    per = objective.per_controller
    rows = np.array(theta)[: per * objective.signs.size].reshape(-1, per)
    leads = np.exp(rows[:, 2:]) * [[0.9, 1.2]] if per == 3 else np.empty((0, 2))
    known = samples(objective.blocks, objective.uncertainty, 1j * OMEGA)
    limits = robust_limits(objective.blocks, known, objective.signs, leads).reshape(-1, per)
    v = np.exp(rows)
    v[:, 1] = v[:, 0] / v[:, 1]
    if (v > limits).any():
        assert objective.levels(rows.ravel(), OMEGA).min() <= FORBIDDEN


def test_an_unstable_loop_is_excluded_by_points_to_the_right_of_the_axis():
    """Integral action that destabilises a dead time meets the demand on the axis, not beside it."""
    plant = first_order(1, 2, 30, 0, 3)
    task = Specification(plant, Uncertainty.from_error(0.2, 1), Performance())
    search = GroupingSearch(task, Freedom.usual(task, ((0,),)), lambda: None)
    bound = BranchAndBound(search.problem, peaks=np.ones(1), value=5.6)
    conditions = bound._conditions  # noqa: SLF001 - its points are what is looked at
    settings = np.array([0.35, 7.0])
    points = conditions.samples.s
    for used, excluded in (
        (np.flatnonzero(points.real == 0), False),
        (np.arange(points.size), True),
    ):
        found = conditions.examine(0.999 * settings, 1.001 * settings, used, -math.inf)
        assert (found.split is None) is excluded
