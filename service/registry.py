"""Which analyses there are: the modules of `service.analyses`.

Light to import, and so is what it says without importing a module: the command line lists and
describes its commands by it.
"""

from __future__ import annotations

import tokenize
from ast import literal_eval
from functools import cache
from importlib import import_module
from inspect import cleandoc
from io import StringIO
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

import service.analyses

if TYPE_CHECKING:
    from service.analysis import Analysis

__all__ = ["description", "every", "load", "names"]


def names() -> tuple[str, ...]:
    """Return the names of the modules, in alphabetical order."""
    return tuple(sorted(module.name for module in iter_modules(service.analyses.__path__)))


def description(name: str) -> str:
    """Return the docstring of a module."""
    for module in iter_modules(service.analyses.__path__):
        if module.name == name:
            spec = module.module_finder.find_spec(name, None)
            source = spec.loader.get_source(name) if spec and spec.loader else ""  # type: ignore[attr-defined]
            for token in tokenize.generate_tokens(StringIO(source).readline):
                if token.type == tokenize.STRING:
                    return cleandoc(literal_eval(token.string))
    message = f"{name} has no docstring"
    raise ValueError(message)


@cache
def load(name: str) -> Analysis[Any, Any]:
    """Return the `ANALYSIS` of a module."""
    analysis: Analysis[Any, Any] = import_module(f"service.analyses.{name}").ANALYSIS
    return analysis


def every() -> tuple[Analysis[Any, Any], ...]:
    """Return all analyses."""
    return tuple(map(load, names()))
