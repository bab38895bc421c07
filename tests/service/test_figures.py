"""Figures of a tuning, by their data."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from archived import PUBLISHED, archived, infeasible, published
from zoo import COLUMN, ZOO, Case

from service import figures
from service.figures.document import figures_to_json
from service.figures.search import landscape
from service.figures.tuning import TuningFigures
from service.schemas.drawn import DrawnCurves
from service.schemas.peaks import Peak, Peaks
from service.tuned import RequestedTuning
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty


@pytest.fixture(scope="module")
def tuned() -> RequestedTuning:
    """Return the published settings as a tuning."""
    return published()


@pytest.fixture(scope="module")
def drawn(tuned: RequestedTuning) -> TuningFigures:
    """Return their figures."""
    return figures.tuning_figures(tuned)


def traces(figure: Any, name: str, mode: str = "lines") -> list[Any]:
    """Return the traces of this name, from the top panel down."""
    return [trace for trace in figure.data if trace.name == name and trace.mode == mode]


def test_every_figure_of_a_tuning_is_drawn(drawn: TuningFigures) -> None:
    """A tuning with settings has all eight figures, in the order in which they are read."""
    assert list(drawn.figures) == [
        "mu",
        "controllers",
        "sensitivity",
        "step_single",
        "step_easy",
        "step_difficult",
        "step_load",
        "landscape",
    ]
    assert drawn.omitted == {}


def test_documented_figures_are_those_that_are_drawn(drawn: TuningFigures) -> None:
    """docs/figures.md lists every figure of a tuning, in their order."""
    text = (Path(__file__).parents[2] / "docs" / "figures.md").read_text("utf-8")
    assert re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE) == list(drawn.figures)


def test_mu_shows_the_three_curves(tuned: RequestedTuning, drawn: TuningFigures) -> None:
    """The curves are those of the result, to six digits."""
    for name in ("robust_performance", "robust_stability", "nominal_performance"):
        (curve,) = traces(drawn.figures["mu"], name.replace("_", " "))
        assert curve.x == pytest.approx(tuned.result.curves.omega, rel=1e-5)
        assert curve.y == pytest.approx(getattr(tuned.result.curves, name), rel=1e-5)


def test_mu_marks_the_published_peak(drawn: TuningFigures) -> None:
    """The refined peak of the published settings is marked, with those that come as high."""
    (marks,) = traces(drawn.figures["mu"], "robust performance", "markers")
    assert marks.x[0] == pytest.approx(0.0314362, rel=1e-5)
    assert marks.y[0] == pytest.approx(1.00034840, rel=1e-5)
    assert len(marks.x) > 1
    assert min(marks.y) > 0.995


def test_mu_has_its_level(drawn: TuningFigures) -> None:
    """A line stands at the level that must not be exceeded."""
    (level,) = drawn.figures["mu"].layout.shapes
    assert (level.y0, level.y1) == (1, 1)


def test_identical_settings_fail_the_demand_of_independent_ones(drawn: TuningFigures) -> None:
    """Identical settings, drawn beside at the same demand, exceed the level (SLH, fig. 4)."""
    (curve,) = traces(drawn.figures["mu"], "robust performance, identical settings")
    assert max(curve.y) > 1.1


def test_bounds_of_two_loops_meet_at_the_peak(drawn: TuningFigures) -> None:
    """The figure of a tuning marks the lower bound; for two loops it is mu itself."""
    (mark,) = traces(drawn.figures["mu"], "lower bound of the peak", "markers")
    (peaks,) = traces(drawn.figures["mu"], "robust performance", "markers")
    assert (mark.x, mark.y) == (peaks.x[:1], pytest.approx(peaks.y[:1], rel=1e-5))


def test_lower_bound_stands_at_the_peak() -> None:
    """A lower bound is a mark of its own; curves that do not exist are gaps."""
    curves = DrawnCurves(
        omega=[0.1, 1.0, 10.0],
        robust_performance=[0.5, None, 0.7],
        robust_stability=[None, None, None],
        nominal_performance=[0.1, 0.2, 0.1],
    )
    nothing = Peak(value=None, omega=None)
    peaks = Peaks(
        robust_performance=Peak(value=0.8, omega=1.0),
        robust_stability=nothing,
        nominal_performance=nothing,
    )
    figure = figures.mu(curves, peaks, lower_bound=Peak(value=0.78, omega=1.1))
    assert traces(figure, "robust performance")[0].y == (0.5, None, 0.7)
    assert traces(figure, "robust stability", "markers")[0].x == ()
    (mark,) = traces(figure, "lower bound of the peak", "markers")
    assert (mark.x, mark.y) == ((1.1,), (0.78,))


def test_controllers_bend_at_their_integral_time(drawn: TuningFigures) -> None:
    """At 1/tau_I a PI controller has the gain k sqrt(2) and the phase -45 degrees."""
    for name, loop in zip(("loop 1", "loop 2"), PUBLISHED, strict=True):
        gain, phase = traces(drawn.figures["controllers"], name)
        at = math.log(1 / loop.integral_time)
        x = np.log(gain.x)
        assert np.interp(at, x, gain.y) == pytest.approx(loop.gain * math.sqrt(2), rel=1e-3)
        assert np.interp(at, x, phase.y) == pytest.approx(-45, abs=0.2)


def test_sensitivity_of_loops_alone(drawn: TuningFigures) -> None:
    """|S| of a loop alone is |1/(1 + g c)|."""
    (curve,) = traces(drawn.figures["sensitivity"], "loop 2 alone")
    s = 1j * np.array(curve.x)
    L = PUBLISHED[1](s) / (100 * s + 1)
    assert curve.y == pytest.approx(np.abs(1 / (1 + L)), rel=2e-5)


def test_sensitivity_with_all_closed(drawn: TuningFigures) -> None:
    """The largest singular value of S is that of the full matrix."""
    (curve,) = traces(drawn.figures["sensitivity"], "all closed")
    s = 1j * np.array(curve.x)
    G = np.array([[1, 0.949], [0.949, 1]]) / (100 * s[:, None, None] + 1)
    C = np.stack([loop(s) for loop in PUBLISHED], axis=-1)
    S = np.linalg.inv(np.eye(2) + G * C[:, None, :])
    assert curve.y == pytest.approx(np.linalg.norm(S, 2, axis=(1, 2)), rel=2e-5)


def test_identical_settings_stand_in_both_panels_of_sensitivity(drawn: TuningFigures) -> None:
    """Identical settings have a curve alone and one together, and one entry of the legend."""
    curves = traces(drawn.figures["sensitivity"], "identical settings")
    assert [curve.yaxis for curve in curves] == ["y", "y2"]
    assert [curve.showlegend for curve in curves] == [True, False]


def test_loops_that_are_unstable_alone_have_no_sensitivity() -> None:
    """A loop that only its neighbours stabilise is left out where it would stand alone."""
    plant = first_order(2, 1, 10, 0.2, 1.0)
    wild = (Controller(2, 8), Controller(40, 8))
    tuned = published()
    unstable = RequestedTuning(
        tuned.request.model_copy(update={"plant": _as_request(plant)}),
        tuned.result.model_copy(update={"loops": [_as_loop(loop) for loop in wild]}),
    )
    names = {trace.name for trace in figures.sensitivity(unstable).data}
    assert "loop 1 alone" in names
    assert "loop 2 alone" not in names


def _as_request(plant: Any) -> Any:
    usual = archived(plant, (Controller(1, 10),) * 2, *_USUAL)
    return usual.request.plant


def _as_loop(loop: Controller) -> Any:
    return archived(first_order(1, 1, 1, 0), (loop,), *_USUAL).result.loops[0]


_USUAL = (Uncertainty.from_error(0.2, 1), Performance(tau_p=19))


def test_a_single_loop_follows_its_set_point(drawn: TuningFigures) -> None:
    """A PI loop on a lag starts with u = k and ends at its set point, the input at 1/g(0)."""
    for name, loop in zip(("loop 1", "loop 2"), PUBLISHED, strict=True):
        nominal, _, signal = traces(drawn.figures["step_single"], name)
        assert nominal.y[0] == 0
        assert nominal.y[-1] == pytest.approx(1, abs=0.02)
        assert signal.y[0] == pytest.approx(loop.gain, rel=1e-5)
        assert signal.y[-1] == pytest.approx(1, abs=1)


def test_directions_are_easy_and_difficult(drawn: TuningFigures) -> None:
    """Both outputs rise together in the easy direction, and part in the difficult one."""
    easy = [traces(drawn.figures["step_easy"], name)[0].y[-1] for name in ("loop 1", "loop 2")]
    hard = [traces(drawn.figures["step_difficult"], name)[0] for name in ("loop 1", "loop 2")]
    assert easy == pytest.approx([1, 1], abs=0.02)
    assert [response.y[-1] for response in hard] == pytest.approx([-1, 1], abs=0.02)


def test_the_difficult_direction_takes_longer_and_more_input(drawn: TuningFigures) -> None:
    """What SLH show in figs. 9 and 10: slower, at twenty times the steady input."""
    easy, hard = (traces(drawn.figures[f"step_{name}"], "loop 1") for name in ("easy", "difficult"))
    assert hard[0].x[-1] > 1.5 * easy[0].x[-1]
    assert hard[-1].y[-1] == pytest.approx(-1 / (1 - 0.949), rel=0.05)


def test_the_worst_case_differs_and_stays_stable(drawn: TuningFigures) -> None:
    """Under the worst perturbation the outputs swing further, and settle none the less."""
    for name in ("easy", "difficult"):
        nominal, worst, _ = traces(drawn.figures[f"step_{name}"], "loop 1")
        assert max(map(abs, worst.y)) < 3
        assert max(abs(a - b) for a, b in zip(nominal.y, worst.y, strict=True)) > 0.05
        assert worst.y[-1] == pytest.approx(nominal.y[-1], abs=0.1)


def test_set_points_are_drawn_once_in_the_legend(drawn: TuningFigures) -> None:
    """The set points of both directions stand in both output panels under one legend entry."""
    curves = traces(drawn.figures["step_difficult"], "set point")
    assert sorted(curve.y[-1] for curve in curves) == [-1, -1, 1, 1]
    assert sum(curve.showlegend for curve in curves) == 1


def test_units_of_a_group_share_a_curve() -> None:
    """Sixty units in two groups draw two controllers, and name the loops they stand for."""
    plant = first_order(60, 1, 50, 0.01)
    loops = (Controller(10, 40),) * 20 + (Controller(14, 30),) * 40
    figure = figures.controllers(archived(plant, loops, *_USUAL))
    assert {trace.name for trace in figure.data} == {"loops 1-20", "loops 21-60"}


def test_a_full_block_has_a_worst_case_too() -> None:
    """The worst perturbation of a full block couples all inputs and can be simulated."""
    uncertainty = Uncertainty.from_error(0.2, 1, Structure.FULL)
    tuned = archived(first_order(2, 1, 10, 0.3), (Controller(2, 8),) * 2, uncertainty, _USUAL[1])
    drawn = figures.tuning_figures(tuned)
    assert drawn.omitted == {}
    worst = [trace for trace in drawn.figures["step_easy"].data if trace.yaxis == "y2"]
    assert {trace.name for trace in worst} == {"set point", "loop 1", "loop 2"}


def test_what_cannot_be_drawn_is_named() -> None:
    """A matrix plant that integrates has no easy direction; its other figures stand."""
    integrator = TransferFunction((1,), (1, 0))
    plant = MatrixPlant([[integrator, TransferFunction((0,), (1,))],
                         [TransferFunction((0.2,), (5, 1)), integrator]])  # fmt: skip
    loops = (Controller(0.4, 20), Controller(0.3, 30))
    drawn = figures.tuning_figures(archived(plant, loops, *_USUAL))
    assert set(drawn.omitted) == {"step_easy", "step_difficult"}
    assert "integrating" in drawn.omitted["step_easy"]
    assert {"mu", "step_single", "landscape"} <= set(drawn.figures)


def test_an_infeasible_tuning_has_no_figures() -> None:
    """Without settings and local optima there is nothing to draw."""
    drawn = figures.tuning_figures(infeasible())
    assert (drawn.figures, drawn.omitted) == ({}, {})


def test_a_result_without_curves_says_so() -> None:
    """Figures over frequency need curves."""
    drawn = figures.tuning_figures(published(curves=None, peaks=None))
    assert {"mu", "controllers", "sensitivity"} == set(drawn.omitted)


@pytest.mark.parametrize(
    ("counts", "told"),
    [
        (
            (2, 0),
            "2 ended in 1 local optimum, the others were given up as worse; 1 more was",
        ),
        ((3, 1), "Of 4 starts 4 ended in 2 different local optima. Above"),
        ((0, 0), "Of 4 starts 0 ended in 0 different local optima"),
    ],
)
def test_starts_add_up_in_the_landscape(counts: tuple[int, int], told: str) -> None:
    """An optimum that another one led to is no start's end, and is told beside those that are."""
    tuned = published()
    search = tuned.result.search
    optima = [
        optimum.model_copy(update={"count": count})
        for optimum, count in zip(search.local_optima, counts, strict=True)
    ]
    changed = search.model_copy(update={"starts": 4, "local_optima": optima})
    result = tuned.result.model_copy(update={"search": changed})
    assert told in str(landscape(replace(tuned, result=result)).layout.to_plotly_json())


