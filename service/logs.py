"""Structured logs: a line of JSON for each event, with the id of the request it belongs to."""

from __future__ import annotations

import json
import logging
import sys
from contextvars import ContextVar
from datetime import UTC, datetime

__all__ = ["configure", "fields", "request_id"]

# Of what is being served: tasks and threads that a request starts have it too.
request_id: ContextVar[str | None] = ContextVar("request_id", default=None)

_FIELDS = "fields"


def fields(**values: object) -> dict[str, object]:
    """Return `extra` of a call of a logger: what its line holds beside the event."""
    return {_FIELDS: values}


class Line(logging.Formatter):
    """A record as a JSON object."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        found: dict[str, object] = {**getattr(record, _FIELDS, {}), "event": record.getMessage()}
        if (known := request_id.get()) is not None:
            found["request_id"] = known
        found["level"] = record.levelname.lower()
        found["logger"] = record.name
        found["timestamp"] = datetime.fromtimestamp(record.created, UTC).isoformat()
        if record.exc_info:
            found["exception"] = self.formatException(record.exc_info)
        return json.dumps(found, default=repr)


def configure() -> None:
    """Send everything that this process logs to standard error, one JSON object a line."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(Line())
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(logging.INFO)
    # Dask brings handlers of its own, and tells of every connection at INFO.
    for name in ("distributed", "distributed.scheduler", "distributed.nanny"):
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate = [], True
        logger.setLevel(logging.WARNING)
