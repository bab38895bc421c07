"""Loops are called by their tags in every text, table and figure."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from archived import published

from service.figures.tuning import tuning_figures
from service.loop_tags import cell_tagged, tagged, tags_of
from service.printing import Grid, Line, named_loops
from service.report.document import report_html
from service.schemas.tunings import TuningRequest
from service.tuned import RequestedTuning

TAGS = ("TIC-1", "TIC-2", "PIC-3", "FIC-4")


def named(record: RequestedTuning) -> RequestedTuning:
    """Return the record with a tag for each loop."""
    signals = [{"tag": tag} for tag in TAGS[: record.plant.n]]
    asked = record.request.model_dump(mode="json", exclude_unset=True) | {"instruments": signals}
    return replace(record, request=TuningRequest.model_validate_json(json.dumps(asked)))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("With loop 2 in manual put loop 1 in manual too.",
         "With TIC-2 in manual put TIC-1 in manual too."),
        ("Loops 1-4 alone; loops 1, 3: none", "TIC-1 to FIC-4 alone; TIC-1, PIC-3: none"),
        ("loops 1-2 and 4 drift, 3 % each", "TIC-1, TIC-2, FIC-4 drift, 3 % each"),
        ("loop 3 overshoots", "PIC-3 overshoots"),
        # What is no count of loops, not all of it, or a name of the caller's stays as it is.
        ("loop 5, loops 4-5, loops 1, 2, ...", "loop 5, loops 4-5, loops 1, 2, ..."),
        ("scenario 'loop 1 out', 2 loops 3 times", "scenario 'loop 1 out', 2 loops 3 times"),
        ("loop 1.5 and loop 10", "loop 1.5 and loop 10"),
    ],
)  # fmt: skip
def test_texts_that_count_loops_name_them(text: str, told: str) -> None:
    """Numbers of loops become tags; every other number stays."""
    assert tagged(text, TAGS) == told
    assert tagged(text, ()) == text
    assert tagged(text, (None,) * 4) == text


def test_cells_of_the_column_of_loops_are_named() -> None:
    """A number alone is a loop in the column of loops, and in no other."""
    line, grid = named_loops(
        [Line("loop 1"), Grid(("loop", "sets"), [("1-2", "1"), ("all", "4")])], TAGS
    )
    assert line == Line("TIC-1")
    assert isinstance(grid, Grid)
    assert [tuple(row) for row in grid.rows] == [("TIC-1, TIC-2", "1"), ("all", "4")]
    assert cell_tagged("3.5", TAGS) == "3.5"


def test_one_entry_for_several_loops_names_none() -> None:
    """The spans of all are said by one entry: its tag belongs to no loop in particular."""
    request = named(published()).request
    assert list(tags_of(request, 2)) == ["TIC-1", "TIC-2"]
    assert request.instruments is not None
    shared = request.model_copy(update={"instruments": request.instruments[:1]})
    assert not tags_of(shared, 2)


def test_figures_and_report_of_a_tuning_count_no_loops() -> None:
    """Where every loop has a tag no legend, heading or sentence says ``loop 1``."""
    record = named(published())
    for figure in tuning_figures(record).figures.values():
        shown = [trace.name or "" for trace in figure.data] + list(figure.layout.meta.values())
        assert not [text for text in shown if "loop 1" in text or "loops 1" in text]
    report = report_html(record, datetime(2026, 1, 1, tzinfo=UTC))
    text = re.sub(r"<script.*?</script>|<pre.*?</pre>|<[^>]*>", " ", report, flags=re.DOTALL)
    assert not re.findall(r".{30}\bloops? \d.{20}", text, re.IGNORECASE)
