"""Draw the pictures of the guide: each curve is computed by mutune when this runs.

Called by ``scripts/pictures``; writes SVG files to ``docs/images`` (matplotlib, as in ``bench``).
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch

import mutune
from service.analyses.controller_forms import ANALYSIS as CONTROLLER_FORMS
from service.analyses.step_response import ANALYSIS as STEP_RESPONSE
from service.schemas.parsing import parse

ROOT = Path(__file__).parent.parent
IMAGES = ROOT / "docs" / "images"
STYLE = {"svg.hashsalt": "", "svg.fonttype": "none", "font.size": 10}
OWN, OTHER, MARK = "#00796b", "#c2185b", "#555555"


def main() -> None:
    """Write all pictures."""
    with mpl.rc_context(STYLE):
        for draw in (header, faceplate, step_test, responses, weight, fouled, column_step):
            figure = draw()
            path = IMAGES / f"{draw.__name__}.svg"
            figure.savefig(path, metadata={"Date": None}, bbox_inches="tight")


def example(name: str) -> dict[str, Any]:
    """Return an example request."""
    request: dict[str, Any] = json.loads((ROOT / "examples" / name).read_text(encoding="utf-8"))
    return request


def from_page(page: str, file: str) -> dict[str, Any]:
    """Return a request that a page of the guide writes down."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    found = re.search(rf"<!-- file: {re.escape(file)} -->\n```json\n(.*?)```", text, re.DOTALL)
    assert found is not None  # noqa: S101 - a page that lost its file is to be seen
    request: dict[str, Any] = json.loads(found[1])
    return request


def simulated(request: dict[str, Any]) -> dict[str, Any]:
    """Return the result of a step response, by name as over HTTP."""
    return STEP_RESPONSE.compute(parse(STEP_RESPONSE.request, json.dumps(request)))


def tidy(axes: Axes, title: str, x: str, y: str) -> None:
    """Label the axes and take away what says nothing."""
    axes.set(title=title, xlabel=x, ylabel=y)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)


def header() -> Figure:
    """Draw like units on one header: what each valve does to its own output and to the others."""
    units = 4
    figure = Figure(figsize=(7.2, 3.6))
    axes = figure.subplots()
    axes.plot([0.2, 2 * units + 0.3], [3.4, 3.4], color=OWN, linewidth=6, solid_capstyle="round")
    axes.text(0.2, 3.62, "one steam header", color=OWN)
    for unit in range(units):
        x = 1 + 2 * unit
        axes.plot([x, x], [2.3, 3.4], color=OWN, linewidth=3)
        box = FancyBboxPatch(
            (x - 0.6, 1.3), 1.2, 1.0, boxstyle="round,pad=0.02", facecolor="white", edgecolor=MARK
        )
        axes.add_patch(box)
        axes.text(x, 1.8, f"boiler {unit + 1}", ha="center", va="center")
        axes.plot([x, x], [0.5, 1.3], color=MARK)
        axes.plot([x - 0.15, x + 0.15, x - 0.15, x + 0.15, x - 0.15], [0.6, 0.9, 0.9, 0.6, 0.6],
                  color=MARK)  # fmt: skip
        axes.text(x + 0.25, 0.75, f"valve {unit + 1}", va="center", fontsize=9)
        axes.add_patch(Circle((x + 0.62, 2.75), 0.27, facecolor="white", edgecolor=MARK))
        axes.text(x + 0.62, 2.75, f"PIC\n{101 + unit}", ha="center", va="center", fontsize=7)
    strong = {"arrowstyle": "-|>", "color": OWN, "linewidth": 2.5, "connectionstyle": "arc3,rad=0"}
    axes.annotate("", (0.55, 2.9), (0.55, 1.0), arrowprops=strong)
    axes.text(0.45, 0.25, "own output: gain $k$", color=OWN, ha="left")
    for unit in range(1, units):
        weak = {"arrowstyle": "-|>", "color": OTHER, "linewidth": 1, "linestyle": "--",
                "connectionstyle": "arc3,rad=-0.12"}  # fmt: skip
        axes.annotate("", (0.75 + 2 * unit, 2.55), (1.15, 0.45), arrowprops=weak)
    axes.text(4.2, 0.25, "every neighbour: interaction $a$ times $k$", color=OTHER)
    axes.set(xlim=(0, 2 * units + 0.6), ylim=(0, 4))
    axes.axis("off")
    return figure


