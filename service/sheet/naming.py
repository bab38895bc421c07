"""Loops as the plant knows them: by their tags where the request gives them, and their signals."""

from __future__ import annotations

from collections.abc import Sequence

from service.loop_tags import called, tags_of
from service.schemas.fields import Instrument
from service.tuned import RequestedTuning, Setting
from solver.model.controllers import Controller

__all__ = ["instrument_of", "loops_name", "unlike", "with_unit"]


def instrument_of(tuned: RequestedTuning, unit: int) -> Instrument:
    """Return the signals of a unit (from 0), unknown ones where the request does not give them."""
    n = tuned.plant.n
    own = tuned.request.signals(n)[unit]
    # One entry for all of several loops says their spans, and no tag of any of them.
    shared = n > 1 and len(tuned.request.instruments or ()) == 1
    return own.model_copy(update={"tag": None}) if shared else own


def unlike(tuned: RequestedTuning) -> tuple[Setting, ...]:
    """Return the different settings, those of equal units that came out equal as one."""
    if not tuned.plant.interchangeable:
        return tuned.settings
    found: dict[Controller, tuple[int, ...]] = {}
    for setting in tuned.settings:
        units = found.get(setting.controller, ()) + setting.units
        found[setting.controller] = tuple(sorted(units))
    return tuple(Setting(units, controller) for controller, units in found.items())


def with_unit(tuned: RequestedTuning, words: str, signal: str) -> str:
    """Return the head of a column, with the unit of the signals where all loops have the same."""
    units = {getattr(instrument_of(tuned, unit), f"{signal}_unit") for unit in range(tuned.plant.n)}
    unit = units.pop() if len(units) == 1 else None
    return f"{words}, {unit}" if unit else words


def loops_name(tuned: RequestedTuning, units: Sequence[int]) -> str:
    """Return ``TIC-101, TIC-103``, ``TIC-101 to TIC-106`` or, without tags, ``loops 1-6``."""
    return called(units, tags_of(tuned.request, tuned.plant.n))
