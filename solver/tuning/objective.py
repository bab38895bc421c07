"""What the tuner makes small, as one batched evaluation with exact gradients.

With the skewed level p*(omega) of theory section "skewed form" every frequency demands

    |w_P(j omega; tau_P)|^2 <= p*(omega; parameters),

so the objective tau_P is the plain minimax problem  max over omega of tau_P(omega; parameters)
(Skogestad, Lundstrom and Hovd 1989, eq. 32, without its outer search). The objective mu has the
same form with mu^2 in the place of tau_P. Both are written: the least s with
``demand(s) <= level`` at every frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.controllers import DERIVATIVE_FILTER, Controller
from solver.mu.kernel import COLD, FINE
from solver.mu.scaling import sweep
from solver.tuning.specification import ControllerKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.blocks import LoopBlocks
    from solver.weights import Performance, Uncertainty

SEARCH_NU = 1e-7  # barrier parameter of the search: levels right to about that much
WARM = 1e-4  # first barrier parameter where a neighbour's scales are the start

__all__ = ["PENALTY", "Evaluation", "Goal", "LoopObjective", "MuGoal", "TauGoal"]

PENALTY = 30.0  # price in s of a missing level; more than its multiplier at any optimum seen


@dataclass(frozen=True)
class TauGoal:
    """The objective tau_P: s = log tau_P, level log p*, demand log |w_P|^2.

    `target` < 1 demands mu <= target instead of 1, as a margin.
    """

    performance: Performance
    target: float = 1.0
    skewed: bool = True

    def weight(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weight of the performance rows before the level scales them, (k,)."""
        return np.ones_like(omega)

    def demand(
        self, s: float, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Level needed at `omega` (k,) for tau_P = e^s, and its slope in s."""
        M, A = self.performance.max_peak, self.performance.offset
        square = np.exp(2 * s) * omega**2
        level = np.log((square + 1) / (square * M**2 + A**2)) - 2 * math.log(self.target)
        return level, 2 * square * (1 / (square + 1) - M**2 / (square * M**2 + A**2))

    def saturated(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of s, (k,), from which a frequency's demand falls by less than 1/PENALTY.

        There, far above the bandwidth, a frequency is a constraint on the controller and no
        measure of tau_P: a trifle in the level would stand for any tau_P at all.
        """
        return 0.5 * math.log(2 * PENALTY - 1) - np.log(omega)

    def attained(
        self, level: NDArray[np.float64], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Least s that each frequency permits, (k,); infinite where no tau_P does."""
        M, A = self.performance.max_peak, self.performance.offset
        p = np.exp(np.minimum(level + 2 * math.log(self.target), 500))
        # tau_P^2 = (1 - p A^2)/(p M^2 - 1)/omega^2, theory of the skewed form.
        room = p * M**2 - 1
        with np.errstate(divide="ignore"):
            square = np.where(room > 0, np.maximum(1 - p * A**2, 0) / np.maximum(room, 1e-300),
                              np.inf)  # fmt: skip
            return 0.5 * np.log(square) - np.log(omega)


@dataclass(frozen=True)
class MuGoal:
    """The objective mu at a given weight: s = log mu^2, level -log mu^2, demand -s.

    `performance.tau_p` None stands for an infinitely slow loop, w_P = 1/M: whether any tau_P at
    all can be had.
    """

    performance: Performance
    target: float = 1.0
    skewed: bool = False

    def weight(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weight |w_P|^2 of the performance rows, (k,)."""
        if self.performance.tau_p is None:
            return np.full_like(omega, self.performance.max_peak**-2)
        return self.performance.magnitude(omega) ** 2

    def demand(
        self, s: float, omega: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Level needed at `omega` (k,) for mu^2 = e^s, and its slope in s."""
        return np.full_like(omega, -s), np.full_like(omega, -1.0)

    def saturated(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Infinite, (k,): every frequency measures mu."""
        return np.full_like(omega, np.inf)

    def attained(
        self, level: NDArray[np.float64], omega: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Log mu^2 of each frequency, (k,)."""
        return -level * np.ones_like(omega)


Goal = TauGoal | MuGoal


@dataclass(frozen=True)
class Evaluation:
    """The loop at one point of the parameter space.

    Attributes
    ----------
    theta : (m,)
        Parameters, logarithms of the magnitudes, controller by controller.
    value : float
        The least s; infinite where a frequency permits none or the loop is unstable.
    s, merit : float
        The least s of the frequencies below saturation, and that s with a penalty for what the
        others miss: finite where `value` is not, and equal to it where nothing is missed.
    level, gradient : (k,), (k, m)
        Level of each frequency, and its gradient in theta.
    y : (k, scales)
        The D-scales, a start for a neighbour's evaluation.

    """

    theta: NDArray[np.float64]
    value: float
    s: float
    merit: float
    level: NDArray[np.float64]
    gradient: NDArray[np.float64]
    y: NDArray[np.float64]


class LoopObjective:
    """Levels of all frequencies for given parameters, and their gradients.

    Parameters
    ----------
    blocks : LoopBlocks
        Plant and grouping.
    uncertainty : Uncertainty
        w_I.
    goal : Goal
        What is made small.
    kind : ControllerKind
        PI or PID.
    signs : (controllers,)
        Sign of each gain.
    omega : (k,)
        Frequencies, rad per time unit, ascending.

    """

    def __init__(
        self,
        blocks: LoopBlocks,
        uncertainty: Uncertainty,
        goal: Goal,
        *,
        kind: ControllerKind,
        signs: NDArray[np.float64],
        omega: NDArray[np.float64],
    ) -> None:
        self.blocks = blocks
        self.uncertainty = uncertainty
        self.goal = goal
        self.kind = kind
        self.signs = signs
        self.omega = omega
        self.per_controller = 3 if kind is ControllerKind.PID else 2
        self._s = 1j * omega
        self._G = blocks.packed(omega)
        self._u = uncertainty.magnitude(omega) ** 2 / goal.target**2
        self._b = goal.weight(omega)
        self._saturated = goal.saturated(omega)
        # Far enough from the first point for the slope there; peaks may lie beside it.
        self._beside_first = min(int(np.searchsorted(omega, 1.2 * omega[0])), omega.size - 1)

    def on(self, omega: NDArray[np.float64], goal: Goal | None = None) -> LoopObjective:
        """Return the same objective at other frequencies, or with another goal."""
        return LoopObjective(
            self.blocks,
            self.uncertainty,
            goal or self.goal,
            kind=self.kind,
            signs=self.signs,
            omega=omega,
        )

    def controllers(self, theta: NDArray[np.float64]) -> tuple[Controller, ...]:
        """Return the controllers that `theta` stands for."""
        values = np.exp(theta).reshape(-1, self.per_controller)
        return tuple(
            Controller(float(sign * row[0]), float(row[1]), float(row[2]) if row.size > 2 else None)
            for sign, row in zip(self.signs, values, strict=True)
        )

    def evaluate(
        self,
        theta: NDArray[np.float64],
        *,
        near: Evaluation | None = None,
    ) -> Evaluation:
        """Evaluate at `theta`.

        Parameters
        ----------
        theta : (m,)
            Parameters.
        near : Evaluation or None
            A neighbouring evaluation at the same frequencies, whose scales are the start.

        """
        c, dc = self._response(theta)
        y = np.zeros((self.omega.size, self.blocks.n_scales)) if near is None else near.y.copy()
        level, slope = self._sweep(c, y, SEARCH_NU, cold=near is None)
        gradient = (slope[:, :, None] * dc).real.reshape(self.omega.size, -1)
        attained = self.goal.attained(level, self.omega)
        value, s = float(attained.max()), float(np.minimum(attained, self._saturated).max())
        missing = float((self.goal.demand(s, self.omega)[0] - level).max())
        merit = s + PENALTY * max(missing, 0.0)
        if not self._winds_as_stable(c):
            value = merit = math.inf
        return Evaluation(theta, value, s, merit, level, gradient, y)

    def levels(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Level of each frequency at `theta`, (k,), as exact as the kernel gives it.

        Says nothing about stability, so the frequencies may be any.
        """
        y = np.zeros((self.omega.size, self.blocks.n_scales))
        return self._sweep(self._response(theta)[0], y, FINE, cold=True)[0]

    def _sweep(
        self, c: NDArray[np.complex128], y: NDArray[np.float64], nu_end: float, *, cold: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        level, slope = sweep(
            self._G, c, self._u, self._b, self.blocks.layout, not self.goal.skewed,
            COLD if cold else WARM, nu_end, cold, y,
        )  # fmt: skip
        return level, slope

    def _response(
        self, theta: NDArray[np.float64]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return controller responses (k, controllers) and derivatives (k, controllers, params)."""
        values = np.exp(theta).reshape(-1, self.per_controller)
        s = self._s[:, None]
        k, integral_time = self.signs * values[:, 0], values[:, 1]
        integral = 1 / (integral_time * s)
        c = k * (1 + integral)
        parts = [-k * integral]
        if self.per_controller == 3:
            lead = values[:, 2] * s
            filtered = 1 + DERIVATIVE_FILTER * lead
            factor = (1 + lead) / filtered
            parts = [parts[0] * factor, c * (1 - DERIVATIVE_FILTER) * lead / filtered**2]
            c = c * factor
        return c, np.stack([c, *parts], axis=-1)

    def _winds_as_stable(self, c: NDArray[np.complex128]) -> bool:
        """Whether det(I + G C) turns on this grid as that of a stable loop does.

        A quick test for the search; `solver.stability` decides on the result.
        """
        channels, _, first = self.blocks.layout
        L = self._G * c[:, channels][:, None, : self._G.shape[2]]
        for block, row in zip(self.blocks.blocks, first, strict=False):
            m = block.size
            gain = L[:, row : row + m, :m] if row == 0 else (
                self._G[:, row : row + 1, :1] * c[:, block.channels[0], None, None]
            )  # fmt: skip
            if m == 1:
                det = 1 + gain[:, 0, 0]
            elif m == 2:
                det = (1 + gain[:, 0, 0]) * (1 + gain[:, 1, 1]) - gain[:, 0, 1] * gain[:, 1, 0]
            else:
                det = np.linalg.det(np.eye(m) + gain)
            if not self._turns_to_zero(det):
                return False
        return True

    def _turns_to_zero(self, det: NDArray[np.complex128]) -> bool:
        turned = np.angle(det[1:] / det[:-1]).sum()
        other = self._beside_first
        ratio = math.log(self.omega[other] / self.omega[0])
        slope = math.log(abs(det[0]) / abs(det[other])) / ratio
        order = round(slope)
        start = det[0] * 1j**order
        start = start if start.real > 0 else -start
        turned += math.atan2(start.imag, start.real)
        turned -= math.atan2(det[-1].imag, det[-1].real)
        return bool(abs(turned - order * math.pi / 2) < 1.0)
