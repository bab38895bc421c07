"""What every public record and function does with what it is given: one rule for each kind.

A value is either understood or refused with an `InvalidInputError` that names it: an integer is
not cut out of 2.5, a number not read from a string, True is not 1. Ranges are the business of the
record, whose conditions must be false for NaN (``0 < x``, never ``not x <= 0``).
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet
from enum import Enum
from inspect import isabstract
from numbers import Real
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeVar, get_args

import numpy as np

from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "MAX_FREQUENCIES",
    "choice",
    "flag",
    "frequencies",
    "instance",
    "instances",
    "integer",
    "integers",
    "items",
    "read_only",
    "real",
    "real_array",
    "reals",
    "settle",
    "settle_reals",
    "square_matrix",
]

MAX_FREQUENCIES = 10_000  # that a caller may choose for the curves of an analysis

_Member = TypeVar("_Member", bound=Enum)
_Kind = TypeVar("_Kind")
_Scalar = TypeVar("_Scalar", bound=np.generic)


def choice(kind: type[_Member], value: object, field: str) -> _Member:
    """Return the member of an enumeration that `value` is, or is the value of.

    Parameters
    ----------
    kind : type of Enum
        The enumeration; of strings.
    value : object
        A member, or its value.
    field : str
        JSON pointer of `value`, for the error; the same in every function here.

    Raises
    ------
    InvalidInputError
        Neither; a member of another enumeration is refused also where the values agree.

    """
    if isinstance(value, kind):
        return value
    if isinstance(value, str) and not isinstance(value, Enum):
        for member in kind:
            if member.value == value:
                return member
    known = ", ".join(repr(member.value) for member in kind)
    message = f"must be one of {known}, not {_shown(value)}"
    raise InvalidInputError(message, field)


def flag(value: object, field: str) -> bool:
    """Return a truth value; nothing else counts as one, 'no' and 0 neither."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    message = f"must be True or False, not {_shown(value)}"
    raise InvalidInputError(message, field)


def integer(value: Any, field: str) -> int:  # noqa: ANN401 - whatever the caller gives
    """Return a count or an index: an integer of any kind but bool, never a float."""
    if not isinstance(value, bool | np.bool_ | np.timedelta64 | np.ndarray):
        try:
            return operator.index(value)
        except TypeError:
            pass
    message = f"must be an integer, not {_shown(value)}"
    raise InvalidInputError(message, field)


def integers(values: object, field: str) -> tuple[int, ...]:
    """Return a sequence of integers, each as `integer` takes it."""
    return tuple(
        integer(value, f"{field}/{index}") for index, value in enumerate(items(values, field))
    )


def real(value: object, field: str) -> float:
    """Return a real number as a float: no bool, no string, no complex one; NaN and inf pass."""
    if type(value) is float:
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0 and not np.ma.isMaskedArray(value):
        value = value[()]
    if isinstance(value, Real) and not isinstance(value, bool | np.timedelta64):
        try:
            return float(value)
        except OverflowError:
            message = "the number is too large"
            raise InvalidInputError(message, field) from None
    message = f"must be a real number, not {_shown(value)}"
    raise InvalidInputError(message, field)


def reals(values: object, field: str) -> tuple[float, ...]:
    """Return a sequence of real numbers, each as `real` takes it."""
    return tuple(
        real(value, f"{field}/{index}") for index, value in enumerate(items(values, field))
    )


def items(values: Any, field: str) -> tuple[Any, ...]:  # noqa: ANN401 - the same
    """Return the items of a sequence; a string, a mapping or a set is none: the order counts."""
    if isinstance(values, tuple):
        return values
    is_sequence = isinstance(values, Iterable) and not isinstance(
        values, str | bytes | bytearray | Mapping | AbstractSet
    )
    if isinstance(values, np.ndarray):
        is_sequence = values.ndim > 0 and not np.ma.is_masked(values)
    if not is_sequence:
        message = f"must be a sequence, not {_shown(values)}"
        raise InvalidInputError(message, field)
    return tuple(values)


def instance(value: object, kind: type[_Kind] | UnionType, field: str) -> None:
    """Refuse what is not of the type `kind`, which may be a union; none of them is None.

    In place of an abstract class the message names those of its kinds that stand beside it.
    """
    if not isinstance(value, kind):
        kinds = get_args(kind) if isinstance(kind, UnionType) else (kind,)
        if isinstance(kind, type) and isabstract(kind):
            kinds = tuple(k for k in kind.__subclasses__() if k.__module__ == kind.__module__)
        wanted = " or ".join("None" if each is type(None) else each.__name__ for each in kinds)
        message = f"must be a {wanted}, not {_shown(value)}"
        raise InvalidInputError(message, field)


