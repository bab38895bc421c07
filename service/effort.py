"""What a request would cost, said before anything is computed.

Only what grows without a bound of the schema is estimated: most requests cannot cost much. The
times are those of the machine that `bench/dear_requests.py` was run on, so the limits of the
service, which hold while it computes, remain behind them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from service.problems import EffortError
from service.schemas.parsing import Fault
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.plants import Plant
from solver.model.weights import Performance, Uncertainty

__all__ = ["Effort", "different_loops", "of_different_loops", "of_readings", "refuse"]

_LIBRARIES = 300e6  # bytes of a process before it computes
# Measured: 40 different loops take 7 s, 60 take 22 s, 80 take 51 s: the cube of their number, from
# the matrices of N_RP and their eigenvalues; a proof, of up to 60, adds a third. 40 take 421 MB,
# 60 take 579 MB, 80 take 694 MB.
_SECONDS = 1e-4
_BYTES = 77e3
# Records of noise, of which nothing can be told, take twice as long as this.
_SECONDS_A_READING = 2e-4
_BUSY = 1.5  # time on a machine that has something else to do as well


@dataclass(frozen=True)
class Effort:
    """Processor time and memory of a computation.

    Parameters
    ----------
    seconds, memory : float
        Seconds and bytes, roughly.
    what : str
        What costs them, with its number.
    pointer : str
        JSON pointer of what is to be reduced.
    reduce : callable
        From the limits, seconds and bytes, to the words that say how much of it is possible.

    """

    seconds: float
    memory: float
    what: str
    pointer: str
    reduce: Callable[[float, float], str]


def different_loops(
    plant: Plant,
    loops: tuple[Controller, ...],
    uncertainty: Uncertainty,
    performance: Performance,
) -> Effort:
    """Return what mu of given loops costs; a proof beside it has a limit of its own."""
    blocks, _ = group_loops(plant, loops, uncertainty, performance.output_scale)
    return of_different_loops(blocks.n_controllers)


def of_different_loops(count: int) -> Effort:
    """Return what mu of so many different loops costs."""
    cube = _BUSY * _SECONDS

    def reduce(seconds: float, memory: float) -> str:
        by_time = (seconds / cube) ** (1 / 3)
        by_memory = (max(memory - _LIBRARIES, 0.0) / _BYTES) ** 0.5
        most = int(min(by_time, by_memory))
        return f"give the same settings to more loops: at most {most} may differ here"

    return Effort(
        cube * count**3,
        _LIBRARIES + _BYTES * count**2,
        f"{count} loops that differ",
        "/loops",
        reduce,
    )


def of_readings(readings: int, elements: int) -> Effort:
    """Return what it costs to identify so many elements from so many readings of each signal."""

    def reduce(seconds: float, memory: float) -> str:
        del memory
        most = int(seconds / (_SECONDS_A_READING * elements))
        return f"send fewer readings, every second or tenth of them: at most {most} here"

    return Effort(
        _SECONDS_A_READING * readings * elements,
        _LIBRARIES,
        f"{readings} readings for {elements} elements",
        "/records",
        reduce,
    )


def refuse(effort: Effort, *, seconds: float, memory: float) -> None:
    """Refuse what would not end within the limits.

    Raises
    ------
    EffortError
        It would not.

    """
    if effort.seconds <= seconds and effort.memory <= memory:
        return
    message = (
        f"{effort.what} take about {effort.seconds:.2g} s and {effort.memory / 1e6:.2g} MB, and a "
        f"request has {seconds:g} s and {memory / 1e6:g} MB: {effort.reduce(seconds, memory)}, "
        "or use the command line, which has no such limit"
    )
    raise EffortError(message, faults=(Fault(effort.pointer, message),))
