"""Simulate a relay experiment.

Return the oscillation under relay feedback, what it means, and what theory says of it.
"""

from __future__ import annotations

from typing import Any

from service.analyses.relay.drawn import DrawnRelayExperiment
from service.analyses.relay.request import EXAMPLE, RelayExperimentRequest
from service.analyses.relay.result import RelayExperimentResult
from service.analyses.relay.table import table
from service.analysis import Analysis, Figures
from service.schemas.encoding import encode

__all__ = ["ANALYSIS", "EXAMPLE", "RelayExperimentRequest", "RelayExperimentResult"]


def compute(request: RelayExperimentRequest) -> dict[str, Any]:
    """Return the outcome of the request's experiment."""
    from solver.relay.analysis import relay_experiment

    outcome = relay_experiment(request.build())
    document: dict[str, Any] = encode(outcome)
    document["theory"]["solutions"] = [
        {**encode(solution), "exists": solution.exists, "stable": solution.stable}
        for solution in outcome.theory.solutions
    ]
    return document


def draw(result: DrawnRelayExperiment, unit: str) -> dict[str, Any]:
    """Return the outputs and inputs."""
    from service.analyses.relay.figure import relay
    from service.figures.document import figures_to_json

    return figures_to_json({"relay": relay(result, unit)})


ANALYSIS = Analysis(
    name="relay_experiment",
    resource="relay-experiments",
    text=__doc__,
    outcome="The outcome.",
    request=RelayExperimentRequest,
    result=RelayExperimentResult,
    compute=compute,
    computes_with=("solver.relay.analysis",),
    table=table,
    figures=Figures(of="a relay experiment", drawn=DrawnRelayExperiment, draw=draw),
)
