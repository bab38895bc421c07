"""A tuning as it is archived: the request and its result, both in their JSON form.

Page, notebook and report draw and print from this one record, whether it comes from the job
table, from a file or from a tuning just made.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from service.schemas import TuningRequest, TuningResult, parse, tuning_to_json
from service.wording import TIME_UNIT
from solver.model.controllers import Controller
from solver.model.loop_names import loops_text
from solver.model.mixed_plant import MixedPlant
from solver.model.plants import Plant
from solver.model.weights import Performance, Uncertainty
from solver.tuning.record import Tuning
from solver.tuning.specification import Specification

__all__ = ["MIXED", "RequestedTuning", "Setting"]


MIXED = (
    "loops share inputs, so none has one of its own; a step-response request with the same mixing "
    "simulates them"
)


@dataclass(frozen=True)
class Setting:
    """A controller and the units (from 0) that have it."""

    units: tuple[int, ...]
    controller: Controller

    @property
    def label(self) -> str:
        """Its loops in words."""
        return loops_text(self.units)


@dataclass(frozen=True)
class RequestedTuning:
    """A request and its result.

    Parameters
    ----------
    request : TuningRequest
        What was asked.
    result : TuningResult
        What was found; `loops` is empty where nothing was.
    unit : str
        Name of the unit of time.

    """

    request: TuningRequest
    result: TuningResult
    unit: str = TIME_UNIT

    @classmethod
    def from_json(
        cls, request: str | bytes, result: str | bytes, unit: str = TIME_UNIT
    ) -> RequestedTuning:
        """Return the record of two JSON texts.

        Raises
        ------
        RequestError
            A text that does not match its schema.

        """
        asked = parse(TuningRequest, request)
        return cls(asked, parse(TuningResult, result), asked.time_unit or unit)

    @classmethod
    def of(cls, request: TuningRequest, tuning: Tuning, unit: str = TIME_UNIT) -> RequestedTuning:
        """Return the record of a tuning just made."""
        return cls(request, TuningResult.model_validate(tuning_to_json(tuning)), unit)

    @cached_property
    def specification(self) -> Specification:
        """The task in the solver's form."""
        return self.request.build()

    @cached_property
    def arranged(self) -> Specification:
        """The task as the loops see it."""
        found = self.result.pairing
        return self.specification.arranged(None if found is None else tuple(found))

    @property
    def plant(self) -> Plant:
        """The plant as the loops see it: inputs paired, a scan time as dead time."""
        return self.arranged.plant

    @property
    def mixes_inputs(self) -> bool:
        """Whether loops share inputs: none has one of its own, which a figure could show."""
        return isinstance(self.plant, MixedPlant) and self.plant.shared

    @property
    def uncertainty(self) -> Uncertainty:
        """The uncertainty of its inputs, in the order of the loops that move them."""
        return self.arranged.uncertainty

    @property
    def performance(self) -> Performance:
        """The demand at the time constant of the result. Needs settings."""
        return replace(self.specification.performance, tau_p=self.result.tau_p)

    @cached_property
    def loops(self) -> tuple[Controller, ...]:
        """One controller a unit."""
        return tuple(loop.build() for loop in self.result.loops)

    @cached_property
    def settings(self) -> tuple[Setting, ...]:
        """The different settings."""
        if not self.loops:
            return ()
        return tuple(
            Setting(tuple(units), self.loops[units[0]]) for units in self.result.groups if units
        )

    @cached_property
    def identical(self) -> tuple[Controller, ...]:
        """The best identical settings, one controller a unit; empty where not compared."""
        comparison = self.result.comparison
        if comparison is None:
            return ()
        return (comparison.identical_loop.build(),) * self.plant.n

    @property
    def as_found(self) -> tuple[Controller, ...]:
        """Today's settings, one controller a unit; empty where the request names none."""
        return self.specification.as_found or ()
