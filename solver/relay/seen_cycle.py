"""Whether a limit cycle is at the ultimate point, by the phase that the process has there.

4 d/(pi a) is the gain at which the process would oscillate only if its phase at the cycle's
frequency is -pi. Hysteresis makes the relay lag by arcsin(eps/a), so the process lags by as much
less; a static load makes the half periods unequal. The first harmonic over that of the relay
is the frequency response itself, so the phase is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from solver.relay.describing_function import Ultimate

__all__ = ["SeenCycle"]

# Johansson (1993) and others use cycles up to 11 degrees off; at 20 the gain of a process of
# relative degree one is off by a third or so, as much as the rules of thumb forgive.
FARTHEST = math.radians(20)
_WORTH_A_WORD = math.radians(6)
_UNEVEN = 0.05  # of the period, by which the two half periods differ
_NO_SINE = 0.05  # of the gain, between the describing function and the first harmonic


@dataclass(frozen=True)
class SeenCycle:
    """What the experiment measured of the process that the relay sees.

    Parameters
    ----------
    omega : float
        2 pi/T, rad per time unit.
    gain, phase : float
        Frequency response there, its static sign turned to plus; phase in rad, -2 pi..0.
    described : float
        4 d/(pi a), what the gain's inverse would be if the output were a sine wave.
    switchings : int
        In a period.
    unevenness : float
        Difference of the half periods over the period.
    hysteresis : bool
        Whether the relay has one.
    exists : bool
        Whether the phase of the process reaches -pi at all, near this frequency or above it. Where
        it does not, what oscillates is the relay's hysteresis or sampling, however near -pi.

    """

    omega: float
    gain: float
    phase: float
    described: float
    switchings: int
    unevenness: float
    hysteresis: bool
    exists: bool = True

    @property
    def off(self) -> float:
        """Return the phase over -pi, rad."""
        return self.phase + math.pi

    @property
    def at_ultimate_point(self) -> bool:
        """Whether the cycle may stand for the ultimate point."""
        return self.exists and self.switchings == 2 and abs(self.off) <= FARTHEST

    @property
    def ultimate(self) -> Ultimate | None:
        """Return the ultimate point: of an even cycle near a sine wave that of the amplitudes.

        Else the amplitudes hold a mean, or harmonics, and the first harmonic counts.
        """
        if not self.at_ultimate_point:
            return None
        plain = self.unevenness <= _UNEVEN and not self._is_no_sine
        return Ultimate(self.described if plain else 1 / self.gain, self.omega)

    @property
    def _is_no_sine(self) -> bool:
        """Whether harmonics make up much of the output, as behind a dominating dead time."""
        return abs(self.described * self.gain - 1) > _NO_SINE

    @property
    def remark(self) -> str | None:
        """What keeps the cycle from the ultimate point; None where nothing does."""
        if self.switchings > 2:
            return (
                f"{self.switchings} switchings in a period: several oscillations at once, no "
                "ultimate point and no settings."
            )
        if not self.exists:
            return (
                "No ultimate gain: the phase of this process does not reach -pi, so it has none; "
                "the relay's hysteresis or sampling makes the cycle. The experiment tells the "
                f"response there, gain {self.gain:.4g} at {self.omega:.4g} rad per time unit, and "
                "no settings. A real process has some dead time: put it into the model."
            )
        parts = []
        if not self.at_ultimate_point:
            parts.append(
                f"No ultimate gain: the phase of the process at this frequency is {self.phase:.3g} "
                f"rad, not -pi. The experiment tells its response there, gain {self.gain:.4g} at "
                f"{self.omega:.4g} rad per time unit, and no settings."
            )
        elif abs(self.off) > _WORTH_A_WORD:
            side = "higher" if self.off > 0 else "lower"
            parts.append(
                f"The phase at this frequency is {self.phase:.3g} rad, not quite -pi: the ultimate "
                f"frequency lies {side}, and as a rule the ultimate gain does."
            )
        if parts and self.hysteresis and self.off > 0:
            parts.append("Less hysteresis or more amplitude comes nearer.")
        if self.at_ultimate_point and self._is_no_sine and self.unevenness <= _UNEVEN:
            parts.append(
                "The output is no sine wave, as behind a dead time longer than the process's time "
                f"constants: 4 d/(pi a) is {self.described:.4g}, but of the first harmonic the "
                f"ultimate gain is {1 / self.gain:.4g}, and that is what counts."
            )
        if self.unevenness > _UNEVEN:
            parts.append(
                "The half periods are unequal: a load pushes the output to one side. Start where "
                "the process is at rest, or add a bias to the relay."
            )
        return " ".join(parts) or None
