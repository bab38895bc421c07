"""Modules of the service stand on each other: no import runs in a circle, lazy ones included."""

from __future__ import annotations

import ast
from pathlib import Path

import service

ROOT = Path(service.__file__).parent


def module_name(path: Path) -> str:
    """Dotted name of a file."""
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in ROOT.rglob("*.py")}


def imports(path: Path) -> set[str]:
    """Modules of the service that a file imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("service"):
            for alias in node.names:
                inside = f"{node.module}.{alias.name}"
                found.add(inside if inside in MODULES else str(node.module))
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in MODULES}
    return found


def test_no_circle() -> None:
    """Modules can be put in an order in which each imports only earlier ones."""
    left = {name: imports(path) - {name} for name, path in MODULES.items()}
    assert len(left) > 80
    while left:
        ready = [name for name, used in left.items() if not used & left.keys()]
        assert ready, f"a circle among {sorted(left)}"
        for name in ready:
            del left[name]
