"""One rule for each kind of value that a user gives."""

from __future__ import annotations

from decimal import Decimal
from enum import StrEnum
from fractions import Fraction

import numpy as np
import pytest

from solver.model.errors import InvalidInputError
from solver.model.plants import ParallelPlant, Plant
from solver.model.validation import (
    choice,
    flag,
    frequencies,
    instance,
    instances,
    integer,
    integers,
    items,
    real,
    real_array,
    reals,
)
from solver.model.weights import Structure


class Other(StrEnum):
    """An enumeration that shares a value with `Structure`."""

    FULL = "full"


@pytest.mark.parametrize("value", ["full", Structure.FULL, np.str_("full")])
def test_a_choice_is_a_member_or_its_value(value):
    """What compares by identity afterwards is the member itself."""
    assert choice(Structure, value, "/structure") is Structure.FULL


@pytest.mark.parametrize("value", ["Full", "FULL", Other.FULL, None, 1, True, ["full"], b"full"])
def test_any_other_choice_is_refused_with_the_known_ones(value):
    """The message lists what would be accepted."""
    with pytest.raises(InvalidInputError, match="one of 'diagonal', 'full'") as error:
        choice(Structure, value, "/structure")
    assert error.value.field == "/structure"


@pytest.mark.parametrize("value", [3, np.int8(3), np.uint8(3), np.int64(3)])
def test_integers_of_any_size_become_int(value):
    """A small integer type cannot overflow later."""
    assert type(integer(value, "/n")) is int
    assert integer(value, "/n") == 3


@pytest.mark.parametrize("value", [3.0, 2.5, True, np.True_, "3", None, np.array(3), 3j, [3]])
def test_what_is_no_integer_is_refused(value):
    """A float is no count, however round; True is not 1."""
    with pytest.raises(InvalidInputError, match="must be an integer") as error:
        integer(value, "/n")
    assert error.value.field == "/n"


@pytest.mark.parametrize(
    "value",
    [2, 2.0, np.float32(2), np.uint8(2), np.float16(2), Fraction(2), np.array(2), np.longdouble(2)],
)
def test_real_numbers_of_any_kind_become_float(value):
    """Records hold floats only."""
    assert type(real(value, "/gain")) is float
    assert real(value, "/gain") == 2


@pytest.mark.parametrize(
    "value",
    [True, np.True_, "2", b"2", 2 + 0j, np.complex128(2), None, [2.0], np.array([2.0]),
     Decimal(2), 10**400, np.ma.masked, np.datetime64("2020-01-01"), np.timedelta64(2, "s")],
)  # fmt: skip
def test_what_is_no_real_number_is_refused(value):
    """Not even a complex number without imaginary part, or a time that carries its own unit."""
    with pytest.raises(InvalidInputError) as error:
        real(value, "/gain")
    assert error.value.field == "/gain"


@pytest.mark.parametrize("value", [True, False, np.True_])
def test_truth_values(value):
    """Those of numpy included."""
    assert flag(value, "/certificate") is bool(value)


@pytest.mark.parametrize("value", ["no", 0, 1, None, [], np.array(True)])
def test_nothing_else_is_true_or_false(value):
    """The string 'no' would count as true."""
    with pytest.raises(InvalidInputError, match="True or False"):
        flag(value, "/certificate")


@pytest.mark.parametrize("value", ["12", b"12", {1: 2}, {1, 2}, 12, None, np.array(12)])
def test_only_a_sequence_has_items(value):
    """A set has no order; a string would be taken apart."""
    with pytest.raises(InvalidInputError, match="must be a sequence"):
        items(value, "/loops")


def test_items_are_named_in_the_error():
    """The pointer ends at the faulty one."""
    for read, values in ((reals, [1, "2"]), (integers, [1, 2.0])):
        with pytest.raises(InvalidInputError) as error:
            read(values, "/num")
        assert error.value.field == "/num/1"
    with pytest.raises(InvalidInputError, match="must be a Structure, not 1") as error:
        instances([Structure.FULL, 1], Structure, "/all")
    assert error.value.field == "/all/1"
    assert reals(np.array([1, 2], dtype=np.uint8), "/num") == (1.0, 2.0)


def test_types_of_a_union_are_named():
    """The user reads which classes would do."""
    with pytest.raises(InvalidInputError, match="a ParallelPlant or MatrixPlant, not a list"):
        instance([], Plant, "/plant")
    with pytest.raises(InvalidInputError, match="must be a ParallelPlant, not None"):
        instance(None, ParallelPlant, "/plant")


@pytest.mark.parametrize("kind", [np.int8, np.uint8, np.int16, np.float16, np.float32, object])
def test_arrays_become_double_precision(kind):
    """Products of small integers do not overflow."""
    found = real_array(np.array([[100, 2], [3, 4]], dtype=kind), "/gain", ndim=2)
    assert found.dtype == np.float64
    assert found[0, 0] ** 2 == 1e4
    with pytest.raises(ValueError, match="read-only"):
        found[0, 0] = 1


@pytest.mark.parametrize(
    "value",
    [[[1, 2], [3]], [[1, "2"]], [[1j]], [[True, False]], "12", None, 3, [1, 2], [[[1]]],
     np.ma.masked_array([[1, 2]], mask=[[0, 1]]), [[None]]],
)  # fmt: skip
def test_other_arrays_are_refused(value):
    """Ragged, masked, complex, of strings or truth values, or of another number of axes."""
    with pytest.raises(InvalidInputError) as error:
        real_array(value, "/gain", ndim=2)
    assert error.value.field.startswith("/gain")


def test_frequencies_keep_their_order():
    """So what is computed of them can be laid beside them."""
    assert frequencies([1, 0.1, 1]).tolist() == [1.0, 0.1, 1.0]
    assert frequencies(2).tolist() == [2.0]
    assert frequencies(range(1, 3)).tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    "omega",
    [0, -1, [1, 0], [1, -1], [1, np.nan], [1, np.inf], [[1, 2]], "1", ["1"], [1j], None,
     [True], {1}, [None]],
)  # fmt: skip
def test_faulty_frequencies_are_refused(omega):
    """Positive, finite, one axis."""
    with pytest.raises(InvalidInputError) as error:
        frequencies(omega)
    assert error.value.field.startswith("/omega")


def test_too_many_frequencies_are_refused_and_none_at_all():
    """The number is in the message."""
    for omega in ([1, 2, 3], []):
        with pytest.raises(InvalidInputError, match="between 1 and 2 frequencies"):
            frequencies(omega, most=2)
