"""The OpenAPI document of the service, for ``python -m service.http.openapi FILE`` to write."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from service.http.app import create_app

__all__ = ["text"]


def text() -> str:
    """Return the committed form of the document."""
    return json.dumps(create_app().openapi(), indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(text(), encoding="utf-8")
