"""Loops as the plant knows them: by their tags where the request gives them, and their signals."""

from __future__ import annotations

from collections.abc import Sequence

from service.schemas.fields import Instrument
from service.tuned import RequestedTuning
from solver.model.loop_names import loops_text

__all__ = ["instrument_of", "loops_name"]

_LISTED = 3  # tags that are told one by one


def instrument_of(tuned: RequestedTuning, unit: int) -> Instrument:
    """Return the signals of a unit (from 0), unknown ones where the request does not give them."""
    n = tuned.plant.n
    own = tuned.request.signals(n)[unit]
    # One entry for all of several loops says their spans, and no tag of any of them.
    shared = n > 1 and len(tuned.request.instruments or ()) == 1
    return own.model_copy(update={"tag": None}) if shared else own


def loops_name(tuned: RequestedTuning, units: Sequence[int]) -> str:
    """Return ``TIC-101, TIC-103``, ``TIC-101 to TIC-106`` or, without tags, ``loops 1-6``."""
    tags = [tag for unit in units if (tag := instrument_of(tuned, unit).tag)]
    if len(tags) < len(units):
        return loops_text(units)
    together = list(units) == list(range(units[0], units[0] + len(units)))
    return f"{tags[0]} to {tags[-1]}" if len(tags) > _LISTED and together else ", ".join(tags)
