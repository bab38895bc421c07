"""Run the notebook among the examples and keep what it shows, figures as pictures.

Called by ``scripts/pictures``. Who only reads the notebook, as on a code host, sees no figure that
a script draws; so each is kept as PNG beside its title. No mark of when or how long it ran.
"""

from __future__ import annotations

import tempfile
from importlib.resources import files
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from playwright.sync_api import Browser
from tour import ROOT, console

__all__ = ["keep_outputs"]

NOTEBOOK = ROOT / "examples" / "quickstart.ipynb"
PLOTLY = "application/vnd.plotly.v1+json"
WIDTH = 640
DRAW = """([data, layout]) => Plotly.toImage(
    { data, layout: { ...layout, paper_bgcolor: "white", plot_bgcolor: "white" } },
    { format: "png", width: %d, height: layout.height ?? 450, scale: 1 })"""


def keep_outputs(browser: Browser) -> None:
    """Run the notebook in an empty folder and write it with its outputs."""
    document = nbformat.read(NOTEBOOK, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(
            document, timeout=300, kernel_name="python3", resources={"metadata": {"path": folder}}
        ).execute()
    page = browser.new_page()
    page.set_content("<main></main>")
    page.add_script_tag(path=str(files("plotly") / "package_data" / "plotly.min.js"))
    for cell in document.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", []):
            figure: dict[str, Any] | None = output.get("data", {}).get(PLOTLY)
            if figure is None:
                continue
            picture = page.evaluate(DRAW % WIDTH, [figure["data"], figure["layout"]])
            title = figure["layout"].get("meta", {}).get("title", "figure")
            output.data = {"image/png": picture.split(",", 1)[1], "text/plain": title}
    page.close()
    document.metadata.pop("widgets", None)
    nbformat.write(document, NOTEBOOK)
    size = Path(NOTEBOOK).stat().st_size
    console.print(f"examples/quickstart.ipynb: {size / 1000:.0f} kB with its outputs")
