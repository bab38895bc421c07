"""Right-half-plane zeros of a loop's own element: a limit of the loop alone.

With the other loops open a loop sees its own element p_kk, and a zero of it in the right half plane
limits the bandwidth whatever the controller. With the others closed it is the zeros of the plant
that count, and they need not be the same: Astrom and Hagglund, Example 11.4, has zeros in its
elements and none in the plant, so that all loops together are as fast as one likes and each alone
is not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.zeros import bandwidth_limit

if TYPE_CHECKING:
    from solver.interaction.zeros import TransmissionZeros
    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction

__all__ = ["LoopLimit", "loop_limits"]


@dataclass(frozen=True)
class LoopLimit:
    """What the zeros of its own element forbid a loop that runs alone.

    Attributes
    ----------
    units : tuple of int
        Loops with this element, from 0.
    zeros : tuple of complex
        Those with Re >= 0, rad per time unit, by magnitude.
    alone : float
        Greatest bandwidth of the loop alone, rad per time unit, for a peak of its sensitivity of 2.
    together : float or None
        The limit from the plant's own zeros, for the worst direction of all loops together; None
        where it has none.
    text : str
        The same in words.

    """

    units: tuple[int, ...]
    zeros: tuple[complex, ...]
    alone: float
    together: float | None
    text: str


def loop_limits(plant: Plant, zeros: TransmissionZeros) -> tuple[LoopLimit, ...]:
    """Return the limits of the loops as numbered, those without one left out.

    Parameters
    ----------
    plant : Plant
        Any plant of two units or more; one alone has no other loops, and no limits here.
    zeros : TransmissionZeros
        Of the plant.

    """
    if plant.n == 1:
        return ()
    own: dict[TransferFunction, list[int]] = {}
    for kind in plant.kinds:
        own.setdefault(plant.element(kind[0], kind[0]), []).extend(kind)
    found = []
    for element, units in own.items():
        if element.is_zero:
            continue
        unsafe = element.zeros[element.zeros.real >= 0]
        if not unsafe.size:
            continue
        ordered = tuple(complex(zero) for zero in unsafe[np.argsort(np.abs(unsafe))])
        alone = min(bandwidth_limit(zero) for zero in ordered)
        together = zeros.bandwidth_limit
        found.append(
            LoopLimit(
                tuple(units), ordered, alone, together, _text(units, ordered, alone, together)
            )
        )
    return tuple(found)


def _text(
    units: list[int], zeros: tuple[complex, ...], alone: float, together: float | None
) -> str:
    names = ", ".join(str(unit + 1) for unit in units[:5]) + (", ..." if len(units) > 5 else "")
    where = f"{zeros[0].real:.3g}" if zeros[0].imag == 0 else f"{zeros[0]:.3g}"
    text = (
        f"Loop{'s' if len(units) > 1 else ''} {names} alone: limited to {alone:.3g} rad per time "
        f"unit by a zero at {where} of the own element; "
    )
    if together is None:
        return text + (
            "all loops together are not limited by zeros. Tuned faster than that, they lose "
            "stability when one of them is opened."
        )
    return text + f"all loops together, in the worst direction, to {together:.3g}."
