"""The service does what its OpenAPI document says: every operation, good and bad requests."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis import Case
from schemathesis.config import SchemathesisConfig
from serving import served

from service.app import create_app
from service.settings import Settings

KEY, SECRET = "0123456789abcdef", "for-this-test-only"

# A request may fit its schema and still make no mathematical sense: 422.
CONFIG = SchemathesisConfig.from_str(f"""
[checks.positive_data_acceptance]
expected-statuses = ["2xx", "404", "409", "422", "503"]

[auth.openapi.ApiKey]
bearer = "mutune_{KEY}_{SECRET}"
""")
schema = schemathesis.openapi.from_path(
    Path(__file__).parents[2] / "openapi" / "openapi.json", config=CONFIG
)


@pytest.fixture(scope="module")
def address(_fake_tuner: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a service with keys."""
    folder = tmp_path_factory.mktemp("data")
    digest = hashlib.sha256(SECRET.encode()).hexdigest()
    entry = {"id": KEY, "name": "", "scopes": ["read", "write"], "digest": digest, "created_at": 0}
    (folder / "keys").write_text(json.dumps(entry))
    settings = Settings(
        data_dir=folder, workers=1, api_keys_file=folder / "keys", requests_per_minute=1_000_000
    )
    with served(create_app(settings)) as client:
        yield str(client.base_url)


@schema.parametrize()
@settings(
    max_examples=5,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
def test_operation_conforms(case: Case, address: str) -> None:
    """Statuses, types, headers and bodies are as documented; bad requests are refused."""
    case.call_and_validate(base_url=address, timeout=60)