def test_landscape_shows_the_best_first(drawn: TuningFigures) -> None:
    """The upper panel ranks the optima, the lower one joins the settings of each."""
    ranked, *settings = drawn.figures["landscape"].data
    assert list(ranked.y) == [19, 22.8]
    assert list(ranked.text) == ["9 starts", "3 starts"]
    assert [trace.name for trace in settings] == ["optimum 2", "optimum 1"]
    assert list(settings[-1].x) == [46.3, 22.8]
    assert list(settings[-1].y) == [101, 3.15]


@pytest.mark.parametrize("case", [*ZOO, Case("column", COLUMN, (Controller(2, 60),) * 2)], ids=str)
def test_every_plant_is_drawn_in_plain_json(case: Case) -> None:
    """Every plant of the zoo gives figures of plain numbers, with named axes and no background."""
    drawn = figures.tuning_figures(
        archived(case.plant, case.loops, case.uncertainty, case.performance, case.loops[0])
    )
    document = figures_to_json(drawn.figures, drawn.omitted)
    text = json.dumps(document, allow_nan=False)
    assert "bdata" not in text
    assert {"mu", "controllers", "sensitivity", "landscape"} <= set(document["figures"])
    for figure in document["figures"].values():
        check_layout(figure["layout"])


def check_layout(layout: dict[str, Any]) -> None:
    """Assert that every labelled axis has a name, and what belongs to the page is left to it."""
    assert set(layout["meta"]) == {"title", "description"}
    assert not {"template", "paper_bgcolor", "plot_bgcolor", "title"} & set(layout)
    axes = [axis for name, axis in layout.items() if name[1:].startswith("axis")]
    assert len(axes) >= 2
    for axis in axes:
        assert axis.get("showticklabels") is False or axis["title"]["text"]
