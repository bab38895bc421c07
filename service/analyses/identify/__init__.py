"""Identify a plant from records.

Return the plant that records of inputs and outputs tell, standard errors, what the records cannot
tell and which test would, and the smallest uncertainty weight above all errors.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

from service.analyses.identify.models import (
    EXAMPLE,
    DrawnIdentification,
    IdentificationJob,
    IdentificationRequest,
    IdentificationResult,
    IdentificationTask,
)
from service.analyses.identify.table import table
from service.analysis import Analysis, Figures, LongWork, OnProgress
from service.effort import Effort, of_readings
from service.schemas.encoding import encode
from service.schemas.origin import MAX_ENTRIES
from service.schemas.transfer_functions import function_document, plant_document
from solver.tuning.scenarios import LONGEST_NAME

if TYPE_CHECKING:
    from solver.identification.record import Record

__all__ = [
    "ANALYSIS",
    "EXAMPLE",
    "IdentificationRequest",
    "IdentificationResult",
    "identified",
    "tuning_request",
]

DRAWN_POINTS = 2000


def compute(
    request: IdentificationRequest, on_progress: OnProgress | None = None
) -> dict[str, Any]:
    """Return the plant that the request's records tell; nothing is told on the way."""
    del on_progress
    return identified(request.build())


def identified(task: IdentificationTask) -> dict[str, Any]:
    """Return the plant that records tell, as JSON."""
    from solver.identification.identify import identify
    from solver.identification.problem import PlantStructure
    from solver.identification.selection import Allowed

    found = identify(
        task.used,
        structure=PlantStructure(task.structure),
        allowed=Allowed(task.order, task.integrating),
        validation=task.kept_back,
        drift=task.drift,
    )
    cover = found.cover
    predictions = []
    for one in found.predictions:
        step = -(-one.time.size // DRAWN_POINTS)
        drawn = {
            name: encode(getattr(one, name)[::step]) for name in ("time", "measured", "predicted")
        }
        predictions.append(
            {
                "record": one.record, "output": one.output, "kept_back": one.kept_back,
                "normalised_fit": one.normalised_fit, "spikes": one.spikes, **drawn,
            }
        )  # fmt: skip
    equality = found.equality
    return {
        "plant": plant_document(found.plant),
        "uncertainty": {
            "weight": function_document(cover.weight.weight_of(0)),
            "structure": cover.weight.structure.value,
        },
        "own_uncertainty": cover.own
        and {
            "weight": function_document(cover.own.weight_of(0)),
            "structure": cover.own.structure.value,
        },
        "alternatives": [
            {"name": one.name, "plant": plant_document(one.plant)} for one in found.alternatives
        ],
        "epsilon": cover.epsilon,
        "theta": cover.theta,
        "inputs": list(found.inputs),
        "outputs": list(found.outputs),
        "elements": [
            {
                "output": element.output,
                "input": element.input,
                "kind": element.element.kind.value,
                "estimates": encode(element.estimates),
                "untold": list(element.untold),
                "test": element.test,
            }
            for element in found.elements
        ],
        "predictions": predictions,
        "starts": [start.value for start in found.begins],
        "equality": equality and {**encode(equality), "plausible": equality.plausible},
        "omega": encode(cover.omega),
        "errors": encode(cover.curves),
        "weight_magnitude": encode(cover.weight.magnitude(cover.omega)),
        "advice": list(found.advice),
        "origin": _origin(task, predictions, encode(cover.curves)),
    }


def tuning_request(document: dict[str, Any], *, as_scenarios: bool = False) -> dict[str, Any]:
    """Return the tuning request of an identification.

    What units and records of their own tell is in the weight, or each is a scenario beside the
    nominal plant, with the weight of what else errs.
    """
    request = {
        "plant": document["plant"],
        "uncertainty": document["uncertainty"],
        "performance": {"max_peak": 2.0, "offset": 0.0},
        "controller": {"kind": "PI", "arrangement": "independent"},
        "objective": "tau_p",
        "origin": document["origin"],
    }
    if as_scenarios and document["alternatives"]:
        request["uncertainty"] = document["own_uncertainty"]
        request["scenarios"] = [
            {**one, "name": one["name"][:LONGEST_NAME]} for one in document["alternatives"]
        ]
    return request


def _origin(
    task: IdentificationTask, predictions: list[dict[str, Any]], curves: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return where the plant comes from, as a tuning request takes it."""
    records = [*task.used, *task.kept_back]
    digests = task.digests or [_digest(record) for record in records]
    return {
        "records": [
            {
                "name": record.name[:200], "digest": digest, "samples": record.time.size,
                "span": record.span, "use": "fit" if index < len(task.used) else "validate",
            }
            for index, (record, digest) in enumerate(zip(records, digests, strict=True))
        ],
        "fits": [
            {
                "record": one["record"][:200], "output": one["output"][:200],
                "kept_back": one["kept_back"], "normalised_fit": one["normalised_fit"],
            }
            for one in predictions[:MAX_ENTRIES]
        ],
        "errors": [
            {"source": curve["source"][:200], "steady_state": curve["size"][0]}
            for curve in curves[:MAX_ENTRIES]
        ],
    }  # fmt: skip


def _digest(record: Record) -> str:
    """Return the digest of a record's signals, in the order in which they are fitted."""
    text = hashlib.sha256(record.time.astype("<f8").tobytes())
    for name, values in (*record.inputs.items(), *record.outputs.items()):
        text.update(name.encode())
        text.update(values.astype("<f8").tobytes())
    return text.hexdigest()


def draw(result: DrawnIdentification, unit: str) -> dict[str, Any]:
    """Return data and fit, and the errors below their weight."""
    from service.analyses.identify.figure import identification
    from service.figures.document import figures_to_json

    return figures_to_json(identification(result, unit))


def _effort(task: IdentificationTask) -> Effort:
    records = task.used
    elements = len(records[0].inputs) * len(records[0].outputs)
    return of_readings(sum(record.time.size for record in records), elements)


ANALYSIS = Analysis(
    name="identify",
    resource="identifications",
    text=__doc__,
    outcome="The plant and its uncertainty.",
    request=IdentificationRequest,
    result=IdentificationResult,
    compute=compute,
    computes_with=("solver.identification.identify",),
    table=table,
    effort=_effort,
    job=LongWork(model=IdentificationJob, compute=compute),
    figures=Figures(of="an identification", drawn=DrawnIdentification, draw=draw),
)
