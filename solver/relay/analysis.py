"""A relay experiment from description to settings: simulate, recognise, estimate, explain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.equality import ByValue
from solver.model.plants import MAX_MATRIX_SIZE
from solver.model.validation import instance
from solver.relay.behaviour import Behaviour, Regime, behaviour, cycle_length, regimes
from solver.relay.describing_function import (
    Harmonic,
    Ultimate,
    half_range,
    harmonics,
    ultimate_gain,
    ultimate_point,
)
from solver.relay.experiment import RelayExperiment, RelayWiring, wire
from solver.relay.mcavoy import McAvoy, mcavoy
from solver.relay.periodic import PeriodicSolution, RelayLoop, periodic_solutions
from solver.relay.relay_switching import RelaySwitching
from solver.relay.seen_cycle import SeenCycle
from solver.relay.settings import UltimateSettings, settings
from solver.simulation.bounds import default_bounds, sizes_of
from solver.simulation.closed_loop import events
from solver.simulation.integrator import End, integrate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.simulation.trajectory import Trajectory

__all__ = ["Cycle", "RelayOutcome", "Theory", "relay_experiment"]

_CURVE = 400  # points of the Nyquist curve
_RANGE = 2000.0  # ratio of the longest half period looked at to the shortest
# Below and above the cycle's frequency, where the process is looked at for an ultimate point.
_BELOW, _ABOVE = 30.0, 1e4
_FAR = 1e4  # over the range looked at: what is not fed through has died away


@dataclass(frozen=True)
class Cycle:
    """The limit cycle at the end.

    Attributes
    ----------
    period : float
        T.
    switchings : int
        In a period; with more than two there is no ultimate point.
    amplitudes : tuple of float
        Half the range of each output.
    phase : float
        Of the process that the relay sees, at the cycle's frequency, measured, rad, in -2 pi..0
        with the sign of its gain turned; -pi at the ultimate point.
    ultimate : Ultimate or None
        K_u = 4 d/(pi a) with the relay input's amplitude a, omega_u = 2 pi/T; 1 over the first
        harmonic's gain where the output is no sine wave or the half periods are unequal. None where
        the cycle is not at the ultimate point: more than two switchings, or a phase far from -pi.
    remark : str or None
        What keeps the cycle from the ultimate point, and what it tells all the same.
    cross_gains : tuple of float or None
        4 d/(pi a) for every output: the ultimate cross gains K_u'; None where an output rests.
    harmonics : tuple of Harmonic
        First harmonics: the frequency responses at 2 pi/T from the relay to each output.
    settings : UltimateSettings or None
        PI settings for the loop; None without an ultimate point.

    """

    period: float
    switchings: int
    amplitudes: tuple[float, ...]
    phase: float
    ultimate: Ultimate | None
    remark: str | None
    cross_gains: tuple[float | None, ...]
    harmonics: tuple[Harmonic, ...]
    settings: UltimateSettings | None


@dataclass(frozen=True, eq=False)
class Theory(ByValue):
    """What is known of the experiment without simulation.

    Attributes
    ----------
    solutions : tuple of PeriodicSolution
        Theorems 1 and 2.
    described : Ultimate or None
        The oscillation that the describing function predicts.
    ultimate : Ultimate or None
        The ultimate point of the process that the relay sees. None where there is none, or where
        direct feedthrough behind dead time lets no frequency be the first to lose stability.
    mcavoy : McAvoy or None
        The loop among equal ones; None without an ultimate point of the loop alone, without a
        complete pairing, for one loop or above 10.
    omega : (k,)
        Frequencies, rad per time unit, over the half periods looked at.
    response : (k,) complex
        The process that the relay sees, with the sign of the relay: the Nyquist curve.
    describing_level : float
        Imaginary part of -1/N(a), -pi eps/(4 d): the line that the curve crosses.

    """

    solutions: tuple[PeriodicSolution, ...]
    described: Ultimate | None
    ultimate: Ultimate | None
    mcavoy: McAvoy | None
    omega: NDArray[np.float64]
    response: NDArray[np.complex128]
    describing_level: float


@dataclass(frozen=True, eq=False)
class RelayOutcome(ByValue):
    """Outcome of an experiment.

    Attributes
    ----------
    behaviour : Behaviour
        How it ended, and what to try next.
    time : (k,) ndarray
        Sampled times.
    units : tuple of tuple of int
        The units that each row of `outputs` and `inputs` stands for.
    outputs, inputs : (units, k) ndarray
        The signals at the sampled times.
    switchings : (m,) ndarray
        Switching times.
    regimes : tuple of Regime
        Stretches of similar periods: more than one is a change of behaviour.
    cycle : Cycle or None
        The limit cycle, where there is one.
    final_outputs : tuple of float
        Outputs at the end.
    theory : Theory
        What theory says.

    """

    behaviour: Behaviour
    time: NDArray[np.float64]
    units: tuple[tuple[int, ...], ...]
    outputs: NDArray[np.float64]
    inputs: NDArray[np.float64]
    switchings: NDArray[np.float64]
    regimes: tuple[Regime, ...]
    cycle: Cycle | None
    final_outputs: tuple[float, ...]
    theory: Theory


def relay_experiment(experiment: RelayExperiment) -> RelayOutcome:
    """Carry out a relay experiment.

    Parameters
    ----------
    experiment : RelayExperiment
        What is done.

    Returns
    -------
    RelayOutcome
        Switching times are right to about 1e-10 of the period.

    Raises
    ------
    InvalidInputError
        As for `step_response`, or a process that reacts to the relay without any delay.

    """
    instance(experiment, RelayExperiment, "")
    wired = wire(experiment)
    closed = wired.closed
    loop = RelayLoop(
        closed.wiring.build(), closed.manuals[wired.input].at, closed.outputs[wired.output].at
    )
    switching = RelaySwitching(experiment.relay, loop.output, loop.external)
    outputs = [place.at for place in closed.outputs]
    trajectory, end = integrate(
        closed.wiring,
        experiment.duration,
        events(experiment.steps, closed, wired.paths),
        outputs=outputs,
        bound=_bounds(experiment, wired),
        switching=switching,
    )
    times = np.array(switching.times)
    resolution = experiment.relay.sampling_period or 0.0
    how = {End.BOUND: Behaviour.DIVERGED, End.STEP_LIMIT: Behaviour.STEP_LIMIT}.get(
        end
    ) or behaviour(times, trajectory, outputs, resolution)
    time = np.linspace(0.0, trajectory.end, experiment.samples)
    signals = [np.array([trajectory.sample(place.at, time) for place in places])
               for places in (closed.outputs, closed.inputs)]  # fmt: skip
    return RelayOutcome(
        behaviour=how,
        time=time,
        units=wired.paths.units,
        outputs=signals[0],
        inputs=signals[1],
        switchings=times,
        regimes=regimes(times),
        cycle=_cycle(experiment, wired, loop, trajectory, times)
        if how is Behaviour.LIMIT_CYCLE
        else None,
        final_outputs=tuple(float(row[-1]) for row in signals[0]),
        theory=_theory(experiment, loop),
    )


def _bounds(experiment: RelayExperiment, wired: RelayWiring) -> NDArray[np.float64]:
    kind_of = {units[0]: kind for kind, units in enumerate(wired.paths.units)}
    inputs, outputs = sizes_of(experiment.steps, kind_of, wired.paths.size)
    inputs[wired.input] += abs(experiment.relay.amplitude)
    return default_bounds(
        wired.paths, wired.loops, wired.distribution, experiment.duration, (inputs, outputs)
    )


def _cycle(
    experiment: RelayExperiment,
    wired: RelayWiring,
    loop: RelayLoop,
    trajectory: Trajectory,
    times: NDArray[np.float64],
) -> Cycle:
    relay, closed = experiment.relay, wired.closed
    count = cycle_length(times, relay.sampling_period or 0.0) or 2
    start, end = float(times[-1 - count]), float(times[-1])
    amplitudes = tuple(half_range(trajectory, place.at, start, end) for place in closed.outputs)
    sign = float(np.sign(relay.amplitude))
    measured = harmonics(
        trajectory,
        [place.at for place in closed.outputs],
        closed.inputs[wired.input].at,
        start,
        end,
    )
    own = measured[wired.output]
    omega = 2 * np.pi / (end - start)
    band = omega / _BELOW, omega * _ABOVE
    seen = SeenCycle(
        omega=omega,
        gain=own.gain,
        phase=float(-np.mod(-own.phase - (np.pi if sign < 0 else 0.0), 2 * np.pi)),
        described=ultimate_gain(amplitudes[wired.output], relay.amplitude),
        switchings=count,
        unevenness=_unevenness(times),
        hysteresis=relay.hysteresis > 0,
        exists=ultimate_point(_response(loop, sign), *band) is not None,
    )
    ultimate = seen.ultimate
    return Cycle(
        period=end - start,
        switchings=count,
        amplitudes=amplitudes,
        phase=seen.phase,
        ultimate=ultimate,
        remark=seen.remark,
        cross_gains=tuple(
            ultimate_gain(amplitude, relay.amplitude) if amplitude else None
            for amplitude in amplitudes
        ),
        harmonics=measured,
        settings=None if ultimate is None else settings(ultimate, sign),
    )


def _unevenness(times: NDArray[np.float64]) -> float:
    """Return by how much the last two intervals differ, over their sum."""
    first, second = np.diff(times)[-2:]
    return float(abs(first - second) / (first + second))


def _response(
    loop: RelayLoop, sign: float
) -> Callable[[NDArray[np.float64]], NDArray[np.complex128]]:
    """Return the frequency response of the process that the relay sees, its sign turned."""

    def response(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        value: NDArray[np.complex128] = sign * loop.response(omega)
        return value

    return response


def _theory(experiment: RelayExperiment, loop: RelayLoop) -> Theory:
    relay = experiment.relay
    longest = experiment.duration / 2
    shortest = longest / _RANGE
    band = float(np.pi / longest), float(np.pi / shortest)
    sign = float(np.sign(relay.amplitude))
    response = _response(loop, sign)
    offset = np.pi * relay.hysteresis / (4 * abs(relay.amplitude))
    omega = np.geomspace(*band, _CURVE)
    return Theory(
        solutions=periodic_solutions(loop, relay, shortest, longest),
        described=ultimate_point(response, *band, offset),
        ultimate=_not_at_infinity(ultimate_point(response, *band), response, band[1]),
        mcavoy=_among_equals(experiment, sign, band),
        omega=omega,
        response=response(omega),
        describing_level=-float(offset),
    )


def _not_at_infinity(
    found: Ultimate | None,
    response: Callable[[NDArray[np.float64]], NDArray[np.complex128]],
    end: float,
) -> Ultimate | None:
    """Return an ultimate point whose gain is less than any far above it; else none.

    What dead time feeds through crosses the axis for ever; where the gain rises to its value at
    infinity, each crossing of the range looked at has a successor with less gain.
    """
    if found is None:
        return None
    far = _FAR * max(end, found.omega) * (1 + np.linspace(0, 1, _CURVE))
    return found if np.abs(response(far)).max() < (1 - _FAR**-0.5) / found.gain else None


def _among_equals(
    experiment: RelayExperiment, sign: float, band: tuple[float, float]
) -> McAvoy | None:
    plant = experiment.plant
    pairs = {placed.output: placed.input for placed in experiment.loops}
    pairs[experiment.output] = experiment.input
    spare = [sorted(set(range(plant.n)) - taken) for taken in (set(pairs), set(pairs.values()))]
    if not 2 <= plant.n <= MAX_MATRIX_SIZE or len(spare[0]) > 1:
        return None
    # With one loop left there is no choice.
    pairs.update(zip(*spare, strict=True))
    own = plant.element(experiment.output, experiment.input)
    alone = ultimate_point(lambda omega: sign * own.response(omega), *band)
    if alone is None:
        return None
    inputs = [pairs[output] for output in range(plant.n)]
    if any(plant.element(row, column).is_zero for row, column in enumerate(inputs)):
        return None
    found = mcavoy(plant, inputs, experiment.output, alone, band)
    return replace(
        found,
        rough_settings=settings(found.rough, sign),
        exact_settings=None if found.exact is None else settings(found.exact, sign),
    )
