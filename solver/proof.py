"""A certificate where one can be had, and a warning in plain words where not."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from solver.certificate import Certificate
    from solver.controllers import Controller
    from solver.plants import Plant
    from solver.weights import Performance, Uncertainty

__all__ = ["prove"]


def prove(
    plant: Plant,
    uncertainty: Uncertainty,
    performance: Performance,
    loops: Sequence[Controller],
    level: float,
    *,
    interrupt: Callable[[], object] = lambda: None,
) -> tuple[Certificate | None, list[str]]:
    """Return the certificate that mu <= `level` and no warning, or none and the reason."""
    # Most analyses ask for no proof and need not wait for the library of exact numbers.
    from solver.certificate import Certificate, Claim  # noqa: PLC0415
    from solver.mu.certificate import certify  # noqa: PLC0415

    outcome = certify(Claim(plant, uncertainty, performance, tuple(loops), level), interrupt)
    if isinstance(outcome, Certificate):
        return outcome, []
    where = "" if outcome.omega is None else f" near omega = {outcome.omega:.4g}"
    return None, [f"no certificate: {outcome.obstacle.value}{where}"]
