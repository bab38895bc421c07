"""The name that people import: what it holds, when it loads, what it says of itself."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import subprocess
import sys
from enum import Enum
from pathlib import Path

import pytest

import mutune

ROOT = Path(mutune.__file__).parent.parent
NAMES = sorted(set(mutune.__all__) - {"__version__", "Plant"})


def run(code: str) -> str:
    """Return what a fresh interpreter prints, with this checkout alone and no metadata."""
    done = subprocess.run(  # noqa: S603 - our own interpreter and text
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_nothing_heavy_loads_before_it_is_used() -> None:
    """Even the records come without compiled code, drawing or the service."""
    heavy = "{'numpy', 'numba', 'scipy', 'pydantic', 'plotly', 'flint', 'service'}"
    assert run(f"import mutune, sys; print({heavy} & set(sys.modules))") == "set()"
    light = "{'numba', 'pydantic', 'plotly', 'service', 'cvxpy', 'matplotlib', 'control'}"
    uses = "mutune.first_order; mutune.Specification; mutune.Experiment; mutune.Controller"
    assert run(f"import mutune, sys; {uses}; print({light} & set(sys.modules))") == "set()"


def test_the_version_needs_no_metadata() -> None:
    """A checkout that nobody installed knows it."""
    hide = "import importlib.metadata as m; m.version = None; import mutune; "
    assert run(hide + "print(mutune.__version__)") == mutune.__version__
    assert re.fullmatch(r"\d+\.\d+\.\d+", mutune.__version__)


def test_the_service_needs_no_metadata_for_its_version() -> None:
    """It starts from a checkout too, where only its dependencies are installed."""
    code = """
import importlib.metadata as metadata

installed = metadata.version

def version(name):
    if name == "mutune":
        raise metadata.PackageNotFoundError(name)
    return installed(name)

metadata.version = version
import service.jobs.engine, service.report.document
from service.http.app import create_app
print(create_app().version)
"""
    assert run(code) == mutune.__version__


def test_the_version_heads_the_changelog() -> None:
    """Every release has its date."""
    text = (ROOT / "CHANGELOG.md").read_text()
    assert re.search(rf"^## \[{mutune.__version__}\] - \d{{4}}-\d\d-\d\d$", text, re.MULTILINE)
    assert "## [Unreleased]" in text


def test_type_checkers_and_the_interpreter_see_the_same() -> None:
    """The table that loads a name and the import that a type checker reads agree."""
    tree = ast.parse(Path(mutune.__file__).read_text())
    seen = {
        alias.name: node.module
        for block in tree.body
        if isinstance(block, ast.If) and isinstance(block.test, ast.Name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == mutune._HOME  # noqa: SLF001 - the table under test
    assert {*seen, "__version__"} == set(mutune.__all__) == set(dir(mutune))
    with pytest.raises(AttributeError, match="no attribute 'tunes'"):
        _ = mutune.tunes  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_documented(name: str) -> None:
    """Parameters of a function and fields of a record are each explained by name."""
    thing = getattr(mutune, name)
    text = inspect.getdoc(thing) or ""
    assert thing.__doc__ is not None
    assert len(text) > 20
    if inspect.isfunction(thing):
        wanted = set(inspect.signature(thing).parameters) - {"options"}
        if wanted:
            assert "Parameters\n---" in text or all(f"`{each}`" in text for each in wanted)
            assert "Raises\n---" in text
    elif dataclasses.is_dataclass(thing):
        wanted = {field.name for field in dataclasses.fields(thing)}
    elif isinstance(thing, type) and issubclass(thing, Enum):
        wanted = {member.name for member in thing}
    else:
        wanted = set()
    missing = {each for each in wanted if not re.search(rf"\b{each}\b", text)}
    assert not missing
