"""The service as ``scripts/run`` starts it."""

from collections.abc import Iterator

import pytest
from touring import Tour, touring


@pytest.fixture(scope="session")
def tour(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tour]:
    """Start a ``scripts/run`` and wait until it has printed its table and serves on."""
    with touring(tmp_path_factory.mktemp("tour")) as tour:
        tour.wait_for("Ctrl-C stops it")
        yield tour
