"""Many subsets of one plant's loops at once: their responses and their stability.

A subset is known by how many units each controller runs (parallel plant), or by which loops are
in service (any other). Plant and controllers are evaluated once for all subsets.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import corners, finite_reach, resonances
from solver.model.memory import batch_length
from solver.model.open_loop import require_supported
from solver.model.plants import ParallelPlant
from solver.stability.encirclements import INFINITELY_MANY, LoopBatch, count_unstable
from solver.stability.neutral import direct_gain, neutral_gain
from solver.stability.singular import origin_poles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.stability.encirclements import LoopGain

__all__ = ["Subsets"]


@dataclass(frozen=True)
class Subsets:
    """Subsets of the loops of one plant.

    Parameters
    ----------
    plant : Plant
        The plant with all its units.
    controllers : tuple of Controller
        Parallel plant: the different ones. Matrix plant: one a loop.
    counts : (subsets, controllers)
        Parallel plant: how many units each controller runs. Matrix plant: a factor on each
        loop's gain, 1 in service and 0 in manual. At least one loop in service in each subset.

    """

    plant: Plant
    controllers: tuple[Controller, ...]
    counts: NDArray[np.float64]

    def unstable_poles(self) -> NDArray[np.int64]:
        """Count the unstable closed-loop poles of each subset, (subsets,).

        Raises
        ------
        UnsupportedPlantError
            The plant is open-loop unstable.

        """
        require_supported(self.plant)
        size = len(self.controllers)
        step = batch_length(1000 * size * size)  # some 1000 frequencies
        chunks = [self.counts[first : first + step] for first in range(0, len(self.counts), step)]
        at_origin = self._origin_poles()
        acting = (self.counts[:, self._integrating] > 0).sum(axis=1)
        integrators = np.where(at_origin > 0, 0, acting)
        neutral = neutral_gain(self.plant, self.controllers, self.counts) >= 1
        means, apart = direct_gain(self.plant, self.controllers, self.counts)
        means[neutral], apart[1 + apart == 0] = 0, 0  # not counted, and I + D is to be regular
        found = np.concatenate(
            [
                self._unstable(
                    self._means(counts),
                    means[first : first + step],
                    integrators[first : first + step],
                )
                for first, counts in zip(range(0, len(self.counts), step), chunks, strict=True)
            ]
        )
        if self.plant.interchangeable:
            # m units under one controller have m - 1 equal modes of their differences.
            alike = np.maximum(self.counts - 1, 0).astype(int)
            used = np.asarray(alike.any(axis=0))
            if used.any():
                differences = self._unstable(
                    self._differences(used),
                    apart[used][:, None, None],
                    self._integrating[used].astype(np.int64),
                )
                found = found + (alike[:, used] * differences).sum(axis=1)
        found = np.where(neutral, INFINITELY_MANY, found)
        return np.where(at_origin > 0, at_origin, found)

    def _origin_poles(self) -> NDArray[np.int64]:
        """Count the poles at s = 0 that a singular static gain leaves in each subset.

        None where a loop lacks integral action: that loop may hold what the others cannot.
        """
        count = origin_poles(self.plant, self.counts)
        return np.where((self.counts[:, ~self._integrating] > 0).any(axis=1), 0, count)

    @property
    def _integrating(self) -> NDArray[np.bool_]:
        """Which controllers have integral action, (controllers,)."""
        return np.array([controller.integral_time is not None for controller in self.controllers])

    def _unstable(
        self, loop_gain: LoopGain, direct: NDArray[np.float64], integrators: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        reached = finite_reach(self.plant, self.controllers)
        bends = np.sort(np.append(corners(self.plant, loops=self.controllers), reached))
        return count_unstable(
            LoopBatch(
                loop_gain,
                bends,
                resonances(self.plant),
                direct,
                integrators,
                dead_time=self.plant.longest_dead_time,
            )
        )

    def controller_response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return all controllers at `omega` (k,), (k, controllers)."""
        return np.stack([controller.response(omega) for controller in self.controllers], axis=-1)

    def plant_response(
        self,
        omega: NDArray[np.float64],
        channels: NDArray[np.intp],
        counts: NDArray[np.float64],
    ) -> NDArray[np.complex128]:
        """Return the plant between the given controllers, (r, m, m).

        Parameters
        ----------
        omega : (r,)
            Frequencies.
        channels : (r, m)
            Controllers, for a matrix plant the same as loops.
        counts : (r, m)
            Units that each runs (parallel plant).

        """
        if not self.plant.interchangeable:
            P = self.plant.response(omega)
            rows = np.arange(omega.size)[:, None, None]
            return np.asarray(P[rows, channels[:, :, None], channels[:, None, :]])
        difference, interaction = self.modes(omega)
        root = np.sqrt(counts)
        means = interaction[:, None, None] * (root[:, :, None] * root[:, None, :])
        means += difference[:, None, None] * np.eye(channels.shape[1])
        return np.asarray(means)

    def modes(
        self, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return g - i and i of a parallel plant."""
        assert isinstance(self.plant, ParallelPlant)  # noqa: S101 - for the type checker
        process = self.plant.process.response(omega)
        if self.plant.n == 1:
            return process, np.zeros_like(process)
        interaction = self.plant.interaction.response(omega)
        return process - interaction, interaction

    def _means(self, counts: NDArray[np.float64]) -> LoopGain:
        """Return the loop gains of the first block; a loop without units has gain zero."""

        def loop_gain(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
            c = self.controller_response(omega)[:, None, None, :]
            if not self.plant.interchangeable:
                return np.asarray(self.plant.response(omega)[:, None] * (c * counts[:, None, :]))
            difference, interaction = (mode[:, None, None, None] for mode in self.modes(omega))
            root = np.sqrt(counts)
            coupling = root[:, :, None] * root[:, None, :]
            own = np.eye(counts.shape[1]) * (counts > 0)[:, None, :]
            return np.asarray((difference * own + interaction * coupling) * c)

        return loop_gain

    def _differences(self, used: NDArray[np.bool_]) -> LoopGain:
        """Return the loop gains c (g - i) of the differences between units of the `used` ones."""

        def loop_gain(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
            gain = self.modes(omega)[0][:, None] * self.controller_response(omega)[:, used]
            return np.asarray(gain[:, :, None, None])

        return loop_gain
