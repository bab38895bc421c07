"""The report: one file that opens without network, holds everything, and runs nothing else."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path

import pytest
from archived import archived, infeasible, published
from playwright.sync_api import sync_playwright
from zoo import COLUMN

from service.beyond import alternatives_to_json, unfinished
from service.cli.tuning import tune_file
from service.report.document import report_html
from service.schemas import parse_tuning_request
from service.schemas.alternatives import Alternatives
from service.tuned import RequestedTuning
from solver.certificate.reading import read_certificate
from solver.certificate.search import prove
from solver.certificate.verify import verify
from solver.limits.comparison import ControllerComparison, Entry, Family
from solver.limits.lower_bound import Limitation, LowerBound
from solver.limits.manual import OneInManual
from solver.limits.record import Limit, LimitStatus
from solver.model.controllers import Controller
from solver.model.weights import Performance, Uncertainty
from solver.tuning.tuner import tune

MADE = datetime(2026, 1, 31, 12, 0, tzinfo=UTC)


class Page(HTMLParser):
    """What a browser would read: elements, texts, scripts."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.scripts: list[str] = []
        self._inside = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        self.elements.append((tag, dict(attrs)))
        self._inside = tag
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, _tag: str) -> None:
        """Leave an element."""
        self._inside = ""

    def handle_data(self, data: str) -> None:
        """Note a text."""
        if self._inside == "script":
            self.scripts[-1] += data
        elif self._inside != "style":
            self.text.append(data)

    @property
    def words(self) -> str:
        """Return all text with single spaces."""
        return " ".join(" ".join(self.text).split())


@pytest.fixture(scope="module")
def tuned() -> RequestedTuning:
    """Return the published settings as a tuning."""
    return published(warnings=("group 0: the gain is on its upper bound",))


@pytest.fixture(scope="module")
def html(tuned: RequestedTuning) -> str:
    """Return their report."""
    return report_html(tuned, MADE, "9f1b0d3c5a7e4c0d8b6a2f4e1c3d5b7a")


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    """Return it parsed."""
    return Page(html)


def test_report_says_what_was_found_when_and_by_what(page: Page) -> None:
    """Headline, date, version and the tuning's identifier stand at the top."""
    assert "Closed-loop time constant τP = 19 min." in page.words
    assert "Made 2026-01-31 12:00 UTC by mutune" in page.words
    assert "9f1b0d3c5a7e4c0d8b6a2f4e1c3d5b7a" in page.words


def test_report_has_the_settings_in_three_forms(page: Page) -> None:
    """The same controllers in cascade, ideal and parallel form."""
    for form in ("Cascade form", "Ideal form", "Parallel form"):
        assert form in page.words
    assert "loop 1 46.3 101" in page.words
    assert "loop 2 22.8 7.2381" in page.words  # K_p, and K_i = 22.8/3.15


def test_report_has_peaks_margins_and_warnings(page: Page) -> None:
    """What an engineer checks before signing."""
    assert "robust performance 1.00035 0.031436" in page.words
    assert re.search(r"loop 2, together .*° ", page.words)
    assert "Careful: Group 0: the gain is on its upper bound" in page.words
    for role in ("prepared", "checked", "approved"):
        assert role in page.words


def test_report_loads_nothing(page: Page) -> None:
    """Every reference is within the file."""
    for tag, attributes in page.elements:
        for name in ("src", "href", "srcset", "action", "data"):
            value = attributes.get(name)
            assert value is None or value.startswith("data:"), (tag, name, value)


def test_policy_permits_exactly_the_scripts_inside(page: Page) -> None:
    """The digests of the policy are those of the two scripts; no other source is permitted."""
    policies = [a["content"] for t, a in page.elements if a.get("http-equiv")]
    (policy,) = policies
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    data, *scripts = page.scripts
    digests = {
        base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts
    }
    assert set(re.findall(r"'sha256-([^']+)'", policy)) == digests
    assert "figures" in json.loads(data)


