"""Figures of analyses and sweeps, and what all figures share, by their data."""

from __future__ import annotations

import itertools
import json
import math

import numpy as np
import pytest

from service import figures
from service.analyses.decouple.drawn import DrawnClosedLoop
from service.analyses.decouple.figure import decoupled
from service.analyses.interaction.drawn import DrawnInteraction
from service.analyses.interaction.figure import interaction
from service.analyses.parallel_drives import EXAMPLE as DRIVES
from service.analyses.parallel_drives import ParallelDrivesRequest
from service.analyses.parallel_drives import compute as simulate_drives
from service.analyses.parallel_drives.drawn import DrawnParallelDrives
from service.analyses.parallel_drives.figure import drives
from service.analyses.relay.drawn import DrawnRelayExperiment
from service.analyses.relay.figure import relay
from service.figures.style import (
    BACKGROUNDS,
    COLOURS,
    DASHES,
    NEUTRAL,
    Theme,
    line,
    log_axis,
    numbers,
    template,
)
from service.schemas import parse
from service.schemas.drawn import DrawnStepResponse
from service.schemas.trade_off import TradeOff, TradeOffPoint
from solver.interaction.analysis import analyse_interaction
from solver.interaction.decoupling import DecouplingSpecification, decouple
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.relay.analysis import relay_experiment
from solver.relay.experiment import Relay, RelayExperiment
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.loops import Loop
from solver.simulation.step_response import step_response

# Machado, Oliveira and Fernandes (2009): what deuteranopes and protanopes see of linear RGB.
DICHROMATS = {
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
}


def linear(colour: str) -> np.ndarray:
    """Return the linear RGB of a hexadecimal colour."""
    values = np.array([int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5)])
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def contrast(first: str, second: str) -> float:
    """Return the contrast of two colours by WCAG 2.2."""
    low, high = sorted(linear(colour) @ [0.2126, 0.7152, 0.0722] for colour in (first, second))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("background", BACKGROUNDS.values())
def test_colours_stand_out_on_both_schemes(background: str) -> None:
    """Every line has a contrast of three to one (WCAG 1.4.11) on light and on dark pages."""
    assert min(contrast(colour, background) for colour in (*COLOURS, NEUTRAL)) >= 3


@pytest.mark.parametrize("vision", DICHROMATS)
def test_colours_differ_for_the_colour_blind(vision: str) -> None:
    """No two colours come near each other for dichromats, lightness included."""
    seen = [np.clip(DICHROMATS[vision] @ linear(colour), 0, 1) ** (1 / 2.2) for colour in COLOURS]
    assert min(math.dist(a, b) for a, b in itertools.combinations(seen, 2)) > 0.1


def test_sixteen_lines_differ_in_colour_or_dash_and_neighbours_in_both() -> None:
    """Neighbouring series differ in both, and sixteen are distinct."""
    styles = [(line(index)["color"], line(index)["dash"]) for index in range(16)]
    assert len(set(styles)) == 16
    assert set(DASHES) == {dash for _, dash in styles}
    for first, second in itertools.pairwise(styles[:4]):
        assert first[0] != second[0]
        assert first[1] != second[1]


def test_numbers_that_are_none_are_gaps() -> None:
    """NaN, infinity and None are gaps; the rest keeps six digits."""
    values = [1.23456789, math.nan, math.inf, None, -1e-9]
    assert numbers(values) == [1.23457, None, None, None, -1e-9]


def test_log_axis_passes_over_what_has_no_logarithm() -> None:
    """Zeros and gaps do not count, magnitudes do; nothing at all still makes an axis."""
    assert log_axis([0.0, None, math.nan, -10.0, 1e4])["range"] == [1, 4]
    assert log_axis([])["range"] == [0, 1]


def test_narrow_log_axes_are_labelled_between_decades() -> None:
    """Less than two decades are labelled at 1, 2 and 5 of each."""
    ticks = log_axis([3.0, 40.0])["tickvals"]
    assert {5, 10, 20} <= set(ticks)
    assert "tickvals" not in log_axis([1.0, 1e4])


def test_templates_leave_the_background_to_the_page() -> None:
    """Both templates are transparent, and their text stands out on their page."""
    for theme in Theme:
        layout = template(theme).layout
        assert layout.paper_bgcolor == layout.plot_bgcolor == "rgba(0,0,0,0)"
        assert contrast(layout.font.color, BACKGROUNDS[theme]) >= 7


