"""The service as ``scripts/run`` starts it, and no limit to the time of a property's example."""

from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings
from touring import Tour, touring

# A busy machine is no fault of what is tested.
settings.register_profile(
    "untimed",
    settings.default,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("untimed")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the module that starts most processes, so that nobody waits for it at the end."""
    items.sort(key=lambda item: item.path.name != "test_run.py")


@pytest.fixture(scope="session")
def tour(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tour]:
    """Start a ``scripts/run`` and wait until it has printed its table and serves on."""
    with touring(tmp_path_factory.mktemp("tour")) as tour:
        tour.wait_for("Ctrl-C stops it")
        yield tour
