"""The wings of the solver stand on each other; no import climbs, and none runs in a circle."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import solver

ROOT = Path(solver.__file__).parent

# From the ground up: a wing imports from itself and from those before it.
FLOORS = (
    "compiled",
    "model",
    "hand_over",
    "mu",
    "stability",
    "certificate",
    "interaction",
    "robustness",
    "simulation",
    "relay",
    "identification",
    "optimality",
    "tuning",
    "limits",
    "workbench",
    "warm",
)


def imports(path: Path) -> set[str]:
    """Modules of the solver that a file imports, those for annotations included."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("solver"):
            for alias in node.names:
                inside = f"{node.module}.{alias.name}"
                found.add(inside if inside in MODULES else str(node.module))
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.startswith("solver")}
    return found


def module_name(path: Path) -> str:
    """Dotted name of a file."""
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in ROOT.rglob("*.py")}


def test_every_wing_has_its_floor() -> None:
    """A wing that the list does not name would be checked by nobody."""
    wings = {name.split(".")[1] for name in MODULES if "." in name}
    assert wings == set(FLOORS)
    assert len(MODULES) > 80


@pytest.mark.parametrize("name", sorted(set(MODULES) - {"solver"}))
def test_no_import_climbs(name: str) -> None:
    """A module imports from its own wing and from the floors below it."""
    floor = FLOORS.index(name.split(".")[1])
    above = {used for used in imports(MODULES[name]) if FLOORS.index(used.split(".")[1]) > floor}
    assert not above


def test_no_circle() -> None:
    """Modules can be put in an order in which each imports only earlier ones."""
    left = {name: imports(path) - {name} for name, path in MODULES.items()}
    while left:
        ready = [name for name, used in left.items() if not used & left.keys()]
        assert ready, f"a circle among {sorted(left)}"
        for name in ready:
            del left[name]
