"""Coloured residuals are recognised, and readings weighted by what they add."""

import numpy as np
import pytest
from drawn import Lag, lag, record

from solver.identification.beginning import starts
from solver.identification.colour import Colour, colour_of
from solver.identification.findings import fitted_elements
from solver.identification.fitting import fit as least
from solver.identification.problem import PlantStructure, limits, matrix_rows
from solver.identification.record import Record
from solver.identification.row_fit import fit_row
from solver.identification.selection import Allowed


def forgetting(generator, time, memory):
    """Return a disturbance of variance 1 at any times, by the Cholesky factor of its covariance."""
    apart = np.abs(time[:, None] - time[None, :])
    factor = np.linalg.cholesky(np.exp(-apart / memory) + 1e-10 * np.eye(time.size))
    return factor @ generator.standard_normal(time.size)


def test_whitening_is_the_inverse_cholesky_factor_whatever_is_missing():
    """The filter gives what the covariance of the readings that count gives."""
    generator = np.random.default_rng(0)
    time = np.cumsum(generator.uniform(0.2, 3.0, 60))
    seen = generator.random(60) > 0.3
    columns = generator.standard_normal((60, 2))
    colour = Colour(5.0, 0.4)
    apart = np.abs(time[seen][:, None] - time[seen][None, :])
    factor = np.linalg.cholesky(np.exp(-apart / 5) + 0.4 * np.eye(int(seen.sum())))
    white = colour.whitened(time, seen, columns)
    assert white[seen] == pytest.approx(np.linalg.solve(factor, columns[seen]))
    assert not np.any(white[~seen])
    assert colour.whitened(time, seen, columns[:, 0]) == pytest.approx(white[:, 0])


def test_white_noise_has_no_colour():
    """Nor has a residual that is nothing at all."""
    time, seen = np.arange(500.0), np.ones(500, dtype=bool)
    noise = np.random.default_rng(1).standard_normal(500)
    assert colour_of(time, seen, noise) is None
    assert colour_of(time, seen, 0 * noise) is None


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_memory_and_white_part_are_found_in_any_units(unit):
    """A disturbance that forgets within 20 samples, read with noise."""
    generator = np.random.default_rng(2)
    time = np.arange(2000.0)
    left = forgetting(generator, time, 20.0) + 0.5 * generator.standard_normal(2000)
    found = colour_of(unit * time, np.ones(2000, dtype=bool), left / unit)
    assert 12 < found.memory / unit < 30
    assert 0.12 < found.share < 0.4


def test_slow_disturbances_mislead_less_than_a_plain_fit():
    """Lags of random plants under a slow disturbance: half of them are nearer to the truth."""
    away = {"weighted": [], "plain": []}
    for seed in range(12):
        generator = np.random.default_rng(seed)
        truth = [lag(generator), lag(generator)]
        clean = record([truth], generator, noise=0.0)
        y = clean.outputs["y0"] + 0.3 * forgetting(generator, clean.time, 30.0)
        one = Record(clean.time, clean.inputs, {"y0": y})
        row = matrix_rows([one], starts([one], PlantStructure.MATRIX))[0]
        fit = fit_row(row, Allowed(1, integrating=False), limits([one]))
        plain = least(fit.row.plain(), fit.solved.kinds, fit.solved.shapes, fit.limits)
        for name, elements in (("weighted", fit.elements), ("plain", plain.elements)):
            away[name] += [
                abs(np.log(e.lag / t.first)) for e, t in zip(elements, truth, strict=True)
            ]
    assert np.median(away["weighted"]) < 0.7 * np.median(away["plain"])


def test_intervals_hold_under_a_slow_disturbance():
    """95 of 100 parameters of one element, or more."""
    hits = 0
    for seed in range(25):
        generator = np.random.default_rng(seed)
        clean = record([[Lag(2, 20, 0, 3)]], generator, noise=0.0)
        y = clean.outputs["y0"] + 0.2 * forgetting(generator, clean.time, 30.0)
        one = Record(clean.time, clean.inputs, {"y": y})
        row = matrix_rows([one], starts([one], PlantStructure.MATRIX))[0]
        fit = fit_row(row, Allowed(1, integrating=False), limits([one]))
        estimates = fitted_elements(fit, "y", ("u0",))[0].estimates
        hits += sum(
            e.low <= truth <= e.high for e, truth in zip(estimates, (2, 20, 3), strict=True)
        )
    assert hits >= 0.95 * 75
