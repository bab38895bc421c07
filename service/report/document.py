"""A tuning as one HTML file that opens without network: to read, print, sign and file.

The file holds Plotly's script and the figures' data; its content policy runs these scripts, by
their digests, and nothing else. It is light in every scheme: it stands for paper.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from markupsafe import Markup

from service.beyond import comparison_table
from service.figures.document import plain
from service.figures.style import Theme, template
from service.figures.tuning import tuning_figures
from service.model_wording import tolerance_lines
from service.report import mathml
from service.report.rendering import render, source
from service.report.typed import typed_in_per_cent
from service.schemas import canonical
from service.settings_wording import range_rows, resolution_text, together_text, tolerance_text
from service.sheet.document import loop_sheet
from service.sheet.naming import loops_name, with_unit
from service.tuned import RequestedTuning
from service.wording import (
    OBJECTIVES,
    demand_rows,
    forms,
    guarantee_text,
    headline,
    in_symbols,
    number,
    optimality_text,
    peak_rows,
    spread_lines,
)
from solver import __version__
from solver.model.controllers import Controller
from solver.model.loop_names import loops_text
from solver.model.measured import MeasuredPlant
from solver.model.neighbours import NeighbourPlant
from solver.model.plants import Plant
from solver.model.transfer_function import TransferFunction
from solver.robustness.margins import Margins, loop_margins

__all__ = ["POLICY", "report_html"]

_SETTINGS = ("gain", "integral_time", "derivative_time", "filter_time")
_TAGS = 8  # of them that fit at the top of a page


def report_html(tuned: RequestedTuning, made_at: datetime, job: str | None = None) -> str:
    """Return the report of a tuning as the text of an HTML file.

    Parameters
    ----------
    tuned : RequestedTuning
        Request and result; without settings the report says why.
    made_at : datetime
        When the report is made, UTC.
    job : str or None
        Identifier of the tuning in the service that made it.

    """
    drawn = tuning_figures(tuned)
    sheet = loop_sheet(tuned)
    figures = {**sheet.figures, **drawn.figures}
    result = tuned.result
    drawing = {
        "template": template(Theme.LIGHT).to_plotly_json(),
        "figures": {name: plain(figure) for name, figure in figures.items()},
    }
    request = canonical(tuned.request)
    archived = f'{{"request":{request},"result":{result.model_dump_json()}}}'
    digest = hashlib.sha256(archived.encode()).hexdigest()
    warnings = [in_symbols(text, tuned.unit) for text in result.warnings]
    names = {setting.units[0]: loops_name(tuned, setting.units) for setting in tuned.settings}
    units = f"{tuned.plant.n} unit{'s' * (tuned.plant.n != 1)}"
    title = tuned.request.title or f"Loop settings for {units}"
    return render(
        "report.html",
        title=title,
        feet=_feet(title, tuned, digest),
        names=list(names.values()),
        behaviour=sheet.behaviour,
        moves_by=with_unit(tuned, "valve moves by", "input"),
        error=with_unit(tuned, "error after load", "output"),
        risks=sheet.risks,
        headline=headline(result, tuned.unit),
        objective=OBJECTIVES[result.objective],
        tuned=tuned,
        made_at=made_at,
        job=job,
        version=__version__,
        # Those of a result with settings are among the risks.
        warnings=() if tuned.settings else warnings,
        forms=forms([setting.controller for setting in tuned.settings]) if tuned.settings else (),
        elements=_elements(tuned),
        weights=_weights(tuned),
        typed=typed_in_per_cent(tuned),
        neighbours=[
            (place.words, mathml.transfer_function(place.element)) for place in tuned.plant.places
        ]
        if isinstance(tuned.plant, NeighbourPlant)
        else [],
        measured=isinstance(tuned.plant, MeasuredPlant),
        peaks=peak_rows(result.peaks),
        certificate=result.certificate,
        proven=guarantee_text(result.guarantee),
        optimality=optimality_text(result),
        model_tolerance=[line.text for line in tolerance_lines(result.model_tolerance)],
        certificate_link=_data_url(json.dumps(result.certificate)),
        demands=demand_rows(result),
        others=_others(tuned),
        asked=_asked(tuned),
        scenarios=_scenarios(tuned),
        spread=spread_lines(result),
        margins=_margins(tuned.plant, tuned.loops, names),
        as_found=_as_found(tuned),
        resolution=resolution_text(result),
        ranges=range_rows(result, list(names.values()), tuned.unit),
        tolerance=tolerance_text(near) if (near := result.settings_tolerance) else None,
        together=together_text(result, list(names.values())),
        figures={name: figure.layout.meta for name, figure in figures.items()},
        omitted={**sheet.omitted, **drawn.omitted},
        request=json.dumps(json.loads(request), indent=2),
        archive_link=_data_url(archived),
        digest=digest,
        drawing=_inert(drawing),
        plotly=_plotly(),
        script=_script(),
        style=source("report.css"),
        policy=POLICY,
    )


def _others(tuned: RequestedTuning) -> dict[str, Any] | None:
    """Return what other kinds of controllers could do: sentences, heads and rows of a table."""
    found = tuned.result.limit
    if found is None:
        return None
    bound = None if found.lower_bound is None else found.lower_bound.value
    heads, rows = comparison_table(found.alternatives, tuned.result.objective, found.limit, bound)
    heads = tuple(f"{head}, {tuned.unit}" if head == "τP" else head for head in heads)
    verdict = [in_symbols(line, tuned.unit) for line in found.verdict.splitlines()]
    there = any(each.value is not None for each in found.alternatives)
    return {"verdict": verdict, "heads": heads, "rows": rows if there else []}


def _feet(title: str, tuned: RequestedTuning, digest: str) -> Markup:
    """Return the style that puts title, tags, digest and page number on every printed page."""
    tags = [each.tag for each in tuned.request.instruments or () if each.tag]
    named = f"{title}: {', '.join(tags[:_TAGS])}{', …' * (len(tags) > _TAGS)}" if tags else title
    boxes = {
        "top-left": _quoted_text(named),
        "bottom-left": _quoted_text(f"mutune {__version__}, SHA-256 {digest[:16]}"),
        "bottom-right": '"page " counter(page) " of " counter(pages)',
    }
    rules = " ".join(f"@{place} {{ content: {text}; }}" for place, text in boxes.items())
    return Markup(f"@page {{ {rules} }}")  # noqa: S704 - every text in it is quoted for CSS


def _quoted_text(text: str) -> str:
    """Return a CSS string in which nothing is left that could end it, or a tag."""
    plain_text = "".join(
        each if each.isalnum() or each in " .,:-_/" else f"\\{ord(each):06x}" for each in text
    )
    return f'"{plain_text}"'


def _elements(tuned: RequestedTuning) -> list[list[Markup]]:
    plant = tuned.plant
    if plant.interchangeable or isinstance(plant, MeasuredPlant | NeighbourPlant):
        return []
    return [[mathml.transfer_function(each) for each in row] for row in plant.rows]


def _weights(tuned: RequestedTuning) -> tuple[TransferFunction, ...]:
    """Return the weight of all inputs, or that of each."""
    weight = tuned.specification.uncertainty.weight
    return weight if isinstance(weight, tuple) else (weight,)


def _margins(
    plant: Plant, loops: Sequence[Controller], labels: Mapping[int, str] = MappingProxyType({})
) -> list[tuple[str, ...]]:
    """Return the margins of each kind of loop, `labels` being names by its first unit."""
    if not loops or isinstance(plant, MeasuredPlant | NeighbourPlant):
        return []
    rows: list[tuple[str, ...]] = []
    for row in loop_margins(plant, loops):
        label = labels.get(row.units[0], loops_text(row.units))
        for name, margins in (("alone", row.alone), ("together", row.together)):
            rows.append((f"{label}, {name}", *_quoted(margins)))
    return rows


def _as_found(tuned: RequestedTuning) -> dict[str, Any] | None:
    """Return what the report says of today's settings."""
    today = tuned.result.as_found
    if today is None:
        return None
    labels = {units[0]: loops_name(tuned, units) for _, units in _alike(tuned.as_found)}
    return {
        "tau_p": today.tau_p,
        "reason": today.reason and in_symbols(today.reason, tuned.unit),
        "peaks": peak_rows(today.peaks),
        "margins": _margins(tuned.plant, tuned.as_found, labels),
        "settings": [
            (loops_name(tuned, units), *(number(getattr(loop, name)) for name in _SETTINGS))
            for loop, units in _alike(tuned.as_found)
        ],
    }


