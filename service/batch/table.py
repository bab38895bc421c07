"""Results of a batch as a table: a row a request or a row a loop, for spreadsheets and data frames.

The columns are the fields of the requests that differ from line to line, what was found, and what
went wrong. Times are in the unit of the requests, indices count from 1 as the lines of a file do.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import IO, Any

from service.batch.formats import Rows, SettingsForm, TableFormat
from service.batch.request_lines import Item
from service.schemas import Fault, RequestError
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError

__all__ = ["Table", "write_csv", "writer"]

_KEYS = ("digest", "job")  # what else tells an entry from others
# A faulty request may hold half of a surrogate pair, which no encoding has: its number is written.
_HALVES = "backslashreplace"
_DEEPEST = 16  # levels of a request that are told apart; the deepest that there can be has ten
_GENERAL = ("title", "id", "labels")  # said of a request whether or not they differ

_CONVERSIONS: dict[SettingsForm, Callable[[Controller], object]] = {
    SettingsForm.CASCADE: lambda controller: controller,
    SettingsForm.IDEAL: Controller.to_ideal,
    SettingsForm.PARALLEL: Controller.to_parallel,
}
_SETTINGS = {
    SettingsForm.CASCADE: ("gain", "integral_time", "derivative_time", "filter_time"),
    SettingsForm.IDEAL: ("gain", "integral_time", "derivative_time", "filter_time"),
    SettingsForm.PARALLEL: ("proportional_gain", "integral_gain", "derivative_gain", "filter_time"),
}


class Table:
    """The table of a batch.

    Parameters
    ----------
    items : sequence of Item
        The requests.
    each : Rows
        What a row stands for.
    form : SettingsForm
        Form of the settings.

    """

    def __init__(self, items: Sequence[Item], *, each: Rows, form: SettingsForm) -> None:
        self._items = items
        self._each = each
        self._form = form
        self._varied = _varied(items)

    def rows(self, entries: Iterable[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
        """Yield rows.

        Parameters
        ----------
        entries : iterable of mapping
            Results with their place (``index``) in the batch, as the lines of a file of results.

        """
        for entry in entries:
            item = self._items[entry["index"]]
            start: dict[str, Any] = {"line": item.line}
            start |= {name: entry[name] for name in _KEYS if name in entry}
            fields = _flat(item.fields)
            start |= {name: fields.get(name) for name in self._varied}
            result = entry.get("result") or {}
            start |= _found(result, entry.get("error"))
            loops = result.get("loops") or []
            if self._each is Rows.LOOP:
                for number, loop in enumerate(loops, 1):
                    yield start | {"loop": number} | _settings(loop, self._form)
                if not loops:
                    yield start | {"loop": None} | dict.fromkeys(_SETTINGS[self._form])
                continue
            for number, group in enumerate(result.get("groups") or [], 1):
                settings = _settings(loops[group[0]], self._form)
                units = {f"setting_{number}.units": " ".join(str(unit + 1) for unit in group)}
                start |= units | {f"setting_{number}.{name}": v for name, v in settings.items()}
            yield start


def writer(
    format_: TableFormat, items: Sequence[Item], *, each: Rows, form: SettingsForm
) -> Callable[[IO[bytes], Iterator[dict[str, Any]]], None]:
    """Return what writes results as a table to a file.

    Raises
    ------
    RequestError
        What it needs is not installed.

    """
    if format_ is TableFormat.PARQUET:
        _require_pyarrow()

    def write(file: IO[bytes], entries: Iterator[dict[str, Any]]) -> None:
        rows = list(Table(items, each=each, form=form).rows(entries))
        if format_ is TableFormat.PARQUET:
            _write_parquet(file, rows)
        else:
            write_csv(file, rows)

    return write


def write_csv(file: IO[bytes], rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows as comma-separated values in UTF-8 under a line of column names."""
    text = io.TextIOWrapper(file, "utf-8", errors=_HALVES, newline="", write_through=True)
    names = _columns(rows)
    sheet = csv.writer(text)
    sheet.writerow([_cell(name) for name in names])
    sheet.writerows([_cell(row.get(name)) for name in names] for row in rows)
    text.detach()


