"""The tuner: specification, objective, minimax method and search."""

from typing import TYPE_CHECKING, Any

from solver.tuning.specification import (
    Arrangement,
    Bounds,
    ControllerKind,
    Objective,
    Signs,
    Specification,
)

if TYPE_CHECKING:
    from solver.tuning.tuner import tune

__all__ = ["Arrangement", "Bounds", "ControllerKind", "Objective", "Signs", "Specification", "tune"]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - a module's attributes have any type
    """Import the tuner when it is first asked for: what only queues tunings needs no kernels."""
    if name != "tune":
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    from solver.tuning.tuner import tune  # noqa: PLC0415

    globals()["tune"] = tune
    return tune
