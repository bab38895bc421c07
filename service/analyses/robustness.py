"""A robustness request and its result as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field

import solver.model.plants
import solver.model.weights
from service.schemas.encoding import encode
from service.schemas.fields import Frequency, ResultModel
from service.schemas.given_loops import EXAMPLE, GivenLoops
from service.schemas.margins import LoopMargins
from service.schemas.peaks import PEAK_EXAMPLE, Curves, Peak, Peaks
from service.schemas.worst_case import WorstCase
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.robustness.record import Robustness

__all__ = [
    "Curves",
    "Peak",
    "Peaks",
    "RobustnessRequest",
    "RobustnessResult",
    "RobustnessTask",
    "robustness_to_json",
]

MAX_FREQUENCIES = 10_000


@dataclass(frozen=True)
class RobustnessTask:
    """Arguments of `solver.robustness.analysis.analyse`; `omega` (k,) rad per time unit or None."""

    plant: solver.model.plants.Plant
    uncertainty: solver.model.weights.Uncertainty
    performance: solver.model.weights.Performance
    loops: tuple[Controller, ...]
    omega: NDArray[np.float64] | None
    certificate: bool


class RobustnessRequest(GivenLoops):
    """Ask how robust given loop settings are."""

    omega: (
        Annotated[tuple[Frequency, ...], Field(min_length=1, max_length=MAX_FREQUENCIES)] | None
    ) = Field(
        default=None,
        description="Frequencies of the curves, ascending; null: chosen from the loop.",
        examples=[None, [0.001, 0.01, 0.1, 1.0, 10.0]],
    )
    certificate: Literal["none", "full"] = Field(
        default="none",
        description="full: the result carries a proof for all frequencies.",
        examples=["none"],
    )

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE]})

    def build(self) -> RobustnessTask:
        """Return the arguments of the solver's analysis.

        Raises
        ------
        InvalidInputError
            A value that the mathematics cannot accept, by pointer into this request.

        """
        task = self.parts()
        omega = None if self.omega is None else np.array(self.omega)
        if omega is not None and np.any(np.diff(omega) <= 0):
            index = int(np.argmax(np.diff(omega) <= 0)) + 1
            message = "the frequencies must ascend"
            raise InvalidInputError(message, f"/omega/{index}")
        return RobustnessTask(
            task.plant,
            task.uncertainty,
            task.performance,
            task.loops,
            omega,
            self.certificate == "full",
        )


class RobustnessResult(ResultModel):
    """Robustness of given loops; peaks and curves are null where the loops are unstable."""

    nominally_stable: bool = Field(
        description="Whether the nominal closed loop is stable.", examples=[True]
    )
    unstable_poles: int = Field(
        description="Closed-loop poles in the right half plane.", examples=[0]
    )
    peaks: Peaks | None = Field(
        description="Peaks of the three mu curves.",
        examples=[
            {
                "robust_performance": PEAK_EXAMPLE,
                "robust_stability": PEAK_EXAMPLE,
                "nominal_performance": PEAK_EXAMPLE,
            }
        ],
    )
    curves: Curves | None = Field(
        description="Upper bounds of mu over frequency.",
        examples=[
            {
                "omega": [0.03],
                "robust_performance": [1.0],
                "robust_stability": [0.4],
                "nominal_performance": [0.9],
            }
        ],
    )
    lower_bound: Peak | None = Field(
        description="Lower bound of the robust performance peak.", examples=[PEAK_EXAMPLE]
    )
    worst_case: WorstCase | None = Field(
        description="The perturbation that reaches the lower bound.", examples=[None]
    )
    uncertainty_scaling: float | None = Field(
        description="Factor by which the uncertainty may grow before robust stability is no "
        "longer assured.",
        examples=[1.84],
    )
    margins: list[LoopMargins] = Field(
        description="Stability margins, an entry for each different loop.", examples=[[]]
    )
    certificate: dict[str, Any] | None = Field(
        description="Proof for all frequencies.", examples=[None]
    )
    warnings: list[str] = Field(description="What to look at twice.", examples=[[]])


def robustness_to_json(robustness: Robustness) -> dict[str, Any]:
    """Return the result as the JSON object that `RobustnessResult` describes."""
    document: dict[str, Any] = encode(robustness)
    return document
