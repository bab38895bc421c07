"""``mutune init``: a tuning request from answers to a few questions."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import typer

from service.cli.outcomes import ExitCode, reported, say
from service.schemas.parsing import Fault, RequestError, parse_tuning_request
from service.whole_file import replace_text

__all__ = ["write_request"]

_Answer = TypeVar("_Answer")


@reported
def write_request(path: Path) -> ExitCode:
    """Ask about identical parallel units and write the tuning request.

    Raises
    ------
    RequestError
        The file is there already, or the answers make no request.

    """
    if path.exists():
        raise RequestError((Fault("", f"{path} is there already; name another file"),))
    try:
        body = _asked()
    except typer.Abort:
        say("Interrupted; nothing was written.")
        return ExitCode.INTERRUPTED
    text = json.dumps(body, indent=2)
    parse_tuning_request(text).build()
    replace_text(path, f"{text}\n")
    say(f"Written: {path}. Next: mutune tune {path}")
    return ExitCode.DONE


def _asked() -> dict[str, Any]:
    """Return the request that the answers make."""
    title = typer.prompt("Title, what the plant is called", default="", show_default=False)
    unit = typer.prompt("Unit of all times (s, min, h)", default="min")
    count = _ask("How many identical parallel units", 2, _whole)
    gain = _ask("Gain of one unit: output over input, at rest", 1.0, _number)
    lag = _ask(f"Its time constant, {unit}", 100.0, _number)
    dead_time = _ask(f"Its dead time, {unit}", 0.0, _number)
    share = _ask("Interaction: effect on another unit's output over that on its own", 0.5, _number)
    error = _ask("Error of the inputs at rest: 0.2 is 20 %", 0.2, _number)
    shift = _ask(f"Time below which the model is not to be trusted, {unit}", 1.0, _number)
    kind = _ask("Controllers, PI or PID", "PI", _kind)
    return {
        **({"title": title} if title else {}),
        "time_unit": unit,
        "plant": {
            "kind": "first_order",
            "n": count,
            "gain": gain,
            "time_constant": lag,
            "interaction": share,
            "dead_time": dead_time,
        },
        "uncertainty": {"epsilon": error, "theta": shift},
        "performance": {"max_peak": 2.0, "offset": 0.0},
        "controller": {"kind": kind},
    }


def _ask(question: str, default: _Answer, convert: Callable[[str], _Answer]) -> _Answer:
    """Return the answer; asked again where it cannot be read."""
    answer: _Answer = typer.prompt(
        question, default=default, value_proc=lambda given: convert(str(given))
    )
    return answer


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        message = "a number is needed"
        raise typer.BadParameter(message) from None


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        message = "a whole number is needed"
        raise typer.BadParameter(message) from None


def _kind(text: str) -> str:
    if text.upper() in {"PI", "PID"}:
        return text.upper()
    message = "PI or PID"
    raise typer.BadParameter(message)
