"""What a frequency demands of the loop for the objective's value s, and the s that it permits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import ONE
from solver.model.transfer_function import TransferFunction
from solver.tuning.goal_levels import Terms, all_attained, all_demands

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.weights import Performance

__all__ = ["LARGEST_S", "Goal", "MuGoal", "TauGoal"]

LARGEST_S = 300.0  # e^s and its square times any omega^2 are numbers: penalties may be larger


@dataclass(frozen=True)
class TauGoal:
    """The objective tau_P: s = log tau_P, level log p*, demand log |w_P|^2.

    `target` < 1 demands mu <= target instead of 1, as a margin.
    """

    performance: Performance
    target: float = 1.0
    skewed: bool = True

    @cached_property
    def terms(self) -> Terms:
        """As compiled code takes it."""
        M, A = self.performance.max_peak, self.performance.offset
        return Terms(True, M, A, 2 * math.log(self.target))  # noqa: FBT003 - in the tuple's order

    @property
    def weight(self) -> TransferFunction:
        """Weight of the performance rows before the level scales them."""
        return ONE

    def demand(
        self, s: float, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Level needed at `omega` (k,) for tau_P = e^s, and its slope in s."""
        level, slope = all_demands(min(s, LARGEST_S), omega, self.terms)
        return level, slope

    def saturation(self, penalty: float) -> float:
        """Value of s, plus log omega, from which a frequency's demand falls by < 1/`penalty`.

        There, far above the bandwidth, a frequency is a constraint on the controller and no
        measure of tau_P: a trifle in the level would stand for any tau_P at all.
        """
        return 0.5 * math.log(2 * penalty - 1)

    def attained(
        self, level: NDArray[np.float64], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Least s that each frequency permits, (k,); infinite where no tau_P does."""
        return np.asarray(all_attained(level, omega, self.terms))


@dataclass(frozen=True)
class MuGoal:
    """The objective mu at a given weight: s = log mu^2, level -log mu^2, demand -s.

    `performance.tau_p` None stands for an infinitely slow loop, w_P = 1/M: whether any tau_P at
    all can be had.
    """

    performance: Performance
    target: float = 1.0
    skewed: bool = False

    @cached_property
    def terms(self) -> Terms:
        """As compiled code takes it."""
        return Terms(False, 1.0, 0.0, 0.0)  # noqa: FBT003 - in the tuple's order

    @property
    def weight(self) -> TransferFunction:
        """Weight w_P of the performance rows."""
        if self.performance.tau_p is None:
            return TransferFunction((1 / self.performance.max_peak,), (1.0,))
        return self.performance.weight

    def demand(
        self, s: float, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Level needed at `omega` (k,) for mu^2 = e^s, and its slope in s."""
        level, slope = all_demands(s, omega, self.terms)
        return level, slope

    def saturation(self, penalty: float) -> float:  # noqa: ARG002 - as the other goal
        """Infinite: every frequency measures mu."""
        return math.inf

    def attained(
        self, level: NDArray[np.float64], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Log mu^2 of each frequency, (k,)."""
        return np.asarray(all_attained(level, omega, self.terms))


Goal = TauGoal | MuGoal
