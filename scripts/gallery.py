"""The gallery of the documentation: the figures of the sources, drawn, and the page around them.

``python scripts/gallery.py`` writes the pictures and the page (Kaleido and Chrome); with
``--page`` the page alone, whose numbers a test recomputes.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from service.gallery import Runs, Source, draw, sources
from service.gallery.definitions import Figure
from service.gallery.drawing import write_image
from service.wording import number

DOCS = Path(__file__).parent.parent / "docs"
PICTURES = "images/gallery"
HEAD = """# Gallery: the figures of the sources

Each figure of the published sources that shows signals or curves, drawn anew by
`mutune figure NAME` (`-o FILE.html`, `.svg`, `.png`, `.pdf`; pictures need
`pip install mutune[images]` and Chrome or Chromium), with what the text states of it beside our
numbers. `mutune figure` lists them. Every number here is recomputed by a test. The settings are
those printed in the source. Block diagrams and schematics (figures 1 to 3, 11.1, 11.9, 11.12,
9-1.5) are left out; where a source's number is wrong or cannot be reached,
[Published numbers, and ours](sources.md) says why.
"""
_DIGITS = 4


def page(runs: dict[str, Runs]) -> str:
    """Return the page, from the results of the runs of each source by its title."""
    parts = [HEAD]
    for source in sources():
        parts.append(f"\n## {source.title}\n")
        parts += [_section(figure, runs[source.title]) for figure in source.figures]
    return "".join(parts)


def _section(figure: Figure, runs: Runs) -> str:
    rows = "".join(
        f"| {_cell(each.text)} | {_cell(each.stated or '-')} | "
        f"{number(runs.value(each.run, each.at), _DIGITS)} |\n"
        for each in figure.numbers
    )
    return (
        f"\n### {figure.name}\n\n{_sentence(figure.title)} {figure.stated}\n\n"
        f"![{figure.name}: {figure.title}]({PICTURES}/{figure.name}.svg)\n\n"
        f"| | stated | ours |\n|---|---|---|\n{rows}"
    )


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _sentence(title: str) -> str:
    return f"{title[0].upper()}{title[1:]}."


def _pictures(source: Source, runs: Runs) -> None:
    folder = DOCS / PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    for figure in source.figures:
        path = folder / f"{figure.name}.svg"
        write_image(draw(source, figure, runs), path)
        # Plotly draws random identifiers; without them a picture that is drawn anew is the same.
        text = path.read_text(encoding="utf-8")
        for index, name in enumerate(dict.fromkeys(re.findall(r"defs-([0-9a-f]{6})", text))):
            text = text.replace(name, f"{index:06x}")
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    results = {source.title: Runs(source) for source in sources()}
    (DOCS / "gallery.md").write_text(page(results), encoding="utf-8")
    if "--page" not in sys.argv:
        for each in sources():
            _pictures(each, results[each.title])
