"""The gallery: every figure can be drawn, and the page has the numbers that are computed."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest
from typer.testing import CliRunner

from service.cli.commands import app
from service.gallery import Runs, draw, figure_names, find_figure, sources, value_at

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def runs() -> dict[str, Runs]:
    """Results of all runs, computed once."""
    return {source.title: Runs(source) for source in sources()}


@pytest.fixture(scope="module")
def script() -> ModuleType:
    """The script that writes the page."""
    spec = importlib.util.spec_from_file_location("gallery", ROOT / "scripts" / "gallery.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_has_the_numbers_of_today(runs: dict[str, Runs], script: ModuleType) -> None:
    """docs/gallery.md is what the script writes from results computed now."""
    assert (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8") == script.page(runs)


@pytest.mark.parametrize("name", figure_names())
def test_every_figure_has_curves_and_a_picture(name: str, runs: dict[str, Runs]) -> None:
    """Its curves have points, those of a panel are told apart, and the page shows it."""
    source, figure = find_figure(name)
    drawn = draw(source, figure, runs[source.title])
    assert len(drawn.data) == sum(len(panel.curves) for panel in figure.panels)
    for trace in drawn.data:
        assert len(trace.x) == len(trace.y) > 50
    for panel in figure.panels:
        assert len({curve.name for curve in panel.curves}) == len(panel.curves)
    assert (ROOT / "docs" / "images" / "gallery" / f"{name}.svg").exists()


def test_names_are_told_apart() -> None:
    """Each figure has a name of its own, and the runs that it names exist."""
    assert len(set(figure_names())) == len(figure_names())
    for source in sources():
        used = {
            each.run
            for figure in source.figures
            for each in (*figure.numbers, *(c for panel in figure.panels for c in panel.curves))
        }
        assert used == set(source.runs)


def test_the_command_lists_draws_and_refuses(tmp_path: Path) -> None:
    """One command: the list, the numbers with an HTML file, and words for what it cannot do."""
    run = CliRunner().invoke
    assert "johansson-8" in run(app, ["figure"]).output
    output = tmp_path / "figure.html"
    done = run(app, ["figure", "ah-11.13", "-o", str(output)])
    assert done.exit_code == 0
    assert "one integrator shared out" in done.output
    assert "plotly" in output.read_text(encoding="utf-8")[:2_000_000].lower()
    wrong = run(app, ["figure", "ah-11.14"])
    assert wrong.exit_code == 2
    assert "did you mean ah-11.4" in wrong.output
    assert run(app, ["figure", "ah-11.13", "-o", "figure.bmp"]).exit_code == 2


def test_values_are_found_by_pointers() -> None:
    """Pointers go through lists, take magnitudes and pick one of many."""
    document = {"a": [{"re": 3.0, "im": 4.0}, {"re": 0.0, "im": 1.0}], "b": [2.0, None, -5.0]}
    assert value_at(document, "/a/*/im") == [4.0, 1.0]
    assert value_at(document, "abs:/a") == [5.0, 1.0]
    assert value_at(document, "absmax:/a") == 5.0
    assert value_at(document, "min:/b") == -5.0
    assert value_at(document, "last:/b") == -5.0
    with pytest.raises(LookupError):
        value_at(document, "/c")
