"""Exact responses of parallel units to steps in set point and load and a measurement pulse.

All inputs are piecewise constant and the loop is linear, so one matrix exponential a piece gives
the response without error. The default scenario is that of Astrom and Hagglund, figures 11.10
and 11.13.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.interaction.parallel_drives import (
    ParallelDrives,
    alternative,
    mended_model,
    original_model,
)
from solver.model.errors import InvalidInputError
from solver.model.validation import instance, integer, real, settle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.interaction.parallel_drives import DriveModel

__all__ = [
    "MAX_POINTS",
    "DriveExperiment",
    "DriveResponse",
    "DriveScenario",
    "DriveSimulation",
    "simulate_drives",
]

MAX_POINTS = 10_000
_NOTHING = 1e-9
_BOUND = 1e9  # times what moves the loop; a response beyond it is cut off: the loop is unstable


@dataclass(frozen=True)
class DriveScenario:
    """What happens: set point step at 0, load step, pulse in one unit's measurement.

    Parameters
    ----------
    set_point, load : float
        Heights of the steps.
    load_time : float
        When the load comes.
    pulse : float
        Height of the measurement error.
    pulse_unit : int or None
        Unit that it hits, from 0; None: the second one, or the only one.
    pulse_time, pulse_duration : float
        When it begins, how long it lasts; after the load.
    end : float
        End of the simulation, after the pulse.
    points : int
        Points of the response, 10..`MAX_POINTS`.

    """

    _: KW_ONLY
    set_point: float = 1.0
    load: float = 1.0
    load_time: float = 10.0
    pulse: float = 1.0
    pulse_unit: int | None = None
    pulse_time: float = 20.0
    pulse_duration: float = 1.0
    end: float = 40.0
    points: int = 401

    def __post_init__(self) -> None:
        heights = ("set_point", "load", "pulse")
        names = ("load_time", "pulse_time", "pulse_duration", "end")
        for name in (*heights, *names):
            settle(self, **{name: real(getattr(self, name), f"/{name}")})
        settle(self, points=integer(self.points, "/points"))
        if self.pulse_unit is not None:
            settle(self, pulse_unit=integer(self.pulse_unit, "/pulse_unit"))
        for name in heights:
            if not abs(getattr(self, name)) <= 1e6:
                message = "must be finite and at most 1e6 in magnitude"
                raise InvalidInputError(message, f"/{name}")
        times = (0.0, self.load_time, self.pulse_time, self.pulse_time + self.pulse_duration)
        for before, after, name in zip(times, (*times[1:], self.end), names, strict=True):
            if not before < after <= 1e9:
                message = "the events must follow each other: 0, load, pulse, its end, end"
                raise InvalidInputError(message, f"/{name}")
        if not 10 <= self.points <= MAX_POINTS:
            message = f"the number of points must lie in 10..{MAX_POINTS}"
            raise InvalidInputError(message, "/points")


@dataclass(frozen=True)
class DriveExperiment:
    """Units on one load, the `system`, and the `scenario` of what happens to them."""

    system: ParallelDrives
    scenario: DriveScenario = DriveScenario()

    def __post_init__(self) -> None:
        instance(self.system, ParallelDrives, "/system")
        instance(self.scenario, DriveScenario, "/scenario")
        if not 0 <= self.pulse_unit < len(self.system.drives):
            message = f"the units are 0 to {len(self.system.drives) - 1}"
            raise InvalidInputError(message, "/scenario/pulse_unit")

    @property
    def pulse_unit(self) -> int:
        """Unit whose measurement errs, from 0."""
        if self.scenario.pulse_unit is None:
            return min(1, len(self.system.drives) - 1)
        return self.scenario.pulse_unit


@dataclass(frozen=True)
class DriveResponse:
    """Response over time; at each event the values before and after it.

    Attributes
    ----------
    time : (k,)
        Time units.
    set_point, load, measurement_error : (k,)
        The inputs.
    output : (k,)
        Common output.
    efforts : (k, n)
        Efforts of the units.
    bounded : bool
        False where the response was cut off because it grew without bound.
    shares_before_pulse, shares_at_end : (n,)
        Share of each unit in the total effort; NaN where that is zero or was not reached.

    """

    time: NDArray[np.float64]
    set_point: NDArray[np.float64]
    load: NDArray[np.float64]
    measurement_error: NDArray[np.float64]
    output: NDArray[np.float64]
    efforts: NDArray[np.float64]
    bounded: bool
    shares_before_pulse: NDArray[np.float64]
    shares_at_end: NDArray[np.float64]


@dataclass(frozen=True)
class DriveSimulation:
    """Responses of the `original` units, and of those that are mended.

    `mended`: by one integrator shared out; None without integral action. `alternative`: with all
    integral action in one unit; None where at most one has any.
    """

    original: DriveResponse
    mended: DriveResponse | None
    alternative: DriveResponse | None


def simulate_drives(experiment: DriveExperiment) -> DriveSimulation:
    """Simulate the units before and after the remedy.

    Parameters
    ----------
    experiment : DriveExperiment
        Units, load and events.

    Raises
    ------
    InvalidInputError
        No such experiment, which checks itself.

    """
    instance(experiment, DriveExperiment, "")
    system = experiment.system
    mended = other = None
    if system.integrating:
        mended = _simulate(mended_model(system), experiment)
    if len(system.integrating) > 1:
        other = _simulate(original_model(alternative(system)), experiment)
    return DriveSimulation(_simulate(original_model(system), experiment), mended, other)


def _simulate(model: DriveModel, experiment: DriveExperiment) -> DriveResponse:
    scenario, disturbed = experiment.scenario, 2 + experiment.pulse_unit
    states, inputs = len(model.A), model.B.shape[1]
    edges = (
        0.0,
        scenario.load_time,
        scenario.pulse_time,
        scenario.pulse_time + scenario.pulse_duration,
        scenario.end,
    )
    # A bias acts on the load as the opposite of a load does, from 0 on.
    biases = np.array([drive.bias for drive in experiment.system.drives])
    largest = _BOUND * _moved(experiment)
    x = np.zeros(states)
    pieces: list[tuple[float, NDArray[np.float64], NDArray[np.float64]]] = []
    bounded = True
    marks = []
    for start, end in itertools.pairwise(edges):
        v = np.zeros(inputs)
        v[0] = scenario.set_point
        v[1] = (scenario.load if start >= scenario.load_time else 0.0) - biases.sum()
        v[disturbed] = scenario.pulse if start == scenario.pulse_time else 0.0
        steps = max(math.ceil(scenario.points * (end - start) / scenario.end), 2)
        block = np.zeros((states + inputs, states + inputs))
        block[:states] = np.hstack([model.A, model.B]) * ((end - start) / steps)
        with np.errstate(over="ignore", invalid="ignore"):  # a loop that explodes within a step
            advance = scipy.linalg.expm(block)[:states]
        for index in range(steps + 1):
            if index:
                with np.errstate(over="ignore", invalid="ignore"):
                    x = advance @ np.concatenate([x, v])
            with np.errstate(over="ignore", invalid="ignore"):
                outputs = model.C @ x + model.D @ v
            if not abs(outputs[0]) <= largest:
                bounded = False
                break
            outputs[1:] += biases
            pieces.append((start + (end - start) * index / steps, v, outputs))
        if not bounded:
            break
        marks.append(pieces[-1][2][1:])
    v = np.array([piece[1] for piece in pieces])
    y = np.array([piece[2] for piece in pieces])
    return DriveResponse(
        time=np.array([piece[0] for piece in pieces]),
        set_point=v[:, 0],
        load=v[:, 1] + biases.sum(),
        measurement_error=v[:, disturbed],
        output=y[:, 0],
        efforts=y[:, 1:],
        bounded=bounded,
        shares_before_pulse=_shares(marks, 1, y.shape[1] - 1),
        shares_at_end=_shares(marks, 3, y.shape[1] - 1),
    )


def _moved(experiment: DriveExperiment) -> float:
    """Return by how much the output is moved, in its unit: an effort by what the gains make of it.

    Proportional gains, and integral ones over the time until the load comes.
    """
    scenario, drives = experiment.scenario, experiment.system.drives
    gain = sum(each.proportional_gain + each.integral_gain * scenario.load_time for each in drives)
    effort = abs(scenario.load) + sum(abs(each.bias) for each in drives)
    return abs(scenario.set_point) + abs(scenario.pulse) + effort / gain


def _shares(marks: list[NDArray[np.float64]], index: int, units: int) -> NDArray[np.float64]:
    if index >= len(marks) or np.sum(marks[index]) == 0:
        return np.full(units, np.nan)
    shares = marks[index] / np.sum(marks[index])
    # What is left of a share of nothing is what the transient has left of it, and rounding.
    return np.asarray(np.where(np.abs(shares) < _NOTHING, 0.0, shares), dtype=np.float64)
