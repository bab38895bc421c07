"""A linear system with dead times, x' = A x + B_r r + B_w w, where w are its own delayed signals.

::

    x'(t)    = A x + B_external r + B_delayed w
    s(t)     = C x + D_external r + D_delayed w
    w_j(t)   = s[delay_sources[j]](t - dead_times[j]),   zero before t = 0
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.memory import batch_length

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["DelaySystem"]


@dataclass(frozen=True, eq=False)
class DelaySystem:
    """The matrices above; dead times are positive, in the caller's time unit."""

    A: NDArray[np.float64]
    B_external: NDArray[np.float64]
    B_delayed: NDArray[np.float64]
    C: NDArray[np.float64]
    D_external: NDArray[np.float64]
    D_delayed: NDArray[np.float64]
    delay_sources: NDArray[np.int_]
    dead_times: NDArray[np.float64]

    def response(self, external: int, signal: int, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response from an external signal to a signal.

        Parameters
        ----------
        external, signal : int
            Their indices.
        omega : (k,) array_like
            rad per time unit, > 0.

        Returns
        -------
        (k,) complex ndarray

        """
        frequencies = np.atleast_1d(np.asarray(omega, dtype=float))
        step = batch_length((self.A.shape[0] + self.dead_times.size) ** 2)
        parts = [
            self._response(external, signal, frequencies[first : first + step])
            for first in range(0, frequencies.size, step)
        ]
        return np.concatenate([np.empty(0, dtype=complex), *parts])

    def _response(
        self, external: int, signal: int, frequencies: NDArray[np.float64]
    ) -> NDArray[np.complex128]:
        states, delays = self.A.shape[0], self.dead_times.size
        s = 1j * frequencies[:, None, None]
        shift = np.exp(-s * self.dead_times[None, :, None])  # (k, delays, 1)
        # Unknowns x and w:  (s I - A) x - B_w w = B_r,  w - E (C x + D_w w)[sources] = E D_r.
        C, D_delayed = self.C[self.delay_sources], self.D_delayed[self.delay_sources]
        matrix = np.zeros((frequencies.size, states + delays, states + delays), dtype=complex)
        matrix[:, :states, :states] = s * np.eye(states) - self.A
        matrix[:, :states, states:] = -self.B_delayed
        matrix[:, states:, :states] = -shift * C
        matrix[:, states:, states:] = np.eye(delays) - shift * D_delayed
        right = np.zeros((frequencies.size, states + delays, 1), dtype=complex)
        right[:, :states, 0] = self.B_external[:, external]
        right[:, states:] = shift * self.D_external[self.delay_sources, external][:, None]
        solved = np.linalg.solve(matrix, right)[:, :, 0]
        value: NDArray[np.complex128] = (
            solved[:, :states] @ self.C[signal]
            + solved[:, states:] @ self.D_delayed[signal]
            + self.D_external[signal, external]
        )
        return value
