"""The table of every statement of the sources, with our number in each row that has one.

``docs/sources/rows.json`` holds rows, runs and what each number was found in; ``python
scripts/rows.py`` writes the page from it. With ``--numbers`` the values are computed anew first; a
test holds them against what is computed today.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

from service.gallery import Runs, Source, sources
from service.gallery.definitions import Run
from service.wording import number

FOLDER = Path(__file__).parent.parent / "docs" / "sources"
HEAD = """# Every statement of the sources

Each statement, equation, figure and open question of the four sources, and of the tool's own
description, in their order: what is stated, what mutune says, and how it stands. Numbers of
analyses are asked again by a test; those of tunings and limits, which take longer, are of single
runs, and tables 1 to 4 have a test of their own. `works`: mutune does it, and its numbers are those
stated where there are any. `partly`, `not there`: as the row says. `differs`: both are
sound, they are not equal. `wrong in the source`: recomputed, with the reason in
[Published numbers, and ours](../sources.md).

"""
_DIGITS = 4


def read() -> dict[str, Any]:
    """Return the file of rows."""
    content: dict[str, Any] = json.loads((FOLDER / "rows.json").read_text(encoding="utf-8"))
    return content


@cache
def runs() -> dict[str, Runs]:
    """Return the runs by the letter before their names: R of the rows, S, A, J of the gallery."""
    content = read()
    own = Source(
        title="rows",
        time_unit="time",
        parts=content["parts"],
        runs={name: Run.model_validate(run) for name, run in content["runs"].items()},
        figures=(),
    )
    return {"R": Runs(own)} | dict(zip("SAJ", map(Runs, sources()), strict=True))


def value(check: dict[str, str]) -> Any:  # noqa: ANN401 - a JSON value
    """Return what a check finds today."""
    letter, _, name = check["run"].partition(":")
    return runs()[letter].value(name, check["at"])


def written(found: Any) -> str:  # noqa: ANN401 - a JSON value
    """Return a value as the page has it."""
    if isinstance(found, bool):
        return "yes" if found else "no"
    return found if isinstance(found, str) else number(found, _DIGITS)


def page(content: dict[str, Any]) -> str:
    """Return the page."""
    rows = content["rows"]
    parts = [HEAD, "| state | rows |\n|---|---|\n"]
    parts += [f"| {state} | {count} |\n" for state, count in _counts(rows).items()]
    section = ""
    for index, row in enumerate(rows, start=1):
        if row["section"] != section:
            section = row["section"]
            parts.append(
                f"\n## {section}\n\n| # | statement | stated | mutune | state |\n"
                "|---|---|---|---|---|\n"
            )
        ours = row["ours"].format(*(check["value"] for check in row["checks"]))
        cells = (str(index), row["statement"], row["stated"], ours, row["state"])
        parts.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n")
    return "".join(parts)


def _counts(rows: list[dict[str, Any]]) -> dict[str, int]:
    return dict(Counter(row["state"] for row in rows).most_common())


if __name__ == "__main__":
    document = read()
    if "--numbers" in sys.argv:
        for each in document["rows"]:
            for check in each["checks"]:
                check["value"] = written(value(check))
        text = json.dumps(document, ensure_ascii=False, indent=1) + "\n"
        (FOLDER / "rows.json").write_text(text, encoding="utf-8")
    (FOLDER / "rows.md").write_text(page(document), encoding="utf-8")
