"""Settings by relay experiments in all loops, again and again: Johansson (1993), section 3.

1. Relay experiments in all pairs of an input and an output, everything else open. 2. PI settings by
rule. 3. Relay experiments in each loop of the pairing, the other loops under their settings. 4. PI
settings by rule from those; 3 and 4 are repeated while the settings change. Where a loop shows no
ultimate point with the others closed the algorithm ends there, and that is its result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.model.frequencies import corners_of
from solver.model.open_loop import require_supported
from solver.model.plants import MatrixPlant
from solver.model.validation import instance
from solver.relay.analysis import relay_experiment
from solver.relay.describing_function import ultimate_point
from solver.relay.experiment import PlacedLoop, Relay, RelayExperiment
from solver.relay.sequential_query import RelayTuning
from solver.simulation.loops import Loop
from solver.stability.closed_loop import is_stable

if TYPE_CHECKING:
    from solver.model.controllers import Controller
    from solver.model.transfer_function import TransferFunction
    from solver.relay.behaviour import Behaviour
    from solver.relay.describing_function import Ultimate

__all__ = ["RelayTuningOutcome", "TunedByRelay", "Verdict", "experiment_of", "relay_tuning"]

SAME = 0.02  # relative change of settings below which nothing changes any more
_PERIODS_OPEN, _PERIODS_CLOSED = 30, 50  # simulated: with loops closed cycles change late
# Time over the slowest corner's, of a process without an ultimate point: until what the relay makes
# of it has settled, and at most; and how much longer than for its periods alone that may take.
_SETTLED, _WITHOUT = 3.0, 100.0
_MOST = 5.0
_SAMPLES = 101


class Verdict(StrEnum):
    """How the algorithm ended.

    CONVERGED: the settings of two rounds agree. NO_CYCLE: a loop shows no ultimate point, in step 1
    or with the others closed. ROUNDS: the settings still change.
    """

    CONVERGED = "converged"
    NO_CYCLE = "no_cycle"
    ROUNDS = "rounds"


@dataclass(frozen=True)
class TunedByRelay:
    """One experiment and the settings read off it.

    Attributes
    ----------
    output, input : int
        The loop that the relay closed, from 0.
    behaviour : Behaviour
        How it ended.
    ultimate : Ultimate or None
        Ultimate point; None where the cycle is not at it, or there is none.
    controller : Controller or None
        Settings by the rule.
    remark : str or None
        What keeps the cycle from the ultimate point.

    """

    output: int
    input: int
    behaviour: Behaviour
    ultimate: Ultimate | None
    controller: Controller | None
    remark: str | None


@dataclass(frozen=True)
class RelayTuningOutcome:
    """Outcome of the algorithm.

    Attributes
    ----------
    verdict : Verdict
        How it ended.
    open_loops : tuple of TunedByRelay
        Step 1 and 2: all pairs, row by row.
    rounds : tuple of tuple of TunedByRelay
        Steps 3 and 4, each round an entry for each loop of the pairing.
    loops : tuple of Controller or None
        The last complete settings, one an output; None where step 1 gave none for the pairing.
    stable : bool or None
        Whether these settings are stable together.

    """

    verdict: Verdict
    open_loops: tuple[TunedByRelay, ...]
    rounds: tuple[tuple[TunedByRelay, ...], ...]
    loops: tuple[Controller, ...] | None
    stable: bool | None


def relay_tuning(task: RelayTuning) -> RelayTuningOutcome:
    """Tune all loops of a plant by relay experiments.

    Raises
    ------
    InvalidInputError
        As `relay_experiment`.
    UnsupportedPlantError
        The plant is open-loop unstable.

    """
    instance(task, RelayTuning, "")
    require_supported(task.plant)  # before the experiments: what is tuned is judged at the end
    n = task.plant.n
    open_loops = tuple(
        _experiment(task, output, input_, ()) for output in range(n) for input_ in range(n)
    )
    current = _settings([open_loops[output * n + task.inputs[output]] for output in range(n)])
    if current is None:
        return RelayTuningOutcome(Verdict.NO_CYCLE, open_loops, (), None, None)
    rounds: list[tuple[TunedByRelay, ...]] = []
    verdict = Verdict.ROUNDS
    for _ in range(task.rounds):
        placed = [
            PlacedLoop(output, task.inputs[output], Loop.of(controller))
            for output, controller in enumerate(current)
        ]
        found = tuple(
            _experiment(
                task,
                output,
                task.inputs[output],
                tuple(each for each in placed if each.output != output),
            )
            for output in range(n)
        )
        rounds.append(found)
        settings = _settings(found)
        if settings is None:
            verdict = Verdict.NO_CYCLE
            break
        before, current = current, settings
        if all(_alike(*pair) for pair in zip(before, current, strict=True)):
            verdict = Verdict.CONVERGED
            break
    paired = MatrixPlant(
        [[task.plant.element(row, column) for column in task.inputs] for row in range(n)]
    )
    return RelayTuningOutcome(
        verdict, open_loops, tuple(rounds), current, is_stable(paired, current)
    )


def experiment_of(
    task: RelayTuning,
    output: int,
    input_: int,
    loops: tuple[PlacedLoop, ...] = (),
    samples: int = _SAMPLES,
) -> RelayExperiment:
    """Return the experiment on a pair, long enough for its cycle to settle."""
    element = task.plant.element(output, input_)
    sign = -1.0 if element.static_gain < 0 else 1.0
    relay = Relay(
        sign * abs(task.relay.amplitude), task.relay.hysteresis, task.relay.sampling_period
    )
    bends = corners_of([element])
    band = float(bends[0]) * 1e-2, float(bends[-1]) * 1e3
    offset = math.pi * relay.hysteresis / (4 * abs(relay.amplitude))
    found = ultimate_point(lambda omega: sign * element.response(omega), *band, offset)
    periods = _PERIODS_CLOSED if loops else _PERIODS_OPEN
    if found is None:
        slowest = 1 / float(bends[0])
        shown = periods * _relay_period(element, relay, float(bends[-1]))
        duration = min(max(shown, _SETTLED * slowest), _MOST * shown, _WITHOUT * slowest)
    else:
        duration = periods * 2 * np.pi / found.omega
    return RelayExperiment(
        task.plant, output, input_, relay, loops, float(duration), samples=samples
    )


def _relay_period(element: TransferFunction, relay: Relay, fastest: float) -> float:
    """Return the period, about, of what oscillates by the relay alone; infinite where nothing says.

    Its hysteresis holds it off until the output has moved as far, and its sampling for two samples
    a half period. Above its corners the process integrates, with amplitude |G| 4 d/pi.
    """
    sampled = 4 * (relay.sampling_period or 0.0)
    omega = fastest * 10.0
    amplitude = 4 * abs(relay.amplitude) / math.pi * abs(element.response(np.array([omega]))[0])
    held = 2 * math.pi / omega * relay.hysteresis / amplitude if amplitude > 0 else 0.0
    return max(sampled, held) or math.inf


def _experiment(
    task: RelayTuning, output: int, input_: int, loops: tuple[PlacedLoop, ...]
) -> TunedByRelay:
    outcome = relay_experiment(experiment_of(task, output, input_, loops))
    cycle = outcome.cycle
    if cycle is None or cycle.settings is None or cycle.ultimate is None:
        remark = None if cycle is None else cycle.remark
        return TunedByRelay(output, input_, outcome.behaviour, None, None, remark)
    controller: Controller = getattr(cycle.settings, task.rule.value)
    return TunedByRelay(output, input_, outcome.behaviour, cycle.ultimate, controller, cycle.remark)


def _settings(
    experiments: list[TunedByRelay] | tuple[TunedByRelay, ...],
) -> tuple[Controller, ...] | None:
    """Return the settings of all experiments; None where one has none."""
    found = tuple(each.controller for each in experiments if each.controller is not None)
    return found if len(found) == len(experiments) else None


def _alike(before: Controller, after: Controller) -> bool:
    times = (before.integral_time or 0.0, after.integral_time or 0.0)
    return math.isclose(before.gain, after.gain, rel_tol=SAME) and math.isclose(
        *times, rel_tol=SAME
    )
