"""The warning that a demand hangs on the units of outputs."""

from __future__ import annotations

import numpy as np
import pytest

from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance
from solver.tuning.output_units import output_units_warning, relative_output_sizes

WOOD_BERRY = (
    ((12.8, 16.7, 1), (-18.9, 21, 3)),
    ((6.6, 10.9, 7), (-19.4, 14.4, 3)),
)


def wood_berry(of_output: float = 1, of_input: float = 1, time: float = 1) -> MatrixPlant:
    """Return the column with its second output and input, and time, in other units."""
    return MatrixPlant(
        [
            [
                TransferFunction(
                    [k * (of_output if r else 1) / (of_input if c else 1)], [T * time, 1], L * time
                )
                for c, (k, T, L) in enumerate(row)
            ]
            for r, row in enumerate(WOOD_BERRY)
        ]
    )


@pytest.mark.parametrize("time", [1e-6, 1, 1e6])
@pytest.mark.parametrize("of_input", [1e-6, 1, 1e6])
@pytest.mark.parametrize(
    ("of_output", "warned"), [(1, False), (5, False), (100, True), (0.01, True)]
)
def test_hundredths_of_an_output_are_seen(
    of_output: float, warned: bool, of_input: float, time: float
) -> None:
    """Wood and Berry's column in hundredths is warned of, whatever the inputs' units and time."""
    warning = output_units_warning(wood_berry(of_output, of_input, time), Performance())
    assert (warning is not None) is warned
    if warning is not None:
        assert ("output 2 moves" in warning) is (of_output > 1)


def test_outputs_without_a_common_input_are_not_compared() -> None:
    """Independent loops: their units do not matter, so nothing is said."""
    nothing = TransferFunction([0], [1])
    plant = MatrixPlant(
        [[TransferFunction([1], [1, 1]), nothing], [nothing, TransferFunction([1e6], [1, 1])]]
    )
    assert output_units_warning(plant, Performance()) is None


def test_units_alike_have_outputs_alike() -> None:
    """Parallel units and plants with equal rows are not warned of."""
    assert output_units_warning(first_order(300, 1e6, 10, 0.9), Performance()) is None
    P = np.array([[1.0, 1e3], [1e3, 1.0]])
    plant = MatrixPlant([[TransferFunction([g], [1, 1]) for g in row] for row in P.tolist()])
    np.testing.assert_allclose(relative_output_sizes(plant), 1)


def test_integrators_and_single_outputs() -> None:
    """An integrating plant is measured off zero frequency; one output has nothing beside it."""
    integrator = TransferFunction([1e6], [1, 0])
    assert output_units_warning(MatrixPlant([[integrator]]), Performance()) is None
    slow = TransferFunction([1], [1, 0])
    plant = MatrixPlant([[slow, slow], [integrator, TransferFunction([-1e6], [1, 0])]])
    assert output_units_warning(plant, Performance()) is not None
