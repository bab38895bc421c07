"""Ctrl-C, by flags and without exceptions.

A `KeyboardInterrupt` that is raised inside compiled code, or in what compiled code calls, comes out
as a `SystemError`, and one inside an import as a traceback. So commands that compute in this
process end by the handler itself, and a tuning is asked to stop with the best so far.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType, TracebackType
from typing import Self

__all__ = ["INTERRUPTED", "Stopping", "end_at_once", "leave", "raise_again"]

INTERRUPTED = 130  # what a shell reports for Ctrl-C
_SHOW_CURSOR = "\x1b[?25h"  # a progress bar hides it


def _end(words: str) -> None:
    if os.isatty(2):
        words = _SHOW_CURSOR + words
    os.write(2, f"{words}\n".encode())
    os._exit(INTERRUPTED)


def _at_once(signum: int, frame: FrameType | None) -> None:
    del signum, frame
    _end("Interrupted.")


def end_at_once() -> None:
    """Let Ctrl-C end this process: for commands that leave nothing behind."""
    signal.signal(signal.SIGINT, _at_once)


def leave(code: int) -> None:
    """End this process, all said, where it leaves nothing behind; return where it may.

    To take the imports apart lasts up to two seconds, in which a terminal waits for its prompt.
    """
    if signal.getsignal(signal.SIGINT) is not _at_once:
        return
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:  # the reader of the output went away, which the interpreter deals with
        return
    os._exit(code)


def raise_again() -> None:
    """Let Ctrl-C raise `KeyboardInterrupt`: for commands that tidy up after it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


class Stopping:
    """While it is entered, Ctrl-C asks for a stop once something was found, and else ends.

    A second one ends at once.
    """

    def __init__(self) -> None:
        self.wanted = False
        self.has_result = False

    def __enter__(self) -> Self:
        self._before = signal.signal(signal.SIGINT, self._handle)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _handle(self, signum: int, frame: FrameType | None) -> None:
        del signum, frame
        if self.wanted:
            _end("Interrupted.")
        if not self.has_result:
            _end("Interrupted; nothing was found yet.")
        self.wanted = True
        clear = "\r\x1b[2K" if os.isatty(2) else ""  # the progress bar
        os.write(2, f"{clear}Stopping; the best so far is checked.\n".encode())
