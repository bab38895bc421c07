"""Of which two loops the effect is asked; light, since the service reads requests with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import Plant
from solver.model.transfer_function import LARGEST, refuse_vanishing
from solver.model.validation import instance, integer, reals, settle

if TYPE_CHECKING:
    from solver.model.transfer_function import TransferFunction

__all__ = ["MAX_GAINS", "LoopEffectQuery"]

MAX_GAINS = 100


@dataclass(frozen=True)
class LoopEffectQuery:
    """Asks what a proportional gain in one loop does to another loop.

    Parameters
    ----------
    plant : Plant
        The elements between the two loops are rational.
    loop, other : int
        Two different loops, from 0.
    gains : sequence of float
        Gains k of loop `other` at which to report, 1 to `MAX_GAINS`.
    controller : Controller or None
        Of loop `loop`; None leaves it open.

    """

    plant: Plant
    loop: int
    other: int
    gains: tuple[float, ...]
    controller: Controller | None = None

    def __post_init__(self) -> None:
        instance(self.plant, Plant, "/plant")
        if self.controller is not None:
            instance(self.controller, Controller, "/controller")
        settle(
            self,
            loop=integer(self.loop, "/loop"),
            other=integer(self.other, "/other"),
            gains=reals(self.gains, "/gains"),
        )
        for name, index in (("loop", self.loop), ("other", self.other)):
            if not 0 <= index < self.plant.n:
                message = f"the plant has the loops 0 to {self.plant.n - 1}"
                raise InvalidInputError(message, f"/{name}")
        if self.loop == self.other:
            message = "the other loop must differ from the loop"
            raise InvalidInputError(message, "/other")
        if not 1 <= len(self.gains) <= MAX_GAINS:
            message = f"the number of gains must lie in 1..{MAX_GAINS}"
            raise InvalidInputError(message, "/gains")
        for index, gain in enumerate(self.gains):
            if not abs(gain) <= LARGEST:
                message = f"a gain must be finite and at most {LARGEST:g} in magnitude"
                raise InvalidInputError(message, f"/gains/{index}")
            refuse_vanishing(gain, f"/gains/{index}")
        if any(element.dead_time and not element.is_zero for element in self.elements.values()):
            message = "the effect of a loop's gain is computed for plants without dead time only"
            raise UnsupportedPlantError(message, "/plant")

    @property
    def elements(self) -> dict[tuple[int, int], TransferFunction]:
        """The elements between the two loops, by output and input."""
        pair = (self.loop, self.other)
        return {(r, c): self.plant.element(r, c) for r in pair for c in pair}
