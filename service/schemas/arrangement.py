"""How loops and plant are connected, as JSON: pairing, and the scan of digital controllers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

import solver.model.arranged
import solver.model.mixing
import solver.model.plants
from service.schemas.fields import WHOLE, AnalysisRequest, Time, below
from service.schemas.mixing import Mixing
from solver.model.errors import InvalidInputError
from solver.model.mixing import summed_outputs
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

    mixing: Mixing | None = Field(
        default=None,
        description="Coupled objectives: which combinations of outputs the loops control, and of "
        "inputs they move. null: loop i controls output i.",
        examples=[None],
    )

    def arranged(self, plant: solver.model.plants.Plant) -> solver.model.plants.Plant:
        """Return a plant as the loops see it.

        Raises
        ------
        InvalidInputError
            A pairing, or combinations, that do not fit the plant.

        """
        plant = solver.model.arranged.sampled(plant, self.scan_time)
        if self.mixing is not None:
            return self._mixed(plant, self.mixing)
        return plant if self.pairing is None else solver.model.arranged.paired(plant, self.pairing)

    def _mixed(self, plant: solver.model.plants.Plant, given: Mixing) -> solver.model.plants.Plant:
        """Return the plant from its inputs to what the loops control."""
        with below("/mixing"):
            mixing = given.build()
        mixing.require_size(plant.n, "/mixing")
        if self.pairing is not None:
            message = "with combinations of signals, order their rows and columns instead"
            raise InvalidInputError(message, "/pairing")
        return self.combined(plant, mixing)

    def combined(
        self, plant: solver.model.plants.Plant, mixing: solver.model.mixing.Mixing
    ) -> solver.model.plants.Plant:
        """Return the plant from its inputs, of which each loop moves one, to what loops control.

        Raises
        ------
        InvalidInputError
            Loops that move several, which this analysis does not know.

        """
        if mixing.inputs is not None:
            message = (
                "loops that move combinations of inputs are for tuning, robustness and step "
                "responses: for anything else leave inputs out"
            )
            raise InvalidInputError(message, "/mixing/inputs")
        return summed_outputs(plant, mixing)

    @property
    def order(self) -> tuple[int, ...] | None:
        """The input of each loop, where each has one of its own; None: as they come."""
        return self.pairing if self.mixing is None else self.mixing.build().own_inputs
