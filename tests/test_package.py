"""What is shipped: the wheel, the locked dependencies, the image."""

from __future__ import annotations

import ast
import re
import shlex
import subprocess
import sys
import tomllib
from fnmatch import fnmatch
from importlib.metadata import PackageNotFoundError, metadata, packages_distributions
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
EXTRAS = (
    "control",
    "parquet",
    "plot",
)  # of those who run it, imported only where they are asked for
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def locked(kind: str) -> list[Requirement]:
    """Return the requirements of a lock file; each carries at least one hash."""
    text = (ROOT / "requirements" / f"{kind}.txt").read_text().replace("\\\n", " ")
    requirements = []
    for line in text.splitlines():
        requirement, *hashes = line.split("--hash=sha256:")
        assert all(re.fullmatch("[0-9a-f]{64} *", value) for value in hashes)
        assert hashes, f"{requirement} has no hash"
        requirements.append(Requirement(requirement.strip()))
    return requirements


def test_wheel_contains_every_file_of_the_packages(tmp_path: Path) -> None:
    """Data files, migrations and examples are installed, not only modules."""
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel"]
    subprocess.run([*build, "--directory", tmp_path], cwd=ROOT, check=True, capture_output=True)  # noqa: S603 - our own interpreter
    (wheel,) = tmp_path.glob("*.whl")
    shipped = set(ZipFile(wheel).namelist())
    wanted = {
        str(path.relative_to(ROOT))
        for package in ("mutune", "solver", "service")
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    wanted |= {f"service/examples/{path.name}" for path in (ROOT / "examples").glob("*.json")}
    assert wanted <= shipped
    assert {f"{package}/py.typed" for package in ("mutune", "solver", "service")} <= shipped


@pytest.mark.parametrize(
    ("kind", "wanted"),
    [
        ("run", PROJECT["dependencies"]),
        ("test", PROJECT["dependencies"] + PROJECT["optional-dependencies"]["test"]),
    ],
)
def test_lock_satisfies_the_project(kind: str, wanted: list[str]) -> None:
    """Every requirement of pyproject.toml is pinned to a version that it permits."""
    pins = locked(kind)
    for text in wanted:
        requirement = Requirement(text)
        name = canonicalize_name(requirement.name)
        found = [pin for pin in pins if canonicalize_name(pin.name) == name]
        assert found, f"{name} is not locked; run scripts/lock"
        for pin in found:
            (version,) = (each.version for each in pin.specifier)
            assert requirement.specifier.contains(version), f"run scripts/lock: {pin}"


def test_every_import_is_of_a_locked_distribution() -> None:
    """No module leans on something that happens to be installed."""
    extras = [PROJECT["optional-dependencies"][name] for name in EXTRAS]
    optional = {Requirement(text).name for extra in extras for text in extra}
    names = {canonicalize_name(name) for name in optional | {pin.name for pin in locked("run")}}
    distributions = packages_distributions()
    for path in [
        path for name in ("mutune", "solver", "service") for path in ROOT.glob(f"{name}/**/*.py")
    ]:
        for node in ast.walk(ast.parse(path.read_text())):
            modules = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                modules = [node.module or ""]
            for module in {each.partition(".")[0] for each in modules}:
                if module in sys.stdlib_module_names or module in {"mutune", "solver", "service"}:
                    continue
                assert any(canonicalize_name(each) in names for each in distributions[module]), path


def test_those_who_run_get_what_was_tested() -> None:
    """The lock for running is part of the lock for testing."""
    run, test = (
        {(pin.name, str(pin.specifier)) for pin in locked(kind)} for kind in ("run", "test")
    )
    assert run <= test


def test_no_dependency_is_under_a_strong_copyleft_licence() -> None:
    """Libraries under the LGPL may be called; code under the GPL or AGPL may not be shipped."""
    for pin in locked("run"):
        if pin.marker is not None and not Marker(str(pin.marker)).evaluate():
            continue
        try:
            document = metadata(pin.name)
        except PackageNotFoundError:
            pytest.fail(f"{pin.name} is not installed; run scripts/setup test")
        classifiers = document.get_all("Classifier", [])
        licence = " ".join(
            [document.get("License-Expression", "")]
            + [each for each in classifiers if each.startswith("License")]
        )
        assert not re.search(r"(?<!L)GPL|GNU (Affero )?General", licence), f"{pin.name}: {licence}"


def instructions() -> list[list[str]]:
    """Return the instructions of the Dockerfile, as words."""
    text = (ROOT / "Dockerfile").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    joined = "\n".join(lines).replace("\\\n", " ")
    return [shlex.split(line) for line in joined.splitlines() if line]


def test_image_runs_as_a_user_without_privileges() -> None:
    """The last stage ends as another user than root, is health-checked, and starts the service."""
    steps = instructions()
    start = max(index for index, step in enumerate(steps) if step[0] == "FROM")
    names = [step[0] for step in steps[start:]]
    users = [step[1] for step in steps[start:] if step[0] == "USER"]
    assert users
    assert users[-1] not in {"root", "0"}
    assert {"HEALTHCHECK", "CMD"} <= set(names)


def test_image_gets_every_file_that_it_copies() -> None:
    """What the Dockerfile copies is there, and .dockerignore lets it through."""
    ignore = (ROOT / ".dockerignore").read_text().split()
    passed = [line[1:] for line in ignore if line.startswith("!")]
    assert ignore[0] == "*"
    for step in instructions():
        if step[0] != "COPY" or step[1].startswith("--from"):
            continue
        for source in step[1:-1]:
            assert (ROOT / source).exists(), source
            assert any(fnmatch(source, pattern) for pattern in passed), source


def test_image_copies_all_that_the_wheel_needs() -> None:
    """The packages, and what their links point to, reach the build."""
    sources = {source for step in instructions() if step[0] == "COPY" for source in step[1:-1]}
    packages = {"mutune", "solver", "service"}
    assert packages | {"examples", "pyproject.toml", PROJECT["readme"]} <= sources
    links = [path for name in packages for path in (ROOT / name).iterdir()]
    for link in links:
        if link.is_symlink():
            assert link.resolve().relative_to(ROOT).parts[0] in sources
