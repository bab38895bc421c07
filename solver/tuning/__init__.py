"""The tuner: specification, objective, minimax method and search."""

from solver.tuning.specification import (
    Arrangement,
    Bounds,
    ControllerKind,
    Objective,
    Specification,
)
from solver.tuning.tune import tune

__all__ = ["Arrangement", "Bounds", "ControllerKind", "Objective", "Specification", "tune"]