def faceplate() -> Figure:
    """Draw settings as mutune prints them, and as the screen of a controller shows them."""
    instrument = {"tag": "PIC-101", "output_unit": "bar", "output_span": 60, "input_unit": "%"}
    request = {
        "loops": example("controller_forms_boilers.json")["loops"],
        "time_unit": "min",
        "instruments": [instrument | {"input_span": 100}],
        "target": {"form": "ideal", "gain": "proportional_band", "integral": "time",
                   "time_unit": "s", "filter": "ratio", "digits": 3},
    }  # fmt: skip
    computed = CONTROLLER_FORMS.compute(parse(CONTROLLER_FORMS.request, json.dumps(request)))
    typed = computed["hand_over"]["loops"][0]
    loop = request["loops"][0]
    figure = Figure(figsize=(7.2, 3.0))
    axes = figure.subplots()
    axes.text(0, 2.75, "mutune prints", color=OWN)
    printed = (
        f"gain  {loop['gain']:g} %/bar",
        f"integral time  {loop['integral_time']:g} min",
        "positive plant gain",
    )
    screen = [(f"{each['name']}", f"{each['value']:g} {each['unit']}") for each in typed["values"]]
    screen.append(("Action", typed["action"].capitalize()))
    why = ("100 / (gain x 60 bar / 100 %)", "times 60 s/min", "too high: valve must close")
    frame = FancyBboxPatch(
        (4.6, 0.25), 3.2, 2.7, boxstyle="round,pad=0.1", facecolor="#263238", edgecolor=MARK
    )
    axes.add_patch(frame)
    axes.text(4.75, 2.7, typed["tag"], color="white", weight="bold")
    for row, (left, (name, value), reason) in enumerate(zip(printed, screen, why, strict=True)):
        y = 2.05 - 0.75 * row
        axes.text(0, y, left, va="center")
        axes.annotate("", (4.4, y), (2.3, y), arrowprops={"arrowstyle": "->", "color": MARK})
        axes.text(3.3, y + 0.16, reason, ha="center", fontsize=7.5, color=MARK)
        axes.text(4.75, y, name, color="#b0bec5", va="center")
        axes.text(7.7, y, value, color="#a5d6a7", va="center", ha="right", family="monospace")
    axes.set(xlim=(0, 8), ylim=(0, 3.1))
    axes.axis("off")
    return figure


def step_test() -> Figure:
    """Draw the step test of the boilers with what is read off it."""
    request = example("step_response_boilers_open.json")
    result = simulated(request)
    plant, size = request["plant"], request["steps"][0]["size"]
    time = np.array(result["time"])
    own, other = (np.array(group["output"]) for group in result["responses"])
    final = plant["gain"] * size
    delay, lag = plant["dead_time"], plant["time_constant"]
    figure = Figure(figsize=(7.2, 3.8))
    axes = figure.subplots()
    axes.plot(time, own, color=OWN, label="boiler 1, whose valve moves")
    axes.plot(time, other, color=OTHER, label="boilers 2 to 4, each")
    reached = final * (1 - np.exp(-1))
    axes.hlines([final, reached], 0, time[-1], color=MARK, linewidth=0.8, linestyle=":")
    axes.vlines(delay + lag, 0, reached, color=MARK, linewidth=0.8, linestyle=":")
    axes.annotate(
        f"63 % of the rise, {reached:.2f} bar,\nafter {delay + lag:g} min",
        (delay + lag, reached),
        (delay + lag + 3, reached - 0.35),
        arrowprops={"arrowstyle": "->", "color": MARK},
    )
    axes.annotate(
        f"dead time {delay:g} min",
        (delay, 0),
        (2.6, 0.02),
        arrowprops={"arrowstyle": "->", "color": MARK},
    )
    axes.text(time[-1], final + 0.04, f"own rise {final:g} bar", ha="right")
    other_final = final * plant["interaction"]
    axes.text(time[-1], other_final + 0.04, f"neighbours' rise {other_final:g} bar", ha="right")
    tidy(axes, f"Fuel valve 1 opened by {size:g} % at 0", "min", "steam pressure, bar from start")
    axes.legend(frameon=False, loc="lower right")
    return figure