def wood_berry() -> MatrixPlant:
    """Return the column of Wood and Berry (1973)."""
    return MatrixPlant(
        [
            [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
            [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
        ]
    )


def test_relative_gains_stand_in_their_cells() -> None:
    """The heat map holds the array, output by output, values written in its cells."""
    drawn = interaction(DrawnInteraction.of(analyse_interaction(wood_berry())))
    (heat,) = drawn["rga"].data
    assert np.array(heat.z) == pytest.approx(
        np.array([[2.0094, -1.0094], [-1.0094, 2.0094]]), abs=1e-4
    )
    assert heat.text[0][1] == "-1.0094"
    assert heat.zmin == -heat.zmax


def test_equal_relative_gains_share_a_curve() -> None:
    """Of a 2 x 2 plant two curves remain; each begins at its static value."""
    drawn = interaction(DrawnInteraction.of(analyse_interaction(wood_berry())))
    own, other = drawn["rga_frequency"].data
    assert (own.name, other.name) == ("λ<sub>11, 22</sub>", "λ<sub>12, 21</sub>")
    assert own.y[0] == pytest.approx(2.0094, abs=0.01)
    assert other.y[0] == pytest.approx(1.0094, abs=0.01)


def test_many_units_are_drawn_by_their_closed_forms() -> None:
    """Above the size of written-out matrices, own and other relative gain have a curve each."""
    drawn = interaction(DrawnInteraction.of(analyse_interaction(first_order(30, 1, 9, 0.5))))
    assert list(drawn) == ["rga_frequency"]
    own, other = drawn["rga_frequency"].data
    # Every row of the array sums to one; off the diagonal its elements are negative.
    assert own.y[0] - 29 * other.y[0] == pytest.approx(1, rel=1e-4)


def test_a_singular_plant_has_gaps() -> None:
    """Where the array does not exist there is no heat map, and the curves are gaps."""
    drawn = interaction(DrawnInteraction.of(analyse_interaction(first_order(2, 1, 9, 1.0))))
    assert "rga" not in drawn
    assert set(drawn["rga_frequency"].data[0].y) == {None}


def test_step_response_shows_outputs_and_inputs() -> None:
    """Outputs and set points stand above, inputs below, loops named by their units."""
    plant = first_order(2, 1, 10, 0.3)
    loops = (Loop.of(Controller(2, 8)),) * 2
    steps = (Step(StepKind.SETPOINT, 1, 5.0, 2.0),)
    response = step_response(Experiment(plant, loops, steps, 80.0, samples=81))
    figure = figures.step_response(DrawnStepResponse.of(response), "s")
    shown = {(trace.name, trace.yaxis): trace for trace in figure.data}
    assert set(shown) == {
        ("set point", "y"), ("loop 1", "y"), ("loop 2", "y"), ("loop 1", "y2"), ("loop 2", "y2"),
    }  # fmt: skip
    assert (shown["set point", "y"].y[4], shown["set point", "y"].y[5]) == (0, 2)
    assert shown["loop 2", "y"].y[-1] == pytest.approx(2, rel=1e-2)
    assert shown["loop 2", "y2"].y[5] == pytest.approx(4, rel=1e-6)
    assert figure.layout.xaxis2.title.text == "time (s)"


def test_relay_experiment_shows_both_levels() -> None:
    """The input switches between its two levels while the output swings about zero."""
    plant = first_order(1, 1, 10, 0.0, 1.0)
    experiment = RelayExperiment(plant, 0, 0, Relay(0.5, 0.01), (), 60.0)
    figure = relay(DrawnRelayExperiment.of(relay_experiment(experiment)))
    output, signal = figure.data
    assert set(signal.y) == {0.5, -0.5}
    assert min(output.y) < 0 < max(output.y)
    assert "switched" in figure.layout.meta["description"]


def test_decoupled_loops_show_what_interaction_is_left() -> None:
    """At low frequency each output follows its own set point and no other (eq. 11.8)."""
    result = decouple(DecouplingSpecification(wood_berry()))
    figure = decoupled(DrawnClosedLoop.of(result.closed_loop), "min")
    shown = {trace.name: trace for trace in figure.data}
    assert shown["h<sub>11</sub>"].y[0] == pytest.approx(1, abs=1e-3)
    assert shown["h<sub>12</sub>"].y[0] == pytest.approx(0, abs=1e-2)
    assert {shown["h<sub>11</sub>"].yaxis, shown["h<sub>21</sub>"].yaxis} == {"y", "y2"}
    assert "h<sub>21</sub>, approximate" in shown


def test_only_the_highest_of_many_interactions_are_shown() -> None:
    """Of the twenty interactions of five loops the six with the highest peaks remain."""
    size = 5
    heights = [[{"re": row + column / 10, "im": 0.0} for column in range(size)]
               for row in range(size)]  # fmt: skip
    figure = decoupled(DrawnClosedLoop(omega=[1.0], approximate=[heights], exact=[heights]))
    below = [trace.name for trace in figure.data if trace.yaxis == "y2" and trace.showlegend]
    assert below == [f"h<sub>{place}</sub>" for place in ("43", "45", "51", "52", "53", "54")]


def test_drives_show_the_shift_of_load_that_the_remedy_prevents() -> None:
    """After a measurement pulse the efforts differ for good, mended they agree (section 11.4)."""
    request = parse(ParallelDrivesRequest, json.dumps(DRIVES))
    result = DrawnParallelDrives.model_validate(simulate_drives(request))
    figure = drives(result.simulation, "s")
    efforts = [trace.y[-1] for trace in figure.data if trace.name.startswith("unit")]
    assert abs(efforts[0] - efforts[1]) > 0.5
    assert efforts[2] == pytest.approx(efforts[3], abs=1e-3)


def test_trade_off_has_gaps_where_nothing_is_feasible() -> None:
    """An infeasible point interrupts its curve, whichever it is."""
    points = [
        TradeOffPoint(value=0.1, tau_p=10.0, identical=14.0),
        TradeOffPoint(value=0.2, tau_p=18.4, identical=None),
        TradeOffPoint(value=0.9, tau_p=None, identical=None),
    ]
    figure = figures.trade_off(TradeOff(parameter="epsilon", points=points), "min")
    best, identical = figure.data
    assert best.y == (10, 18.4, None)
    assert identical.y == (14, None, None)
    assert figure.layout.yaxis.title.text == "τ<sub>P</sub> (min)"
    assert "NaN" not in json.dumps(figure.to_plotly_json()["data"])


def test_trade_off_without_comparison_is_one_curve() -> None:
    """Identical settings that were not looked at are not in the legend."""
    points = [TradeOffPoint(value=value, tau_p=10.0) for value in (1.5, 2.0)]
    figure = figures.trade_off(TradeOff(parameter="max_peak", points=points))
    assert [trace.name for trace in figure.data] == ["best settings"]
