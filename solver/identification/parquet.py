"""Records from Parquet files, by pyarrow where it is installed."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.identification.columns import clock_of, place_of
from solver.identification.record import MAX_SAMPLES
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["heads_of", "read_columns", "stamped"]


def heads_of(raw: bytes, name: str) -> list[str]:
    """Return the names of the columns.

    Parameters
    ----------
    raw : bytes
        What the file holds.
    name : str
        Of the file, for messages.

    Raises
    ------
    InvalidInputError
        pyarrow is missing, the file is no Parquet, or holds more samples than a record may.

    """
    try:
        import pyarrow as pa  # noqa: PLC0415 - an extra
        import pyarrow.parquet as pq  # noqa: PLC0415
    except ImportError:
        message = 'Parquet needs pyarrow: pip install "mutune[parquet]"'
        raise InvalidInputError(message) from None
    try:
        # A small file may hold any number of samples.
        told = pq.read_metadata(BytesIO(raw))
        heads = list(pq.read_schema(BytesIO(raw)).names)
    except pa.ArrowException as error:
        message = f"{name}: {error}"
        raise InvalidInputError(message) from None
    if told.num_rows > MAX_SAMPLES:
        message = f"{name} has {told.num_rows} samples; a record has up to {MAX_SAMPLES}"
        raise InvalidInputError(message)
    return heads


def read_columns(
    raw: bytes, file: str, time: str | None, signals: Sequence[str]
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Return times and the named signals; nulls are NaN, time stamps seconds from the first.

    Raises
    ------
    InvalidInputError
        pyarrow is missing, the file is no Parquet, a column is not there, twice, or no numbers.

    """
    heads = heads_of(raw, file)
    import pyarrow as pa  # noqa: PLC0415 - an extra, and it is there
    import pyarrow.parquet as pq  # noqa: PLC0415

    places = {name: place_of(heads, name, file) for name in signals}
    clock = clock_of(heads, time, list(places.values()), file)
    # By place: two columns of one name are one to pyarrow.
    wanted = [heads[place] for place in (clock, *places.values())]
    try:
        table = pq.ParquetFile(BytesIO(raw)).read(columns=wanted)
    except pa.ArrowException as error:
        message = f"{file}: {error}"
        raise InvalidInputError(message) from None
    times = _numbers(table.column(heads[clock]), file, heads[clock], stamps=True)
    return times, {
        name: _numbers(table.column(heads[place]), file, name, stamps=False)
        for name, place in places.items()
    }


def stamped(raw: bytes, head: str) -> bool:
    """Whether a column of a file that has been read has time stamps."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    return bool(pa.types.is_timestamp(pq.read_schema(BytesIO(raw)).field(head).type))


def _numbers(column: Any, file: str, name: str, *, stamps: bool) -> NDArray[np.float64]:  # noqa: ANN401 - pyarrow has no types
    import pyarrow as pa  # noqa: PLC0415

    kind = column.type
    if stamps and pa.types.is_timestamp(kind):
        whole = column.cast(pa.timestamp("ns")).cast(pa.int64()).to_numpy()
        if column.null_count:
            message = f"{file}, column {name!r}: a time is missing"
            raise InvalidInputError(message)
        return np.asarray((whole - whole[0]) / 1e9)
    if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
        message = f"{file}, column {name!r}: {kind} is no number" + (
            " nor time stamp" if stamps else ""
        )
        raise InvalidInputError(message)
    return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=float)
