"""Every statement of the sources: the numbers of the table are those computed today."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
STATES = {"works", "partly", "not there", "differs", "wrong in the source", "drawing or reference"}


def _script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("rows", ROOT / "scripts" / "rows.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


SCRIPT = _script()
CONTENT: dict[str, Any] = SCRIPT.read()
CHECKED = [(index, row) for index, row in enumerate(CONTENT["rows"], start=1) if row["checks"]]


@pytest.mark.parametrize(("number", "row"), CHECKED, ids=[f"row-{number}" for number, _ in CHECKED])
def test_a_row_has_the_numbers_of_today(number: int, row: dict[str, Any]) -> None:
    """What the product answers now is what the row says, to the digits printed."""
    del number  # it names the test
    for check in row["checks"]:
        found = SCRIPT.value(check)
        if isinstance(found, float) and not isinstance(found, bool):
            assert found == pytest.approx(float(check["value"]), rel=2e-3, abs=1e-9)
        else:
            assert SCRIPT.written(found) == check["value"]


def test_the_page_is_written_from_the_rows() -> None:
    """docs/sources/rows.md is what the script writes, 301 rows, each number in its place."""
    page = (ROOT / "docs" / "sources" / "rows.md").read_text(encoding="utf-8")
    assert page == SCRIPT.page(CONTENT)
    assert len(CONTENT["rows"]) == 301
    for row in CONTENT["rows"]:
        assert row["state"] in STATES
        assert row["ours"].count("{") == len(row["checks"])


def test_a_wrong_number_is_seen() -> None:
    """A row whose number is off in its third digit fails."""
    _, row = next(each for each in CHECKED if each[1]["stated"] == "a = -0.986")
    wrong = {**row, "checks": [{**row["checks"][0], "value": "-0.98"}]}
    with pytest.raises(AssertionError):
        test_a_row_has_the_numbers_of_today(0, wrong)


def test_rows_that_are_partly_there_say_what_is_missing() -> None:
    """None is empty."""
    for row in CONTENT["rows"]:
        if row["state"] in {"partly", "not there", "differs", "wrong in the source"}:
            assert len(row["ours"]) > 10
