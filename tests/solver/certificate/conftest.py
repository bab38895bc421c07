"""Certificates that several tests look at."""

from __future__ import annotations

import pytest
from certified_loops import published

from solver.certificate.record import Certificate
from solver.certificate.search import certify


@pytest.fixture(scope="session")
def certificate() -> Certificate:
    """Return the certificate of the published loops at 1.0004."""
    found = certify(published(1.0004))
    assert isinstance(found, Certificate)
    return found
