"""What is tuned by relay experiments, again and again; light, for the service that reads it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from solver.model.errors import InvalidInputError
from solver.model.plants import Plant
from solver.model.validation import instance, integer, integers, settle
from solver.relay.experiment import Relay

__all__ = ["MAX_LOOPS", "MAX_ROUNDS", "RelayTuning", "Rule"]

MAX_LOOPS = 4
MAX_ROUNDS = 20


class Rule(StrEnum):
    """Rule from an ultimate point to settings, see `solver.relay.settings`."""

    ZIEGLER_NICHOLS = "ziegler_nichols"
    TYREUS_LUYBEN = "tyreus_luyben"


@dataclass(frozen=True)
class RelayTuning:
    """What is tuned.

    Parameters
    ----------
    plant : Plant
        At most `MAX_LOOPS` loops.
    relay : Relay
        The relay of every experiment; its amplitude takes the sign of each process.
    rule : Rule
        From ultimate points to settings.
    pairing : tuple of int or None
        Input of each output; None: as numbered.
    rounds : int
        Most repetitions of steps 3 and 4.

    """

    plant: Plant
    relay: Relay
    rule: Rule = Rule.ZIEGLER_NICHOLS
    pairing: tuple[int, ...] | None = None
    rounds: int = 5

    def __post_init__(self) -> None:
        instance(self.plant, Plant, "/plant")
        instance(self.relay, Relay, "/relay")
        n = self.plant.n
        if not 2 <= n <= MAX_LOOPS:
            message = f"relay experiments loop by loop are for 2 to {MAX_LOOPS} loops"
            raise InvalidInputError(message, "/plant")
        if self.pairing is not None:
            settle(self, pairing=integers(self.pairing, "/pairing"))
            if sorted(self.pairing) != list(range(n)):
                message = f"a pairing names each of the {n} inputs once"
                raise InvalidInputError(message, "/pairing")
        settle(self, rounds=integer(self.rounds, "/rounds"))
        if not 1 <= self.rounds <= MAX_ROUNDS:
            message = f"1 to {MAX_ROUNDS} rounds"
            raise InvalidInputError(message, "/rounds")

    @property
    def inputs(self) -> tuple[int, ...]:
        """Input of each output."""
        return tuple(range(self.plant.n)) if self.pairing is None else self.pairing
