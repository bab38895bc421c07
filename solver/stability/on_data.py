"""Nominal stability of loops around a plant whose frequency response is known at points only.

det(I + G C) turns once for each closed-loop pole in the right half plane (Nyquist). On data that is
decided where they permit it:

- below the first frequency the plant is at rest there: G is its static gain, and C is known;
- beyond the last one the loop gain stays below one, so that det cannot go around the origin any
  more: the spectral radius of |G| |C| is below one there, in any units of the signals, and what
  happens further up is taken to be less;
- from one frequency to the next det turns by far less than half a turn.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import UnsupportedPlantError
from solver.stability.singular import is_singular

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.measured import MeasuredPlant

__all__ = ["Undecided", "at_rest", "unstable_poles_on_data"]

AT_REST = 0.3  # of |G(0)^-1 G - I| at the first frequency: a lag has turned 17 degrees by then
MOST_TURNED = 2.0  # radians of det between neighbours; more might be less the other way round
NEAR_WHOLE = 0.25  # turns that may be missing where the loop gain has not died away
SLOWER = 1e-3  # of all rates of the loop: there det is what the integrators make of it
PER_DECADE = 8


class Undecided(str):  # noqa: SLOT000 - a reason, told apart from a number by its class
    """Why the data do not decide on stability."""


def at_rest(plant: MeasuredPlant) -> NDArray[np.float64]:
    """Return the static gain, (n, n), that the first frequency shows.

    Raises
    ------
    UnsupportedPlantError
        The number of unstable poles is not stated, or is not zero; or the plant is not at rest at
        its first frequency, or is singular there.

    """
    if plant.unstable_poles is None:
        message = (
            "state unstable_poles: a response on the axis does not show poles in the right half "
            "plane; 0 says that the plant settles by itself after a step of any input"
        )
        raise UnsupportedPlantError(message, "/plant/unstable_poles")
    if plant.unstable_poles:
        message = (
            "plants with poles in the right half plane, or integrating ones, are not tuned on "
            "data: stabilise them with an inner loop first, or give transfer functions"
        )
        raise UnsupportedPlantError(message, "/plant/unstable_poles")
    first = plant.values[0]
    gain: NDArray[np.float64] = first.real.copy()
    if is_singular(gain):
        message = "at the first frequency the plant is singular: its outputs are not independent"
        raise UnsupportedPlantError(message, "/plant/elements")
    # A spectral radius: the same in any units of the inputs, and the weak direction counts fully.
    moved = np.linalg.solve(gain, first) - np.eye(plant.n)
    turned = float(np.abs(np.linalg.eigvals(moved)).max())
    if turned > AT_REST:
        message = (
            f"at the first frequency, {plant.omega[0]:.4g}, the plant is not at rest yet (its gain "
            f"differs from a static one by {100 * turned:.3g} %), so stability cannot be decided: "
            "measure further down"
        )
        raise UnsupportedPlantError(message, "/plant/omega/0")
    return gain


def unstable_poles_on_data(
    plant: MeasuredPlant, gain: NDArray[np.float64], loops: Sequence[Controller]
) -> int | Undecided:
    """Count the closed-loop poles in the right half plane, or say why the data do not tell.

    Parameters
    ----------
    plant : MeasuredPlant
        Without poles in the right half plane.
    gain : (n, n)
        Its static gain, see `at_rest`.
    loops : sequence of Controller
        One a unit.

    """
    high = np.abs(np.array([loop.response(plant.omega[-1:])[0] for loop in loops]))
    if np.abs(np.linalg.eigvals(np.abs(plant.values[-1]) * high)).max() >= 1:
        return Undecided(
            f"at the last frequency, {plant.omega[-1]:.4g}, the loop gain is not below 1: the data "
            "end too early for these settings"
        )
    integrators = np.array([loop.integral_time is not None for loop in loops])
    slow = np.array([loop.gain / (loop.integral_time or math.inf) for loop in loops])
    times = [t for loop in loops for t in (loop.integral_time, loop.lag_time) if t]
    rates = [*(1 / t for t in times), float(plant.omega[0])]
    if integrators.all():
        rates.append(float(np.abs(np.linalg.eigvals(gain * slow)).min()))
    low = SLOWER * min(rate for rate in rates if rate > 0)
    count = math.ceil(PER_DECADE * math.log10(plant.omega[0] / low)) + 1
    below = np.geomspace(low, plant.omega[0], count)[:-1]
    omega = np.concatenate([below, plant.omega])
    G = np.concatenate([np.broadcast_to(gain, (below.size, *gain.shape)), plant.values])
    c = np.stack([loop.response(omega) for loop in loops], axis=-1)
    det = np.linalg.det(np.eye(plant.n) + G * c[:, None, :])
    steps = np.angle(det[1:] / det[:-1])
    widest = int(np.abs(steps).argmax())
    if not abs(steps[widest]) <= MOST_TURNED:
        return Undecided(
            f"between {omega[widest]:.4g} and {omega[widest + 1]:.4g} rad per time unit the data "
            "are too far apart to follow the loop"
        )
    # From -m pi/2 of m integrators to 0 a stable loop turns by m pi/2; each pole takes pi of it.
    turns = float(integrators.sum() / 2 - steps.sum() / math.pi)
    if abs(turns - round(turns)) > NEAR_WHOLE:
        return Undecided("the data end before the loop has come to rest")
    if round(turns) < 0:
        return Undecided(
            "the data turn as those of a plant with poles in the right half plane do, against what "
            "is stated of them"
        )
    return round(turns)
