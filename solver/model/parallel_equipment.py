"""Like units of a plant on one header or in one firebox, from physical parameters.

Each plant is the linearised balances of its docstring; any consistent set of units will do. As in
`solver.model.physical_models`, a is the static effect on a neighbour relative to that on the unit
itself (Skogestad, Lundstrom and Hovd 1989, eq. 7).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.physical_models import LARGEST, Equipment, StreamSplit
from solver.model.plants import ParallelPlant
from solver.model.transfer_function import TransferFunction
from solver.model.validation import settle_reals

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["BurnerPasses", "ParallelCompressors", "ParallelExchangers"]


@dataclass(frozen=True)
class ParallelExchangers(Equipment):
    """n equal heat exchangers whose heating medium comes from one header of finite pressure.

    Each exchanger heats its own stream; its valve sets the medium's flow m, which the header's
    pressure couples as in `StreamSplit`. With M c the heat held in an exchanger, F c that of its
    stream, c_m the medium's heat capacity and N = UA/(m c_m)::

        M c dT/dt = F c (T_in - T) + m c_m (T_m - T) (1 - exp(-N))

    (the medium's effectiveness against a well mixed stream). In deviations::

        dQ/dm = c_m (T_m - T) (1 - exp(-N) (1 + N)),     dQ/dT = -m c_m (1 - exp(-N))

    so g and i of the stream split are followed by K/(tau s + 1), K = dQ/dm / (F c - dQ/dT), tau =
    M c / (F c - dQ/dT): a is the header's alone, from 0 (stiff header) towards -1/(n-1).

    Parameters
    ----------
    n : int
        Number of exchangers.
    holdup_heat : float
        M c > 0, heat per degree held in an exchanger.
    stream_heat : float
        F c > 0, heat per time and degree, of one stream.
    medium_flow : float
        m > 0, of one exchanger.
    medium_heat_capacity : float
        c_m > 0.
    exchange : float
        UA > 0 of one exchanger.
    temperature_difference : float
        T_m - T, not zero: negative for coolers.
    opening : float
        Valve opening, > 0.
    pressure_drop : float
        Over the valve, > 0.
    supply_resistance : float
        Header pressure lost per unit of total flow, >= 0.
    header_time, valve_time, dead_time : float
        As of `StreamSplit`, >= 0.

    """

    n: int
    holdup_heat: float
    stream_heat: float
    medium_flow: float
    medium_heat_capacity: float
    exchange: float
    temperature_difference: float
    opening: float
    pressure_drop: float
    supply_resistance: float
    header_time: float = 0.0
    valve_time: float = 0.0
    dead_time: float = 0.0

    POSITIVE = (
        "holdup_heat",
        "stream_heat",
        "medium_flow",
        "medium_heat_capacity",
        "exchange",
        "opening",
        "pressure_drop",
    )
    NOT_NEGATIVE = ("supply_resistance", "header_time", "valve_time", "dead_time")

    def __post_init__(self) -> None:
        super().__post_init__()
        settle_reals(self, "temperature_difference")
        if not 0 < abs(self.temperature_difference) <= LARGEST:
            message = "must not be zero, and at most 1e12 in magnitude"
            raise InvalidInputError(message, "/temperature_difference")

    @property
    def interaction_limits(self) -> tuple[float, float]:
        """Least and greatest a of such equipment."""
        return _header_limits(self.n)

    def plant(self) -> ParallelPlant:
        """Return the plant from valve openings to the streams' outlet temperatures.

        Examples
        --------
        >>> plant = ParallelExchangers(3, 800, 20, 2, 4, 10, 60, 0.5, 2, 0.5).plant()
        >>> round(plant.interaction.static_gain / plant.process.static_gain, 6)
        -0.166667

        """
        split = StreamSplit(
            self.n, self.medium_flow, self.opening, self.pressure_drop, self.supply_resistance,
            self.header_time, self.valve_time, self.dead_time,
        ).plant()  # fmt: skip
        units = self.exchange / (self.medium_flow * self.medium_heat_capacity)
        by_flow = (
            self.medium_heat_capacity
            * self.temperature_difference
            # 1 - exp(-N) (1 + N), without its cancellation for small N.
            * (-math.expm1(-units) - units * math.exp(-units))
        )
        if by_flow == 0:
            message = "the exchanger is so small that the medium's flow has no effect"
            raise InvalidInputError(message, "/exchange")
        taken = self.stream_heat - self.medium_flow * self.medium_heat_capacity * math.expm1(-units)
        lag = (self.holdup_heat / taken, 1.0)
        return ParallelPlant(
            self.n,
            _after(split.process, by_flow / taken, lag),
            _after(split.interaction, by_flow / taken, lag),
        )


@dataclass(frozen=True)
class ParallelCompressors(Equipment):
    """n equal compressors that deliver into one header, each with a flow controller on its speed.

    A compressor's head falls by r per flow and rises by b per speed; its gas has the inertia L; the
    header stores gas and loses it to the consumers through their resistance R = dp/dq::

        L dq_j/dt = b dN_j - r dq_j - dp
        (T s + 1) dp = R sum_j dq_j,     T = R C

    Hence, with y = 1/(L s + r) and Z = R/(T s + 1),

        g = b y (1 + (n-1) y Z)/(1 + n y Z),     i = -b y^2 Z/(1 + n y Z)

    and a = -R/(r + (n-1) R): 0 for a header that holds its pressure, towards -1/(n-1) where the
    consumers take a constant flow. Right of the top of the curve (r > 0) only: left of it the
    compressor surges.

    Parameters
    ----------
    n : int
        Number of compressors.
    head_per_speed : float
        b > 0.
    head_per_flow : float
        r > 0, slope of the curve, counted downwards.
    inertia : float
        L >= 0.
    consumer_resistance : float
        R >= 0.
    header_time : float
        T = R C >= 0.
    drive_time, dead_time : float
        Lag and dead time from speed demand to speed, >= 0.

    """

    n: int
    head_per_speed: float
    head_per_flow: float
    inertia: float
    consumer_resistance: float
    header_time: float = 0.0
    drive_time: float = 0.0
    dead_time: float = 0.0

    POSITIVE = ("head_per_speed", "head_per_flow")
    NOT_NEGATIVE = ("inertia", "consumer_resistance", "header_time", "drive_time", "dead_time")

    @property
    def interaction_limits(self) -> tuple[float, float]:
        """Least and greatest a of such equipment."""
        return _header_limits(self.n)

    def plant(self) -> ParallelPlant:
        """Return the plant from speed demands to flows.

        Examples
        --------
        >>> plant = ParallelCompressors(4, 3.0, 2.0, 1.0, 2.0).plant()
        >>> plant.interaction.static_gain / plant.process.static_gain
        -0.25

        """
        R = self.consumer_resistance
        own = _trimmed([self.inertia, self.head_per_flow])
        header = _trimmed([self.header_time, 1.0])
        both = np.polymul(own, header)
        drive = _trimmed([self.drive_time, 1.0])
        den = np.polymul(np.polymul(own, drive), np.polyadd(both, [self.n * R]))
        b = self.head_per_speed
        return ParallelPlant(
            self.n,
            _function(b * np.polyadd(both, [(self.n - 1) * R]), den, self.dead_time),
            _function(np.array([-b * R]), den, self.dead_time if R else 0.0),
        )


@dataclass(frozen=True)
class BurnerPasses(Equipment):
    """n equal passes of a furnace, each with a burner of its own, in one firebox.

    Of a burner's heat the part m is shared by all passes alike through firebox and walls, which
    have the lag tau_w; the rest heats its own pass. With M c the heat held in a pass and F c its
    stream's::

        M c dT_j/dt = F c (T_in - T_j) + H ((1 - m) f_j + m/(tau_w s + 1) sum_k f_k / n)

    so with K = H/(F c), tau = M/F,

        g = K (1 - m + (m/n)/(tau_w s + 1))/(tau s + 1),     i = K (m/n)/((tau_w s + 1)(tau s + 1))

    and a = m/(n (1 - m) + m): 0 for separate fireboxes, towards 1 for one that mixes all.

    Parameters
    ----------
    n : int
        Number of passes.
    holdup_heat : float
        M c > 0.
    stream_heat : float
        F c > 0.
    fuel_heat : float
        H > 0, absorbed heat per fuel.
    shared : float
        m, 0 <= m < 1.
    firebox_time : float
        tau_w >= 0.
    fuel_time, dead_time : float
        Lag and dead time from fuel demand to heat, >= 0.

    """

    n: int
    holdup_heat: float
    stream_heat: float
    fuel_heat: float
    shared: float
    firebox_time: float = 0.0
    fuel_time: float = 0.0
    dead_time: float = 0.0

    POSITIVE = ("holdup_heat", "stream_heat", "fuel_heat")
    NOT_NEGATIVE = ("shared", "firebox_time", "fuel_time", "dead_time")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.shared < 1:
            message = "passes that share all heat cannot be controlled one by one: below 1"
            raise InvalidInputError(message, "/shared")

    @property
    def interaction_limits(self) -> tuple[float, float]:
        """Least and greatest a of such equipment."""
        return (0.0, 1.0)

    def plant(self) -> ParallelPlant:
        """Return the plant from fuel flows to the passes' outlet temperatures.

        Examples
        --------
        >>> plant = BurnerPasses(2, 800, 20, 1000, 0.5).plant()
        >>> round(plant.interaction.static_gain / plant.process.static_gain, 6)
        0.333333

        """
        K = self.fuel_heat / self.stream_heat
        lag = np.polymul(
            [self.holdup_heat / self.stream_heat, 1.0], _trimmed([self.fuel_time, 1.0])
        )
        firebox = _trimmed([self.firebox_time, 1.0])
        den = np.polymul(lag, firebox)
        part = self.shared / self.n
        own = np.polyadd((1 - self.shared) * np.asarray(firebox), [part])
        return ParallelPlant(
            self.n,
            _function(K * own, den, self.dead_time),
            _function(np.array([K * part]), den, self.dead_time if part else 0.0),
        )


def _header_limits(n: int) -> tuple[float, float]:
    return (-1.0 / (n - 1) if n > 1 else 0.0, 0.0)


def _after(function: TransferFunction, gain: float, lag: tuple[float, float]) -> TransferFunction:
    if function.is_zero:
        return function
    num = [gain * value for value in function.num]
    return _function(np.array(num), np.polymul(function.den, lag), function.dead_time)


def _function(
    num: NDArray[np.floating[Any]], den: NDArray[np.floating[Any]], dead_time: float
) -> TransferFunction:
    return TransferFunction([float(v) for v in num], [float(v) for v in den], dead_time)


def _trimmed(polynomial: list[float]) -> list[float]:
    return polynomial if polynomial[0] else polynomial[1:]
