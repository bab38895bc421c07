"""Plants from physical parameters: the processes that the sources take as examples.

Each function derives a plant from the linearised balances in its docstring. Any consistent set
of units will do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from solver.model.errors import InvalidInputError
from solver.model.plants import MAX_UNITS, MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.validation import integer, real, settle

__all__ = ["LARGEST", "Blender", "CooledReactors", "Equipment", "StreamSplit"]

LARGEST = 1e12  # of any physical parameter, in the user's units


class Equipment:
    """A model of equipment by numbers: a record of real fields, and of `n` units where it has any.

    `POSITIVE` and `NOT_NEGATIVE` name its fields with such a range; a subclass with further
    conditions checks them after these.
    """

    POSITIVE: ClassVar[tuple[str, ...]] = ()
    NOT_NEGATIVE: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        if hasattr(self, "n"):
            settle(self, n=integer(self.n, "/n"))
            if not 1 <= self.n <= MAX_UNITS:
                message = f"the number of units must lie in 1..{MAX_UNITS}"
                raise InvalidInputError(message, "/n")
        for name in (*self.POSITIVE, *self.NOT_NEGATIVE):
            value = real(getattr(self, name), f"/{name}")
            settle(self, **{name: value})
            positive = name in self.POSITIVE
            if not (value > 0 if positive else value >= 0) or not value <= LARGEST:
                bound = "positive" if positive else "zero or positive"
                message = f"must be {bound} and at most 1e12"
                raise InvalidInputError(message, f"/{name}")


@dataclass(frozen=True)
class StreamSplit(Equipment):
    """n equal streams from one header of finite pressure (SLH, example 1 and fig. 1).

    A valve at opening x passes q = c x sqrt(p - p_out); the supply gives less flow at a higher
    header pressure, and the header stores some. In deviations from the operating point::

        dq_j = beta dx_j + alpha dp            beta = q/x, alpha = q/(2 (p - p_out))
        (R C s + 1) dp = -R sum_j dq_j         supply resistance R = -dp/dq, header capacity C

    Hence, with v(s) the dynamics of valve and flow measurement and T = R C,

        g = beta v (T s + 1 + (n-1) alpha R)/(T s + 1 + n alpha R)
        i = -beta v alpha R/(T s + 1 + n alpha R)

    so at steady state a = -alpha R/(1 + (n-1) alpha R): 0 for a stiff header, towards
    -1/(n-1) for a pump of constant flow (SLH eq. 6).

    Parameters
    ----------
    n : int
        Number of streams.
    flow : float
        q, flow of one stream, > 0.
    opening : float
        x, valve opening, > 0.
    pressure_drop : float
        p - p_out, over the valve, > 0.
    supply_resistance : float
        R >= 0, header pressure lost per unit of total flow.
    header_time : float
        T = R C >= 0.
    valve_time, dead_time : float
        v(s) = exp(-dead_time s)/(valve_time s + 1), both >= 0.

    """

    n: int
    flow: float
    opening: float
    pressure_drop: float
    supply_resistance: float
    header_time: float = 0.0
    valve_time: float = 0.0
    dead_time: float = 0.0

    POSITIVE = ("flow", "opening", "pressure_drop")
    NOT_NEGATIVE = ("supply_resistance", "header_time", "valve_time", "dead_time")

    @property
    def valve_gain(self) -> float:
        """Beta = q/x: flow per opening at a stiff header."""
        return self.flow / self.opening

    @property
    def coupling(self) -> float:
        """Alpha R: total flow lost to the header pressure per flow gained, dimensionless."""
        return self.flow / (2 * self.pressure_drop) * self.supply_resistance

    def plant(self) -> ParallelPlant:
        """Return the plant from valve openings to flows.

        Examples
        --------
        >>> split = StreamSplit(4, flow=10, opening=0.5, pressure_drop=2, supply_resistance=0.8)
        >>> plant = split.plant()
        >>> round(plant.interaction.static_gain / plant.process.static_gain, 6)
        -0.285714

        """
        k = self.coupling
        valve = [self.valve_time, 1.0] if self.valve_time else [1.0]
        header = [self.header_time] if self.header_time else []
        den = _product(valve, [*header, 1 + self.n * k])
        beta = self.valve_gain
        own = [beta * c for c in [*header, 1 + (self.n - 1) * k]]
        return ParallelPlant(
            self.n,
            TransferFunction(own, den, self.dead_time),
            TransferFunction([-beta * k], den, self.dead_time if k else 0.0),
        )


@dataclass(frozen=True)
class CooledReactors(Equipment):
    """n equal stirred reactors whose vaporised coolant precools the common feed (SLH, example 2).

    Coolant m_j evaporates completely in reactor j; the vapour of all reactors is then
    superheated in one exchanger by the common feed. With M the mass in a reactor, F its feed,
    c its heat capacity and Q the heat released in it::

        M c dT_j/dt = F c (T_f - T_j) + Q - m_j dH
        n F c (T_in - T_f) = m c_v (T_in - T_b) (1 - exp(-UA/(m c_v))),     m = sum_j m_j

    (exchanger effectiveness with a vapour flow of small heat capacity; its dynamics and those
    of the evaporators are neglected, as in SLH). The valves split the coolant as `StreamSplit`
    at steady state. So an own valve cools its reactor by dH, and all valves cool all reactors
    through the feed by h = dq/dm. In the modes of the parallel matrix::

        differences:  -beta dH/(F c)        sum:  -beta/(1 + n alpha R) (dH + h)/(F c)

    and G(s) = k/(tau s + 1) [1, a; a, 1] with tau = M/F (SLH eq. 7), -1/(n-1) <= a <= 1: the
    lower limit without precooler at constant total flow, the upper one without evaporation.

    Parameters
    ----------
    n : int
        Number of reactors.
    holdup : float
        M > 0, mass.
    feed : float
        F > 0, mass per time, of one reactor.
    heat_capacity : float
        c > 0, of the feed.
    coolant : float
        m_j > 0, mass per time.
    opening : float
        Valve opening, > 0.
    evaporation_heat : float
        dH >= 0, per mass of coolant.
    vapour_heat_capacity : float
        c_v > 0.
    exchanger : float
        UA >= 0 of the precooler, heat per time and degree.
    feed_superheat : float
        T_in - T_b >= 0: feed temperature above the coolant's boiling point.
    coupling : float
        alpha R >= 0 of the coolant header, as `StreamSplit.coupling`.

    """

    n: int
    holdup: float
    feed: float
    heat_capacity: float
    coolant: float
    opening: float
    evaporation_heat: float
    vapour_heat_capacity: float
    exchanger: float
    feed_superheat: float
    coupling: float = 0.0

    POSITIVE = ("holdup", "feed", "heat_capacity", "coolant", "opening", "vapour_heat_capacity")
    NOT_NEGATIVE = ("evaporation_heat", "exchanger", "feed_superheat", "coupling")

    @property
    def precooling(self) -> float:
        """H = dq/dm: heat that the precooler takes from the feed per mass of coolant."""
        units = self.exchanger / (self.n * self.coolant * self.vapour_heat_capacity)
        share = 1 - math.exp(-units) * (1 + units)
        return self.vapour_heat_capacity * self.feed_superheat * share

    def plant(self) -> ParallelPlant:
        """Return the plant from valve openings to reactor temperatures.

        Raises
        ------
        InvalidInputError
            Neither evaporation nor precooling: the coolant has no effect.

        """
        scale = -self.coolant / self.opening / (self.feed * self.heat_capacity)
        difference = scale * self.evaporation_heat
        total = scale / (1 + self.n * self.coupling) * (self.evaporation_heat + self.precooling)
        own = (total + (self.n - 1) * difference) / self.n
        if own == 0:
            message = "neither evaporation nor precooling: the coolant has no effect"
            raise InvalidInputError(message, "/evaporation_heat")
        other = (total - difference) / self.n
        return first_order(self.n, own, self.holdup / self.feed, other / own)


@dataclass(frozen=True)
class Blender(Equipment):
    """Two streams W1, W2 with mass fractions x1, x2 blended (Smith and Corripio, fig. 9-1.5).

    Total flow W = W1 + W2 and W x = W1 x1 + W2 x2, so dW = dW1 + dW2 and
    dx = ((x1 - x) dW1 + (x2 - x) dW2)/W; the relative gain of W and W1 is W1/W. The inputs are
    the two flows, the outputs total flow and composition. The analyser has a lag and a dead
    time.

    Parameters
    ----------
    first_flow, second_flow : float
        W1, W2 > 0.
    first_fraction, second_fraction : float
        x1, x2 in 0..1, different.
    flow_time : float
        Lag of the valves and the flow measurement, >= 0.
    analyser_time, analyser_dead_time : float
        Lag and dead time of the analyser, >= 0.

    """

    first_flow: float
    second_flow: float
    first_fraction: float
    second_fraction: float
    flow_time: float = 0.0
    analyser_time: float = 0.0
    analyser_dead_time: float = 0.0

    POSITIVE = ("first_flow", "second_flow")
    NOT_NEGATIVE = ("flow_time", "analyser_time", "analyser_dead_time")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("first_fraction", "second_fraction"):
            settle(self, **{name: real(getattr(self, name), f"/{name}")})
            if not 0 <= getattr(self, name) <= 1:
                message = "a mass fraction lies in 0..1"
                raise InvalidInputError(message, f"/{name}")
        if self.first_fraction == self.second_fraction:
            message = "streams of equal composition cannot set the composition of the blend"
            raise InvalidInputError(message, "/second_fraction")

    def plant(self) -> MatrixPlant:
        """Return the plant from (W1, W2) to (W, x).

        Examples
        --------
        >>> from solver.interaction.relative_gain import relative_gain_array
        >>> plant = Blender(70, 30, first_fraction=0.9, second_fraction=0.2).plant()
        >>> relative_gain_array(plant.static_gain()).round(6)
        array([[0.7, 0.3],
               [0.3, 0.7]])

        """
        total = self.first_flow + self.second_flow
        blend = self.first_flow * self.first_fraction + self.second_flow * self.second_fraction
        flow_lag = [self.flow_time, 1.0] if self.flow_time else [1.0]
        analyser = [self.analyser_time, 1.0] if self.analyser_time else [1.0]
        flow = TransferFunction([1.0], flow_lag)
        composition = [
            TransferFunction(
                [(fraction - blend / total) / total],
                _product(flow_lag, analyser),
                self.analyser_dead_time,
            )
            for fraction in (self.first_fraction, self.second_fraction)
        ]
        return MatrixPlant([[flow, flow], composition])


def _product(first: list[float], second: list[float]) -> list[float]:
    """Product of two polynomials."""
    result = [0.0] * (len(first) + len(second) - 1)
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            result[i + j] += a * b
    return result
