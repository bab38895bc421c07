"""The service with real workers, whose tuner does as the request's seed tells it."""

from collections.abc import Iterator
from pathlib import Path

import dask
import httpx
import pytest
from serving import served

from service.configuration import Configuration
from service.http.app import create_app


@pytest.fixture(scope="session")
def _fake_tuner() -> Iterator[None]:
    preload = str(Path(__file__).with_name("fake_tune.py"))
    with dask.config.set({"distributed.worker.preload": [preload]}):
        yield


@pytest.fixture(scope="session")
def client(_fake_tuner: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """Client of a service with two workers and an empty job table."""
    configuration = Configuration(
        data_dir=tmp_path_factory.mktemp("data"), workers=2, analysis_time_limit=300
    )
    with served(create_app(configuration)) as client:
        yield client
