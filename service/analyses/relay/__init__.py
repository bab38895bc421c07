"""Simulate a relay experiment.

Return the oscillation under relay feedback, what it means, and what theory says of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

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
        {
            **encode(solution),
            "exists": solution.exists,
            "stable": solution.stable,
            "waveform_time": encode(np.linspace(0.0, solution.half_period, len(solution.waveform))),
        }
        for solution in outcome.theory.solutions
    ]
    return document


def draw(result: DrawnRelayExperiment, unit: str) -> dict[str, Any]:
    """Return the outputs and inputs, and the Nyquist curve."""
    from service.analyses.relay.figure import nyquist, relay
    from service.figures.document import figures_to_json

    drawn = {"relay": relay(result, unit)}
    if not result.theory.response:
        return figures_to_json(drawn, {"nyquist": "the result has no Nyquist curve"})
    return figures_to_json(drawn | {"nyquist": nyquist(result.theory)})


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
