"""The ultimate point of a loop among equal loops: McAvoy's method with the dynamic RGA.

McAvoy, Interaction Analysis (1983), as given by Johansson (1993), section 5. If all loops have
the same loop function L = c_i g_ii, the characteristic equation of a 2 x 2 plant is
1 + 2 L + L^2/lambda = 0, lambda the dynamic relative gain, so

::

    -L = lambda + sqrt(lambda^2 - lambda)   or   lambda - sqrt(lambda^2 - lambda)

For n loops the same is -L = 1/mu_k with the eigenvalues mu_k of G diag(g_11, ..., g_nn)^{-1}: the
roots above for n = 2, and any n otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq, linear_sum_assignment

from solver.model.errors import InvalidInputError
from solver.relay.describing_function import Ultimate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.model.plants import Plant
    from solver.relay.settings import UltimateSettings

__all__ = ["McAvoy", "mcavoy"]

_GRID = 2000  # frequencies looked at
_MOST_REFINED = 10


@dataclass(frozen=True)
class McAvoy:
    """Ultimate point of one loop among equal ones.

    Attributes
    ----------
    factor : complex
        1/mu at the ultimate frequency of the loop alone, the least in magnitude:
        lambda + sqrt(lambda^2 - lambda) for two loops.
    rough : Ultimate
        Gain |factor| K_u at the unchanged omega_u, Johansson's proposal.
    exact : Ultimate or None
        The least gain at which equal loops oscillate, without that approximation; None where
        they never do in the range looked at.
    rough_settings, exact_settings : UltimateSettings or None
        PI settings by rule from both points.

    """

    factor: complex
    rough: Ultimate
    exact: Ultimate | None
    rough_settings: UltimateSettings | None = None
    exact_settings: UltimateSettings | None = None


def mcavoy(
    plant: Plant, inputs: Sequence[int], loop: int, alone: Ultimate, band: tuple[float, float]
) -> McAvoy:
    """Return the ultimate point of a loop among equal ones.

    Parameters
    ----------
    plant : Plant
        The plant, n x n.
    inputs : sequence of int
        The pairing: output i is controlled by input inputs[i].
    loop : int
        The output of the loop in question.
    alone : Ultimate
        Its ultimate point with the other loops open.
    band : tuple of float
        Range of frequencies looked at, rad per time unit.

    Raises
    ------
    InvalidInputError
        The inputs are no permutation, or a paired element is zero.

    """
    if sorted(inputs) != list(range(plant.n)):
        message = "the pairing must name every input once"
        raise InvalidInputError(message, "/loops")
    for row, column in enumerate(inputs):
        if plant.element(row, column).is_zero:
            message = (
                f"output {row + 1} does not react to input {column + 1}: they cannot be paired"
            )
            raise InvalidInputError(message, "/loops")
    own = plant.element(loop, inputs[loop])
    order = list(inputs)

    def eigenvalues(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        G = plant.response(omega)[:, :, order]
        diagonal = np.diagonal(G, axis1=1, axis2=2)
        return np.linalg.eigvals(G / diagonal[:, None, :]).astype(np.complex128)

    mu = eigenvalues(np.array([alone.omega]))[0]
    factor = complex(1 / mu[np.argmax(np.abs(mu))])
    rough = Ultimate(abs(factor) * alone.gain, alone.omega)

    def loci(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        value: NDArray[np.complex128] = eigenvalues(omega) * own.response(omega)[:, None]
        return value

    return McAvoy(factor, rough, _first_oscillation(loci, np.geomspace(*band, _GRID)))


def _first_oscillation(
    loci: Callable[[NDArray[np.float64]], NDArray[np.complex128]], grid: NDArray[np.float64]
) -> Ultimate | None:
    """Return the crossing of the negative real axis with the least gain, by any of the loci."""
    values = _followed(loci(grid))
    changes = (values.imag[:-1] * values.imag[1:] < 0) & (values.real[:-1] < 0)
    found = []
    crossings = np.argwhere(changes)
    # Only the least gain is wanted; a dead time crosses the axis at ever higher gains.
    strength = np.abs(values[crossings[:, 0], crossings[:, 1]])
    for index, branch in crossings[np.argsort(-strength)][:_MOST_REFINED]:
        near = values[index : index + 2, branch]

        def height(omega: float, near: NDArray[np.complex128] = near) -> float:
            now = loci(np.array([omega]))[0]
            return float(now[np.argmin(np.abs(now - near.mean()))].imag)

        low, high = float(grid[index]), float(grid[index + 1])
        if height(low) * height(high) >= 0:
            continue
        omega = float(brentq(height, low, high, xtol=1e-14 * low))
        now = loci(np.array([omega]))[0]
        value = complex(now[np.argmin(np.abs(now - near.mean()))])
        if value.real < 0:
            found.append(Ultimate(1 / abs(value), omega))
    return min(found, key=lambda point: point.gain, default=None)


def _followed(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Order the eigenvalues (k, n) of each frequency like those before."""
    ordered = values.copy()
    for index in range(1, len(ordered)):
        distance = np.abs(ordered[index - 1][:, None] - ordered[index][None, :])
        ordered[index] = ordered[index][linear_sum_assignment(distance)[1]]
    return ordered
