"""What moves instead of what is wanted: actual plant inputs from wanted ones.

An input perturbation G (I + w_I Delta_I) in time. With a diagonal Delta_I each input has its own
actuator 1 + w_I delta; the worst perturbation of a full block is of rank one,
Delta_I = left right^T, and couples all inputs through one signal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import TransferFunction
from solver.model.validation import instance, instances, settle

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator

__all__ = ["Actuators", "CoupledActuators", "OwnActuators"]


@dataclass(frozen=True)
class OwnActuators:
    """Actual over wanted input of each unit, stable, dead time allowed: n transfer functions."""

    functions: tuple[TransferFunction, ...]

    def __post_init__(self) -> None:
        settle(self, functions=instances(self.functions, TransferFunction, ""))
        _check_stable(enumerate(self.functions), "")

    def __len__(self) -> int:
        """Return the number of units."""
        return len(self.functions)

    def of(self, unit: int) -> Hashable:
        """Return what distinguishes the actuator of a unit from others."""
        return self.functions[unit]


@dataclass(frozen=True)
class CoupledActuators:
    """Actual inputs u + left w (right^T u): n stable transfer functions in `left` and `right`.

    Parameters
    ----------
    weight : TransferFunction
        w(s), stable.
    left, right : tuple of TransferFunction
        The two factors of Delta_I, one entry a unit.

    """

    weight: TransferFunction
    left: tuple[TransferFunction, ...]
    right: tuple[TransferFunction, ...]

    def __post_init__(self) -> None:
        instance(self.weight, TransferFunction, "/weight")
        settle(
            self,
            left=instances(self.left, TransferFunction, "/left"),
            right=instances(self.right, TransferFunction, "/right"),
        )
        if len(self.left) != len(self.right):
            message = f"{len(self.right)} entries, the left factor has {len(self.left)}"
            raise InvalidInputError(message, "/right")
        if np.any(self.weight.poles.real >= 0):
            message = "an actuator must be stable"
            raise InvalidInputError(message, "/weight/den")
        _check_stable(enumerate(self.left), "/left")
        _check_stable(enumerate(self.right), "/right")

    def __len__(self) -> int:
        """Return the number of units."""
        return len(self.left)

    def of(self, unit: int) -> Hashable:
        """Return what distinguishes the actuator of a unit from others."""
        return self.left[unit], self.right[unit]


Actuators = OwnActuators | CoupledActuators


def _check_stable(functions: Iterator[tuple[int, TransferFunction]], field: str) -> None:
    for index, function in functions:
        if np.any(function.poles.real >= 0):
            message = "an actuator must be stable"
            raise InvalidInputError(message, f"{field}/{index}/den")
