"""Connections and schema of the database: SQLite in one file, or PostgreSQL."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from filelock import FileLock, Timeout
from sqlalchemy import Connection, Engine, create_engine, event, text
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, OperationalError

from service.startup import CannotStartError

__all__ = [
    "DatabaseInUseError",
    "DatabaseNewerError",
    "DatabaseSilentError",
    "connect",
    "migrate",
    "sole_user",
]

_MIGRATIONS = Path(__file__).parent / "migrations"
_MIGRATION_LOCK = 0x6D7574756E6501  # "mutune" and a number: an advisory lock of PostgreSQL
_BUSY_SECONDS = 5.0


class DatabaseInUseError(CannotStartError):
    """Another process serves from this SQLite file."""


class DatabaseNewerError(CannotStartError):
    """A newer version of mutune has written to this database."""


class DatabaseSilentError(CannotStartError):
    """The database server does not answer; it may do so later."""


def connect(url: str) -> Engine:
    """Return an engine for `url`, with the settings that durability needs.

    Raises
    ------
    CannotStartError
        `url` is none, or the folder of its SQLite file cannot be made.

    """
    parsed = _parsed(url)
    if parsed.get_backend_name() != "sqlite":
        return create_engine(
            parsed, pool_pre_ping=True, pool_size=8, connect_args={"connect_timeout": 5}
        )
    if parsed.database:
        _make_private(Path(parsed.database))
    engine = create_engine(
        parsed, pool_size=8, connect_args={"timeout": _BUSY_SECONDS, "check_same_thread": False}
    )
    event.listen(engine, "connect", _prepare_sqlite)
    event.listen(engine, "begin", _begin_sqlite)
    return engine


def _parsed(url: str) -> URL:
    try:
        return make_url(url)
    except ArgumentError:
        message = "MUTUNE_DATABASE_URL is not the URL of a database"  # it may hold a password
        raise CannotStartError(message) from None


def _make_private(path: Path) -> None:
    """Make a file that only this user reads, in a folder of which the same holds.

    SQLite gives its other files the permissions of the first. What is there already stays as its
    administrator has it.

    Raises
    ------
    CannotStartError
        Not permitted, or no room.

    """
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        os.close(os.open(path, os.O_CREAT | os.O_RDWR, 0o600))
    except OSError as error:
        message = f"{path}: {error.strerror}; see MUTUNE_DATA_DIR"
        raise CannotStartError(message) from None


def _prepare_sqlite(connection: Any, _record: object) -> None:  # noqa: ANN401 - a DBAPI connection
    connection.isolation_level = None  # transactions begin in `_begin_sqlite`
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("PRAGMA secure_delete = ON")  # expired jobs leave no traces in the file


def _begin_sqlite(connection: Connection) -> None:
    # A transaction that begins by reading and then writes fails at once when another wrote in
    # between, whatever the busy timeout; one that begins as a writer waits its turn.
    options = connection.get_execution_options()
    writes = options.get("writes", False)
    if writes:  # with FULL an accepted job survives a power cut; with NORMAL the file does
        level = "FULL" if options.get("durable", True) else "NORMAL"
        connection.exec_driver_sql(f"PRAGMA synchronous = {level}")
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def migrate(engine: Engine, revision: str = "head") -> None:
    """Bring the schema to a revision; of several processes one does it and the others wait.

    Raises
    ------
    DatabaseNewerError, DatabaseSilentError, CannotStartError
        See there; or the database refuses.

    """
    try:
        _migrate(engine, revision)
    except OperationalError as error:
        if engine.dialect.name == "postgresql":
            message = f"the database does not answer: {_first_line(error)}"
            raise DatabaseSilentError(message) from None
        message = f"{engine.url.database}: {_first_line(error)}"
        raise CannotStartError(message) from None
    except DBAPIError as error:
        message = f"the database refuses: {_first_line(error)}"
        raise CannotStartError(message) from None


def _first_line(error: DBAPIError) -> str:
    return str(error.orig).strip().partition("\n")[0]


def _migrate(engine: Engine, revision: str) -> None:
    config = Config()
    config.set_main_option("script_location", str(_MIGRATIONS))
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    with engine.connect().execution_options(writes=True) as connection, connection.begin():
        if connection.dialect.name == "postgresql":
            connection.execute(
                text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _MIGRATION_LOCK}
            )
        found = set(MigrationContext.configure(connection).get_current_heads())
        if found - known:
            message = (
                "the database was written by a newer mutune than this one "
                f"({version('mutune')}); install that version again, or restore a copy from before"
            )
            raise DatabaseNewerError(message)
        config.attributes["connection"] = connection
        command.upgrade(config, revision)


@contextmanager
def sole_user(url: str) -> Iterator[None]:
    """Hold the SQLite file of `url` for this process; PostgreSQL serves many.

    Raises
    ------
    DatabaseInUseError
        Another process holds it.

    """
    parsed = _parsed(url)
    if parsed.get_backend_name() != "sqlite" or not parsed.database:
        yield
        return
    path = Path(parsed.database)
    _make_private(path)
    try:
        with FileLock(path.with_suffix(".lock"), timeout=0, mode=0o600, thread_local=False):
            yield
    except Timeout:
        message = (
            f"another mutune serves from {path}; stop it, choose another MUTUNE_DATA_DIR, or set "
            "MUTUNE_DATABASE_URL to a PostgreSQL database that several may share"
        )
        raise DatabaseInUseError(message) from None
