"""What the results of a batch can be written as."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["Rows", "SettingsForm", "TableFormat"]


class TableFormat(StrEnum):
    """How results are written."""

    NDJSON = "ndjson"
    CSV = "csv"
    PARQUET = "parquet"


class Rows(StrEnum):
    """What a row stands for."""

    REQUEST = "request"
    LOOP = "loop"


class SettingsForm(StrEnum):
    """Form of the controllers' settings."""

    CASCADE = "cascade"
    IDEAL = "ideal"
    PARALLEL = "parallel"