def _alike(loops: Sequence[Controller]) -> list[tuple[Controller, list[int]]]:
    found: dict[Controller, list[int]] = {}
    for unit, loop in enumerate(loops):
        found.setdefault(loop, []).append(unit)
    return list(found.items())


def _asked(tuned: RequestedTuning) -> list[tuple[str, str]]:
    """Return what else is asked of the loops, in words: demands, scan time, pairing."""
    found = [
        (name.replace("_", " "), number(limit) if isinstance(limit, float) else str(limit))
        for name, limit in tuned.request.demands
        if limit not in {None, "none"}
    ]
    found = [(name, limit.replace("_", " ")) for name, limit in found]
    if tuned.request.controller.scan_time:
        scan = f"{number(tuned.request.controller.scan_time)} {tuned.unit}"
        found.append(("scan time", f"{scan}, 3/2 of it as dead time in every element of the plant"))
    if tuned.result.pairing is not None:
        inputs = ", ".join(str(unit + 1) for unit in tuned.result.pairing)
        found.append(("input of outputs 1, 2, …", inputs))
    return found


def _scenarios(tuned: RequestedTuning) -> list[tuple[str, ...]]:
    return [
        (
            each.name,
            loops_name(tuned, each.in_service),
            str(each.sets),
            number(each.tau_p),
            number(each.peaks.robust_performance.value),
            guarantee_text(each.guarantee) or "",
        )
        for each in tuned.result.scenarios
    ]


def _quoted(margins: Margins | None) -> tuple[str, ...]:
    if margins is None:
        return ("unstable", *["-"] * 5)
    factors = (margins.gain_decrease, margins.gain_increase)
    return (
        " / ".join(number(factor, 3) for factor in factors),
        number(margins.phase_margin, 3) + "°",
        number(margins.delay_margin, 3),
        number(margins.sensitivity.value, 3),
        number(margins.complementary_sensitivity.value, 3),
        number(margins.bandwidth, 3),
    )


def _inert(document: dict[str, Any]) -> Markup:
    """Return JSON that no parser of HTML can take for a tag."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c"))  # noqa: S704 - no tag left


def _data_url(text: str) -> str:
    return "data:application/json;base64," + base64.b64encode(text.encode()).decode()


@cache
def _script() -> Markup:
    return source("report.js")


@cache
def _plotly() -> Markup:
    text = (files("plotly") / "package_data" / "plotly.min.js").read_text("utf-8")
    return Markup(text)  # noqa: S704 - Plotly's script, which holds no closing tag


def _policy() -> str:
    digests = [
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        for script in (_plotly(), _script())
    ]
    scripts = " ".join(f"'sha256-{digest}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )


POLICY = _policy()
