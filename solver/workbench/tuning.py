"""Tuning by keywords."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, Literal, overload

from solver.model.errors import InvalidInputError
from solver.model.validation import reals
from solver.model.weights import Performance
from solver.tuning import tuner
from solver.tuning.specification import Bounds, ControllerKind, Specification
from solver.workbench.tuned import Tuned

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Uncertainty
    from solver.tuning.demands import Demands
    from solver.tuning.record import Progress
    from solver.tuning.resolution import Resolution
    from solver.tuning.scenarios import Scenario
    from solver.tuning.specification import Arrangement, Objective, Signs
    from solver.tuning.spread import Spread

    KindName = Literal["PI", "PID", "PIF", "PIDF"]
    ArrangementName = Literal["identical", "independent", "grouped", "best"]

__all__ = ["tune"]


@overload
def tune(plant: Specification, *, progress: Callable[[Progress], None] | None = None) -> Tuned: ...
@overload
def tune(
    plant: Plant,
    uncertainty: Uncertainty,
    *,
    max_peak: float = 2.0,
    offset: float = 0.0,
    tau_p: float | None = None,
    output_scale: Sequence[float] | None = None,
    controller: ControllerKind | KindName = ...,
    arrangement: Arrangement | ArrangementName = ...,
    group_sizes: Sequence[int] | None = None,
    groups: Sequence[Sequence[int]] | None = None,
    pairing: Sequence[int] | Literal["best"] | None = None,
    scan_time: float = 0.0,
    objective: Objective | Literal["tau_p", "mu"] = ...,
    bounds: Bounds | None = None,
    signs: Signs | Literal["usual", "any"] = ...,
    demands: Demands = ...,
    scenarios: Sequence[Scenario] = ...,
    spread: Spread | None = None,
    start: Sequence[Controller] | None = None,
    resolution: Resolution | None = None,
    as_found: Sequence[Controller] | None = None,
    starts: int | None = None,
    seed: int = 0,
    time_limit: float | None = None,
    certificate: bool = False,
    model_tolerance: bool = False,
    optimality_gap: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Tuned: ...
def tune(
    plant: Plant | Specification,
    uncertainty: Uncertainty | None = None,
    *,
    progress: Callable[[Progress], None] | None = None,
    **options: Any,
) -> Tuned:
    """Find the best settings.

    Parameters
    ----------
    plant : Plant or Specification
        Open-loop stable, or integrating; or the whole task, with `progress` alone beside it.
    uncertainty : Uncertainty
        How wrong the inputs may be.
    max_peak, offset, tau_p, output_scale
        The demand, see `Performance`; `tau_p` (time unit of the plant) for the objective 'mu',
        and only then.
    controller : ControllerKind or str
        Kind of all controllers, 'PI', 'PID', or 'PIF' and 'PIDF' with a free filter time.
    arrangement : Arrangement or str
        Which loops share settings: 'identical', 'independent', 'grouped' or 'best'.
    group_sizes : sequence of int or None
        Sizes of the groups, for 'grouped', and only then.
    groups, pairing, scan_time
        See `Specification`; `mixing` likewise.
    objective : Objective or str
        'tau_p', the fastest settings, or 'mu', the smallest peak of mu at `tau_p`.
    bounds, signs, demands, scenarios, spread, start, resolution, as_found
        See `Specification`.
    starts, seed, time_limit, certificate, model_tolerance, optimality_gap
        See `Specification`.
    progress : callable or None
        Called about ten times a second with a `Progress`; what it raises passes through.

    Returns
    -------
    Tuned
        Look at its `ok` first, or call its `raise_if_infeasible`.

    Raises
    ------
    UnsupportedPlantError
        The plant is open-loop unstable.
    InvalidInputError
        An argument of the wrong kind or out of range, by name.

    """
    if isinstance(plant, Specification):
        for name in ("uncertainty", *options) if uncertainty is not None else options:
            message = f"a specification is the whole task: give no {name} beside it"
            raise InvalidInputError(message, f"/{name}")
        specification = plant
    else:
        specification = _specification(plant, uncertainty, **options)
    return Tuned(specification, tuner.tune(specification, progress))


def _specification(
    plant: Plant,
    uncertainty: Uncertainty | None,
    *,
    max_peak: float = 2.0,
    offset: float = 0.0,
    tau_p: float | None = None,
    output_scale: Sequence[float] | None = None,
    controller: str = ControllerKind.PI,
    bounds: Bounds | None = None,
    **others: Any,  # noqa: ANN401 - the record checks them
) -> Specification:
    """Return the task; the record checks what it gets, values of enumerations included."""
    known = {each.name for each in fields(Specification)} - {
        "plant",
        "uncertainty",
        "performance",
        "kind",
    }
    for name in others:
        if name not in known:
            message = f"tune() has no option {name!r}"
            raise TypeError(message)
    return Specification(
        plant,
        uncertainty,  # type: ignore[arg-type]  # None is refused there, by name
        Performance(
            max_peak,
            offset,
            tau_p,
            None if output_scale is None else reals(output_scale, "/output_scale"),
        ),
        kind=controller,  # type: ignore[arg-type]  # a value becomes the member there
        bounds=Bounds() if bounds is None else bounds,
        **others,
    )
