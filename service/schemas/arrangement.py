"""How loops and plant are connected, as JSON: pairing, and the scan of digital controllers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

import solver.model.arranged
import solver.model.plants
from service.schemas.fields import WHOLE, AnalysisRequest, Time
from solver.model.plants import MAX_UNITS

__all__ = ["ArrangedRequest", "PairedInput", "Pairing", "PairingOrBest"]

PairedInput = Annotated[int, Field(ge=0, lt=MAX_UNITS, json_schema_extra={"x-index": True}), WHOLE]
Pairing = Annotated[tuple[PairedInput, ...], Field(min_length=1, json_schema_extra={"x-unit": "1"})]


def _form(value: Any) -> str:  # noqa: ANN401 - whatever the caller sent
    """Tell a word from a list."""
    return "best" if isinstance(value, str) else "list"


PairingOrBest = Annotated[
    Annotated[Pairing, Tag("list")] | Annotated[Literal["best"], Tag("best")], Discriminator(_form)
]


class ArrangedRequest(AnalysisRequest):
    """Base of analyses of loops that are paired, and that digital controllers run."""

    pairing: Pairing | None = Field(
        default=None,
        description="Input, from 0, of each output; null: output i by input i.",
        examples=[None, [1, 0]],
    )
    scan_time: Time = Field(
        default=0.0,
        description="Time between two scans of a digital controller; 3/2 of it is dead time in "
        "every loop, for hold and computation.",
        examples=[0.0],
    )

    def arranged(self, plant: solver.model.plants.Plant) -> solver.model.plants.Plant:
        """Return a plant as the loops see it.

        Raises
        ------
        InvalidInputError
            A pairing that does not fit the plant.

        """
        plant = solver.model.arranged.sampled(plant, self.scan_time)
        return plant if self.pairing is None else solver.model.arranged.paired(plant, self.pairing)
