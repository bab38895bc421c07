"""A relay experiment: one loop of a plant closed by a relay, the others open or controlled.

Astrom and Hagglund, Automatica 20 (1984) 645-651; Johansson, Difficulties When Applying SISO
Relay Design Methods to a MIMO-System, TFRT-7506 (1993), whose relay this is, eq. (3)::

    u = d   if e > eps  or  (e > -eps and u was d)
    u = -d  if e < -eps or  (e < eps and u was -d),   e = -y
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import Plant
from solver.model.transfer_function import LARGEST
from solver.model.validation import instance, instances, integer, real, settle
from solver.simulation.closed_loop import ClosedLoop, close
from solver.simulation.experiment import MAX_SAMPLES, Step, acts
from solver.simulation.loops import Loop
from solver.simulation.paths import Paths, alike

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["PlacedLoop", "Relay", "RelayExperiment", "RelayWiring", "wire"]

# Times at which a sampled relay looks at the output: far more than a cycle can use, and few enough
# for times to be told apart in double precision.
MAX_LOOKS = 1_000_000


@dataclass(frozen=True)
class Relay:
    """A relay with hysteresis.

    Parameters
    ----------
    amplitude : float
        d, not zero; negative for a process with negative gain.
    hysteresis : float
        eps >= 0: the switching levels of the output are +eps and -eps.
    sampling_period : float or None
        T > 0: the relay looks at the output at the times 0, T, 2T, ... only. None: always.

    """

    amplitude: float = 1.0
    hysteresis: float = 0.0
    sampling_period: float | None = None

    def __post_init__(self) -> None:
        settle(
            self,
            amplitude=real(self.amplitude, "/amplitude"),
            hysteresis=real(self.hysteresis, "/hysteresis"),
        )
        if self.sampling_period is not None:
            settle(self, sampling_period=real(self.sampling_period, "/sampling_period"))
        if not 0 < abs(self.amplitude) <= LARGEST:
            message = "the amplitude must be finite and not zero"
            raise InvalidInputError(message, "/amplitude")
        if not 0 <= self.hysteresis <= LARGEST:
            message = "the hysteresis must not be negative"
            raise InvalidInputError(message, "/hysteresis")
        if self.sampling_period is not None and not 0 < self.sampling_period <= LARGEST:
            message = "the sampling period must be positive"
            raise InvalidInputError(message, "/sampling_period")


@dataclass(frozen=True)
class PlacedLoop:
    """A controller from an output to an input, both counted from 0.

    A `Controller` becomes the loop with error feedback.
    """

    output: int
    input: int
    loop: Loop

    def __post_init__(self) -> None:
        if isinstance(self.loop, Controller):
            settle(self, loop=Loop.of(self.loop))
        instance(self.loop, Loop, "/loop")
        settle(self, output=integer(self.output, "/output"), input=integer(self.input, "/input"))


@dataclass(frozen=True)
class RelayExperiment:
    """What is simulated, from rest with the relay at +d.

    Parameters
    ----------
    plant : Plant
        The plant.
    output, input : int
        The loop that the relay closes, counted from 0.
    relay : Relay
        The relay.
    loops : tuple of PlacedLoop
        The loops under control; the inputs and outputs that do not appear rest.
    duration : float
        Time simulated, > 0.
    samples : int
        Equidistant samples returned, both ends included.
    steps : tuple of Step
        Disturbances on the way, if any.

    """

    plant: Plant
    output: int
    input: int
    relay: Relay
    loops: tuple[PlacedLoop, ...]
    duration: float
    _: KW_ONLY
    samples: int = 2001
    steps: tuple[Step, ...] = ()

    def __post_init__(self) -> None:
        instance(self.plant, Plant, "/plant")
        instance(self.relay, Relay, "/relay")
        settle(
            self,
            output=integer(self.output, "/output"),
            input=integer(self.input, "/input"),
            loops=instances(self.loops, PlacedLoop, "/loops"),
            duration=real(self.duration, "/duration"),
            samples=integer(self.samples, "/samples"),
            steps=instances(self.steps, Step, "/steps"),
        )
        self._check_places()
        if not 0 < self.duration <= LARGEST:
            message = "the duration must be positive"
            raise InvalidInputError(message, "/duration")
        period = self.relay.sampling_period
        if period is not None and period * MAX_LOOKS < self.duration:
            message = (
                f"the relay would look at the output more than {MAX_LOOKS} times; give a sampling "
                "period of a thousandth of the oscillation's, or null for a relay without sampling"
            )
            raise InvalidInputError(message, "/relay/sampling_period")
        if not 2 <= self.samples <= MAX_SAMPLES:
            message = f"the number of samples must lie in 2..{MAX_SAMPLES}"
            raise InvalidInputError(message, "/samples")
        self._check_steps()

    def _check_places(self) -> None:
        n = self.plant.n
        places = [
            (self.output, self.input, ""),
            *(
                (placed.output, placed.input, f"/loops/{index}")
                for index, placed in enumerate(self.loops)
            ),
        ]
        for side, name in enumerate(("output", "input")):
            seen: set[int] = set()
            for place in places:
                field = f"{place[2]}/{name}"
                number = (place[0], place[1])[side]
                if not 0 <= number < n:
                    message = f"the plant has {n} {name}s"
                    raise InvalidInputError(message, field)
                if number in seen:
                    message = f"{name} {number + 1} is in two loops"
                    raise InvalidInputError(message, field)
                seen.add(number)

    def _check_steps(self) -> None:
        n = self.plant.n
        for index, step in enumerate(self.steps):
            if not 0 <= step.unit < n:
                message = f"the plant has {n} loops"
                raise InvalidInputError(message, f"/steps/{index}/unit")
            if not step.time < self.duration:
                message = f"the step comes after the end of the simulation, {self.duration:g}"
                raise InvalidInputError(message, f"/steps/{index}/time")
            loop = next((each.loop for each in self.loops if each.output == step.unit), None)
            if not acts(step.kind, loop):
                message = f"nothing in loop {step.unit + 1} listens to a step of its {step.kind}"
                raise InvalidInputError(message, f"/steps/{index}/kind")


@dataclass(frozen=True)
class RelayWiring:
    """An experiment wired: the kinds of units in `paths`, and which of them the relay joins.

    `loops` acts on the outputs, one a kind; `distribution` leads from them to the inputs.
    """

    closed: ClosedLoop
    paths: Paths
    loops: tuple[Loop | None, ...]
    distribution: NDArray[np.float64]
    output: int
    input: int


def wire(experiment: RelayExperiment) -> RelayWiring:
    """Wire an experiment; the relay's output is the external `manuals[input]`.

    Raises
    ------
    InvalidInputError
        More different units than a simulation holds.

    """
    own = {experiment.output, experiment.input}
    placed = {each.output: each for each in experiment.loops}
    for each in experiment.loops:
        if each.output != each.input:
            own |= {each.output, each.input}
    own |= {step.unit for step in experiment.steps}
    characters: list[object] = [
        unit if unit in own else (placed[unit].loop if unit in placed else None)
        for unit in range(experiment.plant.n)
    ]
    paths = alike(experiment.plant, characters)
    kind = {unit: index for index, units in enumerate(paths.units) for unit in units}
    if any(element.dead_time for element in experiment.plant.elements):
        # Without dead time the states behind inputs at rest stay: theorem 2 counts them in W.
        moving = {experiment.input}
        moving.update(each.input for each in experiment.loops)
        moving.update(step.unit for step in experiment.steps)
        resting = frozenset(range(paths.size)) - {kind[unit] for unit in moving}
        paths = replace(paths, resting=resting)
    distribution = np.zeros((paths.size, paths.size))
    loops: list[Loop | None] = [None] * paths.size
    for each in experiment.loops:
        loops[kind[each.output]] = each.loop
        distribution[kind[each.input], kind[each.output]] = 1.0
    closed = close(paths, loops, distribution)
    return RelayWiring(
        closed, paths, tuple(loops), distribution, kind[experiment.output], kind[experiment.input]
    )
