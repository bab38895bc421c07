"""What the server that workers are forked from imports: what computes, with its kernels compiled.

Neither HTTP nor the database: what is here is in memory a second time beside the service itself.

The import itself does the compiling: that is the one thing that Python's fork server can be
told to do, and every process forked from it is then ready at once. It says how far it is, since
the first time takes a minute or two.
"""

# ruff: noqa: F401 - all imported for the processes forked later

import gc
import json
import sys
import time
from importlib import import_module
from typing import Any

from numba.core import event

import service.drawing
import service.jobs.pool
import service.jobs.work
from service import registry
from service.jobs import forking
from solver.warm import warm

__all__: list[str] = []

_SAY_EVERY = 10.0  # seconds between lines of the log


class _ColdError(Exception):
    """A kernel is not compiled yet."""


def _is_kept(dispatcher: Any) -> bool:  # noqa: ANN401 - numba has no types
    """Return whether the code of a function, once compiled, can be kept for other processes."""
    for cache in getattr(dispatcher._cache, "_caches", ()):  # noqa: SLF001 - no other way to them
        try:
            cache._impl.locator.ensure_cache_path()  # noqa: SLF001 - as numba does before it saves
        except OSError:
            continue
        return True
    return False


class _Expected(event.Listener):  # type: ignore[misc]  # numba has no types
    """Ends what would compile a kernel that can be kept for another process to load."""

    def on_start(self, event: event.Event) -> None:
        """Raise _ColdError."""
        if _is_kept(event.data["dispatcher"]):
            raise _ColdError

    def on_end(self, event: event.Event) -> None:
        """Do nothing."""


class _Compilations(event.Listener):  # type: ignore[misc]  # numba has no types
    """Counts functions that are compiled, and tells of them."""

    def __init__(self) -> None:
        self.count = 0
        self._said = 0.0

    def on_start(self, event: event.Event) -> None:
        """Do nothing."""

    def on_end(self, event: event.Event) -> None:  # noqa: ARG002 - numba's own form
        """Count."""
        self.count += 1
        text = f"compiling the kernels, which is done once: {self.count} functions so far"
        forking.tell(text)
        if time.monotonic() > self._said + _SAY_EVERY:
            self._said = time.monotonic()
            sys.stderr.write(json.dumps({"event": text, "level": "info"}) + "\n")


def _load() -> None:
    """Have all kernels here, compiled.

    The compiler keeps 240 MB, which every process forked from here would have too: it is used in a
    process that ends, and what it made is loaded.
    """
    try:
        with event.install_listener("numba:compile", _Expected()):
            warm()
    except _ColdError:
        forking.apart(_compile)
        _compile()  # loads; and compiles what did not succeed there


def _compile() -> None:
    """Have all kernels compiled, and say how far that is."""
    with event.install_listener("numba:compile", _Compilations()):
        warm()


forking.tell("loading the libraries")
for _analysis in registry.every():
    for _module in _analysis.computes_with:
        import_module(_module)
_load()
forking.tell("")
# The collector writes into every object that it looks at, and a page written to is no longer
# shared: what is here now it need not look at.
gc.collect()
forking.give_back()
gc.freeze()
forking.let_go("llvmlite")
