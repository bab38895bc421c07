"""How a command ends: exit codes, and errors as one line each on standard error."""

from __future__ import annotations

import ipaddress
import sys
import traceback
from collections.abc import Callable
from enum import IntEnum
from functools import wraps
from pathlib import Path
from typing import ParamSpec

from pydantic import ValidationError

from service.schemas import Fault, RequestError, TuningResult
from service.startup import CannotStartError
from solver.model.errors import InvalidInputError

__all__ = ["ExitCode", "exit_code_of", "is_loopback", "read_input", "reported", "say"]

_Parameters = ParamSpec("_Parameters")


class ExitCode(IntEnum):
    """Exit codes; INTERRUPTED is what a shell reports for Ctrl-C."""

    DONE = 0
    FAILED = 1
    BAD_INPUT = 2
    INFEASIBLE = 3
    TIME_LIMIT = 4
    CANNOT_START = 5
    INTERRUPTED = 130


def exit_code_of(result: TuningResult) -> ExitCode:
    """Return the exit code that stands for the status of a tuning."""
    return {
        "optimal": ExitCode.DONE,
        "local": ExitCode.DONE,
        "infeasible": ExitCode.INFEASIBLE,
        "time_limit": ExitCode.TIME_LIMIT,
    }[result.status]


def say(message: str) -> None:
    """Print one line on standard error."""
    print(message, file=sys.stderr)  # noqa: T201 - the one place where commands talk to people


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def read_input(path: Path) -> bytes:
    """Return the content of `path`, or of standard input for ``-``.

    Raises
    ------
    RequestError
        The file cannot be read.

    """
    if str(path) == "-":
        return sys.stdin.buffer.read()
    try:
        return path.read_bytes()
    except OSError as error:
        raise RequestError((Fault("", f"{path}: {error.strerror}"),)) from None


def reported(command: Callable[_Parameters, ExitCode]) -> Callable[_Parameters, ExitCode]:
    """Turn the errors that a user can mend into lines on standard error and an exit code."""

    @wraps(command)
    def run(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> ExitCode:
        try:
            return command(*args, **kwargs)
        except BrokenPipeError:  # the reader of the output went away; typer ends quietly
            raise
        except KeyboardInterrupt:
            say("Interrupted.")
            return ExitCode.INTERRUPTED
        except Exception as error:  # noqa: BLE001 - a user gets a line to report, not a traceback
            return _told(error)

    return run


def _told(error: Exception) -> ExitCode:
    """Say what went wrong; return the exit code that stands for it."""
    match error:
        case RequestError():
            for fault in error.faults:
                _say_fault(fault)
        case InvalidInputError():
            _say_fault(Fault(error.field, error.message))
        case ValidationError(title="Configuration"):
            for wrong in error.errors():
                names = "".join(f"MUTUNE_{str(name).upper()}: " for name in wrong["loc"][:1])
                say(f"error: {names}{wrong['msg'].removeprefix('Value error, ')}")
        case CannotStartError():
            say(f"error: {error}")
            return ExitCode.CANNOT_START
        case OSError():
            say(f"error: {error}")
            return ExitCode.FAILED
        case _:
            return _fault_of_ours(error)
    return ExitCode.BAD_INPUT


def _fault_of_ours(error: Exception) -> ExitCode:
    where = traceback.extract_tb(error.__traceback__)[-1]
    say(
        f"error: a fault of mutune itself: {type(error).__name__}: {error} "
        f"({Path(where.filename).name}:{where.lineno}); please report it with the request"
    )
    return ExitCode.FAILED


def _say_fault(fault: Fault) -> None:
    say("error: " + (f"{fault.pointer}: " if fault.pointer else "") + fault.detail)
