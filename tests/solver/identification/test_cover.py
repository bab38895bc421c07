"""Weights above errors: valid, small, and as good as any of their order."""

import itertools

import numpy as np
import pytest
from drawn import Lag, record

from solver.identification.cover import cover, cover_by_error
from solver.identification.errors import matrix_errors, parallel_errors
from solver.identification.identify import identify
from solver.identification.problem import PlantStructure
from solver.model.errors import InvalidInputError
from solver.model.weights import Uncertainty

OMEGA = np.geomspace(1e-2, 1e4, 300)


def ucover_family():
    """Relative errors of the family in MATLAB's example of `ucover`: a nominal 2/(s - 2)."""
    s = 1j * OMEGA
    nominal = 2 / (s - 2)
    family = (
        1 / (0.06 * s + 1),
        (1 - 0.02 * s) / (1 + 0.02 * s),
        50**2 / (s**2 + 10 * s + 50**2),
        70**2 / (s**2 + 28 * s + 70**2),
        2.4 / (s - 2.2) / nominal,
        1.6 / (s - 1.8) / nominal,
    )
    return np.max([np.abs(member - 1) for member in family], axis=0)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_published_family_is_covered_at_every_frequency(order):
    """Above the error everywhere, touching it somewhere, stable and minimum phase."""
    error = ucover_family()
    weight = cover(OMEGA, error, order)
    ratio = np.abs(weight.response(OMEGA)) / error
    assert ratio.min() >= 1
    assert ratio.min() < 1 + 1e-6
    assert np.all(weight.poles.real < 0)
    assert np.all(weight.zeros.real < 0)


def test_family_of_a_textbook_is_covered_where_its_printed_weight_is_not():
    """Skogestad and Postlethwaite, section 7.4: gain, lag and dead time between 2 and 3."""
    omega = np.geomspace(1e-2, 20, 200)
    s, values = 1j * omega, np.linspace(2, 3, 11)
    nominal = 2.5 / (2.5 * s + 1)
    error = np.zeros(omega.size)
    for gain, lag, dead in itertools.product(values, repeat=3):
        member = gain * np.exp(-dead * s) / (lag * s + 1)
        error = np.maximum(error, np.abs(member / nominal - 1))
    printed = np.abs((4 * s + 0.2) / (1.6 * s + 1)) / error
    assert printed.min() == pytest.approx(0.87, abs=0.01)
    for order, largest in ((1, 1.7), (2, 1.65)):
        ratio = np.abs(cover(omega, error, order).response(omega)) / error
        assert ratio.min() >= 1
        assert ratio.max() < largest


def test_higher_orders_come_closer():
    """And none of first order comes closer than ours, of many tried."""
    error = ucover_family()
    worst = [np.max(np.abs(cover(OMEGA, error, m).response(OMEGA)) / error) for m in (0, 1, 2)]
    assert worst[0] > 2 * worst[1] > 2.5 * worst[2]
    best = np.inf
    for zero in np.geomspace(0.1, 100, 60):
        for pole in np.geomspace(1, 1000, 60):
            shape = np.abs((1j * OMEGA / zero + 1) / (1j * OMEGA / pole + 1)) / error
            best = min(best, shape.max() / shape.min())
    assert worst[1] <= best * (1 + 1e-3)


def test_weight_comes_back_from_itself():
    """The error of a weight of order m is covered by that weight."""
    for truth in (([2.0, 0.2], [0.5, 1.0]), ([3.0, 1.1, 0.1], [1.0, 1.4, 1.0])):
        error = np.abs(np.polyval(truth[0], 1j * OMEGA) / np.polyval(truth[1], 1j * OMEGA))
        weight = cover(OMEGA, error, len(truth[0]) - 1)
        assert np.abs(weight.response(OMEGA)) == pytest.approx(error, rel=2e-3)


def test_epsilon_and_theta_come_back():
    """Of their own error, and in other units of time."""
    for scale in (1.0, 1e-5, 1e6):
        w = Uncertainty.from_error(0.2, 1.5 * scale)
        epsilon, theta = cover_by_error(OMEGA / scale, w.magnitude(OMEGA / scale))
        assert epsilon == pytest.approx(0.2, rel=0.01)
        assert theta == pytest.approx(1.5 * scale, rel=0.01)
    assert cover_by_error(OMEGA, np.full(300, 2.5)) is None


def test_no_error_is_refused():
    """A weight of nothing is none."""
    with pytest.raises(InvalidInputError, match="not all zero"):
        cover(OMEGA, np.zeros(300), 1)


def test_parallel_errors_are_those_of_the_whole_matrix():
    """Two eigenvalues instead of a matrix."""
    generator = np.random.default_rng(0)
    for n in (1, 2, 5):
        pairs = generator.standard_normal((2, 2, 8)) + 1j * generator.standard_normal((2, 2, 8))
        whole = [
            np.eye(n) * (g - i)[:, None, None] + np.ones((n, n)) * i[:, None, None]
            for g, i in pairs
        ]
        size, diagonal = parallel_errors(n, pairs[0], pairs[1])
        full, part = matrix_errors(whole[0], whole[1])
        if n > 1:
            assert size == pytest.approx(full)
            assert diagonal == pytest.approx(part)


@pytest.mark.parametrize("structure", [PlantStructure.MATRIX, PlantStructure.PARALLEL])
def test_cover_holds_for_plants_of_the_fitted_distribution(structure):
    """For 99 of 100 that were not used to find it, at frequencies that were not either."""
    own, other = Lag(2, 20, 0, 3), Lag(0.9, 25, 0, 4)
    found = identify(
        [record([[own, other], [other, own]], np.random.default_rng(3))], structure=structure
    )
    omega = np.geomspace(found.cover.omega[0], found.cover.omega[-1], 777)
    drawn = found.draw(400, np.random.default_rng(99), omega)
    size, _ = matrix_errors(found.plant.response(omega), drawn)
    above = found.cover.weight.magnitude(omega) >= size
    assert np.count_nonzero(np.all(above, axis=1)) >= 0.99 * 400
    for curve in found.cover.curves:
        assert np.all(found.cover.weight.magnitude(found.cover.omega) >= curve.size)
