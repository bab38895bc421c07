"""What the processes of the analyses compute: a request in, JSON values out.

Apart from the routes, so that these processes need nothing of HTTP or of the database. The service
names these functions and never calls them: what they compute with is imported inside, so that it
holds neither kernels nor libraries for them. `service.jobs.fork_server` has it all imported.
"""

# ruff: noqa: PLC0415 - for the reason above

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from service.analyses.decouple import DecouplingRequest, decoupling_to_json
from service.analyses.integrity import IntegrityRequest, integrity_to_json
from service.analyses.interaction.models import InteractionRequest, interaction_to_json
from service.analyses.parallel_drives import ParallelDrivesRequest, parallel_drives_to_json
from service.analyses.relay.models import RelayExperimentRequest, relay_experiment_to_json
from service.analyses.robustness import RobustnessRequest, robustness_to_json
from service.analyses.step_response import StepResponseRequest, step_response_to_json
from service.schemas.drawn import Drawn
from service.tuned import Tuned

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
    from solver.robustness.analysis import analyse

    task = request.build()
    return robustness_to_json(
        analyse(
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
    from solver.robustness.integrity import integrity

    task = request.build()
    return integrity_to_json(integrity(task.plant, task.uncertainty, task.performance, task.loops))


def interaction(request: InteractionRequest) -> dict[str, Any]:
    """Return the interaction between the loops of the request's plant."""
    from solver.interaction.analysis import analyse_interaction
    from solver.interaction.loop_effect import loop_effect

    task = request.build()
    effect = None if task.effect is None else loop_effect(task.effect)
    return interaction_to_json(analyse_interaction(task.plant, task.omega), effect)


def decoupling(request: DecouplingRequest) -> dict[str, Any]:
    """Return the decoupling of the request's plant."""
    from solver.interaction.decoupling import decouple

    return decoupling_to_json(decouple(request.build()))


def parallel_drives(request: ParallelDrivesRequest) -> dict[str, Any]:
    """Return the analysis of the request's units."""
    from solver.interaction.drive_simulation import simulate_drives
    from solver.interaction.parallel_drives import analyse_drives

    experiment = request.build()
    return parallel_drives_to_json(analyse_drives(experiment.system), simulate_drives(experiment))


def relay_experiment(request: RelayExperimentRequest) -> dict[str, Any]:
    """Return the outcome of the request's experiment."""
    from solver.relay import relay_experiment

    return relay_experiment_to_json(relay_experiment(request.build()))


def step_response(request: StepResponseRequest) -> dict[str, Any]:
    """Return the responses that the request asks for."""
    return step_response_to_json(request.build().simulate())


def figures_of_tuning(request: str, result: str, unit: str) -> dict[str, Any]:
    """Return everything that the result of a tuning has to show; both are JSON text."""
    from service.figures.document import draw_tuning

    return draw_tuning(request, result, unit)


def figures(result: Drawn, unit: str) -> dict[str, Any]:
    """Return the figures of the result of an analysis."""
    from service.figures.document import draw

    return draw(result, unit)


def report(request: str, result: str, unit: str, job: str) -> dict[str, Any]:
    """Return the report of a tuning and the content policy that it needs."""
    from service.report.document import POLICY, report_html

    tuned = Tuned.from_json(request, result, unit)
    return {"html": report_html(tuned, datetime.now(UTC), job), "policy": POLICY}
