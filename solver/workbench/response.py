"""A simulated response, unit by unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.validation import read_only

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.simulation.integrator import End
    from solver.simulation.step_response import Metrics, StepResponse

__all__ = ["Response", "by_unit"]


@dataclass(frozen=True, eq=False)
class Response:
    """Signals of every unit over time, as deviations from rest; arrays are read-only.

    Attributes
    ----------
    end : End
        COMPLETE, or why the simulation ended before its time.
    time : (k,) ndarray
        Sampled times, in the time unit of the plant.
    r, y, u : (n, k) ndarray
        Set points, outputs and inputs; the row is the unit, from 0.
    metrics : tuple of Metrics
        Of each unit.

    """

    end: End
    time: NDArray[np.float64]
    r: NDArray[np.float64]
    y: NDArray[np.float64]
    u: NDArray[np.float64]
    metrics: tuple[Metrics, ...]

    def __repr__(self) -> str:
        return f"Response({len(self.y)} units, 0 to {self.time[-1]:.6g}, {self.end.value})"


def by_unit(response: StepResponse) -> Response:
    """Return the response with a row for each unit, where alike ones shared theirs."""
    of = {unit: each for each in response.responses for unit in each.units}
    units = [of[unit] for unit in range(len(of))]
    return Response(
        end=response.end,
        time=read_only(np.array(response.time)),
        r=read_only(np.array([each.set_point for each in units])),
        y=read_only(np.array([each.output for each in units])),
        u=read_only(np.array([each.input for each in units])),
        metrics=tuple(each.metrics for each in units),
    )
