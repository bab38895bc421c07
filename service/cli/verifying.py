"""``mutune verify``: check a certificate from its document alone."""

from __future__ import annotations

import math
import time
from pathlib import Path

from service.cli.outcomes import ExitCode, read_input, reported, say
from solver.certificate.verify import Verification, verify

__all__ = ["verify_file"]

AGREEMENT = 1e-5  # of the semidefinite programs, as in `solver.robustness.cross_check`


@reported
def verify_file(path: Path, *, sdp: bool = False) -> ExitCode:
    """Check the certificate in `path` and say what it proves, or where it fails.

    Parameters
    ----------
    path : Path
        Certificate, or ``-`` for standard input.
    sdp : bool
        Recompute mu at the peaks by semidefinite programming as well.

    Returns
    -------
    ExitCode
        DONE where the claim is proven, and the peaks by semidefinite programming are within it,
        else FAILED.

    """
    text = read_input(path)
    verification = verify(text)
    if verification.ok:
        print(  # noqa: T201 - the output asked for
            f"Proven: the loops are stable and mu <= {verification.gamma!r} at every frequency "
            f"({verification.intervals} intervals)."
        )
        return _by_sdp(text) if sdp else ExitCode.DONE
    say(f"Refused: {_fault(verification)}")
    return ExitCode.FAILED


def _by_sdp(text: str | bytes) -> ExitCode:
    """Recompute mu at the highest peaks: other mathematics and other code than the proof."""
    # Here, since they bring compiled kernels and cvxpy, of which the proof needs nothing.
    from solver.certificate.reading import read_certificate  # noqa: PLC0415
    from solver.robustness.cross_check import cross_check_peaks  # noqa: PLC0415

    began = time.perf_counter()
    claim = read_certificate(text).claim
    checks = cross_check_peaks(claim.plant, claim.uncertainty, claim.performance, claim.loops)
    seconds = time.perf_counter() - began
    for check in checks:
        print(  # noqa: T201 - the output asked for
            f"At {check.omega:.6g} rad per time unit mu is at most {check.sdp:.7g} by semidefinite "
            f"programming, {check.kernel:.7g} by the kernel."
        )
    highest = max(check.sdp for check in checks)
    if not all(check.agree for check in checks) or highest > claim.gamma * (1 + AGREEMENT):
        say(f"Refused: they disagree, or exceed what is claimed, {claim.gamma:.7g}.")
        return ExitCode.FAILED
    print(f"They agree, within what is claimed ({seconds:.1f} s).")  # noqa: T201 - as above
    return ExitCode.DONE


def _fault(verification: Verification) -> str:
    parts = [f"{verification.field}: "] if verification.field else []
    if verification.interval is not None:
        high = "infinity" if math.isinf(verification.interval.high) else verification.interval.high
        parts.append(f"from {verification.interval.low} to {high} rad per time unit, ")
    return "".join([*parts, verification.reason or ""])
