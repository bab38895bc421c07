"""The figures of the published sources: listed, drawn, their numbers beside those stated."""

from __future__ import annotations

import difflib
from pathlib import Path

from service.cli.console import show
from service.cli.outcomes import ExitCode, reported, say
from service.gallery.definitions import figure_names, find_figure, sources
from service.gallery.runs import Runs
from service.printing import Grid, Line, Part
from service.schemas.parsing import Fault, RequestError
from service.wording import number

__all__ = ["draw_figure"]

_KINDS = (".html", ".png", ".svg", ".pdf", ".webp")


@reported
def draw_figure(name: str | None, output: Path | None) -> ExitCode:
    """List the figures, or compute one of them: print its numbers, draw it into a file.

    Parameters
    ----------
    name : str or None
        Name of a figure, ``slh-4``; None: they are listed.
    output : Path or None
        File to write, its kind by its name's end; None: none is written.

    Returns
    -------
    ExitCode
        BAD_INPUT for an unknown name or kind, or where pictures cannot be made.

    Raises
    ------
    RequestError
        As BAD_INPUT.

    """
    if name is None:
        show(_listed())
        return ExitCode.DONE
    try:
        source, figure = find_figure(name)
    except KeyError:
        near = difflib.get_close_matches(name, figure_names(), 1)
        hint = f"did you mean {near[0]}?" if near else "mutune figure lists them"
        raise RequestError((Fault("", f"no figure {name}; {hint}"),)) from None
    if output is not None and output.suffix not in _KINDS:
        kinds = ", ".join(_KINDS)
        raise RequestError((Fault("", f"{output}: the name must end with one of {kinds}"),))
    runs = Runs(source)
    rows = [
        (each.text, each.stated or "-", number(runs.value(each.run, each.at)))
        for each in figure.numbers
    ]
    show([
        Line(f"{figure.name}: {figure.title}", "strong"),
        Line(f"{source.title}: {figure.stated}"),
        Grid(("number", "stated", "ours"), rows, frozenset({0, 1})),
    ])  # fmt: skip
    if output is not None:
        _write(name, runs, output)
    return ExitCode.DONE


def _listed() -> list[Part]:
    parts: list[Part] = []
    for source in sources():
        rows = [(figure.name, figure.title) for figure in source.figures]
        parts += [Line(source.title, "strong"), Grid(("figure", ""), rows, frozenset({0, 1}))]
    return parts


def _write(name: str, runs: Runs, output: Path) -> None:
    from service.gallery.drawing import draw, to_html, write_image  # noqa: PLC0415 - Plotly

    drawn = draw(*find_figure(name), runs)
    if output.suffix == ".html":
        output.write_text(to_html(drawn), encoding="utf-8")
    else:
        try:
            write_image(drawn, output)
        except (ImportError, ValueError) as error:  # Plotly's for Kaleido that is not there
            message = f"{output}: pictures need pip install mutune[images], HTML files do not"
            raise RequestError((Fault("", message),)) from error
        except RuntimeError as error:  # Kaleido's for a browser that is not there
            message = f"{output}: pictures need Chrome or Chromium, HTML files do not: {error}"
            raise RequestError((Fault("", message),)) from error
    say(f"{output}: {output.stat().st_size / 1000:.0f} kB")
