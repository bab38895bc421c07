"""Analyse the interaction between loops.

Return relative gains, pairings, integral controllability and zeros of a plant.
"""

from __future__ import annotations

from typing import Any

from service.analyses.interaction.drawn import DrawnInteraction
from service.analyses.interaction.request import EXAMPLE, InteractionRequest
from service.analyses.interaction.result import InteractionResult
from service.analyses.interaction.table import table
from service.analysis import Analysis, Figures
from service.schemas.encoding import encode

__all__ = ["ANALYSIS", "EXAMPLE", "InteractionRequest", "InteractionResult"]


def compute(request: InteractionRequest) -> dict[str, Any]:
    """Return the interaction between the loops of the request's plant."""
    from solver.interaction.analysis import analyse_interaction
    from solver.interaction.loop_effect import loop_effect

    task = request.build()
    effect = None if task.effect is None else loop_effect(task.effect)
    document: dict[str, Any] = encode(analyse_interaction(task.plant, task.omega))
    return {**document, "effect": encode(effect)}


def draw(result: DrawnInteraction, unit: str) -> dict[str, Any]:
    """Return the relative gains, at steady state and over frequency."""
    from service.analyses.interaction.figure import interaction
    from service.figures.document import figures_to_json

    return figures_to_json(interaction(result, unit))


ANALYSIS = Analysis(
    name="interaction",
    resource="interaction",
    text=__doc__,
    outcome="The analysis.",
    request=InteractionRequest,
    result=InteractionResult,
    compute=compute,
    computes_with=("solver.interaction.analysis", "solver.interaction.loop_effect"),
    table=table,
    figures=Figures(of="an interaction analysis", drawn=DrawnInteraction, draw=draw),
)
