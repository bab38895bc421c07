"""Closed loops around a decoupled plant, interaction included.

With Q = P D and diagonal C, C_bar: Y = H_bar Y_sp, H_bar = (I + Q C)^-1 Q C_bar. The
approximation H neglects products of off-diagonal elements: h_ij = q_ij c_bar_j/(1 + q_ii c_i)
(Astrom and Hagglund, section 11.3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.dynamic_decoupler import DynamicDecoupler, diagonal_mu
from solver.interaction.loop_shape import RobustnessLimits
from solver.interaction.pi_design import LoopDesigner
from solver.interaction.sampling import dense_frequencies
from solver.model.controllers import DERIVATIVE_FILTER
from solver.model.frequencies import EXTREMES, corners, resonances
from solver.model.peaks import highest
from solver.stability.encirclements import LoopBatch, count_unstable
from solver.stability.neutral import delayed_radius, feedthrough

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import ParallelForm
    from solver.model.plants import Plant

__all__ = ["DecoupledLoops"]

BEYOND = 10.0  # times the last frequency at which a loop gain may be one: H is at its end there
PER_DECADE = 60


@dataclass(frozen=True)
class DecoupledLoops:
    """A stable plant behind a decoupler, under PI controllers with set-point weights.

    Attributes
    ----------
    plant : Plant
        P(s), n x n.
    decoupler : (n, n) or DynamicDecoupler
        D = P(0)^-1, or one with dynamics.
    gains : tuple of ParallelForm
        PI settings, one a loop, with positive integral gains.
    weights : tuple of float
        Set-point weights b, one a loop.
    derivative_times : tuple of float
        tau_D of (1 + tau_D s)/(1 + 0.1 tau_D s) in series with each PI controller; empty: none.

    """

    plant: Plant
    decoupler: NDArray[np.float64] | DynamicDecoupler
    gains: tuple[ParallelForm, ...]
    weights: tuple[float, ...]
    derivative_times: tuple[float, ...] = ()

    def approximate(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return H at `omega` (k,) rad per time unit, (k, n, n)."""
        Q = self._process(omega)
        own = np.diagonal(Q, axis1=1, axis2=2)
        single = 1 + own * self._feedback(omega)
        result = Q * self._set_point(omega)[:, None, :] / single[:, :, None]
        return np.asarray(result, dtype=np.complex128)

    def exact(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return H_bar at `omega` (k,) rad per time unit, (k, n, n)."""
        Q = self._process(omega)
        identity = np.eye(self.plant.n)
        result = np.linalg.solve(
            identity + Q * self._feedback(omega)[:, None, :],
            Q * self._set_point(omega)[:, None, :],
        )
        return np.asarray(result, dtype=np.complex128)

    def process(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return Q at `omega` (k,) rad per time unit, (k, n, n)."""
        return self._process(omega)

    def tolerated_input_error(self, omega: NDArray[np.float64]) -> float:
        """Return the relative error of each input, of any phase, up to which they stay stable.

        1/max mu(T_I) from the samples `omega` on, T_I = D C (I + P D C)^-1 P at the plant's inputs.
        """

        def mu(parts: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
            DC = self._decoupler(parts[0]) * self._feedback(parts[0])[:, None, :]
            P = self.plant.response(parts[0])
            T = DC @ np.linalg.solve(np.eye(self.plant.n) + P @ DC, P)
            return [diagonal_mu(T)]

        (peak,) = highest(mu, [(omega, mu([omega])[0])])
        return 1 / peak.value

    def frequencies(self) -> NDArray[np.float64]:
        """Return frequencies (k,) that resolve the plant, up to where its loops end."""
        plant = dense_frequencies(self.plant.elements)
        end = self._reach()
        if end <= plant[-1]:
            return plant
        beyond = np.geomspace(plant[-1], end, int(PER_DECADE * math.log10(end / plant[-1])) + 2)
        return np.concatenate([plant, beyond[1:]])

    def is_stable(self) -> bool:
        """Whether the loops are stable together, by encirclements on the whole axis."""

        def loop_gain(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
            return (self._process(omega) * self._feedback(omega)[:, None, :])[:, None]

        if isinstance(self.decoupler, DynamicDecoupler):
            # Q is diagonal and the decoupler stable: what the loops are alone.
            times = self.derivative_times or (0.0,) * self.plant.n
            return all(
                LoopDesigner(process.led(time), RobustnessLimits()).given(gains).sensitivity
                is not None
                for process, gains, time in zip(
                    self.decoupler.processes, self.gains, times, strict=True
                )
            )
        k = np.array([g.proportional_gain for g in self.gains])
        for index, time in enumerate(self.derivative_times):
            k[index] /= DERIVATIVE_FILTER if time else 1.0
        passed = {
            time: (feedthrough(self.plant, time) @ self.decoupler * k)[None]
            for time in {0.0, *(element.dead_time for element in self.plant.elements)}
        }
        if len(passed) > 1 and delayed_radius(passed)[0] >= 1:
            return False
        resets = [g.integral_gain / abs(g.proportional_gain or np.inf) for g in self.gains]
        rates = [1 / time for time in self.derivative_times if time]
        rates += [rate / DERIVATIVE_FILTER for rate in rates]
        bends = np.append(corners(self.plant), [omega for omega in resets if omega > 0] + rates)
        batch = LoopBatch(
            loop_gain, np.sort(bends), resonances(self.plant), passed[0.0], self.plant.n,
            dead_time=self.plant.longest_dead_time,
        )  # fmt: skip
        return int(count_unstable(batch)[0]) == 0

    def _reach(self) -> float:
        """Return a frequency beyond which no loop gain reaches one, where there is such an end."""
        D = self._decoupler(dense_frequencies(self.plant.elements))
        most = max((abs(g.proportional_gain) for g in self.gains), default=0.0)
        most /= DERIVATIVE_FILTER if any(self.derivative_times) else 1.0
        gain = most * float(np.abs(D).sum(axis=(-2, -1)).max())
        ends = [
            (gain * abs(element.num[0] / element.den[0])) ** (1 / element.relative_degree)
            for element in self.plant.elements
            if element.relative_degree and not element.is_zero
        ]
        return min(BEYOND * max(ends, default=0.0), EXTREMES[1])

    def _process(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        D = self._decoupler(omega)
        return np.asarray(self.plant.response(omega) @ D, dtype=np.complex128)

    def _decoupler(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        if isinstance(self.decoupler, DynamicDecoupler):
            return self.decoupler.response(omega)
        return np.asarray(self.decoupler, dtype=np.complex128)

    def _feedback(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return _pi(omega, self.gains, [1.0] * len(self.gains)) * self._leads(omega)

    def _set_point(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        return _pi(omega, self.gains, self.weights) * self._leads(omega)

    def _leads(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the derivative actions in series, (k, n), or one for all."""
        if not self.derivative_times:
            return np.ones((1, 1), dtype=complex)
        s = 1j * omega[:, None] * np.array(self.derivative_times)
        return np.asarray((1 + s) / (1 + DERIVATIVE_FILTER * s), dtype=np.complex128)


def _pi(
    omega: NDArray[np.float64], gains: Sequence[ParallelForm], weights: Sequence[float]
) -> NDArray[np.complex128]:
    """Responses b k + k_I/s, (k, n)."""
    k = np.array([b * g.proportional_gain for g, b in zip(gains, weights, strict=True)])
    k_I = np.array([g.integral_gain for g in gains])
    return np.asarray(k - 1j * k_I / omega[:, None], dtype=np.complex128)
