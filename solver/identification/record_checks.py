"""Whether records can tell a plant: looked at before anything is fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.identification.record import same_signals
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.identification.record import Record

__all__ = ["check_excitation", "check_records"]

# Two inputs whose moves agree to this part of their size cannot be told apart by any fit.
TOGETHER = 1e-6


def check_records(
    records: Sequence[Record], validation: Sequence[Record]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of inputs and outputs of records that can tell a square plant.

    Raises
    ------
    InvalidInputError
        By pointer into ``{"records": [*records, *validation]}``.

    """
    inputs, outputs = same_signals([*records, *validation])
    if len(inputs) != len(outputs):
        message = f"{len(inputs)} inputs and {len(outputs)} outputs: the plant must be square"
        raise InvalidInputError(message, "/records/0/outputs")
    check_excitation(records)
    return inputs, outputs


def check_excitation(records: Sequence[Record]) -> None:
    """Refuse inputs that rest, or that move together only, and outputs that rest.

    Raises
    ------
    InvalidInputError
        With the advice which input to move.

    """
    names = tuple(records[0].inputs)
    moves = []
    for name in names:
        parts = []
        for record in records:
            values = record.inputs[name]
            parts.append(values - values.mean())
        moves.append(np.concatenate(parts))
    for name, values in zip(names, moves, strict=True):
        largest = max(float(np.max(np.abs(r.inputs[name]))) for r in records)
        if not np.max(np.abs(values)) > 1e-9 * largest:
            message = (
                f"input {name!r} is constant in every record, so its effect cannot be seen: "
                "add a record in which it is moved, or leave it out of the inputs"
            )
            raise InvalidInputError(message, f"/records/0/inputs/{name}")
    unit = np.stack([values / np.linalg.norm(values) for values in moves], axis=1)
    _, s, vt = np.linalg.svd(unit, full_matrices=False)
    if s[-1] < TOGETHER * s[0]:
        involved = [name for name, share in zip(names, vt[-1], strict=True) if abs(share) > 0.1]
        message = (
            f"the inputs {', '.join(involved)} always move together, so their effects cannot be "
            "told apart: add a record in which one of them moves alone"
        )
        raise InvalidInputError(message, f"/records/0/inputs/{involved[0]}")
    for place, name in enumerate(records[0].outputs):
        if not any(np.ptp(r.outputs[name][r.observed[place]]) > 0 for r in records):
            message = f"output {name!r} is constant in every record: is the right column read?"
            raise InvalidInputError(message, f"/records/0/outputs/{name}")