def _write_parquet(file: IO[bytes], rows: Sequence[Mapping[str, Any]]) -> None:
    import pyarrow as pa  # noqa: PLC0415 - an extra
    import pyarrow.parquet as pq  # noqa: PLC0415

    arrays = {_whole(name): _column([row.get(name) for row in rows]) for name in _columns(rows)}
    pq.write_table(pa.table(arrays), file)


def _columns(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the names of all columns in the order of their first appearance."""
    return list(dict.fromkeys(name for row in rows for name in row))


def _found(result: Mapping[str, Any], error: Mapping[str, Any] | None) -> dict[str, Any]:
    peaks = result.get("peaks") or {}
    guarantee = result.get("guarantee") or {}
    search = result.get("search") or {}
    found: dict[str, Any] = {
        "status": result.get("status") or "error",
        "tau_p": result.get("tau_p"),
        "demand_met": result.get("demand_met"),
    }
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        found[f"mu.{name}"] = (peaks.get(name) or {}).get("value")
    for demand in result.get("demands") or ():
        for name in ("limit", "value", "met", "active"):
            found[f"demand.{demand['name']}.{name}"] = demand[name]
    found |= {
        "guarantee": guarantee.get("status"),
        "guarantee_level": guarantee.get("level"),
        "seconds": search.get("elapsed_seconds"),
        "reason": result.get("reason"),
        "warnings": "; ".join(result.get("warnings") or []) or None,
        "error": None if error is None else _fault(error),
    }
    return found


def _fault(error: Mapping[str, Any]) -> str:
    faults = [f"{each['pointer']}: {each['detail']}" for each in error.get("errors") or ()]
    return "; ".join(faults) or str(error.get("detail") or error.get("title"))


def _settings(loop: Mapping[str, float | None], form: SettingsForm) -> dict[str, float | None]:
    """Return the settings of a loop in a form; empty where it has no such form."""
    controller = Controller(
        float(loop["gain"] or 0.0),
        loop["integral_time"],
        loop.get("derivative_time"),
        loop.get("filter_time"),
    )
    try:
        converted: object = _CONVERSIONS[form](controller)
    except InvalidInputError:
        converted = None
    return {name: getattr(converted, name, None) for name in _SETTINGS[form]}


def _flat(value: object, name: str = "", depth: int = 0) -> dict[str, Any]:
    """Return the leaves of a JSON value by their dotted names."""
    if depth > _DEEPEST:
        return {name: "(nested deeper)"}
    if isinstance(value, dict):
        parts = ((f"{name}.{key}" if name else key, each) for key, each in value.items())
    elif isinstance(value, list):
        parts = ((f"{name}.{index + 1}", each) for index, each in enumerate(value))
    else:
        return {name: value}
    return {key: leaf for part, each in parts for key, leaf in _flat(each, part, depth + 1).items()}


def _varied(items: Iterable[Item]) -> list[str]:
    """Return the names of the fields that differ, in the order of their first appearance."""
    values: dict[str, set[str]] = {}
    counts: Counter[str] = Counter()
    requests = 0
    for item in items:
        fields = _flat(item.fields)
        requests += bool(fields)
        for name, value in fields.items():
            if value is not None:
                counts[name] += 1
                found = values.setdefault(name, set())
                if len(found) < 2:
                    found.add(str(value))
    return [
        name
        for name, found in values.items()
        if name.split(".")[0] in _GENERAL or len(found) > 1 or counts[name] < requests
    ]


def _cell(value: object) -> object:
    """Return a value as a spreadsheet takes it: text that begins like a formula stays text."""
    if isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t")):
        return f"'{value}"
    return value


def _column(values: list[Any]) -> list[Any]:
    """Return the values of a column as one type: numbers where all are, else text."""
    values = [_whole(value) if isinstance(value, str) else value for value in values]
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) > 1:
        if kinds <= {int, float}:
            return [None if value is None else float(value) for value in values]
        return [None if value is None else str(value) for value in values]
    return values


def _whole(text: str) -> str:
    """Return a text without halves of characters."""
    return text.encode(errors=_HALVES).decode()


def _require_pyarrow() -> None:
    try:
        import pyarrow as pa  # noqa: F401, PLC0415
    except ImportError:
        message = 'Parquet needs pyarrow: pip install "mutune[parquet]"'
        raise RequestError((Fault("", message),)) from None
