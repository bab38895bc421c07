"""``mutune keys``: create, list and revoke API keys."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import typer

from service.cli.outcomes import ExitCode, reported, say
from service.configuration import Configuration
from service.keys import KeyFile, Scope

__all__ = ["create", "listing", "revoke"]


def _path() -> Path | None:
    path = Configuration().api_keys_file
    if path is None:
        say("error: set MUTUNE_API_KEYS_FILE to the file of keys")
    return path


@reported
def create(name: str, *, read_only: bool) -> ExitCode:
    """Create a key and print its token, this once."""
    if (path := _path()) is None:
        return ExitCode.BAD_INPUT
    scopes = (Scope.READ,) if read_only else (Scope.READ, Scope.WRITE)
    typer.echo(KeyFile(path).create(name, scopes))
    return ExitCode.DONE


@reported
def listing() -> ExitCode:
    """Print the keys, without their tokens."""
    if (path := _path()) is None:
        return ExitCode.BAD_INPUT
    for key in KeyFile(path).all():
        created = datetime.fromtimestamp(key.created_at, UTC).date().isoformat()
        typer.echo(f"{key.id}  {created}  {'+'.join(key.scopes)}  {key.name}")
    return ExitCode.DONE


@reported
def revoke(key_id: str) -> ExitCode:
    """Remove a key; a running service refuses it from its next request on."""
    if (path := _path()) is None:
        return ExitCode.BAD_INPUT
    if not KeyFile(path).revoke(key_id):
        say(f"error: there is no key {key_id}")
        return ExitCode.BAD_INPUT
    return ExitCode.DONE