def test_every_figure_has_its_place_and_alternative_text(page: Page) -> None:
    """Each figure of the data has an element, with its title and description as text."""
    figures = json.loads(page.scripts[0])["figures"]
    assert len(figures) == 10
    places = {a["id"]: a for t, a in page.elements if t == "div" and "id" in a}
    assert set(places) == {f"figure-{name}" for name in figures}
    for name, figure in figures.items():
        assert places[f"figure-{name}"]["role"] == "img"
        assert figure["layout"]["meta"]["description"] in places[f"figure-{name}"]["aria-label"]


def test_request_and_result_are_in_the_file(page: Page, tuned: RequestedTuning) -> None:
    """The archived JSON reads back as the same tuning, and has the digest that is printed."""
    (link,) = [a["href"] for t, a in page.elements if a.get("download") == "tuning.json"]
    text = base64.b64decode(link.partition(",")[2])
    document = json.loads(text)
    again = RequestedTuning.from_json(
        json.dumps(document["request"]), json.dumps(document["result"])
    )
    assert (again.request, again.result) == (tuned.request, tuned.result)
    assert hashlib.sha256(text).hexdigest() in page.words


@pytest.mark.parametrize("attack", ["<script>alert(1)</script>", "</script><img src=x>", '"><b>'])
def test_what_users_wrote_stays_text(tuned: RequestedTuning, attack: str) -> None:
    """Neither a unit nor a warning becomes an element or ends the block of data."""
    result = tuned.result.model_copy(update={"warnings": [attack]})
    page = Page(report_html(replace(tuned, result=result, unit=attack), MADE, attack))
    assert len(page.scripts) == 3
    assert not {"img", "b"} & {tag for tag, _ in page.elements}
    assert " ".join(attack.split()) in page.words
    json.loads(page.scripts[0])


def test_report_without_settings_says_why() -> None:
    """An infeasible tuning has a report too, without scripts."""
    page = Page(report_html(infeasible(), MADE))
    assert "No settings: the static gain is singular (at ω = 0.001 rad/time unit)." in page.words
    assert page.scripts == []


def test_matrix_plants_and_missing_forms_are_shown() -> None:
    """A matrix is set as such, and a form that does not exist says so instead of values."""
    # tau_I below a tenth of tau_D: no ideal form.
    loops = (Controller(0.5, 0.5, 8.0), Controller(1.0, 60.0, 1.0))
    tuned = archived(
        COLUMN,
        loops,
        Uncertainty.from_error(0.2, 1),
        Performance(tau_p=40),
        peaks=None,
        curves=None,
    )
    page = Page(report_html(tuned, MADE))
    assert sum(tag == "mfrac" for tag, _ in page.elements) == 4 + 1  # and the weight
    assert "no ideal form" in page.words
    assert "Not drawn: mu, because the result has no curves." in page.words


def test_values_to_type_are_in_per_cent_where_the_spans_are_known() -> None:
    """Gains in per cent of span stand first, and are limited so; what else is asked is told."""
    spans = {"output_span": 50.0, "input_span": 10.0}
    request = parse_tuning_request(
        json.dumps(
            {
                "time_unit": "min",
                "plant": {"kind": "first_order", "n": 2, "gain": 1, "time_constant": 100,
                          "interaction": 0.949},
                "uncertainty": {"epsilon": [0.2, 0.1], "theta": 1},
                "instruments": [{"tag": tag, **spans} for tag in ("TIC-1", "TIC-2")],
                "demands": {"max_controller_gain": 200},
                "search": {"starts": 2}, "certificate": "none", "model_tolerance": False,
                "scenarios": [{"name": "one out", "in_service": [0]}],
            }
        )
    )  # fmt: skip
    tuned = RequestedTuning.of(request, tune(request.build()), "min")
    page = Page(report_html(tuned, MADE))
    assert "In per cent of the spans: K*(1 + 1/(Ti*s) + Td*s/(1 + Tf*Td*s)), Td = 0" in page.words
    typed = tuned.loops[0].to_ideal()
    row = f"TIC-1 reverse {5 * typed.gain:.4g} {typed.integral_time:.4g}"
    assert row in page.words
    assert "TIC-2, integral time" in page.words
    assert "of input 2:" in page.words
    assert max(loop.gain for loop in tuned.loops) == pytest.approx(200 / 5, rel=1e-6)
    assert "max controller gain 200 200 binds" in page.words
    assert "max controller gain 200 objective" in page.words
    assert "one out TIC-1 1" in page.words


