"""``mutune keys``: create, list, rotate and revoke API keys."""

from __future__ import annotations

import getpass
import time
from datetime import UTC, datetime

import typer

from service import audit
from service.cli.outcomes import ExitCode, reported, say
from service.configuration import Configuration
from service.keys import KeyFile, Scope

__all__ = ["create", "listing", "revoke", "rotate"]

_DAY = 86_400.0
_HOUR = 3600.0


def _opened() -> tuple[KeyFile, audit.Trail] | None:
    configuration = Configuration()
    path = configuration.api_keys_file
    if path is None:
        say("error: set MUTUNE_API_KEYS_FILE to the file of keys")
        return None
    return KeyFile(path), audit.Trail(configuration.audit_file)


def _note(trail: audit.Trail, action: str, key_id: str) -> None:
    trail.write(action=action, key=key_id, user=getpass.getuser())


@reported
def create(name: str, *, read_only: bool, days: float | None) -> ExitCode:
    """Create a key and print its token, this once."""
    if (opened := _opened()) is None:
        return ExitCode.BAD_INPUT
    keys, trail = opened
    scopes = (Scope.READ,) if read_only else (Scope.READ, Scope.WRITE)
    token = keys.create(name, scopes, lifetime=None if days is None else days * _DAY)
    _note(trail, "create_key", _id(token))
    typer.echo(token)
    return ExitCode.DONE


@reported
def listing() -> ExitCode:
    """Print the keys, without their tokens."""
    if (opened := _opened()) is None:
        return ExitCode.BAD_INPUT
    now = time.time()
    for key in opened[0].all():
        ends = "never" if key.expires_at is None else _date(key.expires_at)
        state = "EXPIRED" if key.has_expired(now) else ends
        scopes = "+".join(key.scopes)
        typer.echo(f"{key.id}  {_date(key.created_at)}  {state:10}  {scopes:10}  {key.name}")
    return ExitCode.DONE


@reported
def rotate(key_id: str, *, grace: float, days: float | None) -> ExitCode:
    """Give a key a new secret and print its token, this once; its jobs stay its own."""
    if (opened := _opened()) is None:
        return ExitCode.BAD_INPUT
    keys, trail = opened
    lifetime = None if days is None else days * _DAY
    token = keys.rotate(key_id, grace=grace * _HOUR, lifetime=lifetime)
    if token is None:
        say(f"error: there is no key {key_id}")
        return ExitCode.BAD_INPUT
    _note(trail, "rotate_key", key_id)
    typer.echo(token)
    return ExitCode.DONE


@reported
def revoke(key_id: str) -> ExitCode:
    """Remove a key; a running service refuses it from its next request on."""
    if (opened := _opened()) is None:
        return ExitCode.BAD_INPUT
    keys, trail = opened
    if not keys.revoke(key_id):
        say(f"error: there is no key {key_id}")
        return ExitCode.BAD_INPUT
    _note(trail, "revoke_key", key_id)
    return ExitCode.DONE


def _id(token: str) -> str:
    return token.split("_")[1]


def _date(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).date().isoformat()
