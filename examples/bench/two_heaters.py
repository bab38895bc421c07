"""A nonlinear bench of two heaters, and two PI loops on it, in plain Python.

    mutune tune heaters.json --json > settings.json
    python examples/bench/two_heaters.py settings.json

Each heater is a mass that loses heat by convection and radiation to the room and to the other one;
a sensor follows it with a lag::

    m c dT_j/dt = p_j u_j + U A (T_room - T_j) + e s A (T_room^4 - T_j^4)
                  + U A_s (T_k - T_j) + e s A_s (T_k^4 - T_j^4),     tau dS_j/dt = T_j - S_j

The loops are what mutune tunes, k (1 + 1/(tau_I s)), in per cent of heater per degree, on the
sensors once a second, heaters within 0 and 100 per cent, integral held while they are at a limit.
Set points: 50 and 40 degrees at the start, then 45 for the second; at the end the room cools.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Bench", "Pi", "run"]

STEFAN_BOLTZMANN = 5.67e-8  # W/(m^2 K^4)
ZERO = 273.15
EVENTS = (
    ("start", 0, 1500),
    ("second set point", 1500, 2750),
    ("room 4 degrees cooler", 2750, 4000),
)


@dataclass
class Bench:
    """Two heaters and their sensors, in degrees Celsius."""

    room: float = 21.0
    heat: float = 2.0  # m c, J/K
    power: tuple[float, float] = (0.010, 0.0075)  # W per cent
    convection: float = 0.0100  # U A, W/K
    between: float = 0.0045  # U A_s, W/K
    surface: float = 0.0010 * 0.9  # e A, m^2
    facing: float = 0.0002 * 0.9  # e A_s, m^2
    sensor: float = 15.0  # tau, s

    def __post_init__(self) -> None:
        self.state = [self.room] * 4

    @property
    def readings(self) -> list[float]:
        """Of the sensors, to the hundredth degree."""
        return [round(value, 2) for value in self.state[2:]]

    def slope(self, state: list[float], inputs: list[float]) -> list[float]:
        """Time derivative of temperatures and sensors."""
        first, second = state[:2]
        crossing = self._loss(first, second, self.between, self.facing)
        flows = (
            self.power[0] * inputs[0] - crossing - self._loss(first, self.room),
            self.power[1] * inputs[1] + crossing - self._loss(second, self.room),
        )
        return [
            *(flow / self.heat for flow in flows),
            (first - state[2]) / self.sensor,
            (second - state[3]) / self.sensor,
        ]

    def _loss(
        self, warm: float, cool: float, convection: float | None = None, area: float | None = None
    ) -> float:
        radiated = STEFAN_BOLTZMANN * ((warm + ZERO) ** 4 - (cool + ZERO) ** 4)
        return (self.convection if convection is None else convection) * (warm - cool) + (
            self.surface if area is None else area
        ) * radiated

    def step(self, inputs: list[float], length: float) -> None:
        """Move by `length` with the inputs held (Runge and Kutta, fourth order)."""
        x = self.state
        a = self.slope(x, inputs)
        b = self.slope([v + length / 2 * d for v, d in zip(x, a, strict=True)], inputs)
        c = self.slope([v + length / 2 * d for v, d in zip(x, b, strict=True)], inputs)
        d = self.slope([v + length * e for v, e in zip(x, c, strict=True)], inputs)
        self.state = [
            v + length / 6 * (p + 2 * q + 2 * r + s)
            for v, p, q, r, s in zip(x, a, b, c, d, strict=True)
        ]


@dataclass
class Pi:
    """A PI controller with limits."""

    gain: float
    integral_time: float
    low: float = 0.0
    high: float = 100.0
    total: float = 0.0

    def output(self, error: float, length: float) -> float:
        """Return the input for the next `length`."""
        wanted = self.gain * (error + (self.total + error * length) / self.integral_time)
        if self.low < wanted < self.high or (wanted - self.low) * error < 0:
            self.total += error * length
        return min(max(wanted, self.low), self.high)


def set_points(time: float) -> tuple[float, float]:
    """Return both set points."""
    return 50.0, 40.0 if time < 1500 else 45.0


def run(
    loops: list[Pi],
    *,
    duration: float = 4000.0,
    wanted: Callable[[float], tuple[float, float]] = set_points,
    cool_at: float = 2750.0,
) -> list[tuple[float, list[float], list[float]]]:
    """Close the loops on the bench; return times, readings and inputs, once a second."""
    bench = Bench()
    trace = []
    for second in range(int(duration)):
        if second == cool_at:
            bench.room -= 4.0
        readings = bench.readings
        errors = [w - y for w, y in zip(wanted(second), readings, strict=True)]
        inputs = [loop.output(error, 1.0) for loop, error in zip(loops, errors, strict=True)]
        trace.append((float(second), readings, inputs))
        bench.step(inputs, 1.0)
    return trace


def main(path: str) -> None:
    """Print what the loops of a tuning's result do."""
    loops = json.loads(Path(path).read_text())["loops"]
    trace = run([Pi(loop["gain"], loop["integral_time"]) for loop in loops])
    print("loop  event                 farthest off then  within 0.5 degrees after, s")
    for index in range(2):
        for name, begin, end in EVENTS:
            away = [abs(set_points(t)[index] - y[index]) for t, y, _ in trace[begin:end]]
            late = max((k for k, value in enumerate(away) if value > 0.5), default=-1) + 1
            first = next((k for k, value in enumerate(away) if value < 0.5), 0)
            print(f"{index + 1:4}  {name:22} {max(away[first:]):17.2f}  {late:27}")


if __name__ == "__main__":
    main(sys.argv[1])
