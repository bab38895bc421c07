"""What other kinds of controllers could do for the demand of a tuning: as JSON, and in words."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from service.schemas.encoding import encode
from service.schemas.full_controllers import full_controller_document
from service.wording import number
from solver.model.errors import InvalidInputError, UnsupportedPlantError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from service.schemas.alternatives import Alternative
    from service.schemas.tunings import TuningRequest
    from solver.limits.comparison import ControllerComparison, Entry

__all__ = ["SHORTEST", "alternatives_to_json", "comparison_table", "unfinished", "with_limit"]

NAMES = {
    "identical_pi": "identical PI",
    "unlike_pi": "unlike PI",
    "unlike_pid": "PID",
    "unlike_pidf": "PIDF",
    "static_decoupling": "static decoupling",
    "one_way_decoupling": "one-way decoupling",
    "inverse": "plant's inverse",
    "mode_control": "mode control",
    "pairs": "decoupled pairs",
    "multivariable": "multivariable",
}
LOOPS = ("identical_pi", "unlike_pi", "unlike_pid", "unlike_pidf")
SYMBOLS = {"tau_p": "τP", "mu": "μ"}  # of what is made small
NOTHING_WON = 1 / 1.05  # of the best single loops' value: a factor that rounds to 1.0
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


def comparison_table(
    alternatives: Sequence[Alternative],
    objective: str,
    limit: float | None,
    lower_bound: float | None,
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heads and rows of a comparison: value, ratio, and what one loop in manual costs.

    Parameters
    ----------
    alternatives : sequence of Alternative
        The kinds of controllers.
    objective : str
        "tau_p" or "mu": what was made small.
    limit, lower_bound : float or None
        What was found over all of them, and what none can pass.

    """
    best = next((each for each in alternatives if each.ratio == 1), None)
    reference = None if best is None else best.value
    over = "" if best is None else f"over {best.title}"
    heads = "", SYMBOLS[objective], over, "μ, one in manual"
    rows: list[tuple[str, ...]] = [
        (each.title, _value(each), _ratio(each.value, reference), _manual(each))
        for each in alternatives
    ]
    if limit is not None:
        rows.append(("any controller", number(limit), _ratio(limit, reference), ""))
    if lower_bound:
        below = number(lower_bound), _ratio(lower_bound, reference), ""
        rows.append(("none below, proven", *below))
    return heads, rows


def _value(alternative: Alternative) -> str:
    if alternative.value is None:
        return "out of time" if alternative.time_limit else "none found"
    return number(alternative.value)


def _ratio(value: float | None, reference: float | None) -> str:
    return number(value / reference, 3) if value and reference else ""


def _manual(alternative: Alternative) -> str:
    """Return the peak of mu of the others while the worst unit is in manual."""
    if alternative.manual is None:
        return ""
    return number(alternative.manual.peak, 3) if alternative.manual.stable else "unstable"


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
    order = "" if entry.states is None else f", {entry.states} states"
    return {
        "family": entry.family.value,
        "title": NAMES[entry.family.value] + order,
        "value": encode(entry.value),
        "ratio": ratio,
        "time_limit": entry.exhausted,
        "states": entry.states,
        "manual": encode(entry.manual),
        "guarantee": encode(entry.guarantee),
        "loops": encode(entry.loops),
        "settings": settings,
        "controller": controller,
    }


def _verdict(document: dict[str, Any], objective: str, reason: str | None) -> str:
    """Return the comparison in words, a line each, from the numbers that stand beside it."""
    bound = document["lower_bound"]["value"]
    below = f"; nothing linear can go below {number(bound, 3)}" if bound else ""
    limit = document["limit"]
    nothing = limit is None and all(each["value"] is None for each in document["alternatives"])
    if nothing and document["status"] == "time_limit":
        return f"No time was left for other controllers: allow more (search.time_limit){below}."
    found = {each["family"]: each for each in document["alternatives"]}
    single = [found.pop(family) for family in LOOPS if family in found]
    built = found.pop("multivariable", None)
    out_of_time = any(each["time_limit"] for each in single) or not single
    values = [_told(each) for each in single if each["value"] is not None]
    within = " within the time" if out_of_time else ""
    loops = (
        f"Single loops reach {SYMBOLS[objective]} = {_listed(values)}"
        if values
        else f"No single loops were found{within} that meet the demand"
    )
    best = next((each for each in single if each["ratio"] == 1), None)
    lines = [f"{loops}{_multivariable(built, limit, best, objective)}."]
    between = [_told(each) for each in found.values() if each["value"] is not None]
    missing = [each["title"] for each in found.values() if each["value"] is None]
    if between:
        lines.append(f"In between: {_listed(between)}.")
    if missing:
        ended = any(each["time_limit"] for each in found.values())
        lines.append(f"None found{' within the time' if ended else ''}: {', '.join(missing)}.")
    if limit is None:
        return "\n".join([*lines, f"Any controller: {reason or 'no limit was found'}{below}."])
    lines.append(f"The best found of any order reaches {number(limit, 3)}{below}.")
    return "\n".join(lines)


def _multivariable(
    built: dict[str, Any] | None, limit: float | None, best: dict[str, Any] | None, objective: str
) -> str:
    """Say what a multivariable controller reaches: one that is built, or else that of the limit."""
    if built is not None and built["value"] is not None:
        value = built["value"]
        text = f"; a multivariable controller ({built['states']} states) reaches {number(value, 3)}"
    elif limit is not None:
        value = limit
        text = f"; a multivariable controller could reach {number(value, 3)} (none was built)"
    else:
        return ""
    if best is None:
        return text
    share = value / best["value"]
    if built is None and share > NOTHING_WON:
        return "; no multivariable controller was found that does better"
    if objective == "mu":
        return f"{text}, {share:.0%} of {best['title']}'s"
    if share > NOTHING_WON:
        return f"{text}, no faster than {best['title']}"
    return f"{text}, {1 / share:.1f} times as fast as {best['title']}"


def _told(alternative: dict[str, Any]) -> str:
    return f"{number(alternative['value'], 3)} ({alternative['title']})"


def _listed(values: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(values[:-1]), values[-1]]))
