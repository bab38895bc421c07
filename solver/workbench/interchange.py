"""Plants from other libraries' objects and nested lists, and back to python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.from_state_space import from_state_space
from solver.model.measured import MeasuredPlant
from solver.model.plants import MatrixPlant, ParallelPlant, Plant
from solver.model.transfer_function import TransferFunction
from solver.model.validation import instances, integer, items, real, real_array

if TYPE_CHECKING:
    from collections.abc import Sequence

    import control

__all__ = ["from_control", "plant", "to_control"]


def plant(G: Any, *, dead_time: Any = 0.0) -> Plant:  # noqa: ANN401 - objects of other libraries
    """Return the plant that another library's object, or a nested list, describes.

    Parameters
    ----------
    G : object
        A square continuous-time model: of python-control (``control.tf``, ``control.ss``), or of
        scipy.signal (``scipy.signal.lti`` in any form; see `from_state_space`). Or a square nested
        list whose entries are such objects, `TransferFunction`, pairs ``(num, den)`` of
        coefficients in descending powers of s, or numbers. Or frequency-response data of
        python-control (``control.frd``), whose `unstable_poles` are to be stated before it is
        tuned: ``dataclasses.replace(plant(G), unstable_poles=0)``.
    dead_time : float or (n, n) array_like
        Dead time of every element, in the time unit of G, >= 0; added to that of the entries.

    Returns
    -------
    Plant
        A `ParallelPlant` where all units are alike, else a `MatrixPlant`; of data a
        `MeasuredPlant`. Row r, column c is from input c to output r; loop i connects output i to
        input i.

    Raises
    ------
    InvalidInputError
        Not square, improper, of discrete time, or nothing of the above.
    UnsupportedPlantError
        In state space with a mode in the right half plane.

    Examples
    --------
    >>> lag = ([1], [10, 1])
    >>> plant([[lag, 0], [0, lag]], dead_time=2).process.dead_time
    2.0

    """
    if isinstance(G, MeasuredPlant) or hasattr(G, "frdata"):
        return _measured(G, dead_time)
    rows = G.rows if isinstance(G, Plant) else _rows(G)
    n = len(rows)
    delays = (
        np.full((n, n), real(dead_time, "/dead_time"))
        if np.ndim(dead_time) == 0
        else (real_array(dead_time, "/dead_time", ndim=2))
    )
    if delays.shape != (n, n):
        message = f"give one dead time, or {n} x {n} of them"
        raise InvalidInputError(message, "/dead_time")
    elements = [
        [
            element
            if element.is_zero
            else TransferFunction(element.num, element.den, element.dead_time + float(delays[r, c]))
            for c, element in enumerate(row)
        ]
        for r, row in enumerate(rows)
    ]
    own = {row[r] for r, row in enumerate(elements)}
    other = {each for r, row in enumerate(elements) for c, each in enumerate(row) if r != c}
    if n > 1 and len(own) == len(other) == 1:
        return ParallelPlant(n, own.pop(), other.pop())
    return MatrixPlant(elements)


def from_control(sys: Any, *, dead_time: Any = 0.0) -> Plant:  # noqa: ANN401 - no types there
    """Return the plant that an object of python-control describes.

    Parameters
    ----------
    sys : control.TransferFunction, control.StateSpace or control.FrequencyResponseData
        Square, of continuous time; see `plant`, which takes more besides.
    dead_time : float or (n, n) array_like
        As for `plant`.

    Raises
    ------
    InvalidInputError
        Another object, or as `plant`.
    UnsupportedPlantError
        As `plant`.

    """
    if not type(sys).__module__.startswith("control."):
        message = f"an object of python-control is needed, not {type(sys).__name__}"
        raise InvalidInputError(message, "")
    if not (hasattr(sys, "num") or hasattr(sys, "frdata") or _is_state_space(sys)):
        message = f"a {type(sys).__name__} is no linear model: linearise it first"
        raise InvalidInputError(message, "")
    return plant(sys, dead_time=dead_time)


def _measured(G: Any, dead_time: Any) -> MeasuredPlant:  # noqa: ANN401 - see `plant`
    delay = real(dead_time, "/dead_time")
    if delay < 0:
        message = "a dead time is not negative"
        raise InvalidInputError(message, "/dead_time")
    if not isinstance(G, MeasuredPlant):
        _require_continuous(G, "")
        return MeasuredPlant(G.omega, np.moveaxis(G.frdata, -1, 0)).delayed(delay)
    return G.delayed(delay)


def to_control(
    thing: TransferFunction | Controller | Plant | Sequence[Controller], *, pade: int | None = None
) -> control.TransferFunction:
    """Return a python-control transfer function.

    Parameters
    ----------
    thing : TransferFunction, Controller, Plant or sequence of Controller
        A plant becomes its (n, n) matrix, controllers become their diagonal one.
    pade : int or None
        Order of the Padé approximation of dead times, > 0: python-control has none. None:
        refuse dead time, so that nothing is approximated unasked.

    Raises
    ------
    InvalidInputError
        Dead time without `pade`, or a thing that is none of the above.

    """
    import control  # noqa: PLC0415 - only who asks for it needs it

    if pade is not None and integer(pade, "/pade") < 1:
        message = "the order must be at least 1"
        raise InvalidInputError(message, "/pade")
    if isinstance(thing, Controller):
        return control.tf(*thing.polynomials)
    if isinstance(thing, TransferFunction):
        return control.tf(*_polynomials(thing, pade))
    if isinstance(thing, Plant):
        parts = [[_polynomials(element, pade) for element in row] for row in thing.rows]
    else:
        loops = instances(thing, Controller, "")
        none = [0.0], [1.0]
        parts = [
            [loop.polynomials if r == c else none for c in range(len(loops))]
            for r, loop in enumerate(loops)
        ]
    return control.tf(
        [[p[0] for p in row] for row in parts], [[p[1] for p in row] for row in parts]
    )


def _rows(G: Any) -> list[list[TransferFunction]]:  # noqa: ANN401 - see `plant`
    if _is_state_space(G):
        _require_continuous(G, "")
        found = from_state_space(G.A, G.B, G.C, G.D)
        return [list(row) for row in found.rows]
    if hasattr(G, "ninputs") and hasattr(G, "noutputs") and hasattr(G, "num"):
        _require_continuous(G, "")
        size = G.noutputs, G.ninputs
        if size[0] != size[1]:
            message = f"a plant is square; this one has {size[0]} outputs and {size[1]} inputs"
            raise InvalidInputError(message, "")
        return [
            [_of(G.num[r][c], G.den[r][c], f"/{r}/{c}") for c in range(size[1])]
            for r in range(size[0])
        ]
    if hasattr(G, "num") or hasattr(G, "zeros"):
        return [[_entry(G, "")]]
    given = [items(row, f"/{r}") for r, row in enumerate(items(G, ""))]
    for r, row in enumerate(given):
        if len(row) != len(given):
            message = f"a plant is square; row {r + 1} has {len(row)} of {len(given)} entries"
            raise InvalidInputError(message, f"/{r}")
    if not given:
        message = "a plant has at least one element"
        raise InvalidInputError(message, "")
    return [[_entry(each, f"/{r}/{c}") for c, each in enumerate(row)]
            for r, row in enumerate(given)]  # fmt: skip


def _entry(entry: Any, field: str) -> TransferFunction:  # noqa: ANN401 - see `plant`
    if isinstance(entry, TransferFunction):
        return entry
    if _is_state_space(entry):
        _require_continuous(entry, field)
        found = from_state_space(entry.A, entry.B, entry.C, entry.D)
        if found.n != 1:
            message = "an entry has one input and one output"
            raise InvalidInputError(message, field)
        return found.element(0, 0)
    if hasattr(entry, "ninputs") and hasattr(entry, "num"):
        _require_continuous(entry, field)
        if (entry.noutputs, entry.ninputs) != (1, 1):
            message = "an entry has one input and one output"
            raise InvalidInputError(message, field)
        return _of(entry.num[0][0], entry.den[0][0], field)
    if hasattr(entry, "to_tf"):  # scipy.signal
        _require_continuous(entry, field)
        polynomials = entry.to_tf()
        if np.ndim(polynomials.num) != 1:
            message = "an entry has one input and one output"
            raise InvalidInputError(message, field)
        return _of(polynomials.num, polynomials.den, field)
    if isinstance(entry, tuple | list):
        if len(entry) != 2:
            message = "an entry is a pair of numerator and denominator"
            raise InvalidInputError(message, field)
        num, den = ([part] if np.ndim(part) == 0 else part for part in entry)
        return _of(num, den, field)
    return _of([real(entry, field)], [1.0], field)


def _of(num: Any, den: Any, field: str) -> TransferFunction:  # noqa: ANN401 - see `plant`
    """Return a transfer function without the leading zeros that other libraries keep."""
    parts = []
    for name, part in (("num", num), ("den", den)):
        values = [real(value, f"{field}/{name}/{k}") for k, value in enumerate(items(part, field))]
        while len(values) > 1 and values[0] == 0:
            del values[0]
        parts.append(values)
    try:
        return TransferFunction(parts[0], parts[1])
    except InvalidInputError as error:
        raise error.within(field) from None


def _is_state_space(thing: object) -> bool:
    return all(hasattr(thing, name) for name in "ABCD")


def _require_continuous(thing: Any, field: str) -> None:  # noqa: ANN401 - see `plant`
    # python-control: 0 is continuous, None unspecified; scipy.signal: None is continuous.
    if getattr(thing, "dt", None) not in {None, 0}:
        message = "a discrete-time model; a plant is of continuous time"
        raise InvalidInputError(message, field)


def _polynomials(function: TransferFunction, pade: int | None) -> tuple[Any, Any]:
    if not function.dead_time or function.is_zero:
        return list(function.num), list(function.den)
    if pade is None:
        message = "python-control has no dead time: give the order of its approximation, pade="
        raise InvalidInputError(message, "/dead_time")
    import control  # noqa: PLC0415 - as above

    num, den = control.pade(function.dead_time, pade)
    return np.polymul(function.num, num), np.polymul(function.den, den)
