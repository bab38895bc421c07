"""Dead time with direct feedthrough: the loop gain at infinity, where the phase takes every value.

With D_0 what passes on at once and D_k what passes on after the dead time theta_k, high frequencies
see det(I + D_0 + sum_k D_k exp(-s theta_k)). All of its zeros are in the left half plane, and stay
there when the dead times change a little, iff the spectral radius of

    (I + D_0)^-1 sum_k D_k exp(j phi_k)

stays below one for all phases (J. K. Hale and S. M. Verduyn Lunel, "Introduction to Functional
Differential Equations", 1993, section 9.6). Otherwise infinitely many closed-loop poles are
unstable.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from solver.model.plants import ParallelPlant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction

__all__ = ["direct_gain", "neutral_gain"]

PHASES = 4096  # sets of phases that are tried where more than one dead time feeds through
SEED = 1


def neutral_gain(
    plant: Plant, controllers: Sequence[Controller], counts: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the greatest spectral radius at infinity of several loops, (loops,).

    0 where nothing with dead time feeds through, infinite where I + D_0 is singular: such a loop
    defines no outputs. Exact for one such dead time; for more it is a bound if that is below one,
    else the greatest over many sets of phases.

    Parameters
    ----------
    plant : Plant
        The plant.
    controllers : sequence of Controller
        Parallel plant: the different ones. Matrix plant: one a loop.
    counts : (loops, controllers)
        Parallel plant: units that each runs. Matrix plant: a factor on each loop's gain.

    """
    times = {e.dead_time for e in plant.elements if e.feedthrough}
    means, differences = direct_gain(plant, controllers, counts)
    lost = np.linalg.det(np.eye(means.shape[1]) + means) == 0
    lost = lost | ((counts > 1) & (1 + differences == 0)).any(axis=1)
    if lost.any() or not any(times):
        return np.where(lost, np.inf, 0.0)
    gains = {time: direct_gain(plant, controllers, counts, time) for time in times}
    found = delayed_radius({time: mean for time, (mean, _) in gains.items()})
    apart = delayed_radius({time: apart[:, None, None] for time, (_, apart) in gains.items()})
    return np.asarray(np.maximum(found, np.max(np.where(counts > 1, apart, 0.0), axis=1)))


def direct_gain(
    plant: Plant,
    controllers: Sequence[Controller],
    counts: NDArray[np.float64],
    time: float = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what loops pass on after just that `time`, (loops, m, m), and differences, (m,).

    Parameters: as for `neutral_gain`; the differences between units of a parallel plant under one
    controller, for any other plant zero.
    """
    c = np.array([_high_frequency_gain(controller) for controller in controllers])
    if not isinstance(plant, ParallelPlant):
        D = feedthrough(plant, time) * c
        return np.asarray(D * counts[:, None, :]), np.zeros(c.size)
    own, other = _at(plant.process, time), _at(plant.interaction, time) if plant.n > 1 else 0.0
    root = np.sqrt(counts)
    used = np.eye(c.size) * (counts > 0)[:, None, :]
    means = ((own - other) * used + other * (root[:, :, None] * root[:, None, :])) * c
    return np.asarray(means), (own - other) * c


def mode_gain(
    blocks: LoopBlocks, controllers: Sequence[Controller], index: int
) -> NDArray[np.float64]:
    """Return what one mode of a ring passes on at once, (1, m, m)."""
    c = np.array(
        [_high_frequency_gain(controllers[channel]) for channel in blocks.blocks[index].channels]
    )
    terms = blocks.terms(index)
    D = np.array([[sum(f * _at(e, 0.0) for f, e in entry) for entry in row] for row in terms])
    return np.asarray(D * c)[None]


def feedthrough(plant: Plant, time: float) -> NDArray[np.float64]:
    """Return what a plant passes on after just that `time`, (n, n)."""
    size = range(plant.n)
    return np.array(
        [[sum(f * _at(e, time) for f, e in plant.terms(r, c)) for c in size] for r in size],
        dtype=float,
    )


def delayed_radius(D: dict[float, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the greatest spectral radius of each loop, from D_k (loops, m, m) by dead time."""
    size = next(iter(D.values())).shape[-1]
    direct = np.eye(size) + D.get(0.0, np.zeros((size, size)))
    delayed = [np.linalg.solve(direct, part) for time, part in D.items() if time > 0]
    if len(delayed) == 1:
        return _spectral_radius(delayed[0])
    bound = _spectral_radius(np.sum(np.abs(delayed), axis=0))
    open_ = bound >= 1
    if open_.any():
        highest = np.zeros(int(open_.sum()))
        for phases in _phases(len(delayed)):
            turned = sum(
                part[open_] * np.exp(1j * phase)
                for part, phase in zip(delayed, phases, strict=True)
            )
            highest = np.maximum(highest, _spectral_radius(np.asarray(turned)))
        bound[open_] = highest
    return bound


def _phases(count: int) -> NDArray[np.float64]:
    """Return sets of phases (sets, count); the first can be zero, being common to all."""
    signs = np.array(list(itertools.product([0.0, np.pi], repeat=min(count - 1, 10))))
    rest = np.random.default_rng(SEED).uniform(0, 2 * np.pi, (PHASES, count - 1))
    rest[: len(signs), : signs.shape[1]] = signs
    if count == 2:
        rest = np.linspace(0, 2 * np.pi, PHASES, endpoint=False)[:, None]
    return np.hstack([np.zeros((PHASES, 1)), rest])


def _spectral_radius(matrices: NDArray[np.inexact]) -> NDArray[np.float64]:
    return np.asarray(np.abs(np.linalg.eigvals(matrices)).max(axis=-1))


def _at(element: TransferFunction, dead_time: float) -> float:
    return element.feedthrough if element.dead_time == dead_time else 0.0


def _high_frequency_gain(controller: Controller) -> float:
    if not controller.lag_time:
        return controller.gain
    return controller.gain * (controller.derivative_time or 0.0) / controller.lag_time
