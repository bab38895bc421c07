"""What set-point steps ask of valves, beside their ranges: the input spans of the instruments.

A valve that rests in the middle of its range has half of it to either side. A unit step of the set
points asks at once for (I + C(inf) G(inf))^-1 C(inf) of it, and at rest for G(0)^-1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from service.beyond import with_limit
from service.schemas.fields import Instrument
from service.schemas.tunings import tuning_to_json
from service.wording import number
from solver.model.loop_names import loops_text, units_text
from solver.model.measured import MeasuredPlant
from solver.stability.neutral import feedthrough
from solver.stability.singular import is_singular

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from service.schemas.tunings import TuningRequest
    from solver.model.controllers import Controller
    from solver.model.mixing import Mixing
    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction
    from solver.simulation.step_response import StepResponse
    from solver.tuning.record import Tuning

__all__ = ["finished", "limits_of", "step_remarks", "tuning_remarks"]

HALF = 0.5  # of the range: what a valve in the middle of it has to either side
LARGEST_MATRIX = 100  # units whose plant is taken as a matrix


def finished(
    request: TuningRequest, tuning: Tuning, check: Callable[[], bool | None] = lambda: None
) -> dict[str, Any]:
    """Return a tuning as JSON, with what follows from parts of the request that tune nothing.

    Parameters
    ----------
    request : TuningRequest
        What was asked.
    tuning : Tuning
        What was found.
    check : callable
        As for `service.beyond.with_limit`.

    """
    document = tuning_to_json(tuning)
    asked = request.build()
    plant = asked.arranged(tuning.pairing).plant
    if tuning.loops and not isinstance(plant, MeasuredPlant):
        said = tuning_remarks(request.signals(plant.n), plant, tuning.loops, asked.mixing)
        document["warnings"] = [*document["warnings"], *said]
    return with_limit(request, document, check)


def limits_of(signals: Sequence[Instrument]) -> tuple[float | None, ...]:
    """Return how far each valve moves to either side from the middle; None: not known."""
    return tuple(None if each.input_span is None else HALF * each.input_span for each in signals)


def tuning_remarks(
    signals: Sequence[Instrument],
    plant: Plant,
    loops: Sequence[Controller],
    mixing: Mixing | None = None,
) -> Iterator[str]:
    """Yield what a unit step of each set point asks for, where the valve has less.

    Parameters
    ----------
    signals : sequence of Instrument
        Of each loop; with `mixing`, of each output and input.
    plant : Plant
        As the loops see it.
    loops : sequence of Controller
        One a unit.
    mixing : Mixing or None
        The combinations that they see it through.

    """
    inputs = None if mixing is None else mixing.inputs
    outputs = None if mixing is None else mixing.outputs
    M = None if inputs is None else np.array(inputs)
    spans = np.array([each.input_span or np.inf for each in signals])
    if np.isinf(spans).all():
        return
    at_once = _at_once(plant, loops)
    at_rest = _at_rest(plant, loops)
    found: dict[tuple[str, str], list[int]] = {}
    for unit, each in enumerate(signals):
        columns = [moves.column(unit, plant.n) for moves in (at_once, at_rest)]
        now, then = (np.abs(v if M is None else M @ v) / spans for v in columns)
        valve = int(np.maximum(now, then).argmax())
        share, when = float(now[valve]), "at once"
        if then[valve] > share:
            share, when = float(then[valve]), "in the end"
        if share > HALF:
            whose = "its valve" if valve == unit else f"the valve of loop {valve + 1}"
            if inputs is not None:
                whose = f"input {valve + 1}"
            asked = f"asks {when} for {_share(share, whose, signals[valve])}"
            # Of a combination of outputs the unit is not known.
            size = f"1 {each.output_unit}" if each.output_unit and outputs is None else "1"
            found.setdefault((size, asked), []).append(unit)
    for (size, asked), units in found.items():
        yield f"A set-point step of {size} on {loops_text(units)} {asked}. Ramp it, or step less."


def step_remarks(
    signals: Sequence[Instrument],
    limited: Sequence[bool],
    found: StepResponse,
    *,
    shared: bool = False,
) -> Iterator[str]:
    """Yield which inputs move further than their valves can.

    Parameters
    ----------
    signals : sequence of Instrument
        Of each loop.
    limited : sequence of bool
        Whether the simulation keeps each input within limits.
    found : StepResponse
        The responses.
    shared : bool
        Whether the loops share the inputs.

    """
    for response in found.responses:
        moved = float(np.abs(response.input).max())
        said: dict[str, list[int]] = {}
        for unit in response.units:
            span = signals[unit].input_span
            if span is not None and not limited[unit] and moved > HALF * span:
                text = _share(moved / span, "its valve", signals[unit])
                said.setdefault(text, []).append(unit)
        for text, units in said.items():
            which = f"The input of {loops_text(units)} moves"
            if shared:
                which = f"Input{'s' * (len(units) > 1)} {units_text(units)} of the plant "
                which += "move" if len(units) > 1 else "moves"
            yield (
                f"{which} by up to {text}. With the valve at its limits the loops do what the thin "
                "lines show."
            )


def _share(share: float, whose: str, signals: Instrument) -> str:
    """Say how much of a range that is."""
    assert signals.input_span is not None  # noqa: S101 - for the type checker: it has a share
    unit = f" {signals.input_unit}" if signals.input_unit else ""
    more = "it has" if share > 1 else "there is to either side of its middle"
    return (
        f"{number(share * signals.input_span, 3)}{unit}, {100 * share:.3g} % of the range of "
        f"{whose}: more than {more}"
    )


@dataclass(frozen=True, eq=False)
class _Moves:
    """How far inputs move: (n, n) by step in their columns, or (n,), each at its own step alone."""

    values: NDArray[np.float64]

    def column(self, unit: int, n: int) -> NDArray[np.float64]:
        """Return the moves of all inputs, those of loops, at a step of one set point, (n,)."""
        if self.values.ndim == 2:
            return self.values[:, unit]
        own = np.zeros(n)
        own[unit] = self.values[unit]
        return own


def _at_once(plant: Plant, loops: Sequence[Controller]) -> _Moves:
    """Return how far each valve jumps at a unit step of a set point."""
    C = np.array([_jump(loop) for loop in loops])
    if plant.n > LARGEST_MATRIX or not any(_through(element) for element in plant.elements):
        return _Moves(C)
    M = np.eye(plant.n) + C[:, None] * feedthrough(plant, 0.0)
    return _Moves(C if is_singular(M) else np.asarray(np.linalg.solve(M, np.diag(C)), dtype=float))


def _at_rest(plant: Plant, loops: Sequence[Controller]) -> _Moves:
    """Return how far each valve has moved in the end; zeros where nothing is known of that."""
    unknown = _Moves(np.zeros(plant.n))
    if plant.n > LARGEST_MATRIX or any(loop.integral_time is None for loop in loops):
        return unknown
    G = plant.static_gain()
    if not np.isfinite(G).all() or is_singular(G):
        return unknown
    return _Moves(np.asarray(np.linalg.inv(G), dtype=float))


def _jump(loop: Controller) -> float:
    """Return c(inf), what a unit step of the error makes of the controller's output at once."""
    lead, lag = loop.derivative_time or 0.0, loop.lag_time
    if not lag:
        return loop.gain
    return loop.gain * lead / lag


def _through(element: TransferFunction) -> float:
    """Return what an element passes on at once."""
    return 0.0 if element.dead_time else element.feedthrough
