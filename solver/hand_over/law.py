"""The law by which a control system computes, as far as its settings are typed into it.

With K the gain, T_i and T_d the times and T_f that of the filter::

    cascade    K (1 + 1/(T_i s)) (1 + T_d s)/(1 + T_f s)
    ideal      K (1 + 1/(T_i s) + T_d s/(1 + T_f s))
    parallel   K + K_i/s + K_d s/(1 + T_f s)

A filter on the measurement stands before the whole law instead: 1/(1 + T_f s) times the above
without its own filter. Seen from the measurement that is one product; the answer to a set point
then passes no filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from solver.model.errors import InvalidInputError

__all__ = ["FilterEntry", "Form", "GainEntry", "IntegralEntry", "Law", "Names"]


class Form(StrEnum):
    """Which of the three laws."""

    CASCADE = "cascade"
    IDEAL = "ideal"
    PARALLEL = "parallel"


class GainEntry(StrEnum):
    """How the gain K is typed: itself, or as 100/K."""

    GAIN = "gain"
    PROPORTIONAL_BAND = "proportional_band"


class IntegralEntry(StrEnum):
    """How integral action is typed: the time T_i of a repeat, or repeats 1/T_i per time."""

    TIME = "time"
    REPEATS = "repeats"


class FilterEntry(StrEnum):
    """How the filter is typed: T_f/T_d, T_f, T_d/T_f, or T_f of a filter on the measurement."""

    RATIO = "ratio"
    TIME = "time"
    GAIN = "gain"
    MEASUREMENT = "measurement"


@dataclass(frozen=True, kw_only=True)
class Names:
    """What a control system calls its settings."""

    gain: str = "K"
    integral: str = "Ti"
    derivative: str = "Td"
    filter: str = "Tf"


@dataclass(frozen=True, kw_only=True)
class Law:
    """A law and how its settings are typed.

    Parameters
    ----------
    form : Form
        Which law.
    gain, integral, filter : GainEntry, IntegralEntry, FilterEntry
        How each setting is typed. The parallel law has gains, and takes the first of each only.
    lowest, highest : float or None
        Permitted range of T_f/T_d; equal where the system fixes it, and then nothing is typed.
    signed : bool
        Whether a negative gain is typed as such; else the action says it.
    names : Names
        What the system calls its settings.

    """

    form: Form
    gain: GainEntry = GainEntry.GAIN
    integral: IntegralEntry = IntegralEntry.TIME
    filter: FilterEntry = FilterEntry.RATIO
    lowest: float | None = None
    highest: float | None = None
    signed: bool = False
    names: Names = Names()

    def __post_init__(self) -> None:
        if self.form is Form.PARALLEL:
            if self.gain is not GainEntry.GAIN:
                message = "the parallel form has gains, and no proportional band"
                raise InvalidInputError(message, "/gain")
            if self.integral is not IntegralEntry.TIME:
                message = "the parallel form has an integral gain, and no repeats"
                raise InvalidInputError(message, "/integral")

    @property
    def has_fixed_filter(self) -> bool:
        """Whether T_f/T_d cannot be chosen."""
        return self.lowest is not None and self.lowest == self.highest

    @property
    def equation(self) -> str:
        """The law in the names of its settings, over the signals in per cent."""
        names = self.names
        gain = names.gain
        if self.gain is GainEntry.PROPORTIONAL_BAND:
            gain = f"100/{gain}"
        integral = f"1/({names.integral}*s)"
        if self.integral is IntegralEntry.REPEATS:
            integral = f"{names.integral}/s"
        time = names.derivative
        if self.form is Form.PARALLEL:  # T_d = K_d/K
            time = f"{names.derivative}/{names.gain}"
        lag = {
            FilterEntry.RATIO: f"{names.filter}*{time}*s",
            FilterEntry.TIME: f"{names.filter}*s",
            FilterEntry.GAIN: f"{time}/{names.filter}*s",
            FilterEntry.MEASUREMENT: "",
        }[self.filter]
        own = f"/(1 + {lag})" if lag else ""
        derivative = f"{names.derivative}*s{own}"
        if self.form is Form.CASCADE:
            text = f"{gain}*(1 + {integral})*(1 + {names.derivative}*s){own}"
        elif self.form is Form.IDEAL:
            text = f"{gain}*(1 + {integral} + {derivative})"
        else:
            text = f"{gain} + {names.integral}/s + {derivative}"
        if lag:
            return text
        product = f"({text})" if self.form is Form.PARALLEL else text
        return f"{product}/(1 + {names.filter}*s)"
