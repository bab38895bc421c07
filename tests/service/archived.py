"""Tunings as they are archived, of given settings: no search is run."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from service.schemas import parse_tuning_request
from service.schemas.encoding import encode
from service.tuned import RequestedTuning
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, Plant, first_order
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.tuning.groupings import MAX_CONTROLLERS
from solver.tuning.record import Comparison, LocalOptimum, SearchSummary, Status, Tuning

__all__ = ["PUBLISHED", "archived", "infeasible", "published"]

# Skogestad, Lundstrom and Hovd (1989), table 2: tau = 100, a = 0.949, PI.
PUBLISHED = (Controller(46.3, 101), Controller(22.8, 3.15))
PUBLISHED_IDENTICAL = Controller(39.7, 65.1)


def archived(
    plant: Plant,
    loops: Sequence[Controller],
    uncertainty: Uncertainty,
    performance: Performance,
    identical: Controller | None = None,
    **changes: Any,
) -> RequestedTuning:
    """Return a tuning that ended with `loops`, grouped where they are equal."""
    analysis = analyse(plant, uncertainty, performance, loops)
    groups: dict[Controller, list[int]] = {}
    for unit, loop in enumerate(loops):
        groups.setdefault(loop, []).append(unit)
    tau_p = performance.tau_p or 0.0
    fields = {
        "status": Status.OPTIMAL,
        "objective": "tau_p",
        "tau_p": tau_p,
        "peaks": analysis.peaks,
        "loops": tuple(loops),
        "groups": tuple(tuple(units) for units in groups.values()),
        "nominally_stable": True,
        "search": SearchSummary(
            12,
            (
                LocalOptimum(tau_p, 9, tuple(loops)),
                LocalOptimum(1.2 * tau_p, 3, (loops[0],) * plant.n),
            ),
            0,
            0.5,
        ),
        "curves": analysis.curves,
        "comparison": identical and Comparison(1.4 * tau_p, identical, 100 * (1 - 1 / 1.4)),
    }
    return RequestedTuning.of(
        _request(plant, uncertainty, performance), Tuning(**(fields | changes)), "min"
    )


def published(**changes: Any) -> RequestedTuning:
    """Return the published independent settings, the published identical ones beside."""
    return archived(
        first_order(2, 1, 100, 0.949),
        PUBLISHED,
        Uncertainty.from_error(0.2, 1),
        Performance(tau_p=19),
        PUBLISHED_IDENTICAL,
        **changes,
    )


def infeasible() -> RequestedTuning:
    """Return a tuning that found nothing."""
    plant, uncertainty = first_order(2, 1, 100, 1.0), Uncertainty.from_error(0.2, 1)
    tuning = Tuning(
        status=Status.INFEASIBLE,
        objective="tau_p",
        tau_p=None,
        peaks=None,
        loops=(),
        groups=((0,), (1,)),
        nominally_stable=False,
        search=SearchSummary(0, (), 0, 0.0),
        curves=None,
        reason="the static gain is singular",
        omega=0.001,
    )
    return RequestedTuning.of(_request(plant, uncertainty, Performance()), tuning)


def _request(plant: Plant, uncertainty: Uncertainty, performance: Performance) -> Any:
    described = (
        {"kind": "matrix", "elements": _asked(plant.elements_by_row)}
        if isinstance(plant, MatrixPlant)
        else {"kind": "parallel", **_asked(plant)}
    )
    request = {
        "plant": described,
        "uncertainty": _asked(uncertainty),
        "performance": _asked(performance) | {"tau_p": None},
        "controller": {"arrangement": "independent" if plant.n <= MAX_CONTROLLERS else "best"},
    }
    return parse_tuning_request(json.dumps(request))


def _asked(value: Any) -> Any:
    """Return a record as a request has it: what a record remarks on itself is no part of one."""
    return _without_remarks(encode(value))


def _without_remarks(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_remarks(each) for key, each in value.items() if key != "remarks"}
    return [_without_remarks(each) for each in value] if isinstance(value, list) else value
