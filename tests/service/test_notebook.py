"""The notebook among the examples: it runs, and its results show."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from archived import published
from nbclient import NotebookClient

from service import notebook
from service.schemas import RequestError

NOTEBOOK = Path(__file__).parents[2] / "examples" / "quickstart.ipynb"


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> tuple[nbformat.NotebookNode, Path]:
    """Return the notebook after a run in an empty folder, and that folder."""
    folder = tmp_path_factory.mktemp("notebook")
    document = nbformat.read(NOTEBOOK, as_version=4)
    NotebookClient(
        document, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    ).execute()
    return document, folder


def shown(document: nbformat.NotebookNode, source: str) -> dict[str, object]:
    """Return what the cell whose source ends with `source` displays, by MIME type."""
    cell = next(cell for cell in document.cells if cell.source.endswith(source))
    return cell.outputs[-1].data


def test_outputs_are_kept_and_are_those_of_a_run(
    executed: tuple[nbformat.NotebookNode, Path],
) -> None:
    """Who only reads it sees tables and small pictures, which `scripts/pictures` makes anew."""
    kept = nbformat.read(NOTEBOOK, as_version=4)
    assert NOTEBOOK.stat().st_size < 350_000
    assert shown(kept, "\ntuning")["text/html"] == shown(executed[0], "\ntuning")["text/html"]
    for now, then in zip(executed[0].cells, kept.cells, strict=True):
        assert "execution" not in then.metadata
        for output, stored in zip(now.get("outputs", []), then.get("outputs", []), strict=True):
            drawn = "application/vnd.plotly.v1+json" in output.data
            assert ("image/png" in stored.data) is drawn


def test_tuning_shows_as_table(executed: tuple[nbformat.NotebookNode, Path]) -> None:
    """A tuning displays its time constant and the settings of both loops."""
    html = shown(executed[0], "\ntuning")["text/html"]
    assert "τP = 18.4" in html
    assert "loop 1" in html
    assert "loop 2" in html


def test_figures_show_as_figures(executed: tuple[nbformat.NotebookNode, Path]) -> None:
    """Figures display by Plotly's MIME type, with the unit of time on their axes."""
    figure = shown(executed[0], 'tuning.figures["mu"]')["application/vnd.plotly.v1+json"]
    assert figure["layout"]["xaxis"]["title"]["text"] == "frequency ω (rad/min)"


def test_sweep_costs_time(executed: tuple[nbformat.NotebookNode, Path]) -> None:
    """The more uncertain the inputs, the slower the loops that can be promised."""
    figure = shown(executed[0], 'unit="min")')["application/vnd.plotly.v1+json"]
    tau_p = figure["data"][0]["y"]
    assert len(tau_p) == 3
    assert tau_p == sorted(tau_p)


def test_report_is_saved(executed: tuple[nbformat.NotebookNode, Path]) -> None:
    """The last cell leaves a report in the folder of the run."""
    assert (executed[1] / "report.html").read_text("utf-8").startswith("<!doctype html>")


def test_view_shows_its_table_figures_and_report(tmp_path: Path) -> None:
    """Without Jupyter: HTML for display, figures by name in the given unit, a report file."""
    view = notebook.TuningView(published())
    html = view._repr_html_()
    assert "46.3" in html
    assert view.result.tau_p == published().result.tau_p
    assert {"mu", "controllers"} <= set(view.figures)
    path = view.save_report(tmp_path / "report.html")
    assert path.read_text("utf-8").startswith("<!doctype html>")


def test_faults_of_a_request_are_named() -> None:
    """As over HTTP: the place in the request."""
    with pytest.raises(RequestError) as raised:
        notebook.parse({"plant": {"kind": "first_order", "n": 0}})
    assert "/plant/n" in [fault.pointer for fault in raised.value.faults]
