"""Figures over frequency: mu, controllers, sensitivities.

The forms of Skogestad, Lundstrom and Hovd (1989), figs. 4 to 7.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from service.figures.panels import Panels
from service.figures.style import IDENTICAL, NEUTRAL, THIN, frequency_title, line, log_axis
from service.schemas.drawn import DrawnCurves
from service.schemas.peaks import Curves, Peak, Peaks
from service.sheet.naming import loops_name, unlike
from service.tuned import RequestedTuning
from service.wording import TIME_UNIT, number
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.plants import Plant
from solver.model.subsystems import subsystem
from solver.robustness.curves import LoopAnalysis
from solver.robustness.margins import loop_transfer
from solver.robustness.worst_case import worst_case
from solver.stability.closed_loop import is_stable

__all__ = ["controllers", "mu", "sensitivity", "tuned_mu"]

_ACTIVE = 5e-3  # relative distance from the highest peak up to which a grid's peak is marked
_FLAT = 0.05  # of mu: what differs less from the end of the grid need not be seen
_BESIDE = 10.0  # factor in frequency beyond what must be seen
_CURVES = (
    ("robust performance", "robust_performance", "circle"),
    ("robust stability", "robust_stability", "diamond"),
    ("nominal performance", "nominal_performance", "square"),
)


def mu(
    curves: Curves,
    peaks: Peaks,
    *,
    lower_bound: Peak | None = None,
    identical: Curves | None = None,
    scenarios: Mapping[str, Curves] | None = None,
    unit: str = TIME_UNIT,
) -> go.Figure:
    """Return mu over frequency: three curves, their peaks, and the level that must be kept.

    Parameters
    ----------
    curves, peaks : Curves, Peaks
        Of a tuning or an analysis.
    lower_bound : Peak or None
        Lower bound of the robust performance peak.
    identical : Curves or None
        Those of the best identical settings at the same demand.
    scenarios : mapping of str to Curves or None
        Those of further plants under the same settings, by name.
    unit : str
        Name of the unit of time.

    """
    peak = peaks.robust_performance
    panels = Panels(
        "Robustness: μ over frequency",
        f"Robust performance peaks at μ = {number(peak.value)} at ω = {number(peak.omega)}; up to "
        "1 the demand is met for every plant in the uncertainty set. Marks: the active peaks"
        + (
            "."
            if lower_bound is None
            else "; triangle: the lower bound, which shows how exact μ is."
        ),
    )
    for index, (name, field, symbol) in enumerate(_CURVES):
        style = line(index)
        panels.curve(curves.omega, getattr(curves, field), name, style)
        marks = _marks(curves, getattr(curves, field), getattr(peaks, field))
        panels.curve(
            [mark.omega for mark in marks], [mark.value for mark in marks], name, style,
            mode="markers", marker={"color": style["color"], "symbol": symbol, "size": 8},
        )  # fmt: skip
    for index, (name, each) in enumerate((scenarios or {}).items()):
        panels.curve(
            each.omega, each.robust_performance, f"robust performance, {name}",
            line(len(_CURVES) + index),
        )  # fmt: skip
    if identical is not None:
        panels.curve(
            identical.omega, identical.robust_performance,
            "robust performance, identical settings", IDENTICAL,
        )  # fmt: skip
    if lower_bound is not None:
        panels.curve(
            [lower_bound.omega], [lower_bound.value], "lower bound of the peak", THIN,
            mode="markers", marker={"color": NEUTRAL, "symbol": "triangle-up-open", "size": 11},
        )  # fmt: skip
    panels.x(1, frequency_title(unit), **log_axis(np.array(curves.omega)[_shown(curves)], 0.01))
    panels.y(1, "μ (1)", rangemode="tozero", hoverformat=".5g")
    panels.level(1.0, "level 1")
    return panels.figure()


def _marks(curves: Curves, values: list[float | None], peak: Peak) -> list[Peak]:
    """Return the highest peak and the peaks of the grid, as far as shown, that come as high."""
    shown = _shown(curves)
    heights = np.array(values, dtype=float)[shown]
    if peak.value is None or not peak.omega or peak.omega < 0 or heights.size == 0:
        return []
    padded = np.concatenate([[-np.inf], np.nan_to_num(heights, nan=-np.inf), [-np.inf]])
    tops = (padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:])
    omega = np.array(curves.omega)[shown]
    # The refined peak stands for the one of the grid beside it.
    apart = np.abs(np.log(omega / peak.omega)) > 2 * np.max(np.diff(np.log(omega)), initial=0)
    chosen = np.flatnonzero(tops & apart & (heights >= (1 - _ACTIVE) * peak.value))
    return [peak, *(Peak(value=heights[index], omega=omega[index]) for index in chosen)]


def tuned_mu(tuned: RequestedTuning) -> go.Figure:
    """Return mu over frequency of a tuning, the best identical settings beside. Needs settings."""
    curves, peaks = _curves(tuned), tuned.result.peaks
    if peaks is None:
        message = "the result has no peaks"
        raise InvalidInputError(message)
    identical = None
    if tuned.identical:
        analysis = _analysis(tuned, tuned.identical)
        identical = DrawnCurves.of(analysis.curves(np.array(curves.omega)))
    lower_bound = _lower_bound(tuned, peaks.robust_performance.omega)
    return mu(
        curves, peaks, lower_bound=lower_bound, identical=identical,
        scenarios={each.name: each.curves for each in tuned.result.scenarios[1:]}, unit=tuned.unit,
    )  # fmt: skip


def _lower_bound(tuned: RequestedTuning, omega: float | None) -> Peak | None:
    """Return the lower bound of mu at the frequency of the peak, which shows the bounds' gap."""
    if omega is None or omega <= 0:  # no perturbation is sought at steady state
        return None
    analysis, top = _analysis(tuned, tuned.loops), np.array([omega])
    worst = worst_case(
        analysis.blocks, analysis.controllers, tuned.uncertainty, tuned.performance,
        omega=top, scales=analysis.scales(top),
    )  # fmt: skip
    return Peak(value=worst.mu, omega=worst.omega)


