"""A level of mu proven for every plant of a box: against plants drawn from it and other codes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.deviations import Parameter
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.axis import proven_peaks
from solver.robustness.box_loop import Boxes, BoxLoop
from solver.robustness.box_models import constant, phasor, variable
from solver.robustness.box_proof import proven_box
from solver.tuning.spread import Spread

USUAL = Uncertainty.from_error(0.2, 1)
SLH = first_order(2, 1.0, 100.0, 0.949)
LATE = first_order(3, 1.0, 50.0, 0.3, 2.0)
WOOD_BERRY = MatrixPlant(
    [
        [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
        [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
    ]
)
INTEGRATING = ParallelPlant(
    2, TransferFunction([1.0, 0.3], [4.0, 1.0, 0.0]), TransferFunction([0.2], [3.0, 1.0], 0.5)
)
LOOPS = {
    "slh": (
        SLH, (Controller(50.45, 100.7), Controller(17.87, 3.36)), 27.7, Spread(interaction=0.02)
    ),
    "late": (LATE, (Controller(8.0, 45.0),) * 3, 40.0, Spread(dead_time=0.3, interaction=0.1)),
    "pid": (
        LATE, (Controller(8.0, 45.0, 1.0), *(Controller(7.0, 40.0),) * 2), 40.0, Spread(0.1, 0.2)
    ),
    "column": (
        WOOD_BERRY, (Controller(0.2, 9.0), Controller(-0.06, 10.0)), 30.0,
        Spread(dead_time=0.1, interaction=0.1),
    ),
    "each": (
        SLH, (Controller(40.0, 100.0), Controller(19.0, 4.0)), 30.0, Spread(0.05, each_unit=True)
    ),
    "integrating": (
        INTEGRATING, (Controller(0.4, 30.0), Controller(0.3, 40.0)), 60.0,
        Spread(time_constant=0.1, interaction=0.2),
    ),
}  # fmt: skip


def peak(plant, loops, tau_p):
    """The peak over the whole axis, as it is proven for one plant."""
    return proven_peaks(
        plant, USUAL, Performance(tau_p=tau_p), loops
    ).peaks.robust_performance.value


@pytest.mark.parametrize("name", LOOPS)
def test_no_plant_drawn_from_a_box_exceeds_the_proven_level(name):
    """Corners and draws stay below; the level just below the highest of them is not proven."""
    plant, loops, tau_p, spread = LOOPS[name]
    axes = spread.axes(plant)
    rng = np.random.default_rng(3)
    shares = [*itertools.product((-1.0, 1.0), repeat=len(axes))]
    shares += [tuple(share) for share in rng.uniform(-1, 1, (3, len(axes)))]
    top = max(peak(spread.plant_at(plant, share), loops, tau_p) for share in shares)
    assert np.isfinite(top)
    proof = proven_box(plant, USUAL, Performance(tau_p=tau_p), loops, axes, levels=(top * 1.05,))
    assert proof.proven
    low = proven_box(
        plant, USUAL, Performance(tau_p=tau_p), loops, axes, levels=(top * (1 - 1e-4),), work=0.1
    )
    assert not low.proven
    assert low.count > 0


def test_the_level_just_above_the_worst_corner_is_proven():
    """One part in ten thousand above, the proof still stands; nothing of it is open."""
    plant, loops, tau_p, spread = LOOPS["slh"]
    top = max(peak(spread.plant_at(plant, (side,)), loops, tau_p) for side in (-1.0, 1.0))
    proof = proven_box(
        plant, USUAL, Performance(tau_p=tau_p), loops, spread.axes(plant), levels=(top * 1.0001,)
    )
    assert proof.proven
    assert proof.open is None


def test_a_plant_in_the_box_that_is_not_stable_is_never_covered():
    """Settings that a plant 30 % later makes unstable: no level at all is proven."""
    late = first_order(1, 1.0, 10.0, 0.0, 1.0)
    loops = (Controller(14.0, 10.0),)
    proof = proven_box(
        late, Uncertainty.from_error(0.01, 0), Performance(tau_p=50.0), loops,
        [Parameter("dead_time", 0.3, None)], levels=(1e3,), work=0.05,
    )  # fmt: skip
    assert not proof.proven


def test_work_has_an_end_and_what_is_left_is_told():
    """With little work the rest lies within the frequencies and deviations that are told."""
    plant, loops, tau_p, spread = LOOPS["slh"]
    proof = proven_box(
        plant, USUAL, Performance(tau_p=tau_p), loops, spread.axes(plant),
        levels=(1.0005,), work=1e-3,
    )  # fmt: skip
    assert not proof.proven
    assert not proof.exceeded
    assert proof.count > 0
    (low, high), ((a, b),) = proof.open
    assert low < high
    assert -0.02 <= a < b <= 0.02


@pytest.mark.parametrize("rate", [1e-6, 1e6])
def test_the_proof_knows_no_unit_of_time(rate):
    """The same plant in other units takes the same boxes."""
    plant, loops, tau_p, spread = LOOPS["slh"]
    there = first_order(2, 1.0, 100.0 * rate, 0.949)
    scaled = [Controller(each.gain, each.integral_time * rate) for each in loops]
    found = [
        proven_box(p, u, Performance(tau_p=t), c, spread.axes(p), levels=(1.002,)).boxes
        for p, u, t, c in (
            (plant, USUAL, tau_p, loops),
            (there, Uncertainty.from_error(0.2, rate), tau_p * rate, scaled),
        )
    ]
    assert found[0] == pytest.approx(found[1], rel=0.02)


def test_the_matrix_of_a_box_encloses_those_of_its_plants():
    """F of points of a box, its coefficients at them, and the radius: congruent by one matrix."""
    rng = np.random.default_rng(0)
    plant, loops, tau_p, spread = LOOPS["column"]
    axes, demand = spread.axes(plant), Performance(tau_p=tau_p)
    blocks, controllers = group_loops(plant, loops, USUAL)
    loop = BoxLoop(blocks, controllers, USUAL, demand, tuple(axes))
    level, tried = 30.0, 0
    for _ in range(24):
        width = rng.choice([0.01, 0.1, 0.3])
        low = 10 ** rng.uniform(-3, 0)
        middle = rng.uniform(-1 + width, 1 - width, len(axes))
        box = Boxes(
            np.array([[low, *(middle - width)]]), np.array([[low * (1 + width), *(middle + width)]])
        )
        X = loop.scales(box)
        ((P, radius),) = loop.forms(box, X, level)
        if not np.isfinite(radius).all():
            continue
        tried += 1

        def form(z, box=box, X=X):
            point = 0.5 * (box.low + box.high)[0] + 0.5 * (box.high - box.low)[0] * z
            omega = point[:1]
            G = spread.plant_at(plant, tuple(point[1:]))
            response = np.array(
                [[G.element(r, c)(1j * omega)[0] for c in range(2)] for r in range(2)]
            )
            c = np.array([each.response(omega)[0] for each in controllers])
            M = USUAL.magnitude(omega) ** 2 * np.abs(c) ** 2 * X[0] + demand.magnitude(omega) ** 2
            E = np.eye(2) + response * c
            return (
                level**2 * (E / M) @ E.conj().T - (response / X[0]) @ response.conj().T - np.eye(2)
            )

        z = rng.uniform(-1, 1, 1 + len(axes))
        products = [
            z[i] * z[j] for i, j in itertools.combinations_with_replacement(range(z.size), 2)
        ]
        here = np.einsum("v,vij->ij", np.array([1, *z, *products]), P[:, 0])
        # T F T^H with T F(0) T^H = I: its eigenvalues are those of F(0)^-1 F(z).
        expected = np.sort(np.linalg.eigvals(np.linalg.solve(form(0 * z), form(z))).real)
        error = np.abs(np.linalg.eigvalsh(here) - expected).max()
        assert error <= np.linalg.norm(radius[0], 2) + 1e-9 * np.abs(expected).max()
    assert tried > 12


def test_models_enclose_products_quotients_and_phases():
    """Values at drawn points lie within the radius of the polynomial."""
    rng = np.random.default_rng(5)
    z = rng.uniform(-1, 1, (2, 400))
    x = variable(np.array([2.0]), np.array([0.5]), 0, 2)
    y = variable(np.array([0.3]), np.array([0.2]), 1, 2)
    u, v = 2 + 0.5 * z[0], 0.3 + 0.2 * z[1]
    one = constant(np.array([1.0 + 0j]), 2)
    cases = [
        (x * y * x, u * v * u),
        ((one + (x * y).times(1j)).reciprocal(), 1 / (1 + 1j * u * v)),
        (phasor(x * y) * x, np.exp(-1j * u * v) * u),
    ]
    powers = np.array([np.ones(400), z[0], z[1], z[0] ** 2, z[0] * z[1], z[1] ** 2])
    for model, values in cases:
        error = np.abs(model.P[:, 0] @ powers - values)
        assert error.max() <= model.radius[0]
        assert model.radius[0] < 0.5
