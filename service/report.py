"""A tuning as one HTML file that opens without network: to read, print, sign and file.

The file holds Plotly's script and the figures' data; its content policy runs these scripts, by
their digests, and nothing else. It is light in every scheme: it stands for paper.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
from datetime import datetime
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from service import mathml
from service.figures.answers import plain
from service.figures.style import Theme, template
from service.figures.tuning import tuning_figures
from service.schemas import canonical
from service.tuned import Tuned
from service.wording import forms, number
from solver.margins import Margins, loop_margins
from solver.plants import MatrixPlant

__all__ = ["POLICY", "report_html"]

_PEAKS = (
    ("robust performance", "robust_performance"),
    ("robust stability", "robust_stability"),
    ("nominal performance", "nominal_performance"),
)
_OBJECTIVES = {"tau_p": "closed-loop time constant τP", "mu": "peak of μ"}


def report_html(tuned: Tuned, made_at: datetime, job: str | None = None) -> str:
    """Return the report of a tuning as the text of an HTML file.

    Parameters
    ----------
    tuned : Tuned
        Request and result; without settings the report says why.
    made_at : datetime
        When the report is made, UTC.
    job : str or None
        Identifier of the tuning in the service that made it.

    """
    drawn = tuning_figures(tuned)
    result = tuned.result
    drawing = {
        "template": template(Theme.LIGHT).to_plotly_json(),
        "figures": {name: plain(figure) for name, figure in drawn.figures.items()},
    }
    request = canonical(tuned.request)
    archived = request + result.model_dump_json()
    return _environment().get_template("report.html").render(
        title=f"Loop settings for {tuned.plant.n} unit{'s' * (tuned.plant.n != 1)}",
        headline=_headline(tuned),
        objective=_OBJECTIVES[result.objective],
        tuned=tuned,
        made_at=made_at,
        job=job,
        version=version("mutune"),
        warnings=result.warnings,
        forms=forms([setting.controller for setting in tuned.settings]) if tuned.settings else (),
        elements=_elements(tuned),
        peaks=_peaks(tuned),
        certificate=result.certificate,
        certificate_link=_data_url(json.dumps(result.certificate)),
        margins=_margins(tuned),
        figures={name: figure.layout.meta for name, figure in drawn.figures.items()},
        omitted=drawn.omitted,
        request=json.dumps(json.loads(request), indent=2),
        digest=hashlib.sha256(archived.encode()).hexdigest(),
        drawing=_inert(drawing),
        plotly=_plotly(),
        script=_script(),
        style=_source("report.css"),
        policy=POLICY,
    )  # fmt: skip


def _headline(tuned: Tuned) -> str:
    result, unit = tuned.result, tuned.unit
    if not result.loops:
        where = f" (at ω = {number(result.omega)} rad/{unit})" if result.omega else ""
        return f"No settings: {result.reason or 'none were found'}{where}."
    found = f"Closed-loop time constant τP = {number(result.tau_p)} {unit}"
    if result.objective == "mu" and result.peaks is not None:
        peak = result.peaks.robust_performance.value
        found = f"Peak of μ = {number(peak)} at τP = {number(result.tau_p)} {unit}"
    ended = "" if result.status == "optimal" else ", the best up to the time limit"
    return f"{found}{ended}."


def _elements(tuned: Tuned) -> list[list[Markup]]:
    plant = tuned.plant
    if not isinstance(plant, MatrixPlant):
        return []
    return [[mathml.transfer_function(each) for each in row] for row in plant.elements_by_row]


def _peaks(tuned: Tuned) -> list[tuple[str, str, str]]:
    peaks = tuned.result.peaks
    if peaks is None:
        return []
    found = [(name, getattr(peaks, field)) for name, field in _PEAKS]
    return [
        (name, "-" if peak.value is None else f"{peak.value:.5f}", _digits(peak.omega))
        for name, peak in found
    ]


def _margins(tuned: Tuned) -> list[tuple[str, ...]]:
    if not tuned.settings:
        return []
    rows: list[tuple[str, ...]] = []
    labels = {setting.units[0]: setting.label for setting in tuned.settings}
    for row in loop_margins(tuned.plant, tuned.loops):
        label = labels.get(row.units[0], f"loop {row.units[0] + 1}")
        for name, margins in (("alone", row.alone), ("together", row.together)):
            rows.append((f"{label}, {name}", *_quoted(margins)))
    return rows


def _quoted(margins: Margins | None) -> tuple[str, ...]:
    if margins is None:
        return ("unstable", *["-"] * 5)
    factors = (margins.gain_decrease, margins.gain_increase)
    return (
        " / ".join(_digits(factor, 3) for factor in factors),
        _digits(margins.phase_margin, 3) + "°",
        _digits(margins.delay_margin, 3),
        _digits(margins.sensitivity.value, 3),
        _digits(margins.complementary_sensitivity.value, 3),
        _digits(margins.bandwidth, 3),
    )


def _digits(value: float | None, count: int = 5) -> str:
    if value is None:
        return "-"
    return f"{value:.{count}g}" if math.isfinite(value) else "∞"


def _inert(document: dict[str, Any]) -> Markup:
    """Return JSON that no parser of HTML can take for a tag."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c"))  # noqa: S704 - no tag left


def _data_url(text: str) -> str:
    return "data:application/json;base64," + base64.b64encode(text.encode()).decode()


def _source(name: str) -> Markup:
    text = (files("service") / "templates" / name).read_text("utf-8")
    return Markup(text)  # noqa: S704 - our own file


@cache
def _script() -> Markup:
    return _source("report.js")


@cache
def _plotly() -> Markup:
    text = (files("plotly") / "package_data" / "plotly.min.js").read_text("utf-8")
    return Markup(text)  # noqa: S704 - Plotly's script, which holds no closing tag


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("service"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["digits"] = _digits
    environment.filters["mathml"] = mathml.transfer_function
    environment.globals["zip"] = zip
    return environment


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
