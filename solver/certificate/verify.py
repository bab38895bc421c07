"""Independent check of a certificate from its document alone.

Nothing of the tuner or of the mu computation is used: plant, weights and controllers are taken
from the document into exact numbers, the reduction by symmetry is derived from them, and every
interval is proven anew. See docs/certificate.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from solver.certificate.enclosed_loop import ExactLoop
from solver.certificate.enclosures import Interval
from solver.certificate.proof import Gap, examine, proven_unstable_poles
from solver.certificate.reading import read_certificate
from solver.certificate.taylor_models import PRECISION
from solver.model.errors import InvalidInputError
from solver.model.precision import working_precision

if TYPE_CHECKING:
    from solver.certificate.record import Certificate

__all__ = ["Verdict", "Verification", "check", "verify"]


class Verdict(StrEnum):
    """Outcome of a check.

    PROVEN: the claim holds, for every frequency and with all rounding errors.
    MALFORMED: the document is none that this program can check; `Verification.field` says where.
    UNPROVEN: an interval's D-scales do not prove the claim there; `Verification.interval` names it.
    UNSTABLE: the loops are not nominally stable, or this could not be shown.
    """

    PROVEN = "proven"
    MALFORMED = "malformed"
    UNPROVEN = "unproven"
    UNSTABLE = "unstable"


@dataclass(frozen=True)
class Verification:
    """Outcome of a check: `verdict`, and its `reason` where it is not PROVEN.

    `gamma` is the claimed level and `intervals` the number of intervals; None and 0 where the
    document is malformed. `field` is a JSON pointer into the document, `interval` (rad per time
    unit) the frequencies that could not be proven.
    """

    verdict: Verdict
    gamma: float | None
    intervals: int
    reason: str | None = None
    field: str | None = None
    interval: Interval | None = None

    @property
    def ok(self) -> bool:
        """Whether the claim is proven."""
        return self.verdict is Verdict.PROVEN


def verify(text: str | bytes) -> Verification:
    """Return the outcome of checking a certificate document.

    Parameters
    ----------
    text : str or bytes
        The JSON document.

    Raises
    ------
    UnsupportedPlantError
        The plant is unstable in open loop. Whatever else is wrong is an outcome.

    """
    try:
        return check(read_certificate(text))
    except InvalidInputError as error:
        return Verification(Verdict.MALFORMED, None, 0, error.message, error.field)


def check(certificate: Certificate) -> Verification:
    """Return the outcome of checking a certificate that has been read or made.

    Parameters
    ----------
    certificate : Certificate
        The claim and its evidence.

    Raises
    ------
    UnsupportedPlantError
        The plant is unstable in open loop.
    InvalidInputError
        Too many different settings.

    """
    loop = ExactLoop.of(certificate.claim)
    gamma, count = certificate.claim.gamma, len(certificate.intervals)
    turns = []
    with working_precision(PRECISION):
        for index, proven in enumerate(certificate.intervals):
            found = examine(loop, proven.interval, proven.scales)
            if isinstance(found, Gap):
                return Verification(
                    Verdict.UNPROVEN,
                    gamma,
                    count,
                    found.value,
                    f"/intervals/{index}",
                    proven.interval,
                )
            turns.append(found)
        poles = proven_unstable_poles(loop, turns)
    if poles != 0:
        reason = (
            "stability is undecided"
            if poles is None
            else f"{poles} of the closed-loop poles are unstable"
        )
        return Verification(Verdict.UNSTABLE, gamma, count, reason, "/loops")
    return Verification(Verdict.PROVEN, gamma, count)
