"""What other kinds of controllers could do for the demand of a tuning: as JSON, and in words."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from service.schemas.encoding import encode
from service.schemas.full_controllers import full_controller_document
from service.wording import number
from solver.model.errors import InvalidInputError, UnsupportedPlantError

if TYPE_CHECKING:
    from collections.abc import Callable

    from service.schemas.tunings import TuningRequest
    from solver.limits.comparison import ControllerComparison, Entry

__all__ = ["NAMES", "SHORTEST", "alternatives_to_json", "unfinished", "with_limit"]

NAMES = {
    "identical_pi": "identical PI",
    "unlike_pi": "unlike PI",
    "unlike_pid": "PID",
    "unlike_pidf": "PIDF",
    "static_decoupling": "static decoupling, PI",
    "one_way_decoupling": "one-way decoupling, PI",
    "inverse": "plant's inverse",
    "mode_control": "mode control, PI",
    "pairs": "decoupled pairs, PI",
    "multivariable": "multivariable, built",
}
SYMBOLS = {"tau_p": "τP", "mu": "μ"}  # of what is made small
LARGEST_SHOWN = 20  # units up to which a full controller is written down

SHORTEST = 1e-3  # seconds: too few for anything but the lower bound
MOST_UNITS = 4  # one convex step of a larger matrix plant takes longer than a job may overrun


def with_limit(
    request: TuningRequest,
    document: dict[str, Any],
    check: Callable[[], bool | None] = lambda: None,
) -> dict[str, Any]:
    """Return the result of a tuning with the limit beside it, if the request asks for it.

    Parameters
    ----------
    request : TuningRequest
        What was asked.
    document : dict
        Its result.
    check : callable
        Called often; what it raises passes through. If it returns True, the comparison ends with
        what it has by then, as when the time is over.

    """
    if not request.search.limit:
        return document
    pairing = document.get("pairing")
    specification = request.build().arranged(None if pairing is None else tuple(pairing))
    if specification.plant.n > MOST_UNITS and not specification.plant.interchangeable:
        text = f"matrix plants above {MOST_UNITS} units take minutes: ask `mutune limit`"
        return {**document, "limit": _without("not_covered", f"No limit: {text}.")}
    # Compiled kernels are loaded where they are used.
    from solver.limits.comparison import compare_controllers  # noqa: PLC0415
    from solver.limits.ending import EnoughError  # noqa: PLC0415

    left = request.search.time_limit - float(document["search"]["elapsed_seconds"])

    def tick() -> None:
        if check():
            raise EnoughError

    warnings: list[str] = document.get("warnings") or []
    try:
        comparison = compare_controllers(
            replace(specification, time_limit=max(left, SHORTEST)), tick=tick
        )
        found = alternatives_to_json(comparison)
        warnings = [*warnings, *comparison.warnings]
    except (InvalidInputError, UnsupportedPlantError) as error:
        found = _without("not_covered", f"No limit: {error}.")
    return {**document, "limit": found, "warnings": warnings}


def unfinished() -> dict[str, Any]:
    """Return what stands for the comparison where it did not come to its end."""
    return _without("time_limit", "No limit: the time was over before one was found.")


def _without(status: str, verdict: str) -> dict[str, Any]:
    return {
        "status": status,
        "limit": None,
        "lower_bound": None,
        "alternatives": [],
        "verdict": verdict,
    }


def alternatives_to_json(comparison: ControllerComparison) -> dict[str, Any]:
    """Return the comparison as the JSON object that `Alternatives` describes."""
    limit, best = comparison.limit, comparison.best_loops
    reference = None if best is None else best.value
    document: dict[str, Any] = {
        "status": limit.status.value,
        "limit": encode(limit.value),
        "lower_bound": encode(limit.lower_bound),
        "alternatives": [_alternative(entry, reference) for entry in comparison.entries],
    }
    return {**document, "verdict": _verdict(document, limit.objective, limit.reason)}


def _alternative(entry: Entry, reference: float | None) -> dict[str, Any]:
    structure = entry.structure
    settings: list[dict[str, Any]] = []
    controller = None
    if structure is not None:
        names = ("acts_on", "gain", "integral_time")
        settings = [dict(zip(names, each, strict=True)) for each in structure.settings]
        whole = structure.controller
        if whole is not None and len(getattr(whole, "D", ())) <= LARGEST_SHOWN:
            controller = full_controller_document(whole)
    ratio = None if entry.value is None or reference is None else entry.value / reference
    return {
        "family": entry.family.value,
        "value": encode(entry.value),
        "ratio": ratio,
        "time_limit": entry.exhausted,
        "manual": encode(entry.manual),
        "guarantee": encode(entry.guarantee),
        "loops": encode(entry.loops),
        "settings": settings,
        "controller": controller,
    }


def _verdict(document: dict[str, Any], objective: str, reason: str | None) -> str:
    """Return the comparison in words, a line each, from the numbers that stand beside it."""
    values = {each["family"]: each["value"] for each in document["alternatives"]}
    loops = _listed(values, ("identical_pi", "unlike_pi", "unlike_pid", "unlike_pidf"))
    between = _listed(
        values, ("static_decoupling", "one_way_decoupling", "inverse", "mode_control", "pairs")
    )
    out_of_time = [each["family"] for each in document["alternatives"] if each["time_limit"]]
    within = " within the time" if out_of_time or not document["alternatives"] else ""
    lines = [
        f"Single loops: {SYMBOLS[objective]} = {loops}." if loops
        else f"Single loops: none were found{within} that meet the demand."
    ]  # fmt: skip
    if between:
        lines.append(f"In between: {between}.")
    bound = document["lower_bound"]["value"]
    below = f"; nothing linear can go below {number(bound)}" if bound else ""
    if document["limit"] is None:
        return "\n".join([*lines, f"Any controller: {reason or 'no limit was found'}{below}."])
    built = values.get("multivariable")
    reached = "none was built"
    if built:
        ratios = {each["family"]: each["ratio"] for each in document["alternatives"]}
        reached = f"{number(built)} as built" + _against(ratios["multivariable"], objective)
    lines.append(f"Multivariable controller: {reached}.")
    lines.append(f"Any controller, of any order: {number(document['limit'])} was found{below}.")
    return "\n".join(lines)


def _against(share: float | None, objective: str) -> str:
    """Say what a share of the best single loops' value means."""
    if share is None:
        return ""
    if objective == "mu":
        return f", {share:.0%} of the best single loops' peak"
    if share > 1 / 1.05:  # what rounds to 1.0 is nothing won
        return ", no faster than the best single loops"
    return f", {1 / share:.1f} times as fast as the best single loops"


def _listed(values: dict[str, float | None], families: tuple[str, ...]) -> str:
    """Return the values that there are, each with its name."""
    found = [f"{number(values[each])} ({NAMES[each]})" for each in families if values.get(each)]
    return ", ".join(found)
