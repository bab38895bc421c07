"""The server that this service's processes are forked from; it has everything imported.

A command forks it from itself, once it has imported what both need: that is imported once, and is
in memory once. Then each does the rest of its imports beside the other.
"""

from __future__ import annotations

import ctypes
import gc
import mmap
import os
import re
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import forkserver, resource_tracker, util
from pathlib import Path
from typing import Any

__all__ = [
    "apart",
    "begin",
    "give_back",
    "let_go",
    "limit_threads",
    "listen",
    "progress",
    "start",
    "tell",
]

_VARIABLE = "MUTUNE_START_PROGRESS"  # for the server alone: where it tells how far it is
_SIZE = 200
_FIRST = 3  # after standard input, output and error

# BLAS on one thread: a server without threads can be forked, results do not depend on the number
# of cores, and as many workers as cores do not get into each other's way.
_THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


_MAPPING = re.compile(
    r"^(?P<start>[0-9a-f]+)-(?P<end>[0-9a-f]+) (?P<rights>\S+) .* (?P<path>/.*)\n"
    r"(?:[A-Z].*\n)*?Anonymous: +(?P<own>\d+) kB$",
    re.MULTILINE,
)

_kept: dict[str, int] = {}  # the file in memory that the server writes to, once there is one


def limit_threads() -> None:
    """Have numerical libraries that are imported from now on compute on one thread."""
    for name in _THREADS:
        os.environ[name] = "1"


def start() -> None:
    """Start the server as a program of its own, unless it runs.

    Like `begin` it does not wait until the server has done its imports.
    """
    limit_threads()
    listen()
    forkserver.set_forkserver_preload(["service.jobs.fork_server"])
    forkserver.ensure_running()


def begin() -> None:
    """Start the server from this process, which has done nothing yet but for its imports.

    After `limit_threads`, since what is imported before is in both.
    """
    # A fork takes no threads along, and only on Linux do the system's libraries bear it.
    if sys.platform == "linux" and threading.active_count() == 1:
        with _forked():
            start()
    else:
        start()


@contextmanager
def _forked() -> Iterator[None]:
    """Have the server forked from this process, where Python would start its program anew."""
    resource_tracker.ensure_running()  # a process that is started anew, whatever starts it
    anew = util.spawnv_passfds
    util.spawnv_passfds = _fork
    try:
        yield
    finally:
        util.spawnv_passfds = anew


def _fork(path: bytes, args: Sequence[Any], passfds: Sequence[int]) -> int:
    """Do as `multiprocessing.util.spawnv_passfds`, with what is imported here."""
    # The collector writes into every object that it looks at, and a page written to is no longer
    # shared.
    gc.freeze()
    del path
    pid = os.fork()
    if pid:
        return pid
    status = 1
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        _disconnect(passfds)
        exec(args[-1], {})  # noqa: S102 - what `python -c` would have been given
        status = 0
    except SystemExit:  # all who could ask for processes have gone
        status = 0
    except BaseException:  # noqa: BLE001 - nobody else is there to tell
        traceback.print_exc()
    finally:
        os._exit(status)


def _disconnect(kept: Sequence[int]) -> None:
    """Let go of all open files and sockets but for the standard ones and those that are `kept`.

    Objects that came along, such as the file of a log, go on writing to the numbers that they know:
    these lead nowhere now, and none becomes the number of what is opened later.
    """
    nowhere = os.open(os.devnull, os.O_RDWR)
    for entry in list(Path("/proc/self/fd").iterdir()):
        descriptor = int(entry.name)
        if descriptor >= _FIRST and descriptor != nowhere and descriptor not in kept:
            with suppress(OSError):  # that of the listing itself
                os.fstat(descriptor)
                os.dup2(nowhere, descriptor, inheritable=False)
    os.close(nowhere)


def apart(work: Callable[[], None]) -> None:
    """Do something in a process of its own, forked from this one, and wait until that has ended.

    For what leaves only files behind; whoever calls sees by these whether it succeeded.
    """
    pid = os.fork()
    if pid:
        os.waitpid(pid, 0)
        return
    try:
        work()
    finally:
        os._exit(0)


def listen() -> None:
    """Make what the server writes its progress to; where there is no such thing it is not told."""
    if "sheet" not in _kept and hasattr(os, "memfd_create"):
        _kept["sheet"] = os.memfd_create("mutune-start")
        os.environ[_VARIABLE] = f"/proc/{os.getpid()}/fd/{_kept['sheet']}"


def progress() -> str | None:
    """Return what the server is doing before it can be forked; None: nothing, or nobody knows."""
    if "sheet" not in _kept:
        return None
    return os.pread(_kept["sheet"], _SIZE, 0).rstrip(b" \0").decode() or None


def tell(text: str) -> None:
    """Say, in the server, what it is doing."""
    path = os.environ.get(_VARIABLE)
    if path is None:
        return
    try:
        descriptor = os.open(path, os.O_WRONLY)
    except OSError:  # whoever started this server has gone
        return
    os.pwrite(descriptor, text.encode().ljust(_SIZE)[:_SIZE], 0)
    os.close(descriptor)


def let_go(name: str) -> None:
    """Give back the pages of a library's code, which are read again where they are needed.

    Loading the kernels goes through 70 MB of the compiler's library, and nothing else needs them.

    Parameters
    ----------
    name : str
        In the path of the library.

    """
    if sys.platform != "linux":
        return
    advise = ctypes.CDLL(None).madvise
    for mapping in _MAPPING.finditer(Path("/proc/self/smaps").read_text()):
        start, end = (int(mapping[each], 16) for each in ("start", "end"))
        # What nobody writes to, nor has written to, is what the file holds.
        if name in mapping["path"] and "w" not in mapping["rights"] and mapping["own"] == "0":
            advise(ctypes.c_void_p(start), ctypes.c_size_t(end - start), mmap.MADV_DONTNEED)


def give_back() -> None:
    """Give back to the system what the C library keeps of memory that was freed.

    Imports and the loading of kernels leave 7 MB of it, which would stay for good.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:  # another C library than GNU's has none
        trim(0)
