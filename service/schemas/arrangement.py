"""How loops and plant are connected, as JSON: pairing, and the scan of digital controllers."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

import solver.model.arranged
import solver.model.plants
from service.schemas.fields import WHOLE, AnalysisRequest, Time
from solver.model.plants import MAX_UNITS

__all__ = ["ArrangedRequest", "PairedInput", "Pairing"]

PairedInput = Annotated[int, Field(ge=0, lt=MAX_UNITS), WHOLE]
Pairing = Annotated[tuple[PairedInput, ...], Field(min_length=1, json_schema_extra={"x-unit": "1"})]


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