def test_other_kinds_of_controllers_stand_in_a_table(tuned: RequestedTuning) -> None:
    """Sentence and table with the unit of time; where no time was left, the sentence alone."""
    limit = Limit(LimitStatus.FOUND, "tau_p", 4.25, LowerBound(0.62, 1j, Limitation.UNCERTAINTY))
    manual = OneInManual(0, stable=True, peak=1.33)
    entries = (
        Entry(Family.UNLIKE_PI, 18.4, manual=manual),
        Entry(Family.MULTIVARIABLE, 4.46, states=38),
    )
    document = alternatives_to_json(ControllerComparison(entries, limit))
    asked = tuned.request.model_copy(update={"time_unit": "min"})
    found = tuned.result.model_copy(update={"limit": Alternatives.model_validate(document)})
    page = Page(report_html(replace(tuned, request=asked, result=found, unit="min"), MADE))
    assert "Single loops reach τP = 18.4 min (unlike PI); a multivariable controller" in page.words
    assert "τP, min over unlike PI μ, one in manual unlike PI 18.4 1 1.33" in page.words
    assert "multivariable, 38 states 4.46 0.242" in page.words
    found = tuned.result.model_copy(update={"limit": Alternatives.model_validate(unfinished())})
    page = Page(report_html(replace(tuned, result=found), MADE))
    assert "the time was over" in page.words
    assert "one in manual" not in page.words


def test_the_certificate_is_in_the_file(tuned: RequestedTuning) -> None:
    """The proof can be taken out of the report and verified."""
    certificate, _ = prove(
        tuned.plant, tuned.uncertainty, tuned.performance, tuned.loops, level=1.001
    )
    assert certificate is not None
    result = tuned.result.model_copy(update={"certificate": certificate.to_document()})
    page = Page(report_html(replace(tuned, result=result), MADE))
    (link,) = [a["href"] for t, a in page.elements if a.get("download") == "certificate.json"]
    text = base64.b64decode(link.partition(",")[2])
    assert verify(text).ok
    assert read_certificate(text).claim.gamma == 1.001
    assert "μ ≤ 1.001 is proven at every frequency" in page.words


def test_figures_are_drawn_in_a_browser_without_network(html: str, tmp_path: Path) -> None:
    """Opened from disk, offline, every figure is drawn and nothing complains."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("needs Chromium")
    file = tmp_path / "report.html"
    file.write_text(html, "utf-8")
    complaints: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium)
        context = browser.new_context(offline=True)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(file.as_uri())
        drawn = page.locator(".plot:has(g.trace)").count()
        browser.close()
    assert complaints == []
    assert drawn == 10


def test_command_line_writes_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`mutune tune --report FILE` writes it beside the output; JSON on stdout stays JSON."""
    request = tmp_path / "request.json"
    document = published().request.model_dump(mode="json") | {"search": {"starts": 1}}
    request.write_text(json.dumps(document), "utf-8")
    report = tmp_path / "report.html"
    assert tune_file(request, as_json=True, report=report) == 0
    found = json.loads(capsys.readouterr().out)["tau_p"]
    assert f"τP = {found:.5g} time units." in report.read_text("utf-8")
