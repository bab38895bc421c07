"""Of which loops it is asked what they see; light, since the service reads requests with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.model.controllers import Controller
from solver.model.equality import ByValue
from solver.model.errors import InvalidInputError
from solver.model.plants import Plant
from solver.model.validation import MAX_FREQUENCIES, frequencies, instance, settle

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["LoopResponsesQuery"]


@dataclass(frozen=True, eq=False)
class LoopResponsesQuery(ByValue):
    """A plant and its loops.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    loops : tuple of Controller or None
        One a unit; None: the loop is open.
    omega : (k,) or None
        Frequencies, rad per time unit, > 0; None: chosen from plant and loops.

    """

    plant: Plant
    loops: tuple[Controller | None, ...]
    omega: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        instance(self.plant, Plant, "/plant")
        if len(self.loops) != self.plant.n:
            message = f"{len(self.loops)} loops for a plant of {self.plant.n} units"
            raise InvalidInputError(message, "/loops")
        if self.omega is not None:
            settle(self, omega=frequencies(self.omega, most=MAX_FREQUENCIES))
