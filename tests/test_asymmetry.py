"""docs/asymmetry.md: its table is that of bench/asymmetry.csv."""

from __future__ import annotations

import csv
import re

import pytest
from touring import ROOT

DOCUMENT = (ROOT / "docs" / "asymmetry.md").read_text()
with (ROOT / "bench" / "asymmetry.csv").open() as file:
    LINES = list(csv.DictReader(file))


def gains(n: int, share: str, ratio: str) -> dict[str, float]:
    """Return the gain in per cent of every split of `n` units in two groups, PI."""
    return {
        line["groups"]: float(line["gain_percent"])
        for line in LINES
        if (line["kind"], line["n"], line["share"], line["ratio"]) == ("PI", str(n), share, ratio)
        and line["groups"].count("+") == 1
    }


@pytest.mark.parametrize("n", range(2, 13))
def test_the_best_splits_are_those_of_the_data(n: int) -> None:
    """Each cell has the highest gain of all splits, and the split that has it."""
    (row,) = re.findall(rf"^\| {n} \| ([\d.]+ .*) \|$", DOCUMENT, re.MULTILINE)
    cells = row.split(" | ")
    places = [(share, ratio) for share in ("-0.95", "-0.8") for ratio in ("10", "30", "100")]
    for cell, place in zip(cells, places, strict=True):
        value, _, split = cell.partition(" ")
        every = gains(n, *place)
        assert len(every) == n // 2
        assert float(value) == pytest.approx(max(every.values()), abs=0.0501)
        if split:
            assert every[split.strip("()")] == max(every.values())


def test_helping_units_gain_nothing() -> None:
    """For a > 0 and more than two units no grouping of PI gains more than the document says."""
    found = [
        float(line["gain_percent"])
        for line in LINES
        if float(line["a"]) > 0 and int(line["n"]) > 2 and line["kind"] == "PI"
    ]
    assert len(found) > 300
    assert f"{max(found):.2f} % at most" in DOCUMENT
    assert f"{len(LINES)} tunings" in DOCUMENT
