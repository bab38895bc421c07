"""Periodic solutions of relay feedback: which exist, and which of them are locally stable.

Astrom (1993) as given by Johansson (1993), theorems 1 and 2, for the system x' = A x + B u,
y = C x, whose relay switches once in every half period h, from +d to -d at time zero::

    f(h) = C (I + e^{Ah})^{-1} int_0^h e^{As} ds B = eps/d               theorem 1
    y(t) > -eps  for  0 <= t < h
    W = (I - v C/(C v)) e^{Ah},   |eigenvalues| < 1                      theorem 2

with x(0) = a = (I + e^{Ah})^{-1} int_0^h e^{As} ds B d and v = A a + B d. With dead time the
same function is a sum over the harmonics of the square wave (Tsypkin's locus), and theorem 2
does not apply.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.relay.experiment import Relay
    from solver.simulation.delay_system import DelaySystem

__all__ = ["PeriodicSolution", "RelayLoop", "periodic_solutions"]

_GRID = 1000  # half periods looked at for a change of sign
_HARMONICS = 400  # odd ones: the rest of a process of relative degree two is below 1e-5 of it
_FEW_HARMONICS = 25  # enough to see where the sign changes
_INSTANTS = 400  # at which the output of a candidate is looked at
_MOST_TRIED = 25  # changes of sign, the slowest; a dead time makes infinitely many
_MOST_GROWTH = 23.0  # logarithm of the growth of a state in a half period: 1e10
WAVEFORM = 101
_MOST_LOOKED = 5000  # samples of a half period looked at
_MOST_SAMPLED = 100  # sampled solutions beside one continuous one


@dataclass(frozen=True)
class PeriodicSolution:
    """A symmetric periodic solution with one switching in each half period.

    Attributes
    ----------
    half_period : float
        h.
    slope : float
        dy/dt just before the switching; must be positive. None for a sampled relay, whose
        switching the slope does not fix.
    lowest : float
        Least y + eps in 0 <= t < h (at the samples, for a sampled relay), zero where only rounding
        is left; where it is negative the relay would have switched earlier, and the solution does
        not exist.
    eigenvalues : tuple of complex, or None
        Of W, largest first; for a sampled relay of e^{Ah}, since there a small change of the
        state moves no switching. None with dead time.
    waveform : tuple of float
        y over the half period after the switching to -d, `WAVEFORM` points at equal distances, its
        ends included.

    """

    half_period: float
    slope: float | None
    lowest: float
    eigenvalues: tuple[complex, ...] | None
    waveform: tuple[float, ...] = ()

    @property
    def exists(self) -> bool:
        """Whether the relay switches as supposed."""
        return (self.slope is None or self.slope > 0) and self.lowest >= 0

    @property
    def stable(self) -> bool | None:
        """Whether it exists and is locally stable; None where that is not known."""
        if not self.exists:
            return False
        if self.eigenvalues is None:
            return None
        return all(abs(value) < 1 for value in self.eigenvalues)


@dataclass(frozen=True, eq=False)
class RelayLoop:
    """What the relay sees: a system from its output to its input, other loops included.

    Parameters
    ----------
    system : DelaySystem
        The wired experiment.
    external, output : int
        The relay's output among its externals, the relay's input among its signals.

    """

    system: DelaySystem
    external: int
    output: int

    def __post_init__(self) -> None:
        if self.system.D_external[self.output, self.external] != 0:
            message = "the process reacts without delay to the relay: it has no relay oscillation"
            raise InvalidInputError(message, "/plant")

    @property
    def has_dead_time(self) -> bool:
        """Whether any signal is delayed."""
        return bool(self.system.dead_times.size)

    @property
    def A(self) -> NDArray[np.float64]:  # noqa: N802 - the matrix of the theorems
        """The matrix A."""
        return self.system.A

    @property
    def B(self) -> NDArray[np.float64]:  # noqa: N802 - the matrix of the theorems
        """The matrix B, (states,)."""
        column: NDArray[np.float64] = self.system.B_external[:, self.external]
        return column

    @property
    def C(self) -> NDArray[np.float64]:  # noqa: N802 - the matrix of the theorems
        """The matrix C, (states,)."""
        row: NDArray[np.float64] = self.system.C[self.output]
        return row

    def response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Frequency response from relay output to relay input at `omega` > 0, (k,) complex."""
        return self.system.response(self.external, self.output, omega)

    def sampled(
        self, times: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return e^{At}, (k, states, states), and int_0^t e^{As} ds B, (k, states)."""
        states = self.B.size
        augmented = np.zeros((states + 1, states + 1))
        augmented[:states, :states], augmented[:states, states] = self.A, self.B
        exponential = expm(times[:, None, None] * augmented)
        return exponential[:, :states, :states], exponential[:, :states, states]

    def switching_output(
        self, half_periods: NDArray[np.float64], harmonics: int = _HARMONICS
    ) -> NDArray[np.float64]:
        """f(h): the relay's input when a relay of amplitude 1 switches, (k,).

        Exact without dead time; otherwise from that many odd `harmonics`. Not a number where
        e^{Ah} has the eigenvalue -1.
        """
        if self.has_dead_time:
            return self.harmonics(half_periods, np.zeros(1), harmonics)[:, 0]
        Phi, Gamma = self.sampled(half_periods)
        value = np.full(half_periods.shape, np.nan)
        matrix = np.eye(self.B.size) + Phi
        good = np.linalg.det(matrix) != 0
        value[good] = np.linalg.solve(matrix[good], Gamma[good, :, None])[:, :, 0] @ self.C
        return value

    def harmonics(
        self, half_periods: NDArray[np.float64], phases: NDArray[np.float64], harmonics: int
    ) -> NDArray[np.float64]:
        """Return y at `phases` (m,), shares of half periods (k,) after switching to -1, (k, m)."""
        orders = np.arange(1, 2 * harmonics, 2)
        omega = np.pi / half_periods
        G = self.response(np.outer(omega, orders).ravel()).reshape(omega.size, orders.size)
        turned = np.exp(1j * np.pi * np.outer(orders, phases))
        value: NDArray[np.float64] = -(4 / np.pi) * ((G / orders) @ turned).imag
        return value

    def waveform(self, half_period: float, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return y at `shares` (k,) of the half period after the switching from +1 to -1."""
        if self.has_dead_time:
            row: NDArray[np.float64]
            row = self.harmonics(np.array([half_period]), shares, _HARMONICS)[0]
            return row
        start = self.start(half_period)
        Phi, Gamma = self.sampled(shares * half_period)
        value: NDArray[np.float64] = (Phi @ start - Gamma) @ self.C
        return value

    def start(self, half_period: float) -> NDArray[np.float64]:
        """Return the state at the switching for a relay of amplitude 1, (states,)."""
        Phi, Gamma = self.sampled(np.array([half_period]))
        value: NDArray[np.float64] = np.linalg.solve(np.eye(self.B.size) + Phi[0], Gamma[0])
        return value


def periodic_solutions(
    loop: RelayLoop, relay: Relay, shortest: float, longest: float
) -> tuple[PeriodicSolution, ...]:
    """Return the solutions of f(h) = eps/d with half periods in a range, ascending.

    Parameters
    ----------
    loop : RelayLoop
        What the relay sees.
    relay : Relay
        The relay.
    shortest, longest : float
        Range of half periods, 0 < shortest < longest.

    Returns
    -------
    tuple of PeriodicSolution
        All where f(h) - eps/d changes its sign between 1000 half periods spaced evenly in the
        logarithm (the 25 slowest, where a dead time makes more), those that do not exist
        included, since the theorem's further conditions say why. For a sampled relay those that
        exist, h then being a multiple of its period.

    """
    sign = 1.0 if relay.amplitude > 0 else -1.0
    found = []
    for half_period in _roots(loop, relay, sign, (shortest, longest)):
        if relay.sampling_period is None:
            found.append(_solution(loop, relay, sign, half_period))
        else:
            found.extend(_sampled_solutions(loop, relay, sign, half_period))
    return tuple({solution.half_period: solution for solution in found}.values())


def _roots(loop: RelayLoop, relay: Relay, sign: float, limits: tuple[float, float]) -> list[float]:
    level = relay.hysteresis / abs(relay.amplitude)

    def excess(half_period: float) -> float:
        return sign * float(loop.switching_output(np.array([half_period]))[0]) - level

    # Beyond this growth of an unstable system the output has lost its digits.
    growth = float(np.linalg.eigvals(loop.A).real.max(initial=0.0))
    longest = min(limits[1], _MOST_GROWTH / growth) if growth > 0 else limits[1]
    if longest <= limits[0]:
        return []
    grid = np.geomspace(limits[0], longest, _GRID)
    values = sign * loop.switching_output(grid, _FEW_HARMONICS) - level
    found = []
    for index in np.flatnonzero(values[:-1] * values[1:] < 0)[-_MOST_TRIED:].tolist():
        low, high = float(grid[index]), float(grid[index + 1])
        if loop.has_dead_time:
            # The further harmonics may move the root to a neighbouring interval.
            low, high = float(grid[max(index - 1, 0)]), float(grid[min(index + 2, _GRID - 1)])
        if excess(low) * excess(high) >= 0:
            continue
        try:
            half_period = float(brentq(excess, low, high, xtol=1e-14 * low))
        except ValueError:  # e^{Ah} overflows inside: time constants too far apart for a root
            continue
        # A pole of f changes sign too, but not through zero.
        if abs(excess(half_period)) <= abs(values[index]):
            found.append(half_period)
    return found


def _solution(loop: RelayLoop, relay: Relay, sign: float, half_period: float) -> PeriodicSolution:
    d = abs(relay.amplitude)
    shares = np.arange(_INSTANTS) / _INSTANTS
    lowest = _lowest(sign * d * loop.waveform(half_period, shares), relay)
    waveform = _waveform(loop, sign * d, half_period)
    if loop.has_dead_time:
        step = np.array([-1e-4, 0.0])
        before = sign * d * loop.waveform(half_period, 1 + step)
        # y is odd from one half period to the next: this is the slope at the switching to -d.
        slope = -float(before[1] - before[0]) / (1e-4 * half_period)
        return PeriodicSolution(half_period, slope, lowest, None, waveform)
    a = loop.start(half_period)
    v = loop.A @ a + loop.B
    rise = float(loop.C @ v)
    Phi = loop.sampled(np.array([half_period]))[0][0]
    W = (np.eye(a.size) - np.outer(v, loop.C) / rise) @ Phi
    eigenvalues = _sorted_eigenvalues(W)
    return PeriodicSolution(half_period, sign * d * rise, lowest, eigenvalues, waveform)


def _waveform(loop: RelayLoop, amplitude: float, half_period: float) -> tuple[float, ...]:
    shares = np.linspace(0.0, 1.0, WAVEFORM)
    return tuple((amplitude * loop.waveform(half_period, shares)).tolist())


def _lowest(output: NDArray[np.float64], relay: Relay) -> float:
    """Return the least y + eps; without hysteresis that is zero, at the switching."""
    lowest = float(output.min()) + relay.hysteresis
    return 0.0 if abs(lowest) <= 1e-9 * float(np.abs(output).max()) else lowest


def _sampled_solutions(
    loop: RelayLoop, relay: Relay, sign: float, half_period: float
) -> list[PeriodicSolution]:
    """Half periods N T from a root of f(h) - eps/d on: y passes -eps just before the last sample.

    Several may exist beside each other, each locally stable: which one an experiment settles in
    depends on how it started.
    """
    period = relay.sampling_period or 0.0
    d = abs(relay.amplitude)
    first = int(np.ceil(half_period / period - 1e-9))
    found: list[PeriodicSolution] = []
    for count in range(max(first, 1), first + _MOST_SAMPLED):
        end = sign * d * float(loop.switching_output(np.array([count * period]))[0])
        shares = np.arange(0, count, max(count // _MOST_LOOKED, 1)) / count
        lowest = _lowest(sign * d * loop.waveform(count * period, shares), relay)
        if end <= relay.hysteresis or lowest < 0:
            break
        eigenvalues = None
        if not loop.has_dead_time:
            Phi = loop.sampled(np.array([count * period]))[0][0]
            eigenvalues = _sorted_eigenvalues(Phi)
        waveform = _waveform(loop, sign * d, count * period)
        found.append(PeriodicSolution(count * period, None, lowest, eigenvalues, waveform))
    return found


def _sorted_eigenvalues(matrix: NDArray[np.float64]) -> tuple[complex, ...]:
    values = np.linalg.eigvals(matrix)
    return tuple(complex(value) for value in values[np.argsort(-np.abs(values))])
