"""What the processes of the analyses compute: a request in, JSON values out.

Apart from the routes, so that these processes need nothing of HTTP or of the database.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import solver.integrity
import solver.relay
import solver.robustness
from service.schemas.decouplings import DecouplingRequest, decoupling_to_json
from service.schemas.drawn import Drawn
from service.schemas.integrity import IntegrityRequest, integrity_to_json
from service.schemas.interaction import InteractionRequest, interaction_to_json
from service.schemas.parallel_drives import ParallelDrivesRequest, parallel_drives_to_json
from service.schemas.relay_experiments import RelayExperimentRequest, relay_experiment_to_json
from service.schemas.robustness import RobustnessRequest, robustness_to_json
from service.schemas.step_responses import StepResponseRequest, step_response_to_json
from service.tuned import Tuned
from solver.interaction.analysis import analyse_interaction
from solver.interaction.decoupling import decouple
from solver.interaction.drive_simulation import simulate_drives
from solver.interaction.loop_effect import loop_effect
from solver.interaction.parallel_drives import analyse_drives

__all__ = [
    "decoupling",
    "figures",
    "figures_of_tuning",
    "integrity",
    "interaction",
    "parallel_drives",
    "relay_experiment",
    "report",
    "robustness",
    "step_response",
]


def robustness(request: RobustnessRequest) -> dict[str, Any]:
    """Return the robustness of the request's loops."""
    task = request.build()
    return robustness_to_json(
        solver.robustness.analyse(
            task.plant,
            task.uncertainty,
            task.performance,
            task.loops,
            task.omega,
            certificate=task.certificate,
        )
    )


def integrity(request: IntegrityRequest) -> dict[str, Any]:
    """Return the integrity of the request's loops."""
    task = request.build()
    return integrity_to_json(
        solver.integrity.integrity(task.plant, task.uncertainty, task.performance, task.loops)
    )


def interaction(request: InteractionRequest) -> dict[str, Any]:
    """Return the interaction between the loops of the request's plant."""
    task = request.build()
    effect = None if task.effect is None else loop_effect(task.effect)
    return interaction_to_json(analyse_interaction(task.plant, task.omega), effect)


def decoupling(request: DecouplingRequest) -> dict[str, Any]:
    """Return the decoupling of the request's plant."""
    return decoupling_to_json(decouple(request.build()))


def parallel_drives(request: ParallelDrivesRequest) -> dict[str, Any]:
    """Return the analysis of the request's units."""
    experiment = request.build()
    return parallel_drives_to_json(analyse_drives(experiment.system), simulate_drives(experiment))


def relay_experiment(request: RelayExperimentRequest) -> dict[str, Any]:
    """Return the outcome of the request's experiment."""
    return relay_experiment_to_json(solver.relay.relay_experiment(request.build()))


def step_response(request: StepResponseRequest) -> dict[str, Any]:
    """Return the responses that the request asks for."""
    return step_response_to_json(request.build().simulate())


# Plotly is imported only where it draws.
def figures_of_tuning(request: str, result: str, unit: str) -> dict[str, Any]:
    """Return everything that the result of a tuning has to show; both are JSON text."""
    from service.figures.answers import draw_tuning  # noqa: PLC0415

    return draw_tuning(request, result, unit)


def figures(result: Drawn, unit: str) -> dict[str, Any]:
    """Return the figures of the result of an analysis."""
    from service.figures.answers import draw  # noqa: PLC0415

    return draw(result, unit)


def report(request: str, result: str, unit: str, job: str) -> dict[str, Any]:
    """Return the report of a tuning and the content policy that it needs."""
    from service.report import POLICY, report_html  # noqa: PLC0415

    tuned = Tuned.from_json(request, result, unit)
    return {"html": report_html(tuned, datetime.now(UTC), job), "policy": POLICY}
