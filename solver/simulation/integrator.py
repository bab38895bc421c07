"""Adaptive, event-exact integration of a delay system with given inputs, limits and relays.

A step is as long as its signals are resolved by polynomials of fixed degree; it ends at every
jump of an input, at every breakpoint that a dead time makes of it, and where a switching takes
place. Steps are never longer than the shortest dead time, so that what is delayed is known.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.simulation.breakpoints import Breakpoints
from solver.simulation.chebyshev import (
    DEGREE,
    DIFFERENTIATION,
    NODES,
    TO_COEFFICIENTS,
    evaluation_matrix,
)
from solver.simulation.propagator import MAX_WORK, Propagator
from solver.simulation.switching import NoSwitching
from solver.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.simulation.delay_system import DelaySystem
    from solver.simulation.switching import Crossing, Event, Switching
    from solver.simulation.wiring import Wiring

__all__ = ["MAX_STEPS", "End", "integrate"]

MAX_STEPS = 10_000
_MAX_VALUES = 2e7  # numbers held, 160 MB
# Relative size of the highest polynomial coefficients of a resolved step. The signals are then
# right to about as much; below 1e-12 rounding would shorten the steps for ever.
_TOLERANCE = 1e-10
_TINY = 1e-300  # what is nothing must not be divided by nothing
_FIRST_GUESS = 64  # steps in the whole time, before anything is known
_MAX_SWITCHES = 2000
_SHORTEST = 2.0**-46  # of the whole time: accepted unresolved, no clock has more digits
_TRY_LONGER = 8  # steps of one length before a longer one is tried without good reason
_MAX_SWITCHES_AT_ONCE = 100


class End(StrEnum):
    """How an integration ended.

    COMPLETE: at the wanted time. BOUND: an output left its bound: the system is unstable, or (a)
    the bound is too low. STEP_LIMIT: too many steps or switchings: (a) shorten the time, (b) leave
    out a dead time or lag that is tiny beside it, (c) give the relay more hysteresis.
    """

    COMPLETE = "complete"
    BOUND = "bound"
    STEP_LIMIT = "step_limit"


def integrate(
    wiring: Wiring,
    duration: float,
    events: Sequence[Event],
    *,
    outputs: Sequence[int],
    bound: NDArray[np.float64],
    switching: Switching | None = None,
) -> tuple[Trajectory, End]:
    """Integrate from rest at time zero.

    Parameters
    ----------
    wiring : Wiring
        The system.
    duration : float
        End time, > 0.
    events : sequence of Event
        Jumps of the external signals.
    outputs : sequence of int
        Signals that must stay within their `bound` in magnitude.
    bound : (outputs,) ndarray
        Of each; where one does not, the integration ends.
    switching : Switching, optional
        Limits or relays.

    Returns
    -------
    trajectory : Trajectory
        All signals of the wiring.
    end : End
        How it ended; the trajectory is right up to its end in every case.

    Raises
    ------
    InvalidInputError
        A dead time shorter than the `MAX_STEPS`-th part of the duration, an algebraic loop
        without solution, limits that contradict each other.

    """
    integrator = _Integrator(wiring, duration, events, switching or NoSwitching())
    return integrator.run(list(outputs), bound)


class _Integrator:
    def __init__(
        self,
        wiring: Wiring,
        duration: float,
        events: Sequence[Event],
        switching: Switching,
    ) -> None:
        self.wiring = wiring
        self.duration = duration
        self.events = sorted(events, key=lambda event: event.time, reverse=True)
        self.switching = switching
        self.propagators: dict[tuple[int, ...], Propagator] = {}
        system = self.free = wiring.build()
        self.shortest = float(system.dead_times.min(initial=math.inf))
        if duration > MAX_STEPS * self.shortest:
            message = (
                f"the duration is more than {MAX_STEPS} times the shortest dead time "
                f"{self.shortest:g}; shorten it, or leave that dead time out"
            )
            raise InvalidInputError(message, "/duration")
        # All modes have the same dead times.
        self.delays = [
            (float(dead_time), channels, system.delay_sources[channels])
            for dead_time in np.unique(system.dead_times)
            for channels in [np.flatnonzero(system.dead_times == dead_time)]
        ]
        self.tolerance = 1e-13 * duration  # of times
        self.breakpoints = Breakpoints(system, self.tolerance)
        self.breakpoints.jump(0.0)
        self.time = 0.0
        self.state = np.zeros(system.A.shape[0])
        self.external = np.zeros(system.B_external.shape[1])
        self.scale = np.zeros(system.C.shape[0])
        # Halvings and doublings of this length come back to the same lengths, so that their
        # operators are computed once.
        self.wanted = min(duration / _FIRST_GUESS, self.shortest)
        self.since_change = self.switches = 0
        self.trajectory = Trajectory(self.tolerance)
        self.max_steps = min(MAX_STEPS, int(_MAX_VALUES / ((DEGREE + 1) * system.C.shape[0])))

    def run(self, outputs: list[int], bound: NDArray[np.float64]) -> tuple[Trajectory, End]:
        self.switching.start(self.external)
        at_once = 0
        while self.time < self.duration - self.tolerance:
            if len(self.trajectory) >= self.max_steps or self.switches >= _MAX_SWITCHES:
                return self.trajectory, End.STEP_LIMIT
            self._take_events()
            before = self.time
            values = self._step()
            if values is None:
                return self.trajectory, End.STEP_LIMIT
            if self.time > before:
                at_once = 0
                if not np.all(np.abs(values[:, outputs]) <= bound):
                    return self.trajectory, End.BOUND
                continue
            at_once += 1
            if at_once > _MAX_SWITCHES_AT_ONCE:
                message = (
                    "switching without end at one moment: a loop without dynamics meets its limits"
                    ", or a relay without hysteresis meets a process without dead time at rest"
                )
                raise InvalidInputError(message)
        return self.trajectory, End.COMPLETE

    def _take_events(self) -> None:
        while self.events and self.events[-1].time <= self.time + self.tolerance:
            event = self.events.pop()
            self.external[event.external] += event.change
            self.breakpoints.jump(self.time)

    def _propagator(self) -> Propagator:
        mode = self.switching.mode()
        if mode not in self.propagators:
            system = self.wiring.build(mode) if mode else self.free
            self.propagators[mode] = Propagator(system)
        return self.propagators[mode]

    def _step(self) -> NDArray[np.float64] | None:
        """Take one step, or switch at once; return the node values, None after too much work."""
        propagator = self._propagator()
        room = min(
            self.breakpoints.after(self.time) - self.time,
            (self.events[-1].time if self.events else math.inf) - self.time,
            self.duration - self.time,
        )
        while True:
            if sum(each.work for each in self.propagators.values()) > MAX_WORK:
                self._require_a_step()
                return None
            length = min(room, self.wanted)
            delayed = self._delayed(propagator.system, length)
            states = propagator.states(length, self.state, self.external, delayed)
            values = propagator.signals(states, self.external, delayed)
            roughness = self._roughness(propagator, states, delayed, values)
            if roughness <= _TOLERANCE or length <= _SHORTEST * self.duration:
                break
            while self.wanted > 0.6 * length:
                self.wanted /= 2
            self.since_change = 0
        if roughness == math.inf:
            # It overflows within the shortest step: held at its last value, and out of bounds.
            values = np.repeat(values[:1], DEGREE + 1, axis=0)
            self._accept(length, values, self.state)
            return np.full_like(values, math.inf)
        found = self.switching.crossing(self.time, length, values)
        if found is None:
            self._accept(length, values, states[-1])
            self._lengthen(length, roughness)
            return values
        return self._switch(propagator, found, length, delayed, values)

    def _require_a_step(self) -> None:
        """Have something to show.

        Raises
        ------
        InvalidInputError
            Not even one step could be taken.

        """
        if len(self.trajectory) == 0:
            message = "the plant and its loops have too many states, and rates too far apart"
            raise InvalidInputError(message, "/plant")

    def _delayed(self, system: DelaySystem, length: float) -> NDArray[np.float64]:
        delayed = np.empty((DEGREE + 1, system.dead_times.size))
        for dead_time, channels, sources in self.delays:
            delayed[:, channels] = self.trajectory.history(sources, self.time - dead_time, length)
        return delayed

    def _roughness(
        self,
        propagator: Propagator,
        states: NDArray[np.float64],
        delayed: NDArray[np.float64],
        values: NDArray[np.float64],
    ) -> float:
        """Size of the last two coefficients beside what the signals are summed from."""
        rest = np.abs(TO_COEFFICIENTS[-2:] @ values).max(axis=0)
        terms = propagator.magnitudes(states[[0, -1]], self.external, delayed[[0, -1]])
        scale = np.maximum(self.scale, terms.max(axis=0))
        worst = float((rest / (scale + _TINY)).max(initial=0.0))
        # Not a number where an unstable process overflowed in a step far too long.
        return worst if math.isfinite(worst) else math.inf

    def _accept(
        self, length: float, values: NDArray[np.float64], state: NDArray[np.float64]
    ) -> None:
        self.trajectory.append(self.time, length, values)
        self.time += length
        self.state = state
        self.scale = np.maximum(self.scale, np.abs(values).max(axis=0))

    def _lengthen(self, length: float, roughness: float) -> None:
        longer = 2 * self.wanted
        # The last coefficients of a smooth signal grow with this power of the length.
        expected = roughness * (longer / length) ** DEGREE
        # Rounding hides how smooth a stiff system has become: then try, now and then.
        self.since_change += 1
        promising = expected < _TOLERANCE or self.since_change >= _TRY_LONGER
        if promising and longer <= min(self.shortest, self.duration):
            self.wanted = longer
            self.since_change = 0

    def _switch(
        self,
        propagator: Propagator,
        found: Crossing,
        length: float,
        delayed: NDArray[np.float64],
        values: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        if found.place * length > self.tolerance:
            place, state = self._sharpen(propagator, found, length, delayed, values)
            # The part of the step before the switching: the same polynomials, seen at its nodes.
            values = evaluation_matrix(place * NODES) @ values
            self._accept(place * length, values, state)
        self.switches += 1
        order = self.switching.switch(found, self.time, self.external)
        self.breakpoints.jump(self.time, order)
        return values

    def _sharpen(
        self,
        propagator: Propagator,
        found: Crossing,
        length: float,
        delayed: NDArray[np.float64],
        values: NDArray[np.float64],
    ) -> tuple[float, NDArray[np.float64]]:
        """Newton's method on the exact solution, from the root of the polynomial."""
        place = found.place
        for attempt in range(3):
            state = propagator.state_within(place, length, self.state, self.external, delayed)
            if found.signal is None or found.level is None or attempt == 2:
                break
            weights = evaluation_matrix(place)
            exact = propagator.signals(state[None, :], self.external, weights @ delayed)
            slope = float((weights @ DIFFERENTIATION @ values[:, found.signal])[0])
            miss = float(exact[0, found.signal]) - found.level
            if slope == 0 or abs(miss) <= 1e-15 * abs(found.level):
                break
            better = place - miss / slope
            if not 0 < better <= 1 or abs(better - place) < 1e-15:
                break
            place = better
        return place, state
