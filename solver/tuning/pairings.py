"""Pairings of inputs and outputs that a tuning tries."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.integral_controllability import ControllabilityVerdict
from solver.interaction.pairing import rank_pairings
from solver.model.arranged import check_pairing
from solver.model.errors import InvalidInputError
from solver.model.plants import MAX_MATRIX_SIZE
from solver.stability.singular import is_singular
from solver.tuning.groupings import groupings

if TYPE_CHECKING:
    from solver.model.plants import Plant
    from solver.tuning.specification import Specification

__all__ = ["MOST_PAIRINGS", "pairings", "require_ranked"]

MOST_PAIRINGS = 6  # that are tuned, those nearest to no interaction first


def pairings(specification: Specification) -> tuple[tuple[int, ...], ...]:
    """Return the pairings to be tuned: the given one, or those that may have integral action.

    Of "best" those are tried that are not disproven to be decentralised integral
    controllable (DIC), the nearest to no interaction first.

    Raises
    ------
    InvalidInputError
        A plant whose static gain says nothing: integrating, singular, or of too many units; or
        groups of loops that have gains of opposite signs in each pairing.

    """
    plant, given = specification.plant, specification.pairing
    own = tuple(range(plant.n))
    if given is None:
        return (own,)
    if not isinstance(given, str):
        return (check_pairing(given, plant.n),)
    require_ranked(plant)
    found = [
        each.inputs
        for each in rank_pairings(plant.static_gain()).pairings
        if each.admissible
        and each.integral_controllability is not ControllabilityVerdict.IMPOSSIBLE
    ] or [own]
    fitting, refused = [], None
    for inputs in found:
        try:  # loops that share a gain may have processes of opposite signs in one pairing
            groupings(specification.arranged(inputs))
        except InvalidInputError as error:
            refused = refused or error
        else:
            fitting.append(inputs)
    if refused is not None and not fitting:
        raise refused
    return tuple(fitting[:MOST_PAIRINGS])


def require_ranked(plant: Plant) -> None:
    """Refuse a plant whose static gain ranks no pairings.

    Raises
    ------
    InvalidInputError
        Too many units, an integrating plant, or a singular gain.

    """
    if plant.n > MAX_MATRIX_SIZE:
        message = f"pairings are sought for up to {MAX_MATRIX_SIZE} units; give it as a list"
        raise InvalidInputError(message, "/pairing")
    gain = plant.static_gain()
    if not np.isfinite(gain).all():
        message = "the plant integrates, so its static gain ranks no pairings; give it as a list"
        raise InvalidInputError(message, "/pairing")
    if is_singular(gain):
        message = "the static gain is singular, so that no pairing is better than another"
        raise InvalidInputError(message, "/pairing")
