"""Compiled functions, and where their machine code is kept.

It is kept in the first place that can be written, and read from every place that has it: where
`NUMBA_CACHE_DIR` points, beside the modules, in the user's cache. So code compiled when mutune was
installed serves processes that may not write there, or anywhere. Where nothing can be written, what
is not there yet is compiled by each process anew.

Functions and constants of other modules are compiled into it, so it is good as long as none of the
modules has changed from which it may have any.

A function is compiled once for arguments of the same types, whether or not a caller that is
compiled too passes constants: numba by itself would compile it, and all that it calls, once more
for every constant. Machine code that is put into its caller has the constant all the same.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import re
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numba import config, njit, types
from numba.core import caching

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["compiled"]

logger = logging.getLogger(__name__)

_COMPILES = re.compile(r"^@(?:compiled|inner)\b|^(?:compiled|inner) = ", re.MULTILINE)
_TAKES_FROM = re.compile(r"^from solver\.([\w.]+) import", re.MULTILINE)

_Function = Any  # numba has no types


def compiled(**options: bool | str) -> Callable[[_Function], _Function]:
    """Return a decorator that compiles with these options of numba, and keeps the code."""

    def decorate(function: _Function) -> _Function:
        dispatcher = njit(**options)(function)
        dispatcher._cache = _Places(function)  # noqa: SLF001 - numba itself would take one place
        template = dispatcher.get_call_template

        def of_plain_types(args: tuple[Any, ...], kws: dict[str, Any]) -> object:
            """Return what a compiled caller calls, as if it passed no constants."""
            named = {name: types.unliteral(kind) for name, kind in kws.items()}
            return template(tuple(map(types.unliteral, args)), named)

        dispatcher.get_call_template = of_plain_types
        return dispatcher

    return decorate


class _Places(caching._Cache):  # type: ignore[misc]  # noqa: SLF001 - numba has no types
    """Several caches of one function as one."""

    _warned = threading.Event()

    def __init__(self, function: _Function) -> None:
        self._caches = [
            cache
            for locator in (_Provided, _Beside, _OfUser)
            if (cache := _cache(function, locator)) is not None
        ]

    @property
    def cache_path(self) -> str | None:
        """Where it is looked for first."""
        return str(self._caches[0].cache_path) if self._caches else None

    def load_overload(self, sig: object, target_context: object) -> object:
        """Return the code for a signature from the first place that has it."""
        for cache in self._caches:
            try:
                found = cache.load_overload(sig, target_context)
            except OSError:  # not readable
                continue
            if found is not None:
                return found
        return None

    def save_overload(self, sig: object, data: object) -> None:
        """Keep the code for a signature in the first place that can be written."""
        for cache in self._caches:
            try:
                cache.save_overload(sig, data)
            except OSError:
                continue
            return
        if not self._warned.is_set():
            self._warned.set()
            logger.warning(
                "compiled code can be kept nowhere: every start compiles for a minute or two; set "
                "NUMBA_CACHE_DIR to a folder that can be written, or run python -m solver.warm as "
                "the owner of the installation"
            )

    def enable(self) -> None:
        """Use the caches."""
        for cache in self._caches:
            cache.enable()

    def disable(self) -> None:
        """Do not use the caches."""
        for cache in self._caches:
            cache.disable()

    def flush(self) -> None:
        """Forget what is kept, where that can be written."""
        for cache in self._caches:
            try:
                cache.flush()
            except OSError:
                continue


@functools.cache
def _sources() -> str:
    """Return a digest of the modules that compile functions and of those that they import from."""
    root = Path(__file__).parent
    texts = {path: path.read_text(encoding="utf-8") for path in root.rglob("*.py")}
    compiling = {path for path, text in texts.items() if _COMPILES.search(text)}
    taken = {
        root.joinpath(*name.split(".")).with_suffix(".py")
        for path in compiling
        for name in _TAKES_FROM.findall(texts[path])
    }
    digest = hashlib.sha256()
    for path in sorted((compiling | taken) & texts.keys()):
        digest.update(f"{path.relative_to(root)}\n{texts[path]}\n".encode())
    return digest.hexdigest()


def _cache(function: _Function, locator: type) -> caching.FunctionCache | None:
    """Return the cache of a function in the place that a locator names."""
    before = config.CACHE_LOCATOR_CLASSES
    config.CACHE_LOCATOR_CLASSES = f"{__name__}.{locator.__name__}"
    try:
        return caching.FunctionCache(function)
    except (RuntimeError, OSError):  # no such place for this function
        return None
    finally:
        config.CACHE_LOCATOR_CLASSES = before


class _Readable:
    """A place that may not be writable, of code that depends on more than one file."""

    @classmethod
    def from_function(cls, py_func: _Function, py_file: str) -> _Readable | None:
        """Return the place for a function."""
        return cls(py_func, py_file)  # type: ignore[call-arg]  # of the locator mixed in

    def get_source_stamp(self) -> str:
        """Return what must be as it was: numba itself looks at the function's own file alone."""
        return _sources()


class _Provided(_Readable, caching.UserProvidedCacheLocator):  # type: ignore[misc]  # no types
    """Where `NUMBA_CACHE_DIR` points."""

    @classmethod
    def from_function(cls, py_func: _Function, py_file: str) -> _Readable | None:
        """Return the place for a function, where there is such a variable."""
        return super().from_function(py_func, py_file) if config.CACHE_DIR else None


class _Beside(_Readable, caching.InTreeCacheLocator):  # type: ignore[misc]  # the same
    """Beside the module."""


class _OfUser(_Readable, caching.UserWideCacheLocator):  # type: ignore[misc]  # the same
    """In the cache of the user."""
