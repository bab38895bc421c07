"""From an empty form to settings on file, and the ways that this can go wrong."""

import csv
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Locator, Page, expect
from running import Service
from watching import ROOT, Watched

ENTRIES = {
    "/plant/n": "2",
    "/plant/gain": "1",
    "/plant/time_constant": "100",
    "/plant/interaction": "0,949",
    "/uncertainty/epsilon": "0.2",
    "/uncertainty/theta": "1",
}


def field(page: Page, pointer: str) -> Locator:
    """Return the field of a value of the request."""
    return page.locator(f"[data-pointer='{pointer}'] input")


def start(page: Page) -> None:
    """Press the button, and wait for the job's own view."""
    page.get_by_role("button", name="Start tuning").click()
    page.wait_for_url("**/#/tunings/*")


def start_a_long_one(watched: Watched) -> Page:
    """Start a tuning that lasts as long as a test wants, and wait for its first progress."""
    page = watched.page
    watched.go("#/")
    field(page, "/plant/n").fill("4")
    page.get_by_label("PID", exact=True).check()
    page.get_by_text("More: ").click()
    page.get_by_text("Search", exact=True).click()
    field(page, "/search/starts").fill("1000")
    start(page)
    expect(page.get_by_text("% of the search")).to_be_visible()
    return page


def stop(page: Page) -> None:
    """Stop a job, and wait for the end."""
    page.get_by_role("button", name="Stop").click()
    expect(page.locator(".status")).to_have_text("Stopped")


