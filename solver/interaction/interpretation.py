"""What a relative gain means, in a process engineer's words.

Bristol's reading (Astrom and Hagglund, section 11.2) and that of Smith and Corripio, section
9-1.2: with positive interaction the loops help each other, with negative interaction they fight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.pairing import BAND

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["InteractionSign", "LoopMeaning", "LoopReading", "interaction_sign", "read_loop"]

_EXACT = 1e-9  # a relative gain this near 0 or 1 is 0 or 1
# Interaction that nobody notices: a change of the gain by as much as a valve's or a transmitter's.
_SLIGHT = 0.02


class InteractionSign(StrEnum):
    """Sign of the interaction of a plant.

    NONE: every relative gain is 0 or 1 within 0.02. POSITIVE: all lie between 0 and 1; the loops
    help each other. NEGATIVE: some are negative, and then some above 1; the loops fight each other.
    """

    NONE = "none"
    POSITIVE = "positive"
    NEGATIVE = "negative"


class LoopMeaning(StrEnum):
    """What closing the other loops does to the gain of a loop.

    UNAFFECTED: nothing, or less than 2 per cent. HELPED: the gain rises. FOUGHT: it falls.
    REVERSED: it changes its sign. DEPENDENT: there is none with the others open, as good as none
    for a relative gain below 0.02.
    """

    UNAFFECTED = "unaffected"
    HELPED = "helped"
    FOUGHT = "fought"
    REVERSED = "reversed"
    DEPENDENT = "dependent"


@dataclass(frozen=True)
class LoopReading:
    """A loop as paired (output r with input r), from 0.

    `within_band` says whether its relative gain lies in 0.67..1.5, where single loops usually
    do; outside it decoupling can improve control.
    """

    loop: int
    relative_gain: float
    meaning: LoopMeaning
    within_band: bool
    text: str


def interaction_sign(relative_gains: NDArray[np.float64]) -> InteractionSign:
    """Return the sign of the interaction from the relative gain array, (n, n)."""
    near_whole = np.minimum(np.abs(relative_gains), np.abs(relative_gains - 1)) <= _SLIGHT
    if np.all(near_whole):
        return InteractionSign.NONE
    if np.min(relative_gains) >= -_EXACT:
        return InteractionSign.POSITIVE
    return InteractionSign.NEGATIVE


def read_loop(loop: int, relative_gain: float) -> LoopReading:
    """Return what the relative gain of a loop means.

    Parameters
    ----------
    loop : int
        Index from 0.
    relative_gain : float
        Gain with the other loops open over the gain with them closed and perfect.

    """
    name = f"Loop {loop + 1}"
    if abs(relative_gain) <= _EXACT:
        meaning = LoopMeaning.DEPENDENT
        text = (
            f"{name} acts through the other loops only: it fails when they are open. Pair it with "
            "another input; two loops interchanged then do not interact at all."
        )
    elif abs(relative_gain - 1) <= _EXACT:
        meaning = LoopMeaning.UNAFFECTED
        text = f"{name} keeps its gain when the other loops close."
    elif abs(relative_gain - 1) <= _SLIGHT:
        meaning = LoopMeaning.UNAFFECTED
        text = (
            f"{name} hardly notices the other loops: its gain goes to "
            f"{_number(1 / relative_gain)} times when they close."
        )
    elif relative_gain < 0:
        meaning = LoopMeaning.REVERSED
        text = (
            f"{name} changes the sign of its gain when the other loops close "
            f"(to {_number(1 / relative_gain)} times): it then acts the wrong way. "
            "Pair it with another input."
        )
    elif relative_gain < 1:
        meaning = LoopMeaning.HELPED
        text = (
            f"{name} is helped by the other loops: its gain rises to "
            f"{_number(1 / relative_gain)} times when they close."
        )
    else:
        meaning = LoopMeaning.FOUGHT
        text = (
            f"{name} is fought by the other loops: its gain falls to "
            f"{_number(1 / relative_gain)} times when they close."
        )
    return LoopReading(loop, relative_gain, meaning, BAND[0] <= relative_gain <= BAND[1], text)


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "infinitely many"
