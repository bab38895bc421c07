"""Robustness of a full (centralised) controller: mu over frequency, its peaks, nominal stability.

N_RP = [[w_I C S G, w_I C S], [w_P S G, w_P S]] with C any matrix: Skogestad, Lundstrom and Hovd
(1989), eq. 31. A parallel controller on a parallel plant splits as the plant does, into the sum of
all units and their differences, which share one D-scale: two scalar blocks for any number of
units. The peak of robust performance is proven over all frequencies where a proof is found.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.frequencies import corners, resonances
from solver.model.given import require_alike, require_weights
from solver.model.mode_controller import ModeController
from solver.model.one_scale import of_one_scale
from solver.model.open_loop import require_supported
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant, Plant
from solver.model.state_space import StateSpace
from solver.model.validation import instance
from solver.robustness.centralised_curves import (
    ON_THE_AXIS,
    CentralisedAnalysis,
    central_blocks,
    controller_poles,
)
from solver.robustness.full_proof import prove
from solver.robustness.record import Curves, Guarantee, Peaks
from solver.stability.encirclements import INFINITELY_MANY, LoopBatch, count_unstable

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Performance, Uncertainty
    from solver.robustness.cross_check import CrossCheck

__all__ = [
    "Centralised",
    "analyse_blocks",
    "analyse_centralised",
    "centralised_poles",
]

WHOLE = 6  # parallel units: half a second; ten are programs of ten seconds

FullController = StateSpace | MatrixPlant | ModeController


@dataclass(frozen=True)
class Centralised:
    """Robustness of a full controller.

    `unstable_poles` counts those of the closed loop with a real part >= 0, `nominally_stable`
    says that there are none, and `warnings` what to look at twice. With any, `peaks`,
    `curves` and `guarantee` are None: mu has no meaning then. The guarantee is of the peak of
    robust performance; None where no proof was asked for. `cross_check` is the bound at that peak
    by semidefinite programming beside the kernel's; None where it was not asked for.
    """

    nominally_stable: bool
    unstable_poles: int
    peaks: Peaks | None
    curves: Curves | None
    guarantee: Guarantee | None = None
    cross_check: CrossCheck | None = None
    warnings: tuple[str, ...] = field(default=())


def analyse_centralised(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    controller: FullController,
    *,
    proof: bool = True,
    cross_check: bool = False,
) -> Centralised:
    """Analyse a full controller.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    controller : StateSpace, MatrixPlant (a transfer matrix) or ModeController
        u = C e, e the set-point error. A mode controller is for a parallel plant.
    proof : bool
        Whether to prove the peak of robust performance over all frequencies, and the stability.
    cross_check : bool
        Whether to recompute the bound at that peak by semidefinite programming, up to
        `WHOLE` parallel units as the matrix that they are.

    Raises
    ------
    InvalidInputError
        No `tau_p`, unlike uncertainty of the inputs, unlike `output_scale` of more outputs than a
        matrix has, a controller of another size than the plant, or with a pole on the imaginary
        axis other than s = 0.
    UnsupportedPlantError
        The plant is open-loop unstable.

    """
    instance(plant, Plant, "/plant")
    require_weights(plant, uncertainty, performance)
    require_alike(uncertainty, "full controllers are analysed with")
    instance(controller, FullController, "/controller")
    require_supported(plant)
    _require_fit(plant, controller)
    scaled = of_one_scale(plant, performance, MAX_MATRIX_SIZE, "full controllers are analysed with")
    plant, performance = scaled.plant, scaled.performance
    controller = scaled.taken(controller)
    blocks, controllers = _paired(plant, uncertainty, controller)
    for each in controllers:
        _require_covered(each)
    found = analyse_blocks(blocks, controllers, uncertainty, performance, proof=proof)
    if not cross_check or found.peaks is None:
        return found
    # Here, since it brings cvxpy, which nothing else of an analysis needs.
    from solver.robustness.cross_check import cross_check_full  # noqa: PLC0415

    analysis = whole = CentralisedAnalysis(blocks, controllers, uncertainty, performance)
    if isinstance(controller, ModeController) and plant.n <= WHOLE:
        # Other matrices than the kernel was given: nothing is taken from the symmetry.
        parts = _paired(MatrixPlant(plant.rows), uncertainty, controller.full(plant.n))
        whole = CentralisedAnalysis(*parts, uncertainty, performance)
    check = cross_check_full(analysis, whole, found.peaks.robust_performance)
    return replace(found, cross_check=check)


def analyse_blocks(
    blocks: LoopBlocks,
    controllers: tuple[StateSpace | MatrixPlant, ...],
    uncertainty: Uncertainty,
    performance: Performance,
    *,
    proof: bool = True,
    tick: Callable[[], None] = lambda: None,
) -> Centralised:
    """Analyse a full controller that is given block by block, see `CentralisedAnalysis`.

    `tick` is called often; what it raises passes through.
    """
    unstable = centralised_poles(blocks, controllers)
    if unstable:
        warning = "the closed loop is unstable: mu has no meaning for it"
        return Centralised(
            nominally_stable=False,
            unstable_poles=unstable,
            peaks=None,
            curves=None,
            warnings=(warning,),
        )
    analysis = CentralisedAnalysis(blocks, controllers, uncertainty, performance)
    tick()
    curves = analysis.curves(analysis.omega)
    tick()
    peaks = analysis.peaks(curves)
    guarantee = None
    if proof:
        peak, guarantee = prove(analysis, peaks.robust_performance, tick)
        peaks = replace(peaks, robust_performance=peak)
    return Centralised(
        nominally_stable=True, unstable_poles=0, peaks=peaks, curves=curves, guarantee=guarantee
    )


def centralised_poles(blocks: LoopBlocks, controllers: tuple[StateSpace | MatrixPlant, ...]) -> int:
    """Count the closed-loop poles with a real part >= 0, dead time exact.

    det(I + G C) of each block along the Nyquist contour; poles of the controller in the right
    half plane are added to the turns counted.
    """
    plant = blocks.plant
    bends = corners(plant)
    total = 0
    for index, (block, controller) in enumerate(zip(blocks.blocks, controllers, strict=True)):
        poles = controller_poles(controller)
        sizes = np.abs(poles)
        near = ON_THE_AXIS * sizes.max(initial=0.0)
        unstable = int(np.count_nonzero((poles.real > ON_THE_AXIS * sizes) & (sizes > near)))
        own = sizes[sizes > near]

        def loop_gain(
            omega: NDArray[np.float64],
            index: int = index,
            controller: StateSpace | MatrixPlant = controller,
        ) -> NDArray[np.complex128]:
            gain = blocks.response(omega)[index] @ controller.response(omega)
            return np.asarray(gain[:, None])

        at_once, delayed = _feedthrough(blocks, index)
        through = _high_frequency_gain(controller)
        direct = at_once @ through
        if delayed.any():
            # Theory in `solver.stability.neutral`: exact for one dead time, else a bound.
            rest = np.linalg.solve(np.eye(block.size) + direct, delayed @ through)
            if np.abs(np.linalg.eigvals(np.abs(rest))).max() >= 1:
                return INFINITELY_MANY
        light = _light(poles)
        batch = LoopBatch(
            loop_gain,
            np.unique(np.concatenate([bends, own])),
            np.concatenate([resonances(plant), light]),
            direct[None],
            dead_time=plant.longest_dead_time,
        )
        total += block.multiplicity * max(int(count_unstable(batch)[0]) + unstable, 0)
    return min(total, INFINITELY_MANY)


def _require_fit(plant: Plant, controller: FullController) -> None:
    if isinstance(controller, ModeController):
        if not plant.interchangeable:
            message = "a mode controller is for a parallel plant"
            raise InvalidInputError(message, "/controller")
        return
    size = controller.n if isinstance(controller, MatrixPlant) else controller.D.shape
    if size not in (plant.n, (plant.n, plant.n)):
        message = f"the controller must be {plant.n} x {plant.n}"
        raise InvalidInputError(message, "/controller")


def _paired(
    plant: Plant, uncertainty: Uncertainty, controller: FullController
) -> tuple[LoopBlocks, tuple[StateSpace | MatrixPlant, ...]]:
    if isinstance(controller, ModeController):
        blocks = central_blocks(plant, uncertainty)
        return blocks, (controller.total, controller.difference)[: len(blocks.blocks)]
    return central_blocks(MatrixPlant(plant.rows), uncertainty), (controller,)


def _require_covered(controller: StateSpace | MatrixPlant) -> None:
    if isinstance(controller, StateSpace):
        controller.require_few("/controller")
    poles = controller_poles(controller)
    sizes = np.abs(poles)
    near = np.abs(poles.real) <= ON_THE_AXIS * sizes
    near &= sizes > ON_THE_AXIS * sizes.max(initial=0.0)
    if near.any():
        message = (
            f"the controller has a pole at {sizes[near][0]:.6g} j on the imaginary axis; only "
            "poles at s = 0 may lie there: give it some damping"
        )
        raise InvalidInputError(message, "/controller")


def _feedthrough(blocks: LoopBlocks, index: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what one block passes on at once, and after a dead time, (m, m) each."""

    def part(element: TransferFunction, *, delayed: bool) -> float:
        return element.feedthrough if delayed == (element.dead_time > 0) else 0.0

    at_once, delayed = (
        np.array(
            [
                [sum(f * part(e, delayed=delayed) for f, e in terms) for terms in row]
                for row in blocks.terms(index)
            ]
        )
        for delayed in (False, True)
    )
    return at_once, delayed


def _high_frequency_gain(controller: StateSpace | MatrixPlant) -> NDArray[np.float64]:
    if isinstance(controller, StateSpace):
        return controller.D
    return np.array([[e.feedthrough for e in row] for row in controller.elements_by_row])


def _light(poles: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Frequencies that resolve lightly damped poles of a controller."""
    light = poles[(poles.imag > 0) & (np.abs(poles.real) < 0.5 * poles.imag)]
    offsets = np.array([-10.0, -3.0, -1.0, 0.0, 1.0, 3.0, 10.0])
    points = (light.imag[:, None] + np.abs(light.real)[:, None] * offsets).ravel()
    return np.unique(points[points > 0])
