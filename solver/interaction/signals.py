"""How two loops help or fight each other, signal by signal, and how their controllers act.

The reading of Smith and Corripio, section 9-1.2 (figs. 9-1.5 and 9-1.6): follow a change of one set
point through both loops by the signs of the gains. Section 9-2: interaction that goes one way only
leaves the stability of the loops alone.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.model.plants import Plant

__all__ = ["Action", "controller_actions", "one_way", "signals"]


class Action(StrEnum):
    """How a controller acts.

    REVERSE: its output falls when its measurement rises, for a process with positive gain. DIRECT:
    its output rises, for one with negative gain.
    """

    REVERSE = "reverse"
    DIRECT = "direct"


def controller_actions(own_gains: NDArray[np.float64]) -> tuple[Action | None, ...]:
    """Return how the controller of each loop must act; None where its process has no gain.

    Parameters
    ----------
    own_gains : (n,)
        Static gains of the loops' own processes, of either sign, infinite where they integrate.

    """
    return tuple(
        None if gain == 0 or math.isnan(gain) else Action.REVERSE if gain > 0 else Action.DIRECT
        for gain in own_gains.tolist()
    )


def signals(gain: NDArray[np.float64], relative_gain: float) -> tuple[str, ...]:
    """Return what happens in two loops when the set point of the first one falls.

    Parameters
    ----------
    gain : (2, 2)
        Static gains, finite.
    relative_gain : float
        Of loop 1.

    Returns
    -------
    tuple of str
        Sentences; none where a gain is zero, and nothing goes round.

    """
    if not gain.all():
        return ()
    actions = controller_actions(gain.diagonal())
    first = -1 if gain[0, 0] > 0 else 1
    crossed = 1 if gain[1, 0] * first > 0 else -1
    second = -crossed if gain[1, 1] > 0 else crossed
    back = 1 if gain[0, 1] * second > 0 else -1
    if back < 0:
        end = "the way it was to go: loop 2 helps loop 1"
    elif relative_gain < 0:
        end = (
            "against the way it was to go, and farther than controller 1 moves it: with loop 2 "
            "closed controller 1 acts the wrong way"
        )
    else:
        end = "against the way it was to go: loop 2 fights loop 1"
    return (
        f"Controller 1 is {actions[0]} acting, controller 2 {actions[1]} acting.",
        f"The set point of loop 1 falls: input 1 {_goes(first)} until output 1 has fallen.",
        f"Input 1 moves output 2 too: it {_goes(crossed)}.",
        f"Controller 2 answers: input 2 {_goes(second)}.",
        f"Input 2 moves output 1 too: it {_goes(back)}, {end}.",
    )


def one_way(plant: Plant) -> str | None:
    """Say what it means that of two loops only one disturbs the other; None where both do."""
    if plant.n != 2:
        return None
    first, second = plant.element(0, 1).is_zero, plant.element(1, 0).is_zero
    if first and second:
        return "No loop disturbs the other: they are stable together where each is alone."
    if not first and not second:
        return None
    disturbed, other = (1, 2) if second else (2, 1)
    return (
        f"Loop {other} disturbs loop {disturbed}, which does not answer: interaction goes one "
        "way, so the loops are stable together where each is alone."
    )


def _goes(direction: int) -> str:
    return "rises" if direction > 0 else "falls"
