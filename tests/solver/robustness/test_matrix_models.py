"""Taylor models of matrices hold what they stand for, whatever the size and the scale."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.robustness.matrix_models import DEGREE, Models, sigma_max_bound

COUNT, POINTS = 4, np.linspace(-1, 1, 21)


def drawn(size: int, scale: float, seed: int) -> Models:
    """Return models on a few intervals, exact, that turn by a third."""
    rng = np.random.default_rng(seed)
    shape = (DEGREE, COUNT, size, size)
    P = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    P *= scale * 0.3 ** np.arange(DEGREE)[:, None, None, None] / size
    P[0] += 2 * scale * np.eye(size)
    return Models(P, np.zeros(shape[1:]))


def at(models: Models, t: float) -> NDArray[np.complex128]:
    """Return the polynomials' values at t, (c, p, q)."""
    return np.asarray(np.tensordot(t ** np.arange(DEGREE), models.P, axes=1))


def held(models: Models, t: float, value: NDArray[np.complex128]) -> bool:
    """Whether a value at t is within the radius; it is itself right to some units of rounding."""
    spare = 1e-14 * np.abs(value).max()
    return bool((np.abs(at(models, t) - value) <= models.radius + spare).all())


@pytest.mark.parametrize("scale", [1e-30, 1.0, 1e30])
@pytest.mark.parametrize("size", [1, 2, 3])
def test_products_and_inverses_hold_the_values(size: int, scale: float) -> None:
    """At every point of the intervals."""
    left, right = drawn(size, scale, 1), drawn(size, scale, 2)
    product, (inverse, known) = left @ right, left.inverse()
    assert known.all()
    for t in POINTS:
        assert held(product, t, at(left, t) @ at(right, t))
        assert held(inverse, t, np.linalg.inv(at(left, t)))
    assert (inverse.radius < 0.2 / scale).all()


@pytest.mark.parametrize("scale", [1e-200, 1e-30, 1.0, 1e100])
@pytest.mark.parametrize("size", [1, 2, 3])
def test_bound_of_the_greatest_singular_value_is_above_it_and_near(size: int, scale: float) -> None:
    """At every point; not far above the greatest of them."""
    models = drawn(size, scale, 3)
    seen = np.max([np.linalg.norm(at(models, t), 2, axis=(1, 2)) for t in POINTS], axis=0)
    bound = sigma_max_bound(models)
    assert (bound >= seen).all()
    assert (bound <= 1.2 * seen).all()


@pytest.mark.parametrize("size", [1, 2, 3])
def test_what_is_not_known_has_no_bound(size: int) -> None:
    """A zero has no inverse, nor has NaN, and the neighbouring intervals are as they were."""
    models = drawn(size, 1.0, 4)
    models.P[:, 1] = 0
    models.P[2, 2, 0, 0] = np.nan
    _, known = models.inverse()
    assert known.tolist() == [True, False, False, True]
    bound = sigma_max_bound(models)
    assert np.isinf(bound).tolist() == [False, False, True, False]
    assert bound[1] < 1e-300
