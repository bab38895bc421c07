"""The demands beside the objective: as constraints of the search, and as settings keep them.

max_controller_gain: no loop amplifies noise more than that, |k| max(1, tau_D/tau_F), the greatest
magnitude of its controller beyond integral action. max_load_error: after a unit step of load at a
process's input the integrated error of its output is tau_I/|k|, whatever the plant, since the
integrators have to deliver the step. Both are linear in the logarithms of the settings.
max_sensitivity_alone: the peak of |1/(1 + g_ii c_i)| of each loop with all others in manual.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.model.controllers import DERIVATIVE_FILTER
from solver.model.measured import MeasuredPlant
from solver.model.subsystems import interchangeable, subsystem
from solver.robustness.margins import loop_margins
from solver.robustness.sets_on_data import sensitivity_alone_on_data
from solver.tuning.demands import DemandOutcome, IntegrityDemand
from solver.tuning.service_sets import integrity_value

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Uncertainty
    from solver.tuning.demands import Demands
    from solver.tuning.specification import ControllerKind

__all__ = ["outcomes", "planes"]

ROUNDING = 1e-6  # relative excess over a limit that is rounding of the last descent
BELOW = 2e-9  # in log, so that rounding of the last descent does not exceed a limit
NEAR = 5e-3  # relative distance from its limit at which a demand binds


def outcomes(
    demands: Demands,
    plants: Sequence[Plant],
    loops: Sequence[Controller],
    uncertainties: Sequence[Uncertainty] = (),
) -> tuple[DemandOutcome, ...]:
    """Return what given loops make of the demands on all `plants`, every value computed anew.

    `uncertainties`: that of each plant, for the demand on integrity.
    """
    values = {
        "max_controller_gain": lambda: max(
            _noise_gain(loop) * demands.gain_ratio((unit,)) for unit, loop in enumerate(loops)
        ),
        "max_load_error": lambda: max(_load_error(loop) for loop in loops),
        "max_sensitivity_alone": lambda: max(_sensitivity_alone(plant, loops) for plant in plants),
    }
    found = []
    for name in demands.names:
        if name == "integrity":
            robust = demands.integrity is IntegrityDemand.ROBUSTLY_STABLE
            value = max(
                integrity_value(plant, uncertainty, loops, robust=robust)
                for plant, uncertainty in zip(plants, uncertainties, strict=True)
            )
            limit = 1.0 if robust else 0.0
            met = value <= limit * (1 + ROUNDING)
            binds = robust and met and value >= limit * (1 - NEAR)
            found.append(DemandOutcome(name, limit, value, met, binds))
            continue
        limit, value = float(getattr(demands, name)), values[name]()
        met = value <= limit * (1 + ROUNDING)
        found.append(DemandOutcome(name, limit, value, met, met and value >= limit * (1 - NEAR)))
    return tuple(found)


def planes(
    demands: Demands, kind: ControllerKind, groups: Sequence[Sequence[int]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rows and limits, (r, m) and (r,): `rows @ theta <= limits` for the log settings.

    `groups`: the units of each controller.
    """
    names = kind.parameters
    own: list[tuple[dict[str, float], float]] = []
    if demands.max_controller_gain is not None:
        most = math.log(demands.max_controller_gain)
        if "derivative_time" not in names:
            own.append(({"gain": 1.0}, most))
        elif "filter_time" not in names:
            own.append(({"gain": 1.0}, most + math.log(DERIVATIVE_FILTER)))
        else:
            own.append(({"gain": 1.0}, most))
            own.append(({"gain": 1.0, "derivative_time": 1.0, "filter_time": -1.0}, most))
    if demands.max_load_error is not None:
        own.append(({"integral_time": 1.0, "gain": -1.0}, math.log(demands.max_load_error)))
    one = np.array([[weights.get(name, 0.0) for name in names] for weights, _ in own])
    rows = np.kron(np.eye(len(groups)), one.reshape(-1, len(names)))
    noise = np.array([0.0 if weights.get("gain") == -1.0 else 1.0 for weights, _ in own])
    limits = np.array([limit - BELOW for _, limit in own])
    ratios = [math.log(demands.gain_ratio(group)) for group in groups]
    return rows, np.concatenate([limits - noise * ratio for ratio in ratios])


def _noise_gain(loop: Controller) -> float:
    lead = (loop.derivative_time or 0.0) / loop.lag_time if loop.lag_time else 0.0
    return abs(loop.gain) * max(1.0, lead)


def _load_error(loop: Controller) -> float:
    return math.inf if loop.integral_time is None else loop.integral_time / abs(loop.gain)


def _sensitivity_alone(plant: Plant, loops: Sequence[Controller]) -> float:
    if isinstance(plant, MeasuredPlant):
        return sensitivity_alone_on_data(plant, loops)
    peaks = []
    for units in interchangeable(plant, loops):
        (row,) = loop_margins(*subsystem(plant, loops, units[:1]))
        peaks.append(math.inf if row.alone is None else row.alone.sensitivity.value)
    return max(peaks)
