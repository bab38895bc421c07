"""Sums of transfer functions by compiled code beside the functions themselves."""

from dataclasses import replace

import numpy as np
import pytest
from zoo import COLUMN, USUAL

from solver.model.blocks import reduce
from solver.model.mixed_plant import MixedPlant
from solver.model.sums import Entry, squares, summed, sums
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Uncertainty

LAG = TransferFunction((3.0,), (10.0, 1.0), 2.0)
LEAD = TransferFunction((2.0, 0.5, -1.0), (4.0, 0.3, 1.0))
INTEGRATOR = TransferFunction((1.0,), (1.0, 0.2, 0.0))
OMEGA = np.geomspace(1e-3, 10, 7)
POINTS = np.array([1e-9j, 0.03j, 0.2 + 0.7j, -0.1 + 4j, 50j, 1e6j])


def test_entries_are_sums_of_multiples() -> None:
    """Several terms add up in their entry; what no entry names is zero."""
    table = sums([Entry(0, 1, 2.0, LAG), Entry(0, 1, -0.5, LEAD), Entry(1, 0, 1.0, INTEGRATOR)])
    G = summed(table, 2, 2, POINTS)
    assert G[:, 0, 1] == pytest.approx(2 * LAG(POINTS) - 0.5 * LEAD(POINTS), rel=1e-13)
    assert G[:, 1, 0] == pytest.approx(INTEGRATOR(POINTS), rel=1e-13)
    assert not G[:, 0, 0].any()
    assert not G[:, 1, 1].any()


def test_powers_of_s_do_not_overflow() -> None:
    """A function of order 20 is as far out as its leading coefficients say."""
    steep = TransferFunction((1.0, *[0.0] * 19), np.poly(np.full(20, -1.0)).tolist())
    s = 1j * np.array([1e2, 1e14, 1e100])
    found = summed(sums([Entry(0, 0, 1.0, steep)]), 1, 1, s)[:, 0, 0]
    assert found == pytest.approx(steep(s), rel=1e-12)
    assert found[2] * s[2] == pytest.approx(1, rel=1e-12)


def test_a_pole_reads_as_huge() -> None:
    """At s = 0 an integrator is a large number, not one that spoils the rest."""
    found = summed(sums([Entry(0, 0, 1.0, INTEGRATOR)]), 1, 1, np.zeros(1, dtype=complex))
    assert abs(found[0, 0, 0]) > 1e70
    assert np.isfinite(found).all()


def test_squares_are_those_of_a_column() -> None:
    """Rows that no entry names are zero."""
    found = squares(sums([Entry(0, 0, 1.0, LAG), Entry(2, 0, 3.0, LEAD)]), 3, POINTS)
    expected = [np.abs(LAG(POINTS)) ** 2, 0 * POINTS.real, np.abs(3 * LEAD(POINTS)) ** 2]
    assert found == pytest.approx(np.stack(expected, axis=1), rel=1e-13)


@pytest.mark.parametrize("outputs", [None, Uncertainty.from_error(0.1, 2)])
def test_blocks_of_a_matrix_are_what_it_is(outputs) -> None:
    """Also where its outputs err, and in the units of permitted errors."""
    e = np.array([2.0, 5.0])
    blocks = reduce(COLUMN, [[0], [1]], replace(USUAL, outputs=outputs), tuple(e))
    (G,) = blocks.known(1j * OMEGA)
    assert pytest.approx(COLUMN.response(OMEGA) * e / e[:, None], rel=1e-13) == G


def test_blocks_of_shared_inputs_are_what_the_loops_see() -> None:
    """M_y G M_u, as matrices."""
    plant = MixedPlant(COLUMN, ((1.0, 0.5), (0.0, 2.0)), ((1.0, 0.0), (-3.0, 1.0)), shared=True)
    blocks = reduce(plant, [[0], [1]], USUAL)
    assert blocks.inputs_shared
    (G,) = blocks.known(1j * OMEGA)
    assert pytest.approx(plant.response(OMEGA), rel=1e-12) == G