def instances(values: object, kind: type[_Kind] | UnionType, field: str) -> tuple[_Kind, ...]:
    """Return a sequence of objects of the type `kind`, which may be a union."""
    found = items(values, field)
    for index, value in enumerate(found):
        instance(value, kind, f"{field}/{index}")
    return found


def real_array(values: object, field: str, *, ndim: int) -> NDArray[np.float64]:
    """Return a read-only copy as float64, whatever the kind of the real numbers.

    Parameters
    ----------
    values : array_like
        Real numbers, `ndim` axes; those of an array may be integers of any size.
    field : str
        JSON pointer of `values`.
    ndim : int
        Number of axes.

    Raises
    ------
    InvalidInputError
        Ragged or of another number of axes, masked entries, entries that are no real numbers.

    """
    if np.ma.is_masked(values):
        message = "must be an array without masked entries"
        raise InvalidInputError(message, field)
    try:
        found = np.asarray(values)
    except ValueError:
        message = "must be a rectangular array of real numbers"
        raise InvalidInputError(message, field) from None
    if found.dtype.kind not in "iuf":
        # An empty list, or numbers such as Fraction, of which numpy makes an array of objects.
        if found.dtype.kind != "O" or found.ndim != ndim:
            message = f"must be an array of real numbers, not {_shown(values)}"
            raise InvalidInputError(message, field)
        flat = [
            real(value, field + "".join(f"/{each}" for each in index))
            for index, value in np.ndenumerate(found)
        ]
        found = np.array(flat).reshape(found.shape)
    if found.ndim != ndim:
        message = f"must have {ndim} {'axis' if ndim == 1 else 'axes'}, not {found.ndim}"
        raise InvalidInputError(message, field)
    return read_only(np.array(found, dtype=np.float64))


def frequencies(
    omega: Any,  # noqa: ANN401 - the same
    field: str = "/omega",
    *,
    most: int | None = None,
) -> NDArray[np.float64]:
    """Return frequencies as everything here takes them: positive, finite, one axis.

    They stay in the caller's order, repeated ones included; so does what is computed of them.

    Parameters
    ----------
    omega : float or (k,) array_like
        Frequencies, rad per time unit; a single one is a list of one.
    field : str
        JSON pointer of `omega`.
    most : int or None
        Greatest permitted number of them, of which there must be one; None: any, none included.

    Returns
    -------
    (k,) ndarray
        A read-only copy.

    Raises
    ------
    InvalidInputError
        A number of them that is not permitted, one that is not finite and positive, more than one
        axis.

    """
    single = isinstance(omega, Real) or (isinstance(omega, np.ndarray) and not omega.ndim)
    given = [real(omega, field)] if single else omega
    found = real_array(given, field, ndim=1)
    if most is not None and not 1 <= found.size <= most:
        message = f"between 1 and {most} frequencies"
        raise InvalidInputError(message, field)
    fit = np.isfinite(found) & (found > 0)
    if not fit.all():
        message = "frequencies must be finite and positive"
        raise InvalidInputError(message, f"{field}/{int(np.argmin(fit))}")
    return found


def square_matrix(values: object, field: str = "") -> NDArray[np.float64]:
    """Return a square matrix of finite real numbers, (n, n), n > 0, as `real_array` takes it."""
    try:
        found = real_array(values, field, ndim=2)
    except InvalidInputError as error:
        message = f"a square matrix is needed: {error.message}"
        raise InvalidInputError(message, error.field) from None
    if found.shape[0] != found.shape[1] or not found.size:
        shape = " x ".join(map(str, found.shape))
        message = f"a square matrix is needed, this one is {shape}"
        raise InvalidInputError(message, field)
    if not np.isfinite(found).all():
        message = "the matrix holds numbers that are not finite"
        raise InvalidInputError(message, field)
    return found


def read_only(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Return the array after it has been closed for writing: records are frozen through."""
    array.setflags(write=False)
    return array


def settle(record: object, **values: object) -> None:
    """Put checked values into a frozen record, from its ``__post_init__`` only."""
    for name, value in values.items():
        object.__setattr__(record, name, value)


def settle_reals(record: object, *names: str, optional: tuple[str, ...] = ()) -> None:
    """Take fields of a frozen record as `real` takes them; those in `optional` may be None."""
    for name in (*names, *optional):
        value = getattr(record, name)
        if value is not None or name in names:
            settle(record, **{name: real(value, f"/{name}")})


def _shown(value: object) -> str:
    """Return a value as errors show it: strings and numbers, anything else by its type."""
    if value is None:
        return "None"
    if isinstance(value, Enum):
        return str(f"{type(value).__name__}.{value.name}")
    if isinstance(value, str | bytes | bool | int | float | complex):
        text = repr(value)
        return text if len(text) <= 40 else f"{text[:36]} ..."
    name = type(value).__name__
    return f"{'an' if name[:1] in 'AEIOUaeiou' else 'a'} {name}"
