import numpy as np
import pytest

from solver.model.blocks import group_loops, reduce
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure
from solver.robustness.curves import LoopAnalysis

OMEGA = np.geomspace(1e-4, 1e2, 25)


def unreduced(plant, loops, uncertainty, performance):
    """N_RP of the whole plant, (k, 2n, 2n), from eq. 31 of SLH."""
    G = plant.response(OMEGA)
    c = np.stack([loop.response(OMEGA) for loop in loops], axis=1)
    S = np.linalg.inv(np.eye(plant.n) + G * c[:, None, :])
    CS = c[:, :, None] * S
    w_I = uncertainty.magnitude(OMEGA)[:, None, None]
    w_P = performance.magnitude(OMEGA)[:, None, None]
    return np.block([[w_I * CS @ G, w_I * CS], [w_P * S @ G, w_P * S]])


@pytest.mark.parametrize("structure", list(Structure))
@pytest.mark.parametrize("sizes", [(6,), (3, 3), (1, 5), (2, 1, 3)])
def test_reduction_equals_the_unreduced_bound(sizes, structure):
    """n = 6 in groups: the blocks' bound is that of all twelve channels to 1e-6."""
    plant = ParallelPlant(
        6, TransferFunction([1], [50, 1], 0.3), TransferFunction([0.5], [30, 1], 0.6)
    )
    kinds = (Controller(10, 40), Controller(6, 9), Controller(14, 25, 0.4))
    loops = [kind for kind, size in zip(kinds, sizes, strict=False) for _ in range(size)]
    uncertainty, performance = Uncertainty.from_error(0.2, 1, structure), Performance(tau_p=20)
    blocks, controllers = group_loops(plant, loops, uncertainty)
    reduced = LoopAnalysis(blocks, controllers, uncertainty, performance).robust_performance(OMEGA)
    scales = (0,) * 6 if structure is Structure.FULL else tuple(range(6))
    N = unreduced(plant, loops, uncertainty, performance)
    assert reduced == pytest.approx(upper_bound(N, BlockStructure(scales, 6)).mu, rel=1e-6)


def test_order_of_the_loops_does_not_matter():
    """Permuted loops have the same blocks."""
    plant = first_order(4, 1, 30, 0.3)
    a, b = Controller(3, 20), Controller(5, 30)
    first, _ = group_loops(plant, [a, b, a, b])
    assert first.groups == ((0, 2), (1, 3))
    assert first.expand([a, b]) == (a, b, a, b)


def test_determinant_splits_over_the_blocks():
    """det(I + G C) is the product of the blocks' determinants to their multiplicities."""
    plant = first_order(5, 1, 30, -0.2)
    loops = [Controller(3, 20)] * 2 + [Controller(5, 9)] * 3
    blocks, controllers = group_loops(plant, loops)
    c = np.stack([loop.response(OMEGA) for loop in loops], axis=1)
    whole = np.linalg.det(np.eye(5) + plant.response(OMEGA) * c[:, None, :])
    product = np.ones_like(whole)
    for block, G in zip(blocks.blocks, blocks.response(OMEGA), strict=True):
        own = np.stack([controllers[i].response(OMEGA) for i in block.channels], axis=1)
        determinant = np.linalg.det(np.eye(block.size) + G * own[:, None, :])
        product *= determinant**block.multiplicity
    assert product == pytest.approx(whole, rel=1e-10)


@pytest.mark.parametrize("groups", [[[0]], [[0, 1], [1]], [[0, 1, 2]]])
def test_groups_must_partition_the_units(groups):
    """Each unit stands in exactly one group."""
    with pytest.raises(InvalidInputError):
        reduce(first_order(2, 1, 1, 0.1), groups)
