"""Who did what: a line of JSON for each act, appended to a file of its own or to the log.

A line is written in one piece to a file opened for appending, so several processes may share it,
and what rotates logs may move it away between two lines.
"""

from __future__ import annotations

import json
import logging
import os
from datetime import UTC, datetime
from pathlib import Path

from service.logs import fields

__all__ = ["Trail"]

logger = logging.getLogger("mutune.audit")


class Trail:
    """The trail of acts.

    Parameters
    ----------
    path : Path or None
        The file; None: the log of this process.

    """

    def __init__(self, path: Path | None) -> None:
        self._path = path

    def write(self, **act: object) -> None:
        """Append an act.

        An act that cannot be written is told in the log, with the reason: it has happened.
        """
        told = {name: value for name, value in act.items() if value not in (None, "")}
        if self._path is None:
            logger.info("audit", extra=fields(**told))
            return
        line = json.dumps({"time": datetime.now(UTC).isoformat(), **told}) + "\n"
        try:
            descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
            try:
                os.write(descriptor, line.encode())
            finally:
                os.close(descriptor)
        except OSError as error:
            reason = f"{self._path}: {error.strerror}"
            logger.error("audit", extra=fields(reason=reason, **told))  # noqa: TRY400
