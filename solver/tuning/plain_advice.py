"""Sentences that an operator understands, each made from numbers of the result."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.measured import MeasuredPlant
from solver.model.plants import MAX_MATRIX_SIZE
from solver.model.subsystems import subsystem
from solver.robustness.axis import proven_peaks
from solver.simulation.estimated import estimated_overshoot
from solver.simulation.exact_overshoot import exact_overshoot
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.loops import Loop
from solver.simulation.step_response import step_response
from solver.stability.closed_loop import is_stable
from solver.tuning.specification import Objective

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from solver.model.plants import Plant
    from solver.tuning.beside import AsFound, SettingsTolerance
    from solver.tuning.record import Comparison, Tuning
    from solver.tuning.scenarios import Case
    from solver.tuning.specification import Specification

__all__ = ["plain_advice"]

WORTH_IT = 1.0  # per cent that unlike settings must gain to be worth the name
NOTHING = 1e-4  # per cent, from rounding
CHIEFLY = 0.6  # share of the weakest direction in one output
APART = 1.02  # ratio of the two weakest directions from which they are two
AT_REST = 1e-4  # of the bandwidth: the limit towards the frequency 0, however near a peak was found
OVERSHOOTS = 0.25
CALM = 0.15  # estimated overshoot up to which a loop is not simulated
MOST_ALONE = 4  # different loops that are looked at alone
ALONE_SHOWN = 3.0  # times tau_P: an overshoot comes early
NO_WORSE = 1e-5  # of mu: loops whose integral time went to the end of its box differ by as much
LOWER_HURTS = 1e-3  # of mu above 1, from which lower gains are said not to be safer


def plain_advice(
    specification: Specification, tuning: Tuning, deciding: Case, omega: float
) -> tuple[str, ...]:
    """Return what the numbers of a result mean for whoever uses the settings.

    `deciding` is the case that has the highest peak of mu, at `omega`.
    """
    found: list[str] = []
    if tuning.comparison is not None and tuning.comparison.gain_percent < WORTH_IT:
        found += _identical_suffice(tuning, tuning.comparison)
    found += _limited_by(specification, tuning, deciding, omega)
    if not isinstance(specification.plant, MeasuredPlant):  # it has no responses in time
        found += _alone(specification, tuning)
        found += _without_integral_action(specification, tuning)
    if tuning.as_found is not None:
        found += _beside_today(specification, tuning, tuning.as_found)
    if tuning.settings_tolerance is not None and tuning.demand_met:
        found += _lower_gains(tuning.settings_tolerance)
    return tuple(found)


def _identical_suffice(tuning: Tuning, comparison: Comparison) -> Iterator[str]:
    """Say that the same settings on every unit are as good."""
    if len(tuning.groups) == 1:
        return
    percent = comparison.gain_percent
    gain = f"{percent:.2g} %" if percent > NOTHING else "nothing"
    yield (
        f"Identical settings suffice: unlike ones gain {gain} over "
        f"{comparison.identical_value:.4g}."
    )


def _without_integral_action(specification: Specification, tuning: Tuning) -> Iterator[str]:
    """Say which loops keep the demand without integral action, all together or one kind alone."""
    plant, offset = specification.plant, specification.performance.offset
    several = len(tuning.scenarios) > 1
    if several or not (offset > 0 or any(e.den[-1] == 0 for e in plant.elements)):
        return
    every = tuple(range(plant.n))
    kinds = [every] if len(tuning.groups) == 1 else [every, *tuning.groups[:MOST_ALONE]]
    for units in kinds:
        mu = _mu_without(specification, tuning, units)
        if mu is None:
            continue
        where = "" if units == every else f" in {_loops(units)}"
        yield (
            f"Integral action{where} is not needed for this demand: without it mu is {mu:.4g}. "
            "Loads then leave an offset; ask for max_load_error where they must not."
        )
        if units == every:
            return


def _loops(units: Sequence[int]) -> str:
    """Name loops, counted from 1."""
    names = [str(unit + 1) for unit in units[:MOST_ALONE]]
    names += ["..."] if len(units) > MOST_ALONE else []
    return f"loop {names[0]}" if len(units) == 1 else f"loops {', '.join(names)}"


def _mu_without(specification: Specification, tuning: Tuning, units: Sequence[int]) -> float | None:
    """Return the peak of mu without integral action in these loops; None: it is needed."""
    plant = specification.plant
    loops = [
        replace(loop, integral_time=None) if unit in units else loop
        for unit, loop in enumerate(tuning.loops)
    ]
    if tuning.tau_p is None or not is_stable(plant, loops):
        return None
    demand = specification.performance.with_tau_p(tuning.tau_p)
    try:
        axis = proven_peaks(plant, specification.uncertainty, demand, loops)
    except InvalidInputError:  # an offset where none is permitted
        return None
    mu = axis.peaks.robust_performance.value
    reached = 1.0 if tuning.peaks is None else max(1.0, tuning.peaks.robust_performance.value)
    return mu if mu <= reached * (1 + NO_WORSE) else None


def _limited_by(
    specification: Specification, tuning: Tuning, case: Case, omega: float
) -> Iterator[str]:
    """Say which unit's output is the weak direction of S where mu is highest."""
    plant = case.plant
    if specification.plant.n == 1 or plant.n > MAX_MATRIX_SIZE:
        return
    at = np.array([omega])
    G = plant.response(at)[0]
    c = np.array([loop.response(at)[0] for loop in case.loops(tuning.loops)])
    e = np.array(case.performance.output_scale or (1.0,) * plant.n)
    S = np.linalg.inv(np.eye(plant.n) + G * c) * (e / e[:, None])
    directions, sizes, _ = np.linalg.svd(S)
    share = np.abs(directions[:, 0]) ** 2
    place = int(share.argmax())
    # Among like directions the weakest is none of them in particular.
    if share[place] >= CHIEFLY and (plant.n == 1 or sizes[0] >= APART * sizes[1]):
        name = "tau_P" if specification.objective is Objective.TAU_P else "mu"
        tau_p = tuning.tau_p or specification.performance.tau_p
        slow = tau_p is not None and omega * tau_p < AT_REST
        where = f"loop {case.units[place] + 1} at "
        where += "rest" if slow else f"{omega:.3g} rad per time unit"
        if case.scenarios[0] != 0:
            where += f", in scenario {specification.name_of(case)!r}"
        yield f"{name} is limited by {where}."


