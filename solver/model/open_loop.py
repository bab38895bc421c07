"""Plants that the analyses of closed loops take: stable in open loop, or integrating."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import UnsupportedPlantError
from solver.model.measured import MeasuredPlant

if TYPE_CHECKING:
    from solver.model.plants import Plant

__all__ = ["require_supported"]


def require_supported(plant: Plant) -> None:
    """Refuse plants that are open-loop unstable.

    Raises
    ------
    UnsupportedPlantError
        An element has a pole in the right half plane, or on the imaginary axis away from 0.
        Poles at 0 (integrating processes) are fine.

    """
    if isinstance(plant, MeasuredPlant):
        return  # what its owner states of its poles is looked at where stability is decided
    for place in plant.places:
        poles = place.element.poles
        away = poles[np.abs(poles) > 0]
        # Roots of a polynomial with a double pole carry errors near sqrt(machine epsilon).
        bad = away[away.real > -1e-9 * np.abs(away)]
        if bad.size:
            message = (
                f"the plant is open-loop unstable (pole at {_text(bad[0])}); "
                "stabilise it with an inner loop first"
            )
            raise UnsupportedPlantError(message, f"/plant{place.pointer}/den")


def _text(pole: complex) -> str:
    if pole.imag == 0:
        return f"{pole.real:.6g}"
    return f"{pole.real:.6g}{pole.imag:+.6g}j"