def controllers(tuned: RequestedTuning) -> go.Figure:
    """Return gain and phase of the controllers, identical ones beside. Needs settings."""
    curves = _curves(tuned)
    omega, shown = np.array(curves.omega), _shown(curves)
    panels = Panels(
        "Controllers: gain and phase",
        "Frequency responses of the different settings"
        + (", the best identical setting beside." if tuned.identical else "."),
        rows=2,
        height=480,
    )
    drawn = [
        (loops_name(tuned, setting.units), setting.controller, line(index))
        for index, setting in enumerate(unlike(tuned))
    ]
    if tuned.identical:
        drawn.append(("identical settings", tuned.identical[0], IDENTICAL))
    gains = []
    for name, controller, style in drawn:
        response = controller.response(omega)
        gains.append(np.abs(response))
        panels.curve(omega, gains[-1], name, style)
        panels.curve(omega, np.degrees(np.unwrap(np.angle(response))), name, style, row=2)
    panels.shared_x(frequency_title(tuned.unit), **log_axis(omega[shown]))
    panels.y(1, "|c(jω)|<br>(input/output)", **log_axis(np.array(gains)[:, shown].flat, 0.05))
    panels.y(2, "phase of c<br>(degrees)", dtick=45)
    return panels.figure()


def sensitivity(tuned: RequestedTuning) -> go.Figure:
    """Return |S| of each loop alone and the largest singular value of S, all closed.

    Needs settings. Loops that are unstable alone have no |S|.
    """
    curves = _curves(tuned)
    omega, shown = np.array(curves.omega), _shown(curves)
    panels = Panels(
        "Sensitivity: each loop alone, and all closed",
        "Above: |S| of each loop with the others open. Below: the largest singular value of S "
        "with all loops closed, under the bound that the demand sets; interaction shows as the "
        "bandwidth lost from above to below.",
        rows=2,
        height=520,
    )
    alone = [
        (
            f"{loops_name(tuned, setting.units)} alone",
            line(index),
            _alone(tuned.plant, tuned.loops, setting.units[0]),
        )
        for index, setting in enumerate(unlike(tuned))
    ]
    all_closed = line(len(alone))
    together = [("all closed", all_closed, _together(tuned, tuned.loops, omega))]
    if tuned.identical:
        name = "identical settings"
        alone.append((name, IDENTICAL, _alone(tuned.plant, tuned.identical, 0)))
        together.append((name, IDENTICAL, _together(tuned, tuned.identical, omega)))
    bound = 1 / tuned.performance.magnitude(omega)
    together.append(("bound 1/|w<sub>P</sub>|", THIN, bound))
    panels.shared_x(frequency_title(tuned.unit), **log_axis(omega[shown]))
    titles = ("|S|, loop alone<br>(1)", "σ<sub>max</sub>(S), all closed<br>(1)")  # noqa: RUF001
    single = [(name, style, S(omega)) for name, style, S in alone if S is not None]
    for row, title, drawn in zip((1, 2), titles, (single, together), strict=True):
        for name, style, values in drawn:
            panels.curve(omega, values, name, style, row=row)
        seen = np.array([values[shown] for _, _, values in drawn])
        panels.y(row, title, **log_axis(seen.flat, 0.05))
    return panels.figure()


def _curves(tuned: RequestedTuning) -> Curves:
    if tuned.result.curves is None:
        message = "the result has no curves"
        raise InvalidInputError(message)
    return tuned.result.curves


def _shown(curves: Curves) -> NDArray[np.bool_]:
    """Tell which frequencies to show at first: those where something happens, and some beside."""
    omega = np.array(curves.omega)
    values = np.array([getattr(curves, field) for _, field, _ in _CURVES], dtype=float)
    from_low = np.any(np.abs(values - values[:, :1]) > _FLAT, axis=0)
    from_high = np.any(np.abs(values - values[:, -1:]) > _FLAT, axis=0)
    if not (from_low.any() and from_high.any()):
        return np.ones(omega.size, dtype=bool)
    lively = omega[np.argmax(from_low)], omega[::-1][np.argmax(from_high[::-1])]
    return np.asarray((omega >= min(lively) / _BESIDE) & (omega <= max(lively) * _BESIDE))


def _alone(
    plant: Plant, loops: tuple[Controller, ...], unit: int
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]] | None:
    """Return |S| of one loop as a function of frequency (k,), None where it is unstable."""
    single, loop = subsystem(plant, loops, (unit,))
    if not is_stable(single, loop):
        return None
    L = loop_transfer(single, loop, 0)
    return lambda omega: np.abs(1 / (1 + L(omega)))


def _together(
    tuned: RequestedTuning, loops: tuple[Controller, ...], omega: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return sigma_max(S): the bound of nominal performance, its weight divided out."""
    nominal = _analysis(tuned, loops).nominal_performance(omega)
    values: NDArray[np.float64] = nominal / tuned.performance.magnitude(omega)
    return values


def _analysis(tuned: RequestedTuning, loops: tuple[Controller, ...]) -> LoopAnalysis:
    uncertainty, performance = tuned.uncertainty, tuned.performance
    scales = performance.output_scale
    blocks, distinct = group_loops(tuned.plant, loops, uncertainty, scales)
    return LoopAnalysis(blocks, distinct, uncertainty, performance)
