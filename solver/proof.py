"""A certificate where one can be had, and a warning in plain words where not."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.certificate import Certificate, Claim
from solver.mu.certificate import certify

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["prove"]


def prove(
    claim: Claim, interrupt: Callable[[], object] = lambda: None
) -> tuple[Certificate | None, list[str]]:
    """Return the certificate of a claim and no warning, or none and the reason."""
    outcome = certify(claim, interrupt)
    if isinstance(outcome, Certificate):
        return outcome, []
    where = "" if outcome.omega is None else f" near omega = {outcome.omega:.4g}"
    return None, [f"no certificate: {outcome.obstacle.value}{where}"]
