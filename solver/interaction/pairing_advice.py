"""What relative gains and pairings call for, in words.

Large relative gains: Skogestad, Lundstrom and Hovd (1989), section 4.2. Band and worst case of
relative gains: Astrom and Hagglund, section 11.2, and Smith and Corripio, section 9-1.2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.integral_controllability import ControllabilityVerdict
from solver.interaction.interpretation import LoopMeaning
from solver.interaction.pairing import BAND

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.interaction.integral_controllability import IntegralControllability
    from solver.interaction.interpretation import LoopReading
    from solver.interaction.nearest_parallel import NearestParallel
    from solver.interaction.pairing import PairingRanking

__all__ = ["gain_warnings", "pairing_warnings", "parallel_warnings"]

LARGE = 10.0  # SLH: from here on control is difficult whatever the controller
_VERY_LARGE = 100.0
_UNEVEN = 5.0  # of the two eigenvalues: one direction is weak
_EVEN = 0.05  # a relative gain this near 0.5 favours neither pairing of two loops


def gain_warnings(
    relative_gains: NDArray[np.float64] | None, loops: Sequence[LoopReading]
) -> tuple[str, ...]:
    """Return what the size of the relative gains says of control by any controller.

    Parameters
    ----------
    relative_gains : ndarray or None
        All different ones of the plant, in any shape; (2, 2) means two loops.
    loops : sequence of LoopReading
        The loops as numbered.

    """
    if relative_gains is None:
        return ()
    found = []
    largest = float(np.max(np.abs(relative_gains)))
    if largest >= LARGE:
        degree = "nearly singular" if largest >= _VERY_LARGE else "ill-conditioned"
        found.append(
            f"Relative gains up to {largest:.3g}: the plant is {degree}, and no controller changes "
            f"that. An error of 1/{largest:.3g} in one element can make the gain singular, so "
            "decouplers and other inverses are not to be trusted; single loops must go slowly in "
            "one direction."
        )
    if np.shape(relative_gains) == (2, 2) and abs(relative_gains[0, 0] - 0.5) <= _EVEN:
        found.append(
            f"A relative gain of {relative_gains[0, 0]:.3g}: neither pairing is better than the "
            "other, interaction between two loops that help each other is at its worst."
        )
    outside = [
        str(reading.loop + 1)
        for reading in loops
        if not reading.within_band
        and reading.meaning not in {LoopMeaning.DEPENDENT, LoopMeaning.REVERSED}
    ]
    if outside and largest < LARGE:
        found.append(
            f"The relative gains of loops {', '.join(outside)} lie outside {BAND[0]:g}..{BAND[1]:g}"
            ": a decoupler can improve control."
            if len(outside) > 1
            else f"The relative gain of loop {outside[0]} lies outside {BAND[0]:g}..{BAND[1]:g}: "
            "a decoupler can improve control."
        )
    return tuple(found)


def pairing_warnings(
    ranking: PairingRanking | None, controllability: IntegralControllability | None
) -> tuple[str, ...]:
    """Return whether another pairing should be taken, and whether there is one at all.

    Parameters
    ----------
    ranking : PairingRanking or None
        Of the plant.
    controllability : IntegralControllability or None
        Of the pairing as numbered; None where the conditions do not apply.

    """
    if ranking is None:
        return ()
    best = ranking.recommended
    if best is None:
        examined = f"{ranking.examined} pairings{'' if ranking.exhaustive else ' examined'}"
        reason = (
            "is decentralised integral controllable"
            if any(pairing.integral_controllability for pairing in ranking.pairings)
            else "has positive relative gains and a positive Niederlinski index"
        )
        message = (
            f"None of the {examined} {reason}: whichever is taken, some loop "
            "has to be retuned or opened when another one goes to manual. Consider other inputs "
            "or outputs, or a multivariable controller."
        )
        return (message,)
    found = []
    if controllability is not None and controllability.verdict is ControllabilityVerdict.IMPOSSIBLE:
        inputs = ", ".join(str(index + 1) for index in best.inputs[:10])
        found.append(
            f"Take the inputs {inputs}{', ...' if len(best.inputs) > 10 else ''} for the outputs "
            "1, 2, ... instead: so paired, "
            + (
                "loops may be detuned and switched off one by one."
                if best.integral_controllability is ControllabilityVerdict.GUARANTEED
                else "no condition excludes that loops are detuned and switched off one by one."
            )
        )
    return tuple(found)


def parallel_warnings(nearest: NearestParallel | None) -> tuple[str, ...]:
    """Say of a matrix plant that it is nearly a parallel one, and what that means.

    Parameters
    ----------
    nearest : NearestParallel or None
        The nearest parallel plant; None where there is none.

    """
    if nearest is None or not nearest.near:
        return ()
    turned = [
        f"{name} {index + 1}"
        for name, signs in (("output", nearest.output_signs), ("input", nearest.input_signs))
        for index, sign in enumerate(signs)
        if sign < 0
    ]
    signs = f", the sign of {' and '.join(turned)} turned" if turned else ""
    n = len(nearest.input_signs)
    total, difference = abs(1 + (n - 1) * nearest.interaction), abs(1 - nearest.interaction)
    message = (
        f"The plant is nearly {n} identical units with a = {nearest.interaction:.3g} (within "
        f"{100 * nearest.greatest_distance:.3g} % at every frequency{signs}): what is said of "
        "parallel units nearly holds"
    )
    if max(total, difference) > _UNEVEN * min(total, difference):
        weak = "sum" if total < difference else "differences"
        message += (
            f". The {weak} of the outputs, signs so turned, is the weak direction; unlike settings "
            "may serve better than alike ones"
        )
    return (message + ".",)
