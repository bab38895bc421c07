"""What a user starts from: example requests, schemas and known control systems."""

from __future__ import annotations

import difflib
import json
import sys
from importlib.resources import files

from pydantic import BaseModel

from service import registry
from service.cli.console import show
from service.cli.outcomes import ExitCode, reported
from service.printing import Grid
from service.schemas import TuningRequest
from service.schemas.known_controllers import known_controllers
from service.schemas.parsing import Fault, RequestError, parse

__all__ = ["list_controllers", "print_example", "print_schema"]

_EXAMPLE, _COMMAND = "example", "command that reads a request"


@reported
def list_controllers(*, as_json: bool) -> ExitCode:
    """Print the known control systems."""
    found = known_controllers()
    if as_json:
        _write(json.dumps({"items": found}))
        return ExitCode.DONE
    rows = [(each["name"], each["title"], each["time_unit"], each["filter_rule"]) for each in found]
    show([Grid(("name", "control system", "times in", "filter"), rows, frozenset(range(4)))])
    return ExitCode.DONE


@reported
def print_example(name: str | None) -> ExitCode:
    """Print an example request, or the list of them with the commands that take them.

    Raises
    ------
    RequestError
        No example of this name.

    """
    folder = files("service") / "examples"
    texts = {
        item.name.removesuffix(".json"): item.read_text("utf-8")
        for item in sorted(folder.iterdir(), key=str)
        if item.name.endswith(".json")
    }
    if name is None:
        rows = [(each, ", ".join(_commands(text))) for each, text in texts.items()]
        show([Grid(("example", "for mutune ..."), rows, frozenset({0, 1}))])
    elif name in texts:
        _write(texts[name].rstrip())
    else:
        raise _unknown(_EXAMPLE, name, known=list(texts))
    return ExitCode.DONE


@reported
def print_schema(command: str) -> ExitCode:
    """Print the JSON schema of the request that a command reads.

    Raises
    ------
    RequestError
        No command of this name reads a request.

    """
    requests = _requests()
    if command not in requests:
        raise _unknown(_COMMAND, command, known=list(requests))
    _write(json.dumps(requests[command].model_json_schema(), indent=2))
    return ExitCode.DONE


def _requests() -> dict[str, type[BaseModel]]:
    """Return the request models by command."""
    found: dict[str, type[BaseModel]] = {"tune": TuningRequest}
    for module in registry.names():
        found[module.replace("_", "-")] = registry.load(module).request
    return found


def _commands(text: str) -> list[str]:
    """Return the commands that take a request as it stands."""
    found = []
    for command, model in _requests().items():
        try:
            parse(model, text)
        except RequestError:
            continue
        found.append(command)
    return found


def _unknown(kind: str, name: str, *, known: list[str]) -> RequestError:
    near = difflib.get_close_matches(name, known, 1)
    hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
    return RequestError((Fault("", f"no {kind} {name}; {hint}"),))


def _write(text: str) -> None:
    sys.stdout.write(f"{text}\n")
