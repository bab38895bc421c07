"""The service does what its OpenAPI document says: every operation, good and bad requests."""

import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from real import PATIENCE
from schemathesis import Case
from schemathesis.config import SchemathesisConfig
from serving import served

from service.configuration import Configuration
from service.http.app import create_app

# The service, a thread of this process, may draw random numbers while an example is made here.
pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module inside strategies")

_SHORT = "^/v1/tunings|^/v1/examples|^/v1/controller-forms|z$|^/metrics"
KEY, SECRET = "0123456789abcdef", "for-this-test-only"

# A request may fit its schema and still make no mathematical sense: 422.
CONFIG_TEXT = f"""
[checks.positive_data_acceptance]
expected-statuses = ["2xx", "404", "409", "422", "503"]

# An analysis that takes too long or too much is answered 503, with the reason.
[checks.not_a_server_error]
expected-statuses = ["2xx", "3xx", "4xx", "503"]

# What is longer than the schema permits may be refused for its length alone: 413.
[checks.negative_data_rejection]
expected-statuses = ["400", "401", "403", "404", "405", "406", "409", "413", "415", "422", "503"]

[auth.openapi.ApiKey]
bearer = "mutune_{KEY}_{SECRET}"

"""


@schemathesis.serializer("application/x-ndjson")
def lines(_context: object, value: object) -> bytes:
    """Return the lines of a body."""
    values = value if isinstance(value, list) else [value]
    return b"".join(json.dumps(each).encode() + b"\n" for each in values)


CONFIG = SchemathesisConfig.from_str(CONFIG_TEXT)
DOCUMENT = Path(__file__).parents[2] / "openapi" / "openapi.json"
schema = schemathesis.openapi.from_path(DOCUMENT, config=CONFIG)
# Hundreds of boundary cases for each operation, each kind of fault once a field (see `is_new`); for
# the large bodies of all analyses and figures those would take many minutes, so one analysis stands
# for them.
thorough = schema.include(path_regex=_SHORT)
without_boundaries = schemathesis.openapi.from_path(
    DOCUMENT,
    config=SchemathesisConfig.from_str(f"{CONFIG_TEXT}[phases.coverage]\nenabled = false\n"),
)
quick = without_boundaries.exclude(path_regex=_SHORT)


@pytest.fixture(scope="module")
def address(_fake_tuner: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a service with keys."""
    folder = tmp_path_factory.mktemp("data")
    digest = hashlib.sha256(SECRET.encode()).hexdigest()
    entry = {"id": KEY, "name": "", "scopes": ["read", "write"], "digest": digest, "created_at": 0}
    (folder / "keys").write_text(json.dumps(entry))
    configuration = Configuration(
        data_dir=folder,
        workers=1,
        api_keys_file=folder / "keys",
        requests_per_minute=1_000_000,
        analysis_time_limit=12,  # a drawn request that takes longer is refused all the same
    )
    with served(create_app(configuration)) as client:
        yield str(client.base_url)


def examples(number: int) -> settings:
    """Return the settings for so many examples of each operation."""
    return settings(
        max_examples=number,
        deadline=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )


# A plant or an error that a scenario has is read by the models that read the request's own.
_SAME_MODELS = re.compile("scenarios -> Array with invalid items: |'scenarios' value: Single-item ")
_seen: set[tuple[str, str]] = set()


def is_new(case: Case) -> bool:
    """Return whether no case before did the same to the same field of the same operation.

    Boundary cases come again for each form of a plant, a weight or a loop that has the field, and
    for each of five values that are of another type.
    """
    told = getattr(case.meta.phase.data if case.meta else None, "description", None)
    if told is None or told == "Positive test case":
        return True
    kind = case.operation.label, _SAME_MODELS.sub("", told)
    if kind in _seen:
        return False
    _seen.add(kind)
    return True


@thorough.parametrize()
@examples(5)
def test_operation_conforms(case: Case, address: str) -> None:
    """Statuses, types, headers and bodies are as documented; bad requests are refused."""
    if is_new(case):
        case.call_and_validate(base_url=address, timeout=PATIENCE)


@quick.parametrize()
@examples(8)
def test_operation_with_a_large_body_conforms(case: Case, address: str) -> None:
    """The same for analyses, figures and batches."""
    case.call_and_validate(base_url=address, timeout=PATIENCE)
