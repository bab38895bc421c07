"""The wiring of a plant under decentralised control: loops, limits, disturbances, relay.

::

    measured = y + noise
    v = law(set point, measured)           one a closed loop
    u = distribution v + manual            plant input that is wanted
    y = G (F limit(u) + load)              F: actuators, the input perturbation
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.simulation.actuators import OwnActuators
from solver.simulation.experiment import StepKind
from solver.simulation.switching import Event
from solver.simulation.wiring import Place, Term, Wiring

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from solver.model.state_space import StateSpace
    from solver.simulation.actuators import Actuators
    from solver.simulation.experiment import Step
    from solver.simulation.loops import Limits, Loop
    from solver.simulation.paths import Paths

__all__ = ["ClosedLoop", "close", "events"]


@dataclass(frozen=True)
class ClosedLoop:
    """A wiring and where its signals stand, one place a unit.

    `set_points`, `loads`, `noises` and `manuals` are external; `outputs` (of the plant),
    `errors` (set point minus output) and `inputs` (limited, before the actuators) are signals.
    `limited` are the units whose input has limits, in the order of `Wiring.limited`.
    """

    wiring: Wiring
    set_points: tuple[Place, ...]
    loads: tuple[Place, ...]
    noises: tuple[Place, ...]
    manuals: tuple[Place, ...]
    outputs: tuple[Place, ...]
    errors: tuple[Place, ...]
    inputs: tuple[Place, ...]
    limited: tuple[int, ...]


def close(
    paths: Paths,
    loops: Sequence[Loop | None],
    distribution: NDArray[np.float64],
    actuators: Actuators | None = None,
    limits: Sequence[Limits | None] | None = None,
    *,
    controller: StateSpace | None = None,
) -> ClosedLoop:
    """Wire a plant and its loops.

    Parameters
    ----------
    paths : Paths
        The plant, k kinds of units.
    loops : sequence of Loop or None
        Loop i acts on output i; None is an open loop.
    distribution : (k, k) ndarray
        Plant inputs from controller outputs: the identity for decentralised control.
    actuators : Actuators, optional
        From the wanted plant inputs to the actual ones, for all units of the plant.
    limits : sequence of Limits or None, optional
        Of each plant input.
    controller : StateSpace, optional
        A full controller on the errors of all units, in place of loops, which are open then.

    """
    wiring = Wiring()
    units = range(paths.size)

    def externals() -> tuple[Place, ...]:
        return tuple(wiring.external() for _ in units)

    def signals() -> tuple[Place, ...]:
        return tuple(wiring.signal() for _ in units)

    set_points, loads, noises, manuals = externals(), externals(), externals(), externals()
    outputs, errors, wanted = signals(), signals(), signals()
    clipped = {
        unit: (wiring.limit(wanted[unit]), limit)
        for unit, limit in enumerate(limits or ())
        if limit is not None
    }
    inputs = tuple(clipped[unit][0] if unit in clipped else wanted[unit] for unit in units)
    # What the limits took from the inputs, as the controllers see it.
    recovered = np.linalg.pinv(distribution) if clipped else distribution
    for unit, loop in enumerate(loops):
        wiring.connect(wanted[unit], [Term(manuals[unit], 1.0)])
        wiring.connect(errors[unit], [Term(set_points[unit], 1.0), Term(outputs[unit], -1.0)])
        if loop is None:
            continue
        windup = [
            Term(place, sign * float(recovered[unit, column]) / limit.tracking_time_for(loop))
            for column, (limited, limit) in clipped.items()
            for place, sign in ((limited, 1.0), (wanted[column], -1.0))
        ]
        measured = [Term(outputs[unit], 1.0), Term(noises[unit], 1.0)]
        law = _law(wiring, loop, set_points[unit], measured, windup)
        for row in units:
            if distribution[row, unit] != 0:
                wiring.connect(wanted[row], _scaled(law, float(distribution[row, unit])))
    if controller is not None:
        measured_errors = [
            [Term(set_points[unit], 1.0), Term(outputs[unit], -1.0), Term(noises[unit], -1.0)]
            for unit in units
        ]
        _connect_controller(wiring, controller, measured_errors, wanted)
    _connect_plant(wiring, paths, _actual(wiring, paths, actuators, inputs), loads, outputs)
    return ClosedLoop(
        wiring=wiring,
        set_points=set_points,
        loads=loads,
        noises=noises,
        manuals=manuals,
        outputs=outputs,
        errors=errors,
        inputs=inputs,
        limited=tuple(clipped),
    )


def events(steps: Sequence[Step], closed: ClosedLoop, paths: Paths) -> list[Event]:
    """Return the jumps of the external signals that `steps` mean for the simulated units."""
    entries = {
        StepKind.SETPOINT: closed.set_points,
        StepKind.LOAD: closed.loads,
        StepKind.MEASUREMENT: closed.noises,
        StepKind.INPUT: closed.manuals,
    }
    kind = {units[0]: index for index, units in enumerate(paths.units)}
    return [
        Event(step.time, entries[step.kind][kind[step.unit]].at, step.size)
        for step in steps
        if step.unit in kind
    ]


def _actual(
    wiring: Wiring, paths: Paths, actuators: Actuators | None, inputs: Sequence[Place]
) -> list[list[Term]]:
    """Return the actual inputs from the limited ones."""
    moved = [[Term(place, 1.0)] for place in inputs]
    if actuators is None:
        return moved
    stand_ins = [units[0] for units in paths.units]
    if isinstance(actuators, OwnActuators):
        return [
            wiring.transfer(actuators.functions[unit], place)
            for unit, place in zip(stand_ins, inputs, strict=True)
        ]
    gathered, weighted = wiring.signal(), wiring.signal()
    for units, place in zip(paths.units, inputs, strict=True):
        terms = wiring.transfer(actuators.right[units[0]], place)
        wiring.connect(gathered, _scaled(terms, len(units)))
    wiring.connect(weighted, wiring.transfer(actuators.weight, gathered))
    return [
        [*own, *wiring.transfer(actuators.left[unit], weighted)]
        for unit, own in zip(stand_ins, moved, strict=True)
    ]


def _connect_plant(
    wiring: Wiring,
    paths: Paths,
    moved: Sequence[list[Term]],
    loads: Sequence[Place],
    outputs: Sequence[Place],
) -> None:
    for column in range(paths.size):
        arriving = wiring.signal()
        wiring.connect(arriving, [*moved[column], Term(loads[column], 1.0)])
        for row in range(paths.size):
            for function, weight in paths.between(row, column):
                wiring.connect(outputs[row], _scaled(wiring.transfer(function, arriving), weight))


def _connect_controller(
    wiring: Wiring,
    controller: StateSpace,
    errors: Sequence[list[Term]],
    wanted: Sequence[Place],
) -> None:
    """Wire u = C x + D e, x' = A x + B e."""
    states = [wiring.state() for _ in range(controller.states)]

    def combined(by_state: NDArray[np.float64], by_error: NDArray[np.float64]) -> list[Term]:
        terms = [
            Term(state, float(gain)) for state, gain in zip(states, by_state, strict=True) if gain
        ]
        for error, gain in zip(errors, by_error, strict=True):
            if gain:
                terms += _scaled(error, float(gain))
        return terms

    for row, state in enumerate(states):
        wiring.connect(state, combined(controller.A[row], controller.B[row]))
    for row, place in enumerate(wanted):
        wiring.connect(place, combined(controller.C[row], controller.D[row]))


def _scaled(terms: Iterable[Term], gain: float) -> list[Term]:
    return [Term(term.source, gain * term.gain) for term in terms]


def _law(
    wiring: Wiring, loop: Loop, set_point: Place, measured: list[Term], windup: list[Term]
) -> list[Term]:
    """Return the output of the law of `Loop`."""

    def difference(weight: float, gain: float) -> list[Term]:
        reference = [Term(set_point, weight * gain)] if weight else []
        return [*reference, *_scaled(measured, -gain)]

    law = difference(loop.setpoint_weight, loop.proportional_gain)
    if loop.integral_time is not None:
        integral = wiring.state()
        wiring.connect(integral, [*difference(1.0, loop.integral_gain), *windup])
        law.append(Term(integral, 1.0))
    if loop.lag_time:
        # D s/(1 + T_f s) = (D/T_f) (1 - 1/(1 + T_f s))
        lag = wiring.state()
        rate = 1 / loop.lag_time
        high = loop.derivative_gain * rate
        wiring.connect(lag, [*difference(loop.derivative_weight, rate), Term(lag, -rate)])
        law.extend([*difference(loop.derivative_weight, high), Term(lag, -high)])
    return law