def responses() -> Figure:
    """Draw the boilers with settings found together, and found one boiler at a time."""
    figure = Figure(figsize=(7.2, 3.4))
    cases = (
        ("Found together", example("step_response_boilers.json")["loops"]),
        ("Found one boiler at a time", example("robustness_boilers_as_found.json")["loops"]),
    )
    every = list(figure.subplots(1, 2, sharey=True))
    for axes, (title, loops) in zip(every, cases, strict=True):
        request = example("step_response_boilers.json") | {"loops": loops, "duration": 20}
        request["steps"] = [
            {"kind": "setpoint", "unit": unit, "size": 1} for unit in range(request["plant"]["n"])
        ]
        # Valves 20 % stronger than the model, and half a minute of dead time that it lacks: what
        # the uncertainty of the example covers, on all boilers at once.
        off = request["plant"] | {
            "gain": 1.2 * request["plant"]["gain"],
            "dead_time": request["plant"]["dead_time"] + 0.5,
        }
        for plant, color, label in (
            (request["plant"], OWN, "plant as modelled"),
            (off, OTHER, "valves +20 %, dead time +0.5 min"),
        ):
            result = simulated(request | {"plant": plant})
            axes.plot(result["time"], result["responses"][0]["output"], color=color, label=label)
        tidy(axes, title, "min", "")
    every[0].set_ylabel("pressure over set point step")
    every[1].legend(frameon=False, loc="lower right", bbox_to_anchor=(1.02, 0.02), fontsize=9)
    return figure


def fouled() -> Figure:
    """Draw exchanger 3, clean and fouled, with today's settings and with those for both."""
    page = "howto/fouled_unit.md"
    today, both = from_page(page, "fouled.json"), from_page(page, "both.json")
    plants = ((both["plant"], OWN, "clean"), (today["plant"], OTHER, "fouled"))
    cases = (
        ("Today's settings", today["as_found"]),
        ("Settings for both states", [{"gain": -2.4116, "integral_time": 3.0124}] * 3),
    )
    figure = Figure(figsize=(7.2, 3.2))
    every = list(figure.subplots(1, 2, sharey=True))
    for axes, (title, loops) in zip(every, cases, strict=True):
        for plant, color, label in plants:
            steps = [{"kind": "setpoint", "unit": 2, "size": 1}]
            request = {"plant": plant, "loops": loops, "steps": steps, "duration": 15}
            result = simulated(request)
            moved = next(each for each in result["responses"] if 2 in each["units"])
            axes.plot(result["time"], moved["output"], color=color, label=label)
        tidy(axes, title, "min", "")
    every[0].set_ylabel("temperature 3 over set point step")
    every[1].legend(frameon=False, loc="lower right")
    return figure


def column_step() -> Figure:
    """Draw what the step of the top's set point does to both ends of the column."""
    result = simulated(from_page("howto/transfer_functions.md", "column_step.json"))
    figure = Figure(figsize=(7.2, 3.2))
    every = list(figure.subplots(1, 2))
    names = (("top", OWN), ("bottom", OTHER))
    for axes, signal, title in zip(every, ("output", "input"), ("per cent", "lb/min"), strict=True):
        for each, (name, color) in zip(result["responses"], names, strict=True):
            axes.plot(result["time"], each[signal], color=color, label=name)
        tidy(axes, title, "min", "")
    every[0].legend(["top", "bottom"], frameon=False)
    every[1].legend(["reflux", "steam"], frameon=False)
    return figure


def weight() -> Figure:
    """Draw the two forms of the uncertainty and the errors that they cover."""
    omega = np.geomspace(0.01, 30, 500)
    figure = Figure(figsize=(7.2, 3.8))
    axes = figure.subplots()
    gains, delays = np.linspace(0.8, 1.2, 9), np.linspace(0, 1, 9)
    errors = [abs(k * np.exp(-1j * omega * d) - 1) for k in gains for d in delays]
    axes.fill_between(omega, 1e-2, np.max(errors, axis=0), color=MARK, alpha=0.25, linewidth=0)
    axes.text(0.02, 0.04, "valves up to 20 % off and up to\n1 min of dead time not in the model")
    for uncertainty, color, label in (
        (mutune.Uncertainty.from_error(0.2, 1), OTHER, "epsilon 0.2, theta 1 min"),
        (
            mutune.Uncertainty.from_gain_and_dead_time(0.2, 1),
            OWN,
            "gain_error 0.2, dead_time_error 1 min",
        ),
    ):
        axes.loglog(omega, abs(uncertainty.weight.response(omega)), color=color, label=label)
    axes.axhline(1, color=MARK, linewidth=0.8, linestyle=":")
    tidy(axes, "How wrong an input may be", "frequency, rad/min", "relative error")
    axes.set_ylim(0.03, 4)
    axes.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
