"""Plants of the solver as a request takes them."""

from __future__ import annotations

from typing import Any

from solver.model.plants import ParallelPlant, Plant
from solver.model.transfer_function import TransferFunction

__all__ = ["function_document", "plant_document"]


def plant_document(plant: Plant) -> dict[str, Any]:
    """Return a plant of the kind parallel, or else of the kind matrix."""
    if isinstance(plant, ParallelPlant):
        return {
            "kind": "parallel",
            "n": plant.n,
            "process": function_document(plant.process),
            "interaction": function_document(plant.interaction),
        }
    rows = [[function_document(element) for element in row] for row in plant.rows]
    return {"kind": "matrix", "elements": rows}


def function_document(function: TransferFunction) -> dict[str, Any]:
    """Return a transfer function."""
    return {
        "num": list(function.num),
        "den": list(function.den),
        "dead_time": function.dead_time,
    }
