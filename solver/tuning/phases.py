"""The two phases of a descent: to settings for which some tau_P exists, then to the best ones.

The price of a missing level is exact only above its multiplier, which grows without limit as the
demand comes close to what no settings meet. So it rises until nothing is missing, and settings that
the first phase found feasible are never given up for others that are not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.mu.kernel import FINE
from solver.tuning.minimax import Box, minimise

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.tuning.objective import Evaluation
    from solver.tuning.together import Together

__all__ = ["EXACT", "Phases"]

EXACT = 1e-8  # tolerance in s of a last descent
FIRST_PHASE = 1e-5  # tolerance in log mu^2 of the first phase
FIRST_PHASE_STEPS = 400
ENOUGH_ROOM = -0.02  # log mu^2 at which it ends
HOPELESS = 0.05  # log mu^2 above which it is not repeated with more digits
DEARER = 30.0  # factor on the price of a missing level where it did not suffice
HIGHEST_PRICE = 1e6  # prices beyond lose the digits of s


@dataclass(frozen=True)
class Phases:
    """How to descend in one search.

    Parameters
    ----------
    feasibility : Together
        mu of an infinitely slow demand: below 1 some tau_P exists.
    box : Box
        Bounds of the parameters.
    checkpoint : callable
        Called often; may raise to stop.

    """

    feasibility: Together
    box: Box
    checkpoint: Callable[[], None]

    def feasible(self, here: Evaluation) -> Evaluation:
        """Return where mu of an infinitely slow demand is below 1, or as low as it gets nearby."""
        for objective, tolerance in (
            (self.feasibility, FIRST_PHASE),
            # At the edge the little that there is counts.
            (self.feasibility.having(nu=FINE), EXACT),
        ):
            here = minimise(
                objective, objective.evaluate(here.theta, near=here), self.box,
                tolerance=tolerance, max_iterations=FIRST_PHASE_STEPS,
                enough=lambda e: e.merit <= ENOUGH_ROOM,
                checkpoint=lambda _: self.checkpoint(),
            )  # fmt: skip
            if not ENOUGH_ROOM < here.value < HOPELESS:
                break
        return here

    def best(
        self,
        objective: Together,
        here: Evaluation,
        tolerance: float,
        enough: Callable[[Evaluation], bool] = lambda _: False,
    ) -> Evaluation:
        """Descend from `here`; a finite value that it has is not lost.

        Where levels are missing at the end, they are by less than `tolerance`.
        """
        start = here
        while math.isfinite(here.merit):
            here = minimise(
                objective, here, self.box, tolerance=tolerance, enough=enough,
                checkpoint=lambda _: self.checkpoint(),
            )  # fmt: skip
            missing = (here.merit - here.s) / objective.penalty
            if missing <= tolerance:
                return here
            if objective.penalty > HIGHEST_PRICE:
                break
            objective = objective.having(penalty=DEARER * objective.penalty)
            here = objective.evaluate(here.theta, near=here)
        return start if start.value < here.value else here
