"""``mutune verify``: check a certificate from its document alone."""

from __future__ import annotations

import math
from pathlib import Path

from service.cli.outcomes import ExitCode, read_input, reported, say
from solver.certificate.verify import Verification, verify

__all__ = ["verify_file"]


@reported
def verify_file(path: Path) -> ExitCode:
    """Check the certificate in `path` and say what it proves, or where it fails.

    Parameters
    ----------
    path : Path
        Certificate, or ``-`` for standard input.

    Returns
    -------
    ExitCode
        DONE where the claim is proven, else FAILED.

    """
    verification = verify(read_input(path))
    if verification.ok:
        print(  # noqa: T201 - the output asked for
            f"Proven: the loops are stable and mu <= {verification.gamma!r} at every frequency "
            f"({verification.intervals} intervals)."
        )
        return ExitCode.DONE
    say(f"Refused: {_fault(verification)}")
    return ExitCode.FAILED


def _fault(verification: Verification) -> str:
    parts = [f"{verification.field}: "] if verification.field else []
    if verification.interval is not None:
        high = "infinity" if math.isinf(verification.interval.high) else verification.interval.high
        parts.append(f"from {verification.interval.low} to {high} rad per time unit, ")
    return "".join([*parts, verification.reason or ""])
