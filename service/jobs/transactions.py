"""Transactions: one a call, and a database that fails is told apart from one that refuses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import Connection, Engine, text
from sqlalchemy.exc import DBAPIError, IntegrityError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

__all__ = ["StoreUnavailableError", "Transactions"]


class StoreUnavailableError(Exception):
    """The database does not answer, is locked, read-only or full."""


_UNHURRIED = text("SET LOCAL synchronous_commit = off")


class Transactions:
    """Gives out transactions.

    Parameters
    ----------
    engine : Engine
        Connections to a migrated database.

    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """Yield a connection that only reads."""
        with _translated(), self._engine.connect() as connection:
            yield connection

    @contextmanager
    def writing(self, *, durable: bool = True) -> Iterator[Connection]:
        """Yield a connection whose writes are committed at the end, or undone on an exception.

        Parameters
        ----------
        durable : bool
            Whether a power cut must not undo them: False does not wait for the disk. The death of
            the process undoes nothing either way.

        """
        options = {"writes": True, "durable": durable}
        with (
            _translated(),
            self._engine.connect().execution_options(**options) as connection,
            connection.begin(),
        ):
            if not durable and connection.dialect.name == "postgresql":
                connection.execute(_UNHURRIED)
            yield connection


@contextmanager
def _translated() -> Iterator[None]:
    """Turn a database that fails into `StoreUnavailableError`."""
    try:
        yield
    except IntegrityError:
        raise
    except (DBAPIError, PoolTimeoutError) as error:
        raise StoreUnavailableError(str(error)) from error
