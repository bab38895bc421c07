"""Plants drawn at random and their records, simulated by superposed step responses."""

import math
from dataclasses import dataclass

import numpy as np

from solver.identification.record import Record


@dataclass(frozen=True)
class Lag:
    """An element K exp(-L s)/((tau_1 s + 1)(tau_2 s + 1)); an integrator has tau_1 = inf."""

    gain: float
    first: float
    second: float
    dead_time: float

    def step(self, t):
        """Response to a unit step at 0; the textbook's formula."""
        t = np.maximum(t - self.dead_time, 0.0)
        if math.isinf(self.first):
            if not self.second:
                return self.gain * t
            return self.gain * (t - self.second * -np.expm1(-t / self.second))
        if not self.second:
            return self.gain * -np.expm1(-t / self.first)
        a, b = self.first, self.second
        return self.gain * (1 - (a * np.exp(-t / a) - b * np.exp(-t / b)) / (a - b))


def moves(generator, count, hold=(10, 80)):
    """Return a random staircase."""
    u = np.zeros(count)
    at = 0
    while at < count:
        length = int(generator.integers(*hold))
        u[at : at + length] = generator.choice([-1.0, 0.0, 1.0])
        at += length
    return u


def respond(element, time, u):
    """Return the response at rest before to an input held between samples."""
    y = np.zeros(time.size)
    for index in np.flatnonzero(np.diff(u)) + 1:
        y += (u[index] - u[index - 1]) * element.step(time - time[index])
    return y


def record(elements, generator, count=600, noise=0.1):
    """Return a record of a plant, elements by row."""
    time = np.arange(count, dtype=float)
    inputs = {f"u{j}": moves(generator, count) for j in range(len(elements[0]))}
    outputs = {}
    for i, row in enumerate(elements):
        y = sum(respond(e, time, u) for e, u in zip(row, inputs.values(), strict=True))
        outputs[f"y{i}"] = 20.0 + y + noise * generator.standard_normal(count)
    return Record(time, inputs, outputs)


def lag(generator, *, second=False):
    """Return a random element."""
    first = math.exp(generator.uniform(math.log(4), math.log(60)))
    return Lag(
        float(generator.choice([-1, 1]) * generator.uniform(0.5, 3)),
        first,
        first * generator.uniform(0.2, 0.7) if second else 0.0,
        generator.uniform(0, 15),
    )
