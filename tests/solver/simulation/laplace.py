"""Laplace transforms of simulated signals: an independent check of any loop."""

from collections.abc import Sequence

import numpy as np

from solver.model.plants import Plant
from solver.simulation.chebyshev import NODES, QUADRATURE
from solver.simulation.closed_loop import close, events
from solver.simulation.experiment import Experiment, Step, StepKind, acts
from solver.simulation.integrator import End, integrate
from solver.simulation.loops import Loop
from solver.simulation.paths import Paths


def simulated(experiment: Experiment, s: float) -> np.ndarray:
    """Return the transforms of the outputs at real s > 0; exp(-s duration) must be negligible."""
    plant = experiment.plant
    paths = Paths(plant, tuple((unit,) for unit in range(plant.n)))
    distribution = experiment.distribution
    closed = close(
        paths,
        experiment.loops,
        np.eye(plant.n) if distribution is None else distribution,
        experiment.actuators,
    )
    trajectory, end = integrate(
        closed.wiring,
        experiment.duration,
        events(experiment.steps, closed, paths),
        outputs=[place.at for place in closed.outputs],
        bound=np.array([1e9]),
    )
    assert end is End.COMPLETE
    times = trajectory.starts[:, None] + trajectory.lengths[:, None] * NODES
    decay = np.exp(-s * times)
    return np.array(
        [
            trajectory.lengths @ ((trajectory.nodes(place.at) * decay) @ QUADRATURE)
            for place in closed.outputs
        ]
    )


def exact(experiment: Experiment, s: float) -> np.ndarray:
    """Return the transforms of the outputs by the algebra of transfer functions."""
    plant, n = experiment.plant, experiment.plant.n
    G = _matrix(plant, s)
    F = np.eye(n)
    if experiment.actuators is not None:
        F = np.diag([function(s).real for function in experiment.actuators.functions])
    T = np.eye(n) if experiment.distribution is None else experiment.distribution
    C = np.diag([_law(loop, s, 1.0, 1.0) for loop in experiment.loops])
    R = np.diag(
        [
            0.0 if loop is None else _law(loop, s, loop.setpoint_weight, loop.derivative_weight)
            for loop in experiment.loops
        ]
    )
    inputs = {kind: np.zeros(n) for kind in StepKind}
    for step in experiment.steps:
        inputs[step.kind][step.unit] += step.size * np.exp(-s * step.time) / s
    wanted = T @ (R @ inputs[StepKind.SETPOINT] - C @ inputs[StepKind.MEASUREMENT])
    right = G @ (F @ (wanted + inputs[StepKind.INPUT]) + inputs[StepKind.LOAD])
    return np.linalg.solve(np.eye(n) + G @ F @ T @ C, right)


def _matrix(plant: Plant, s: float) -> np.ndarray:
    size = range(plant.n)
    return np.array([[plant.element(row, column)(s).real for column in size] for row in size])


def _law(loop: Loop | None, s: float, b: float, c: float) -> float:
    """K (1 + tau_I s)/(tau_I s) (1 + tau_D s)/(1 + tau_F s), weights on its three parts."""
    if loop is None:
        return 0.0
    tau_d = loop.derivative_time or 0.0
    integral = 0.0 if loop.integral_time is None else loop.gain / loop.integral_time
    tau_f = 0.1 * tau_d if loop.filter_time is None else loop.filter_time
    proportional = loop.gain + integral * (tau_d - tau_f)
    whole = (loop.gain + integral / s) * (1 + tau_d * s) / (1 + tau_f * s)
    derivative = whole - integral / s - proportional
    return b * proportional + integral / s + c * derivative


def random_experiment(rng: np.random.Generator, plant: Plant, duration: float) -> Experiment:
    """Calm loops, some open, with steps of every kind at random times."""
    loops: Sequence[Loop | None] = [
        None
        if rng.random() < 0.2
        else Loop(
            float(rng.uniform(0.05, 0.2)),
            float(rng.uniform(2, 8)) if rng.random() < 0.8 else None,
            float(rng.uniform(0.1, 1)) if rng.random() < 0.5 else None,
            float(rng.uniform(0, 1)),
            float(rng.uniform(0, 1)),
            float(rng.uniform(0.02, 1)) if rng.random() < 0.3 else None,
        )
        for _ in range(plant.n)
    ]
    steps = [
        Step(kind, int(rng.integers(plant.n)), float(rng.uniform(0, 5)), float(rng.normal()))
        for kind in StepKind
    ]
    steps = [step for step in steps if acts(step.kind, loops[step.unit])]
    return Experiment(plant, tuple(loops), tuple(steps), duration)
