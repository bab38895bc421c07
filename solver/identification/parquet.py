"""Records from Parquet files, by pyarrow where it is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from solver.identification.columns import place_of
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["read_columns"]


def read_columns(
    path: Path, time: str, signals: Sequence[str]
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Return times and the named signals; nulls are NaN, time stamps seconds from the first.

    Raises
    ------
    InvalidInputError
        pyarrow is missing, the file is no Parquet, a column is not there, twice, or no numbers.

    """
    try:
        import pyarrow as pa  # noqa: PLC0415 - an extra
        import pyarrow.parquet as pq  # noqa: PLC0415
    except ImportError:
        message = 'Parquet needs pyarrow: pip install "mutune[parquet]"'
        raise InvalidInputError(message) from None
    try:
        heads = pq.read_schema(path).names
        places = {name: place_of(heads, name, path.name) for name in (time, *signals)}
        # By place: two columns of one name are one to pyarrow.
        table = pq.ParquetFile(path).read(columns=[heads[p] for p in places.values()])
    except pa.ArrowException as error:
        message = f"{path.name}: {error}"
        raise InvalidInputError(message) from None
    values = {
        name: _numbers(table.column(heads[place]), path.name, name, stamps=name == time)
        for name, place in places.items()
    }
    return values[time], {name: values[name] for name in signals}


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
