"""The sequence of four relay experiments on two loops, repeated with the settings they give.

Johansson, Difficulties When Applying SISO Relay Design Methods to a MIMO-System, TFRT-7506 (1993),
section 3: a relay between every input and every output, the other loop open; PI settings by rule
from each; the same four with the other loop under the settings just found; again until the settings
stay, or an experiment gives none. The open-loop experiments are records besides, and tell the plant
itself, which the settings never do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from solver.identification.identify import identify
from solver.identification.relay_record import relay_record
from solver.model.errors import InvalidInputError
from solver.model.plants import Plant
from solver.model.validation import choice, instance, integer
from solver.relay.analysis import relay_experiment
from solver.relay.behaviour import Behaviour
from solver.relay.experiment import PlacedLoop, Relay, RelayExperiment
from solver.simulation.loops import Loop

if TYPE_CHECKING:
    from collections.abc import Mapping

    from solver.identification.identify import Identification
    from solver.model.controllers import Controller
    from solver.relay.analysis import RelayOutcome
    from solver.relay.describing_function import Ultimate

__all__ = ["RelayRule", "RelaySequence", "RelayTrial", "relay_sequence"]

MAX_ROUNDS = 20
PAIRS = ((0, 0), (0, 1), (1, 0), (1, 1))
SETTLED = 0.01  # relative change of every setting at which rounds end


class RelayRule(StrEnum):
    """PI settings from the ultimate point."""

    ZIEGLER_NICHOLS = "ziegler_nichols"
    TYREUS_LUYBEN = "tyreus_luyben"


@dataclass(frozen=True)
class RelayTrial:
    """One experiment of the sequence.

    Attributes
    ----------
    round : int
        0: the other loop is open.
    output, input : int
        What the relay connects, from 0.
    behaviour : Behaviour
        How the experiment ended.
    ultimate : Ultimate or None
        The ultimate point, where the cycle is at one.
    settings : Controller or None
        PI settings by the rule; None without an ultimate point.

    """

    round: int
    output: int
    input: int
    behaviour: Behaviour
    ultimate: Ultimate | None
    settings: Controller | None


@dataclass(frozen=True, eq=False)
class RelaySequence:
    """The rounds of a sequence, and the plant that its open-loop experiments tell.

    Attributes
    ----------
    trials : tuple of RelayTrial
        Round by round, each of four experiments or of those that could be made.
    converged : bool
        Whether all settings of the last round are those of the round before.
    verdict : str
        Why the sequence ended, in words.
    identification : Identification or None
        The plant from the open-loop experiments; None where they tell none.
    obstacle : str or None
        Why they tell none.

    """

    trials: tuple[RelayTrial, ...]
    converged: bool
    verdict: str
    identification: Identification | None
    obstacle: str | None


def relay_sequence(
    plant: Plant,
    relay: Relay,
    duration: float,
    *,
    rule: RelayRule | str = RelayRule.ZIEGLER_NICHOLS,
    rounds: int = 5,
) -> RelaySequence:
    """Make the experiments.

    Parameters
    ----------
    plant : Plant
        Of two loops.
    relay : Relay
        The same in every experiment; where it does not cycle in an open loop it is turned round.
    duration : float
        Of each experiment.
    rule : RelayRule or str
        Settings from an ultimate point.
    rounds : int
        At most so many with the other loop closed.

    Raises
    ------
    InvalidInputError
        Another number of loops; more rounds than permitted.

    """
    instance(plant, Plant, "/plant")
    rule, rounds = choice(RelayRule, rule, "/rule"), integer(rounds, "/rounds")
    if plant.n != len(PAIRS) // 2:
        message = f"the sequence is one of two loops, and the plant has {plant.n}"
        raise InvalidInputError(message, "/plant")
    if not 1 <= rounds <= MAX_ROUNDS:
        message = f"must lie in 1..{MAX_ROUNDS}"
        raise InvalidInputError(message, "/rounds")
    opened = _open_loops(plant, relay, duration)
    trials = [_trial(0, pair, outcome, rule) for pair, (_, outcome) in opened.items()]
    settings = _settings(trials)
    converged, verdict = False, f"the settings still move after {rounds} rounds"
    for count in range(1, rounds + 1):
        made = []
        for pair, (experiment, _) in opened.items():
            other = (1 - pair[0], 1 - pair[1])
            if other in settings:
                loops = (PlacedLoop(*other, Loop.of(settings[other])),)
                outcome = relay_experiment(replace(experiment, loops=loops))
                made.append(_trial(count, pair, outcome, rule))
        trials += made
        before, settings = settings, _settings(made)
        if not settings:
            verdict = f"in round {count} no experiment gives settings: {_endings(made)}"
            break
        converged = settings.keys() == before.keys() and all(
            _same(settings[pair], before[pair]) for pair in settings
        )
        if converged:
            held = ", ".join(f"output {o + 1} by input {i + 1}" for o, i in settings)
            verdict = f"from round {count} on the settings stay, of {held}"
            break
    found, obstacle = _identified(opened)
    return RelaySequence(tuple(trials), converged, verdict, found, obstacle)


def _open_loops(
    plant: Plant, relay: Relay, duration: float
) -> dict[tuple[int, int], tuple[RelayExperiment, RelayOutcome]]:
    """Return the four experiments with the other loop open, each with the sign that cycles."""
    found = {}
    for pair in PAIRS:
        tried = []
        for turned in (relay, replace(relay, amplitude=-relay.amplitude)):
            experiment = RelayExperiment(plant, *pair, turned, (), duration)
            tried.append((experiment, relay_experiment(experiment)))
            if tried[-1][1].behaviour is Behaviour.LIMIT_CYCLE:
                break
        cycling = tried[-1][1].behaviour is Behaviour.LIMIT_CYCLE
        found[pair] = tried[-1] if cycling else tried[0]
    return found


def _settings(trials: list[RelayTrial]) -> dict[tuple[int, int], Controller]:
    return {(t.output, t.input): t.settings for t in trials if t.settings is not None}


def _trial(count: int, pair: tuple[int, int], outcome: RelayOutcome, rule: RelayRule) -> RelayTrial:
    cycle = outcome.cycle
    found = None if cycle is None else cycle.settings
    return RelayTrial(
        count,
        *pair,
        outcome.behaviour,
        None if cycle is None else cycle.ultimate,
        None if found is None else getattr(found, rule.value),
    )


def _same(a: Controller, b: Controller) -> bool:
    pairs = [(a.gain, b.gain), (a.integral_time or 0.0, b.integral_time or 0.0)]
    return all(abs(x - y) <= SETTLED * abs(y) for x, y in pairs)


def _endings(made: list[RelayTrial]) -> str:
    words = [
        f"output {t.output + 1} by input {t.input + 1}: {t.behaviour.value.replace('_', ' ')}"
        for t in made
    ]
    return "; ".join(words) or "no loop has settings that could be closed"


def _identified(
    outcomes: Mapping[tuple[int, int], tuple[RelayExperiment, RelayOutcome]],
) -> tuple[Identification | None, str | None]:
    """Return the plant from an experiment on each input, those that cycle preferred."""
    records = []
    for source in range(len(PAIRS) // 2):
        mine = [outcomes[pair] for pair in PAIRS if pair[1] == source]
        cycling = [one for one in mine if one[1].behaviour is Behaviour.LIMIT_CYCLE]
        experiment, outcome = (cycling or mine)[0]
        records.append(relay_record(experiment, outcome, f"relay on input {source + 1}"))
    try:
        return identify(records), None
    except InvalidInputError as error:
        return None, error.message
