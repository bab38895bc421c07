"""A step experiment: plant, loops, and the steps that disturb them."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.model.controllers import Controller
from solver.model.equality import ByValue
from solver.model.errors import InvalidInputError
from solver.model.plants import Plant
from solver.model.state_space import StateSpace
from solver.model.transfer_function import LARGEST
from solver.model.validation import (
    choice,
    instance,
    instances,
    integer,
    items,
    real,
    real_array,
    settle,
)
from solver.simulation.actuators import Actuators
from solver.simulation.loops import Limits, Loop

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "MAX_SAMPLES",
    "MAX_STEPS_GIVEN",
    "Experiment",
    "Step",
    "StepKind",
    "acts",
]

MAX_STEPS_GIVEN = 20_000  # two on each unit of the largest plant
MAX_SAMPLES = 20_001


class StepKind(StrEnum):
    """Where a step enters.

    SETPOINT: the set point of a unit. LOAD: added to the plant input behind the actuator.
    MEASUREMENT: added to the measured output. INPUT: added to the wanted input, before limits
    and actuator; on an open loop, moving the valve by hand.
    """

    SETPOINT = "setpoint"
    LOAD = "load"
    MEASUREMENT = "measurement"
    INPUT = "input"


def acts(kind: StepKind, loop: Loop | None) -> bool:
    """Whether a step moves anything: an open loop has no set point and measures nothing."""
    if kind in {StepKind.LOAD, StepKind.INPUT}:
        return True
    if loop is None or kind is StepKind.MEASUREMENT:
        return loop is not None
    by_derivative = loop.derivative_time is not None and loop.derivative_weight > 0
    return loop.integral_time is not None or loop.setpoint_weight > 0 or by_derivative


@dataclass(frozen=True)
class Step:
    """A step of `kind` and `size` at `time` >= 0 on `unit`, from 0; two make a pulse."""

    kind: StepKind
    unit: int
    time: float
    size: float

    def __post_init__(self) -> None:
        settle(
            self,
            kind=choice(StepKind, self.kind, "/kind"),
            unit=integer(self.unit, "/unit"),
            time=real(self.time, "/time"),
            size=real(self.size, "/size"),
        )
        if not 0 <= self.time <= LARGEST:
            message = "the time of a step must not be negative"
            raise InvalidInputError(message, "/time")
        if not 0 < abs(self.size) <= LARGEST:
            message = f"the size of a step must be finite, not zero and at most {LARGEST:g}"
            raise InvalidInputError(message, "/size")


@dataclass(frozen=True, eq=False)
class Experiment(ByValue):
    """What is simulated, from rest.

    Parameters
    ----------
    plant : Plant
        n units.
    loops : sequence of Loop, Controller or None
        n loops; None is an open one, a `Controller` one with error feedback.
    steps : tuple of Step
        At least one; each begins before the end, and acts on something: the set point of an
        open loop does not.
    duration : float
        Time simulated, > 0.
    samples : int
        Equidistant samples returned, both ends included, 2..20001.
    actuators : Actuators or None
        Actual inputs from wanted ones: an input perturbation. None: exact inputs.
    limits : tuple of Limits or None, or None
        Limits of each input; None: none.
    distribution : (n, n) ndarray or None
        Wanted inputs from controller outputs: a static decoupler, or the shares of one
        controller. None: the identity.
    bound : float or None
        The simulation ends where an output exceeds it. None: those of
        `default_bounds`.
    controller : StateSpace or None
        A full controller u = C e, e set point minus measured output, in place of loops, which
        are all None then; without limits and distribution.

    """

    plant: Plant
    loops: tuple[Loop | None, ...]
    steps: tuple[Step, ...]
    duration: float
    _: KW_ONLY
    samples: int = 501
    actuators: Actuators | None = None
    limits: tuple[Limits | None, ...] | None = None
    distribution: NDArray[np.float64] | None = None
    bound: float | None = None
    controller: StateSpace | None = None

    def __post_init__(self) -> None:
        self._settle()
        self._check_sizes()
        if not 1 <= len(self.steps) <= MAX_STEPS_GIVEN:
            message = f"give 1..{MAX_STEPS_GIVEN} steps"
            raise InvalidInputError(message, "/steps")
        if not 0 < self.duration <= LARGEST:
            message = "the duration must be positive"
            raise InvalidInputError(message, "/duration")
        self._check_steps()
        if not 2 <= self.samples <= MAX_SAMPLES:
            message = f"the number of samples must lie in 2..{MAX_SAMPLES}"
            raise InvalidInputError(message, "/samples")
        if self.bound is not None and not 0 < self.bound <= LARGEST:
            message = "the bound must be positive"
            raise InvalidInputError(message, "/bound")

    def _settle(self) -> None:
        instance(self.plant, Plant, "/plant")
        loops = tuple(
            Loop.of(loop) if isinstance(loop, Controller) else loop
            for loop in items(self.loops, "/loops")
        )
        settle(
            self,
            loops=instances(loops, Loop | None, "/loops"),
            steps=instances(self.steps, Step, "/steps"),
            duration=real(self.duration, "/duration"),
            samples=integer(self.samples, "/samples"),
        )
        if self.actuators is not None:
            instance(self.actuators, Actuators, "/actuators")
        if self.limits is not None:
            settle(self, limits=instances(self.limits, Limits | None, "/limits"))
        if self.distribution is not None:
            distribution = real_array(self.distribution, "/distribution", ndim=2)
            settle(self, distribution=distribution)
        if self.controller is not None:
            instance(self.controller, StateSpace, "/controller")
        if self.bound is not None:
            settle(self, bound=real(self.bound, "/bound"))

    def _check_steps(self) -> None:
        for index, step in enumerate(self.steps):
            if not 0 <= step.unit < self.plant.n:
                message = f"the plant has {self.plant.n} loops"
                raise InvalidInputError(message, f"/steps/{index}/unit")
            if not step.time < self.duration:
                message = f"the step comes after the end of the simulation, {self.duration:g}"
                raise InvalidInputError(message, f"/steps/{index}/time")
            if self.controller is None and not acts(step.kind, self.loops[step.unit]):
                message = f"nothing in loop {step.unit + 1} listens to a step of its {step.kind}"
                raise InvalidInputError(message, f"/steps/{index}/kind")

    def _check_sizes(self) -> None:
        n = self.plant.n
        for name in ("loops", "actuators", "limits"):
            given = getattr(self, name)
            if given is not None and len(given) != n:
                message = f"{len(given)} given, the plant has {n} units"
                raise InvalidInputError(message, f"/{name}")
        if self.controller is not None:
            self._check_controller(self.controller)
        if self.distribution is None:
            return
        if self.distribution.shape != (n, n):
            message = f"the distribution must be a {n} x {n} matrix"
            raise InvalidInputError(message, "/distribution")
        if not np.all(np.abs(self.distribution) <= LARGEST):
            message = f"its entries must be finite and at most {LARGEST:g} in magnitude"
            raise InvalidInputError(message, "/distribution")

    def _check_controller(self, controller: StateSpace) -> None:
        n = self.plant.n
        if controller.D.shape != (n, n):
            message = f"the controller must be {n} x {n}"
            raise InvalidInputError(message, "/controller")
        if any(loop is not None for loop in self.loops):
            message = "give loops or a full controller, not both"
            raise InvalidInputError(message, "/loops")
        for name in ("limits", "distribution"):
            if getattr(self, name) is not None:
                message = "this is for single loops, not for a full controller"
                raise InvalidInputError(message, f"/{name}")