def test_from_an_empty_form_to_a_report(watched: Watched, tmp_path: Path) -> None:
    """An engineer types a plant, gets settings, checks, copies and files them."""
    page = watched.page
    watched.go("#/")
    page.get_by_role("button", name="Empty form").click()
    assert field(page, "/uncertainty/epsilon").input_value() == ""
    page.get_by_label("First order").check()
    for pointer, value in ENTRIES.items():
        field(page, pointer).fill(value)
    page.get_by_label("Unit of time").fill("h")
    watched.inspect("form")
    start(page)

    hero = page.locator(".hero")
    expect(hero).to_contain_text("that holds for every plant")
    assert float(hero.locator(".big").inner_text()) <= 18.46
    expect(hero).to_contain_text("h")
    expect(hero.locator(".gain")).to_contain_text("28.4 % faster")
    watched.wait_for_figures()
    watched.inspect("result")
    watched.open_evidence()
    for form, column in (("Ideal", "Integral time, h"), ("Parallel", "Integral gain, 1/h")):
        page.get_by_label(form, exact=True).check()
        expect(page.get_by_role("columnheader", name=column, exact=True)).to_be_visible()

    page.get_by_role("button", name="Copy table").click()
    expect(page.get_by_text("Copied, six digits.")).to_be_visible()
    copied = page.evaluate("navigator.clipboard.readText()")
    assert copied.splitlines()[0].startswith("Loop\tProportional gain\tIntegral gain")

    with page.expect_download() as download:
        page.get_by_role("button", name="CSV").click()
    download.value.save_as(tmp_path / "settings.csv")
    with (tmp_path / "settings.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert [row[0] for row in rows] == ["Loop", "1", "2"]
    assert 40 < float(rows[1][1]) < 55

    watched.inspect("evidence")
    with page.expect_download() as download:
        page.locator("figure .modebar-btn[data-title='Save as PNG']").first.click()
    assert download.value.suggested_filename.endswith(".png")

    with page.expect_download() as download:
        page.get_by_role("button", name="Download report").click()
    download.value.save_as(tmp_path / "report.html")
    assert "Robust performance" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_settings_are_typed_into_a_control_system(watched: Watched) -> None:
    """Title, unit, tag and spans go with the request; values come in the system's own units."""
    page = watched.page
    watched.go("#/")
    page.get_by_label("Unit of time").fill("min")
    field(page, "/title").fill("Reactor train A")
    page.get_by_label("Tags and signals").check()
    for name, value in (("tag", "TIC-101"), ("output_span", "250"), ("input_span", "100")):
        field(page, f"/instruments/0/{name}").fill(value)
    page.get_by_label("Identical", exact=True).check()
    start(page)
    expect(page.get_by_role("heading", level=1)).to_contain_text("Reactor train A")
    typed = page.locator("section").filter(
        has=page.get_by_role("heading", name="What do I type in?")
    )
    typed.get_by_label("Control system").select_option("deltav_standard")
    expect(typed.get_by_role("columnheader", name="RESET, s")).to_be_visible()
    row = typed.get_by_role("row", name="TIC-101").first
    watched.open_evidence()
    settings = page.locator("section").filter(
        has=page.get_by_role("heading", name="Settings in three forms")
    )
    gain, time = (
        float(settings.locator("tbody tr").first.locator("td").nth(place).inner_text())
        for place in (0, 1)
    )
    cells = row.locator("td")
    assert abs(float(cells.nth(1).inner_text()) / (2.5 * gain) - 1) < 1e-3
    assert abs(float(cells.nth(2).inner_text()) / (60 * time) - 1) < 1e-3
    expect(typed.get_by_text("As typed, the demand")).to_be_visible()
    watched.wait_for_figures()
    watched.inspect("typed")


def test_an_error_of_2000_per_cent_is_taken_for_a_slip(watched: Watched) -> None:
    """20 for 20 per cent is answered by what it means, and by a form with what was meant."""
    page = watched.page
    watched.go("#/")
    field(page, "/uncertainty/epsilon").fill("20")
    start(page)
    expect(page.get_by_text("means 2000 %; 20 % is 0.2.")).to_be_visible()
    expect(page.get_by_text("look at the plant")).to_have_count(0)
    page.get_by_role("button", name="Open the request with ε = 0.2").click()
    expect(field(page, "/uncertainty/epsilon")).to_have_value("0.2")


def test_an_infeasible_plant_says_why(watched: Watched) -> None:
    """A singular plant ends with the reason and with advice."""
    page = watched.page
    watched.go("#/")
    field(page, "/plant/interaction").fill("1")
    start(page)
    expect(page.get_by_text("the gain matrix is singular")).to_be_visible()
    expect(page.get_by_role("heading", name="What to try")).to_be_visible()
    expect(page.locator(".status")).to_have_text("Infeasible")
    expect(page.get_by_role("listitem").get_by_role("link", name="Interaction")).to_be_visible()
    expect(page.get_by_role("link", name="Robustness")).to_have_count(0)
    watched.inspect("infeasible")
    watched.go("#/tunings")
    expect(page.get_by_role("row", name="a = 1").first).to_contain_text("Infeasible")


def test_a_wrong_value_is_shown_beside_its_field_and_not_sent(watched: Watched) -> None:
    """What the schema forbids is told while typing; the button leads to the field."""
    page = watched.page
    watched.go("#/")
    gain, units = field(page, "/plant/gain"), field(page, "/plant/n")
    gain.fill("one")
    units.fill("0")
    expect(gain).to_have_accessible_description(
        "Static gain k of a unit, not zero. Enter a number."
    )
    page.get_by_role("button", name="Start tuning").click()
    expect(page.get_by_role("alert")).to_have_text("2 fields need attention.")
    expect(units).to_have_accessible_description("Number of identical parallel units. At least 1.")
    expect(units).to_be_focused()
    watched.inspect("field-errors")
    assert f"{watched.url}/v1/tunings" not in watched.requests
    units.fill("2")
    expect(units).to_have_accessible_description("Number of identical parallel units.")


def test_what_the_service_refuses_is_shown_beside_its_field(watched: Watched) -> None:
    """A fault that only the mathematics can see comes back to its field."""
    watched.permit("status of 422")
    page = watched.page
    watched.go("#/")
    page.get_by_label("Grouped").check()
    sizes = field(page, "/controller/group_sizes")
    sizes.fill("1 2")
    page.get_by_role("button", name="Start tuning").click()
    expect(sizes).to_be_focused()
    expect(page.locator("[data-pointer='/controller/group_sizes'] .error")).to_contain_text("sum")
    sizes.fill("1 1")
    expect(page.locator("[data-pointer='/controller/group_sizes'] .error")).to_be_empty()


def test_a_running_job_survives_a_reload_and_keeps_its_best_when_stopped(watched: Watched) -> None:
    """The job's address is its own; stopping it shows the best settings so far."""
    page = start_a_long_one(watched)
    watched.inspect("progress")
    page.reload()
    expect(page.get_by_text("% of the search")).to_be_visible()
    expect(page.locator("output.big")).to_contain_text(".")
    told = float(page.locator("output.big").inner_text())
    stop(page)
    expect(page.get_by_text("Stopped before the search had ended")).to_be_visible()
    assert float(page.locator(".hero .big").inner_text()) <= 1.05 * told
    expect(page.get_by_role("heading", name="What do I type in?")).to_be_visible()
    watched.wait_for_figures()
    watched.inspect("stopped")
    page.get_by_role("link", name="Change and run again").click()
    expect(field(page, "/search/starts")).to_have_value("1000")


def test_two_tabs_see_the_same_job(
    watch: Callable[[Service], Watched], service: Service, watched: Watched
) -> None:
    """What is stopped in one tab ends in the other."""
    page = start_a_long_one(watched)
    other = watch(service)
    other.page.goto(page.url)
    expect(other.page.get_by_text("% of the search")).to_be_visible()
    stop(other.page)
    expect(page.locator(".status")).to_have_text("Stopped")


def test_a_restarted_service_goes_on_with_the_job(
    watch: Callable[[Service], Watched], tmp_path: Path
) -> None:
    """The page says that the connection is lost, and goes on when it is back."""
    service = Service(tmp_path)
    service.start()
    try:
        watched = watch(service)
        watched.permit("ERR_CONNECTION_REFUSED")
        watched.permit("ERR_INCOMPLETE_CHUNKED_ENCODING")
        page = start_a_long_one(watched)
        banner = page.get_by_text("The connection to the service is lost.")
        service.stop()
        expect(banner).to_be_visible()
        watched.inspect("lost-connection")
        service.start()
        expect(banner).to_be_hidden()
        expect(page.get_by_text("% of the search")).to_be_visible()
        stop(page)
    finally:
        service.stop()


def test_a_job_that_nobody_knows(watched: Watched) -> None:
    """A wrong address ends with the service's words, not with an empty page."""
    watched.permit("status of 404")
    watched.go(f"#/tunings/{'0' * 32}")
    expect(watched.page.get_by_role("heading", name="Not found")).to_be_visible()


WOOD_BERRY = ("12.8\t-18.9\n6.6\t-19.4", "16.7\t21\n10.9\t14.4", "1\t3\n7\t3")


def paste(page: Page, name: str, text: str) -> None:
    """Paste a block of cells, as a spreadsheet puts it on the clipboard, into a cell."""
    cell = page.get_by_label(name, exact=True)
    cell.focus()
    page.evaluate("text => navigator.clipboard.writeText(text)", text)
    page.keyboard.press("Control+V")


def test_wood_and_berry_is_pasted_as_tables(watched: Watched) -> None:
    """Three blocks from a spreadsheet make the plant; it is tuned as it stands."""
    page = watched.page
    watched.go("#/")
    page.get_by_label("Matrix").check()
    for name, text in zip(("Gain K", "Time constant τ", "Dead time θ"), WOOD_BERRY, strict=True):
        paste(page, f"{name}, output 1, input 1", text)
    expect(page.get_by_label("Gain K, output 2, input 2")).to_have_value("-19.4")
    watched.inspect("wood-berry")
    field(page, "/uncertainty/epsilon").fill("0.1")
    start(page)
    expect(page.get_by_role("heading", name="What do I type in?")).to_be_visible()
    expect(page.get_by_role("heading", level=1)).to_contain_text("2 plant")
    watched.wait_for_figures()
    watched.inspect("wood-berry-result")


def test_a_button_stays_where_it_is_pressed(watched: Watched) -> None:
    """What leaving a field changes waits until the button is let go, and comes before its work."""
    page = watched.page
    watched.go("#/")
    page.get_by_label("Matrix").check()
    for name, text in zip(("Gain K", "Time constant τ", "Dead time θ"), WOOD_BERRY, strict=True):
        paste(page, f"{name}, output 1, input 1", text)
    button = page.get_by_role("button", name="Start tuning")
    field(page, "/uncertainty/theta").fill("none")
    field(page, "/uncertainty/epsilon").fill("none")
    pressed_and_let_go(page, button)
    expect(page.get_by_text("2 fields need attention.")).to_be_visible()
    page.get_by_label("Size", exact=True).fill("3")
    pressed_and_let_go(page, button)
    expect(page.get_by_label("Gain K, output 3, input 3")).to_be_visible()


def pressed_and_let_go(page: Page, button: Locator) -> None:
    """Click as slowly as on a busy machine, and check that the button has not moved meanwhile."""
    button.scroll_into_view_if_needed()
    before = button.bounding_box()
    assert before is not None
    page.mouse.move(before["x"] + before["width"] / 2, before["y"] + before["height"] / 2)
    page.mouse.down()
    assert button.bounding_box() == before
    page.mouse.up()


def test_all_three_tables_come_in_one_paste_and_the_table_grows(watched: Watched) -> None:
    """A block of three times the width holds K, tau and theta; three rows make three loops."""
    page = watched.page
    watched.go("#/")
    page.get_by_label("Matrix").check()
    rows = ["1;0,2;0,1;10;12;14;1;2;3", "0,3;1;0,2;11;9;8;2;1;2", "0,1;0,2;1;7;8;9;3;2;1"]
    paste(page, "Gain K, output 1, input 1", "\n".join(rows))
    expect(page.get_by_label("Size", exact=True)).to_have_value("3")
    expect(page.get_by_label("Gain K, output 2, input 1", exact=True)).to_have_value("0.3")
    expect(page.get_by_label("Dead time θ, output 3, input 1", exact=True)).to_have_value("3")
    expect(page.get_by_label("Time constant τ, output 1, input 3", exact=True)).to_have_value("14")


def test_a_long_number_fits_its_cell_and_is_kept(watched: Watched) -> None:
    """A cell shows five digits of a long number, all of them while it is edited, and sends all."""
    page = watched.page
    watched.go("#/")
    page.get_by_label("Matrix").check()
    paste(page, "Gain K, output 1, input 1", "0.66666666666667\t0.1\n0.2\t0.5")
    cell = page.get_by_label("Gain K, output 1, input 1", exact=True)
    page.get_by_label("Gain K, output 2, input 2", exact=True).focus()
    expect(cell).to_have_value("0.66667")
    cell.focus()
    expect(cell).to_have_value("0.66666666666667")
    draft = "JSON.parse(sessionStorage.getItem('mutune.draft/v1/tunings'))"
    assert page.evaluate(f"{draft}.plant.elements[0][0].num") == [0.66666666666667]


def test_a_request_file_is_dropped_into_the_form(watched: Watched, tmp_path: Path) -> None:
    """A request that was saved fills the form; what is no request says so."""
    page = watched.page
    watched.go("#/")
    saved = tmp_path / "request.json"
    saved.write_text(
        '{"title": "From a file", "plant": {"kind": "first_order", "n": 6, "gain": 2,'
        '"time_constant": 7, "interaction": 0.1}, "uncertainty": {"epsilon": 0.1, "theta": 0.5}}'
    )
    page.get_by_label("Open a file").set_input_files(saved)
    expect(field(page, "/plant/n")).to_have_value("6")
    expect(field(page, "/title")).to_have_value("From a file")
    dropped = page.evaluate_handle(
        """text => {
            const carried = new DataTransfer();
            carried.items.add(new File([text], "request.json"));
            return carried;
        }""",
        saved.read_text().replace("From a file", "Dropped"),
    )
    page.dispatch_event("main", "drop", {"dataTransfer": dropped})
    expect(field(page, "/title")).to_have_value("Dropped")
    saved.write_text("not JSON")
    page.get_by_label("Open a file").set_input_files(saved)
    expect(page.get_by_role("alert")).to_contain_text("holds no JSON")


def test_six_burners(watched: Watched) -> None:
    """Six unlike loops are told one by one, in lines that differ in colour and dash."""
    page = watched.page
    watched.go("#/")
    for pointer, value in {"n": "6", "time_constant": "20", "interaction": "0.01"}.items():
        field(page, f"/plant/{pointer}").fill(value)
    field(page, "/uncertainty/epsilon").fill("0.1 0.15 0.2 0.25 0.3 0.35")
    page.get_by_text("More: ").click()
    page.get_by_text("Search", exact=True).click()
    field(page, "/search/starts").fill("1")
    start(page)
    expect(page.get_by_role("heading", name="What do I type in?")).to_be_visible()
    watched.wait_for_figures()
    expect(page.locator(".risks li").first).to_be_visible()
    styles = page.evaluate(
        """() => [...document.querySelector("[data-figure=set_point] .plot").data]
            .filter(({ name, fill }) => /^loop \\d$/.test(name) && !fill)
            .map(({ line }) => `${line.color} ${line.dash}`)"""
    )
    assert len(set(styles)) == 6
    watched.inspect("six-burners")


def test_loops_are_counted_from_one_in_groups_and_pairings(watched: Watched) -> None:
    """People count loops from 1; the request that is sent counts them from 0."""
    page = watched.page
    watched.go("#/")
    page.get_by_label("Grouped").check()
    page.get_by_label("Groups", exact=True).check()
    for group, units in enumerate(("2", "1")):
        field(page, f"/controller/groups/{group}").fill(units)
    page.get_by_text("More: ").click()
    page.get_by_label("Pairing", exact=True).check()
    field(page, "/pairing").fill("2 1")
    watched.inspect("grouped")
    drafts = "JSON.parse(sessionStorage.getItem('mutune.draft/v1/tunings'))"
    assert page.evaluate(f"{drafts}.controller.groups") == [[1], [0]]
    assert page.evaluate(f"{drafts}.pairing") == [1, 0]
    page.reload()
    expect(field(page, "/pairing")).to_have_value("2, 1")
    page.locator(".union").filter(has=page.get_by_text("Pairing, given as")).get_by_label(
        "Best"
    ).check()
    assert page.evaluate(f"{drafts}.pairing") == "best"


def test_times_in_two_units_are_doubted_while_they_are_typed(watched: Watched) -> None:
    """A plant in seconds beside errors in minutes is asked about, before anything is started."""
    page = watched.page
    watched.go("#/")
    doubt = page.get_by_text("far apart. Are both in min?")
    expect(doubt).to_have_count(0)
    field(page, "/plant/time_constant").fill("6000")
    expect(doubt).to_be_visible()
    field(page, "/uncertainty/theta").fill("60")
    expect(doubt).to_have_count(0)


def test_on_a_phone(watched: Watched) -> None:
    """From an example to values on the clipboard, narrow; a lacking unit is asked for."""
    page = watched.page
    page.set_viewport_size({"width": 360, "height": 740})
    watched.go("#/")
    page.get_by_role("button", name="Two parallel reactors").click()
    page.get_by_label("Unit of time").fill("")
    start(page)
    hero = page.locator(".hero")
    expect(hero).to_contain_text("time units")
    page.get_by_label("does not name the unit").select_option("min")
    expect(hero).to_contain_text("min")
    expect(page.get_by_label("does not name the unit")).to_have_count(0)
    page.get_by_role("button", name="Copy values").click()
    expect(page.get_by_text("Copied, as shown.")).to_be_visible()
    assert "Ti, min" in page.evaluate("navigator.clipboard.readText()")
    wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0


def test_from_a_record_to_settings(watched: Watched) -> None:
    """A step test as CSV is drawn, marked and fitted, and its model tuned."""
    page = watched.page
    watched.go("#/record")
    page.get_by_label("Record, CSV or Parquet").set_input_files(
        ROOT / "examples" / "two_heaters_steps.csv"
    )
    expect(page.locator(".curve")).to_have_count(4)
    expect(page.get_by_label("Heater 2")).to_have_value("input")
    expect(page.get_by_label("Temperature 2")).to_have_value("output")
    box = page.locator(".curve svg").first.bounding_box()
    assert box is not None
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 1, middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.9 * box["width"], middle)
    page.mouse.up()
    assert 500 < float(page.get_by_label("to, s").input_value()) < 560
    watched.inspect("record")
    page.get_by_label("First", exact=True).check()
    page.get_by_role("button", name="Find the model").click()
    on = page.get_by_role("button", name="Tune with this model")
    expect(on).to_be_visible()
    watched.wait_for_figures()
    watched.inspect("record-fitted")
    on.click()
    expect(field(page, "/title")).to_have_value("two_heaters_steps")
    start(page)
    typed = page.locator("section").filter(
        has=page.get_by_role("heading", name="What do I type in?")
    )
    expect(typed.get_by_role("row", name="Temperature 1")).to_be_visible()
    watched.wait_for_figures()
    watched.inspect("record-tuned")


def test_a_file_that_is_no_record_is_refused(watched: Watched, tmp_path: Path) -> None:
    """A file without numbers says so, and the view stays usable."""
    page = watched.page
    watched.permit("status of 422")
    watched.go("#/record")
    empty = tmp_path / "empty.csv"
    empty.write_text("time,u,y\n")
    page.get_by_label("Record, CSV or Parquet").set_input_files(empty)
    expect(page.get_by_role("alert").first).to_contain_text("empty.csv has heads and no samples")
