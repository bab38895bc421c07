"""The other views: history, comparison, analyses, the key, and what the page weighs."""

import json
import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect
from running import MUTUNE, Service
from watching import ROOT, Watched

STATIC = ROOT / "service" / "static"
DOCUMENT = json.loads((ROOT / "openapi" / "openapi.json").read_text(encoding="utf-8"))
ANALYSES = [
    path.removeprefix("/v1/")
    for path, operations in DOCUMENT["paths"].items()
    if path.count("/") == 2
    and "analyses" in operations.get("post", {}).get("tags", [])
    # A record comes from a file; the data of equipment have names that no form knows; a tuning
    # asks for its limit itself, and sliders tune beside known settings.
    and path not in {"/v1/identifications", "/v1/physical-models", "/v1/limits", "/v1/retunings"}
]
EXAMPLE = json.loads((ROOT / "examples" / "parallel_reactors.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def tuned(service: Service) -> tuple[str, str]:
    """Return the ids of two finished tunings, of identical and of independent settings."""
    ids = []
    for arrangement in ("identical", "independent"):
        request = {**EXAMPLE, "controller": {"kind": "PI", "arrangement": arrangement}}
        if arrangement == "identical":
            request["search"] = {"optimality_gap": True}
        job = httpx.post(
            f"{service.url}/v1/tunings",
            json=request,
            headers={"Prefer": "wait=60"},
            timeout=90,
        ).json()
        assert job["status"] == "succeeded"
        ids.append(job["id"])
    return ids[0], ids[1]


def test_history_leads_to_a_comparison(watched: Watched, tuned: tuple[str, str]) -> None:
    """Two tunings of the history are put side by side, with what differs between their requests."""
    page = watched.page
    watched.go("#/tunings")
    for job_id in tuned:
        page.locator(f"tr:has([href$='{job_id}'])").get_by_role("checkbox").check()
    watched.inspect("history")
    page.get_by_role("button", name="Compare the chosen").click()
    results = page.get_by_role("row", name="Time constant")
    expect(page.get_by_role("columnheader", name="B: Two parallel reactors")).to_be_visible()
    expect(results).to_contain_text("25.77")
    expect(results).to_contain_text("18.4")
    expect(page.get_by_role("row", name="Arrangement")).to_contain_text("identical")
    watched.wait_for_figures()
    watched.inspect("compare")


def test_what_was_tuned_is_found_by_its_words(watched: Watched, tuned: tuple[str, str]) -> None:
    """The history is searched by title, tag and id."""
    page = watched.page
    watched.go("#/tunings")
    page.get_by_label("Find").fill(f"identical {tuned[0][:8]}")
    expect(page.locator("tbody tr")).to_have_count(1)
    page.get_by_label("Find").fill("nobody called it this")
    expect(page.get_by_text("None of these has such words.")).to_be_visible()


def test_a_tuning_is_renamed_and_deleted(watched: Watched, service: Service) -> None:
    """A name of this browser finds a tuning; what is deleted is gone from the service too."""
    job = httpx.post(
        f"{service.url}/v1/tunings",
        json={**EXAMPLE, "title": "To be renamed"},
        headers={"Prefer": "wait=60"},
        timeout=90,
    ).json()
    page = watched.page
    watched.go("#/tunings")
    page.get_by_role("button", name="Rename To be renamed").click()
    page.get_by_label("New name of To be renamed").fill("Zebra")
    page.keyboard.press("Enter")
    page.get_by_label("Find").fill("zebra")
    expect(page.locator("tbody tr")).to_have_count(1)
    page.get_by_role("button", name="Delete Zebra").click()
    watched.inspect("history-delete")
    page.get_by_role("button", name="Delete for ever Zebra").click()
    expect(page.locator("tbody tr")).to_have_count(0)
    assert httpx.get(f"{service.url}/v1/tunings/{job['id']}").status_code == 404


def test_runs_in_minutes_and_seconds_are_compared(watched: Watched, service: Service) -> None:
    """The same plant in two units has the same numbers and equal requests, in the first's unit."""
    ids = []
    for unit, factor in (("min", 1), ("s", 60)):
        plant = {**EXAMPLE["plant"], "time_constant": 100 * factor}
        uncertainty = {"epsilon": 0.2, "theta": factor}
        request = {**EXAMPLE, "plant": plant, "uncertainty": uncertainty, "time_unit": unit}
        answer = httpx.post(
            f"{service.url}/v1/tunings",
            json={**request, "controller": {"arrangement": "identical"}},
            headers={"Prefer": "wait=60"},
            timeout=90,
        )
        ids.append(answer.json()["id"])
    page = watched.page
    watched.go(f"#/compare?ids={','.join(ids)}")
    expect(page.get_by_text("Times are in min.")).to_be_visible()
    expect(page.get_by_text("The requests are the same.")).to_be_visible()
    found = page.get_by_role("row", name="Time constant").locator("td")
    expect(found).to_have_text(["25.77", "25.77"])


def test_a_comparison_stands_without_the_responses_of_one(
    watched: Watched, tuned: tuple[str, str]
) -> None:
    """Where a sheet takes too long, tables and the curves of the others are there all the same."""
    watched.permit("status of 503")
    page = watched.page
    problem = {"title": "The analysis took too long", "status": 503}
    page.route(
        f"**/{tuned[0]}/sheet*",
        lambda route: route.fulfill(
            status=503, content_type="application/problem+json", body=json.dumps(problem)
        ),
    )
    watched.go(f"#/compare?ids={','.join(tuned)}")
    expect(page.get_by_text("Without the responses of A")).to_be_visible()
    expect(page.get_by_role("row", name="Time constant")).to_contain_text("25.77")
    expect(page.locator("[data-figure=set_point]")).to_contain_text("B: loop 1")


def test_times_are_compared_in_one_unit(watched: Watched) -> None:
    """Hours and seconds of the same thing are equal; units that nobody knows are not converted."""
    watched.go("#/")
    found = watched.page.evaluate(
        """async () => {
            const { src } = document.querySelector("script[type=module]");
            const units = src.replace("main.js", "units.js");
            const { rescaled, unitsIn } = await import(units);
            const hours = {
                plant: { time_constant: 2, gain: 3, process: { num: [4], den: [5, 6, 1] } },
                uncertainty: { theta: [1, 0.5] }, search: { time_limit: 60 },
                measured: { omega: [7200] }, space: { A: [[-3600, 7200]], C: [[1, 0]] },
                as_found: { proportional_gain: 2, integral_gain: 720, derivative_gain: 3 },
                spread: { dead_time: 0.3, time_constant: 0.2 }, resolution: { time: 0.5 } };
            return [unitsIn("h", "s"), unitsIn("min", "weeks"), unitsIn("weeks", "weeks"),
                    rescaled(hours, unitsIn("h", "s"))];
        }"""
    )
    assert found[0] == 3600
    assert math.isnan(found[1])
    assert found[2] == 1
    assert found[3] == {
        "plant": {
            "time_constant": 7200,
            "gain": 3,
            "process": {"num": [4], "den": [5 * 3600**2, 6 * 3600, 1]},
        },
        "uncertainty": {"theta": [3600, 1800]},
        "search": {"time_limit": 60},
        "measured": {"omega": [2]},
        "space": {"A": [[-1, 2]], "C": [[1, 0]]},
        "as_found": {"proportional_gain": 2, "integral_gain": 0.2, "derivative_gain": 10800},
        "spread": {"dead_time": 0.3, "time_constant": 0.2},
        "resolution": {"time": 1800},
    }


def test_texts_count_loops_from_one(watched: Watched) -> None:
    """What the API counts from 0 people count from 1; a time that begins with 0 stays."""
    watched.go("#/")
    found = watched.page.evaluate(
        """async () => {
            const { src } = document.querySelector("script[type=module]");
            const { loopsOf, plain } = await import(src.replace("main.js", "format.js"));
            const { tagged, taggedCell } = await import(src.replace("main.js", "tags.js"));
            const signals = ["A", "B", "C", "D", "E"].map((tag) => ({ tag }));
            return [plain("Units (from 0) in service."), plain("these from 0.2192 on, from 0 to 1"),
                    loopsOf([0, 1, 2, 3], signals), loopsOf([0, 4], signals),
                    tagged("Loops 1, 3 and 5 bind, 'loop 1 out' too, 2 loops 3 times", signals),
                    tagged("With loop 2 in manual; loop 6", signals), taggedCell("1-2", signals)];
        }"""
    )
    assert found == [
        "Units counted from 1 in service.",
        "these from 0.2192 on, from 0 to 1",
        "A to D",
        "A, E",
        "A, C, E bind, 'loop 1 out' too, 2 loops 3 times",
        "With B in manual; loop 6",
        "A, B",
    ]


def test_a_link_opens_a_result_with_its_unit(watched: Watched, tuned: tuple[str, str]) -> None:
    """A link that was copied shows the same result in another browser, in the same unit."""
    watched.go(f"#/tunings/{tuned[1]}?unit=weeks")
    expect(watched.page.locator(".hero")).to_contain_text("weeks")
    watched.page.get_by_role("button", name="Copy link").click()
    expect(watched.page.get_by_role("button", name="Link copied")).to_be_visible()
    copied = watched.page.evaluate("navigator.clipboard.readText()")
    assert copied == f"{watched.url}/#/tunings/{tuned[1]}?unit=weeks"


def test_how_far_from_the_best_possible(watched: Watched, tuned: tuple[str, str]) -> None:
    """A proof of optimality that was asked for stands beside the result, and integrity too."""
    watched.go(f"#/tunings/{tuned[0]}?unit=s")
    hero = watched.page.locator(".hero")
    expect(hero).to_contain_text("Proven: no settings in such groups")
    expect(hero).to_contain_text("go below 25.7")
    expect(hero).to_contain_text("Loops out of service")
    expect(hero).to_contain_text("robust performance")
    watched.inspect("optimality")


def test_what_a_demand_costs(watched: Watched, tuned: tuple[str, str]) -> None:
    """A result shows how its value moves with the demand, from tunings of its own."""
    page = watched.page
    watched.go(f"#/tunings/{tuned[0]}")
    watched.wait_for_figures()
    page.get_by_role("button", name="Over the error").click()
    figure = page.locator("[data-figure=trade_off]")
    expect(figure).to_contain_text("relative error")
    watched.wait_for_figures()
    assert figure.locator(".scatterlayer .point").count() >= 8
    expect(figure.get_by_text("you are here")).to_be_visible()
    watched.inspect("trade-off")


def test_what_if_the_demand_were_another(watched: Watched, tuned: tuple[str, str]) -> None:
    """A slider tunes anew while it moves; letting go confirms it as a tuning of its own."""
    page = watched.page
    watched.go(f"#/tunings/{tuned[1]}")
    watched.wait_for_figures()
    card = page.locator("section").filter(has=page.get_by_role("heading", name="What if?"))
    slider = card.get_by_label("Error ε of the inputs")
    slider.fill("6")
    expect(card.get_by_role("status").or_(card.locator("output")).first).to_contain_text("0.283")
    expect(card.get_by_text("Confirmed by a whole search.")).to_be_visible()
    told = card.locator("p strong").first.inner_text()
    assert 21 < float(told.split()[2]) < 40
    watched.inspect("what-if")
    card.get_by_role("link", name="Open as a tuning of its own").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("ε = 0.283")
    expect(page.locator(".hero .big")).to_have_text(told.split()[2])


def test_tuned_settings_are_handed_to_an_analysis(watched: Watched, tuned: tuple[str, str]) -> None:
    """The link from a result fills the form with the plant and the loops."""
    page = watched.page
    watched.go(f"#/tunings/{tuned[1]}")
    page.get_by_role("link", name="Robustness").click()
    job = httpx.get(f"{watched.url}/v1/tunings/{tuned[1]}").json()
    time = job["result"]["loops"][0]["integral_time"]
    handed = page.get_by_label("Integral time").first.input_value()
    assert float(handed) == pytest.approx(time, rel=1e-8)
    page.get_by_role("button", name="Analyse").click()
    expect(page.get_by_role("row", name="robust performance")).to_contain_text("1")


@pytest.mark.parametrize("name", ANALYSES)
def test_each_analysis_answers_its_first_example(watched: Watched, name: str) -> None:
    """The form of each analysis is made from its schema, and its example gives a result."""
    page = watched.page
    watched.go(f"#/analyses/{name}")
    page.locator(".chip").first.click()
    watched.inspect(f"{name}-form")
    page.get_by_role("button", name="Analyse").click()
    expect(page.locator(".outcome .said, .outcome table").first).to_be_visible()
    if f"/v1/figures/{name}" in DOCUMENT["paths"]:
        watched.wait_for_figures()
    watched.inspect(f"{name}-result")


def test_list_of_analyses(watched: Watched) -> None:
    """Every analysis of the service is one link away."""
    watched.go("#/analyses")
    assert watched.page.locator("main ul a").count() == len(ANALYSES)
    watched.inspect("analyses")


def test_every_form_of_a_plant(watched: Watched) -> None:
    """Each kind of plant has its fields, and the matrix grows and shrinks."""
    page = watched.page
    watched.go("#/")
    page.get_by_label("Parallel", exact=True).check()
    expect(page.get_by_label("Denominator")).to_have_count(2)
    page.get_by_label("Weight w(s)").check()
    expect(page.get_by_label("Denominator")).to_have_count(3)
    watched.inspect("form-parallel")
    page.get_by_label("Matrix").check()
    page.get_by_label("Transfer functions").check()
    page.get_by_label("Size", exact=True).fill("3")
    page.get_by_label("Size", exact=True).blur()
    expect(page.get_by_label("Numerator")).to_have_count(10)
    watched.inspect("form-matrix")


def test_keyboard_alone_starts_a_tuning(watched: Watched) -> None:
    """Skip link, fields and the Enter key are enough."""
    page = watched.page
    watched.go("#/")
    page.keyboard.press("Tab")
    expect(page.get_by_text("Skip to the content")).to_be_focused()
    page.get_by_role("textbox", name="Dead time").focus()
    page.keyboard.press("Enter")
    page.wait_for_url("**/#/tunings/*")
    expect(page.get_by_role("heading", level=1)).to_be_focused()


def test_the_service_asks_for_a_key(watch: Callable[[Service], Watched], tmp_path: Path) -> None:
    """Where the service has keys, the page asks for one, and again where it is wrong."""
    environment = {"MUTUNE_API_KEYS_FILE": str(tmp_path / "keys.json")}
    created = subprocess.run(  # noqa: S603 - our own command
        [MUTUNE, "keys", "create", "browser"],
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    )
    key = created.stdout.split()[-1]
    service = Service(tmp_path, **environment)
    service.start()
    try:
        watched = watch(service)
        watched.permit("status of 401")
        page = watched.page
        page.goto(f"{service.url}/#/tunings")
        dialog = page.get_by_role("dialog")
        dialog.get_by_label("API key").fill("wrong")
        watched.inspect("key")
        dialog.get_by_role("button").click()
        expect(dialog.get_by_label("API key")).to_be_empty()
        dialog.get_by_label("API key").fill(key)
        dialog.get_by_role("button").click()
        expect(page.get_by_text("No tuning yet.")).to_be_visible()
    finally:
        service.stop()


def test_first_paint_needs_little(watched: Watched) -> None:
    """The form needs neither Plotly nor the modules of other views; a decision says how much."""
    watched.go("#/")
    watched.page.wait_for_load_state("networkidle")
    names = {url.rsplit("/", 1)[1] for url in watched.requests if "/assets/" in url}
    assert not [name for name in names if "plotly" in name]
    assert "result.js" not in names
    sizes = {file.name: file.stat().st_size for file in STATIC.iterdir()}
    assert sum(sizes[name] for name in names) < 90_000
    assert sum(sizes.values()) < 180_000


JUMPS = """window.jumps = [];
new PerformanceObserver((list) => {
    const moved = list.getEntries().flatMap((entry) => entry.sources);
    for (const { previousRect: before, currentRect: after } of moved) {
        if (before.height && before.top < innerHeight) {
            const top = after.height ? after.top : innerHeight;  // pushed out of view
            window.jumps.push(Math.abs(top - before.top));
        }
    }
}).observe({ type: "layout-shift", buffered: true });"""


def test_nothing_jumps(watched: Watched, tuned: tuple[str, str]) -> None:
    """A result grows into room that was kept for it: nothing in view moves by more than 50 px."""
    page = watched.page
    page.add_init_script(JUMPS)
    watched.go(f"#/tunings/{tuned[1]}")
    expect(page.locator(".risks[aria-busy]")).to_have_count(0)
    watched.wait_for_figures()
    assert max(page.evaluate("window.jumps"), default=0) <= 50


def test_the_history_does_not_jump_when_it_arrives(
    watched: Watched, tuned: tuple[str, str]
) -> None:
    """A list that comes late pushes nothing down that people have seen."""
    page = watched.page
    page.add_init_script(JUMPS)
    page.route("**/v1/tunings?*", lambda route: (page.wait_for_timeout(300), route.continue_()))
    watched.go("#/tunings")
    expect(page.locator(f"[href$='{tuned[0]}']")).to_be_visible()
    expect(page.get_by_role("button", name="Compare the chosen")).to_be_visible()
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
    assert max(page.evaluate("window.jumps"), default=0) <= 50


def test_page_stays_small() -> None:
    """No module of the page is long, no line wide."""
    files = [file.read_text("utf-8").splitlines() for file in STATIC.glob("*.[jh]*")]
    assert max(map(len, files)) <= 250
    assert max(len(line) for lines in files for line in lines) <= 120


def test_files_are_kept_for_ever_and_the_page_is_not(service: Service) -> None:
    """Assets are immutable under URLs that name their content; unknown ones are not there."""
    client = httpx.Client(base_url=service.url)
    page = client.get("/")
    assert page.headers["cache-control"] == "no-cache"
    assert "unsafe" not in page.headers["content-security-policy"]
    sources = [part.split('"')[0] for part in page.text.split('"/assets/')[1:]]
    assert sources
    for source in sources:
        answer = client.get(f"/assets/{source}")
        assert answer.status_code == 200
        assert "immutable" in answer.headers["cache-control"]
    assert client.get(f"/assets/{sources[0]}.map").status_code == 404
    client.close()