def _alone(specification: Specification, tuning: Tuning) -> Iterator[str]:
    """Say which loops overshoot much when all others are in manual."""
    plant, tau_p = specification.plant, tuning.tau_p
    if plant.n == 1 or tau_p is None or len(tuning.groups) > MOST_ALONE:
        return
    overshooting: dict[str, list[int]] = {}
    for group in tuning.groups:
        part, loops = subsystem(plant, tuning.loops, group[:1])
        shown = ALONE_SHOWN * tau_p
        closed = Loop.of(loops[0]).without_traces(shown)
        overshoot = exact_overshoot(part.element(0, 0), closed.controller, shown)
        calm = overshoot is not None and not overshoot > OVERSHOOTS
        if calm or not is_stable(part, loops):
            continue  # of unstable ones the line on integrity tells
        if overshoot is None:
            overshoot = _simulated_overshoot(part, closed, shown)
        if not overshoot > OVERSHOOTS:
            continue
        percent = f"{100 * overshoot:.0f} %"
        if plant.n == 2:
            here, other = group[0] + 1, 2 - group[0]
            yield (
                f"With loop {other} in manual put loop {here} in manual too: alone it overshoots "
                f"a set-point step by {percent}."
            )
        else:
            overshooting.setdefault(percent, []).extend(group)
    for percent, units in overshooting.items():
        names = [f"loop {unit + 1}" for unit in sorted(units)]
        if len(names) > MOST_ALONE:
            names = [*names[:2], f"{len(names) - 2} others"]
        which, verb = names[0], "overshoots"
        if len(names) > 1:
            which, verb = f"{', '.join(names[:-1])} and {names[-1]} each", "overshoot"
        yield f"Alone in service {which} {verb} a set-point step by {percent}."


def _simulated_overshoot(part: Plant, loop: Loop, shown: float) -> float:
    """Return by how much a loop exceeds a set-point step; 0 where it is small or not known."""
    about = estimated_overshoot(part, loop.controller, shown)
    if about is not None and about < CALM:
        return 0.0
    step = Step(StepKind.SETPOINT, 0, 0.0, 1.0)
    try:
        response = step_response(Experiment(part, (loop,), (step,), shown))
    except InvalidInputError:  # no simulation holds the plant
        return 0.0
    change = response.responses[0].metrics.set_point
    return 0.0 if change is None else change.overshoot


def _beside_today(specification: Specification, tuning: Tuning, today: AsFound) -> Iterator[str]:
    """Say what today's settings do."""
    if specification.objective is Objective.MU:
        if today.peaks is not None and tuning.peaks is not None:
            before, now = today.peaks.robust_performance, tuning.peaks.robust_performance
            yield (
                f"Today's settings have a peak of mu of {before.value:.4g}; these have "
                f"{now.value:.4g}."
            )
            return
    elif today.tau_p is not None and tuning.tau_p is not None:
        share = 100 * (1 - tuning.tau_p / today.tau_p)
        word = f"{share:.3g} % less" if share >= 0 else f"{-share:.3g} % more"
        yield (
            f"Today's settings keep the demand from tau_P = {today.tau_p:.4g} on; these from "
            f"tau_P = {tuning.tau_p:.4g} on, {word}."
        )
        return
    if today.reason is not None:
        yield f"Today's settings do not keep the demand at any tau_P: {today.reason}."


def _lower_gains(near: SettingsTolerance) -> Iterator[str]:
    """Say that lower gains are not safer, where they are not."""
    mu = near.lower_gains
    if mu is None:
        yield "Lower gains are not safer here: with all gains 5 % lower the loops are unstable."
    elif mu > 1 + LOWER_HURTS:
        yield (
            f"Lower gains are not safer here: with all gains 5 % lower mu reaches {mu:.4g} at this "
            "tau_P."
        )
