"""Tuning of loops that move combinations of the inputs, whose uncertainty stays with the inputs.

K = M_u C is no diagonal controller, but N_RP = [[w_I K S G, w_I K S], [w_P S G, w_P S]] is what it
was, and so is the search for the best settings of a fixed structure (`structure_search`): loops on
the columns of W = M_u, each scaled so that its own static gain is one; PI controllers first, then
those with more parameters beside them.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.limits.search import bandwidth_of
from solver.limits.structure_search import STARTS, StructureSearch
from solver.limits.structures import INTEGRAL, SPEEDS, Structure, StructureKind
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.frequencies import corners
from solver.model.measured import MeasuredPlant
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.robustness.centralised_curves import central_blocks
from solver.tuning import tuner
from solver.tuning.clock import Clock, OutOfTimeError
from solver.tuning.demand_checks import BELOW, outcomes, planes
from solver.tuning.groupings import named_partition
from solver.tuning.record import SearchSummary, Status, Tuning
from solver.tuning.relaxing import with_the_demands_named
from solver.tuning.specification import Arrangement, ControllerKind, Signs

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.limits.structure_search import StructuredController
    from solver.model.mixing import Mixing
    from solver.model.weights import Performance
    from solver.tuning.groupings import Groups
    from solver.tuning.record import Progress
    from solver.tuning.specification import Specification

__all__ = ["mixed_controller", "tune_task"]

GRACE = 5.0  # seconds after the end, in which the best so far is checked on the whole axis
# Further times over the integral time, where the search for other controllers than PI begins.
_SHARES: dict[ControllerKind, list[tuple[float, ...]]] = {
    ControllerKind.PID: [(1e-3,), (0.03,), (0.25,), (1.0,)],
    ControllerKind.PIF: [(1e-3,), (0.1,)],
    ControllerKind.PIDF: [(1e-3, 1e-3), (0.03, 0.003), (0.25, 0.03), (1.0, 0.3)],
}
IDLE = 1e-3  # of the integral time: a derivative or filter time that does next to nothing
SMALLEST = 1e-9  # of a loop's own gain over that of its row and column

# What is not offered for loops that move combinations of inputs; and the field that asks for it.
_NOT_OFFERED: tuple[tuple[str, object, str, str], ...] = (
    ("scenarios", (), "/scenarios", "scenarios"),
    ("spread", None, "/spread", "a spread of parameters"),
    ("resolution", None, "/controller/resolution", "a resolution of the settings"),
    ("optimality_gap", False, "/search/optimality_gap", "a proof of optimality"),
    ("signs", Signs.USUAL, "/controller/signs", "other signs"),
)


def tune_task(
    specification: Specification, progress: Callable[[Progress], bool | None] | None = None
) -> Tuning:
    """Find the best settings for a specification, whatever its loops move.

    Where demands on loops that move combinations of inputs forbid settings, they are named.

    Parameters, errors: as for `solver.tuning.tuner.tune`.
    """
    if specification.mixing is None or specification.mixing.inputs is None:
        return tuner.tune(specification, progress)
    found = _tune(specification, progress)
    if found.status is not Status.INFEASIBLE or not specification.demands.names:
        return found
    return with_the_demands_named(
        specification.arranged(None), found, lambda task: _tune(task, progress)
    )


def mixed_controller(loops: Sequence[Controller], mixing: Mixing) -> MatrixPlant:
    """Return M_u C as a matrix of transfer functions."""
    assert mixing.inputs is not None  # noqa: S101 - for the type checker: who calls knows

    def element(factor: float, loop: Controller) -> TransferFunction:
        if factor == 0:
            return TransferFunction((0.0,), (1.0,))
        num, den = loop.polynomials
        return TransferFunction([factor * coefficient for coefficient in num], den)

    return MatrixPlant(
        [
            [element(factor, loop) for factor, loop in zip(row, loops, strict=True)]
            for row in mixing.inputs
        ]
    )


def _tune(
    specification: Specification, progress: Callable[[Progress], bool | None] | None
) -> Tuning:
    for name, usual, where, words in _NOT_OFFERED:
        if getattr(specification, name) != usual:
            message = f"loops that move combinations of inputs (mixing.inputs) are without {words}"
            raise UnsupportedPlantError(message, where)
    for name in ("max_sensitivity_alone", "integrity"):
        if name in specification.demands.names:
            message = (
                "with mixing.inputs no loop has a process of its own; of the demands "
                "max_controller_gain and max_load_error are kept"
            )
            raise UnsupportedPlantError(message, f"/demands/{name}")
    if specification.arrangement is Arrangement.BEST:
        message = "with mixing.inputs, name the arrangement: identical, independent, grouped"
        raise UnsupportedPlantError(message, "/controller/arrangement")
    if specification.uncertainty.unlike_inputs:
        message = "with mixing.inputs all inputs need one uncertainty"
        raise UnsupportedPlantError(message, "/uncertainty")
    task = specification.arranged(None)
    if isinstance(task.plant, MeasuredPlant):
        message = "with mixing.inputs the plant needs transfer functions"
        raise UnsupportedPlantError(message, "/mixing/inputs")
    scales = np.array(task.performance.output_scale or (1.0,) * task.plant.n)
    groups = named_partition(task)
    first, own = _structure(task, scales, groups)
    clock = Clock(task.time_limit, progress, lambda value: value)
    clock.total = STARTS
    performance = replace(task.performance, output_scale=None)
    status, found, of = _searched(task, _Asked(first, own * scales, groups), performance, clock)
    if found is None and status is Status.TIME_LIMIT:
        reason = "no feasible settings were found within the time limit"
        return _nothing(task, groups, clock, reason, status)
    if found is None or found.robustness.peaks is None:
        reason = "none were found that meet the demand at any tau_P"
        return _nothing(task, groups, clock, reason, Status.INFEASIBLE)
    tuning = _result(task, groups, found, of.loops(found.theta), own * scales)
    return replace(
        tuning,
        status=status,
        demands=outcomes(task.demands, (task.plant,), tuning.loops),
        search=SearchSummary(STARTS, (), task.seed, clock.elapsed),
    )


def _structure(
    task: Specification, scales: NDArray[np.float64], groups: Groups
) -> tuple[Structure, NDArray[np.float64]]:
    """Return the structure of the task in units of the permitted errors, and each loop's own gain.

    Raises
    ------
    UnsupportedPlantError
        A plant without static gain, or a loop that does not act on its own output at rest.

    """
    assert task.mixing is not None  # noqa: S101 - for the type checker
    M = np.array(task.mixing.inputs)
    n = task.plant.n
    rows = [[_scaled(task.plant.element(r, c), 1 / scales[r]) for c in range(n)] for r in range(n)]
    plant = MatrixPlant(rows)
    gain = plant.static_gain()
    if not np.isfinite(gain).all():
        message = "with mixing.inputs the plant must have a static gain: it integrates"
        raise UnsupportedPlantError(message, "/plant")
    seen = gain @ M
    own = np.diag(seen).copy()
    for loop, value in enumerate(own):
        most = max(np.abs(seen[loop]).max(), np.abs(seen[:, loop]).max())
        if abs(value) <= SMALLEST * most:
            message = (
                f"loop {loop + 1} does not act on what it controls at rest: take another order of "
                "the rows of outputs or the columns of inputs"
            )
            raise UnsupportedPlantError(message, "/mixing/inputs")
    for index, group in enumerate(groups):
        if len({float(np.sign(own[unit])) for unit in group}) > 1:
            message = "loops of one group act on their outputs with unlike signs"
            raise UnsupportedPlantError(message, f"/controller/groups/{index}")
        # Equal settings on all of them, whatever their own gains are.
        own[list(group)] = own[group[0]] / scales[group[0]] * scales[list(group)]
    bends = corners(plant, task.uncertainty)
    bandwidth = bandwidth_of(plant, task.uncertainty, bends)
    lag = 1 / float(corners(plant).min())
    pairs = [
        np.log([max(speed * bandwidth * lag, 1e-2), time])
        for speed in SPEEDS
        for time in sorted({INTEGRAL / (speed * bandwidth), lag})
    ]
    owner = {unit: index for index, group in enumerate(groups) for unit in group}
    starts = [np.tile(pair, len(groups)) for pair in pairs]
    if len(groups) > 1:  # a direction that is weaker may be the slower one
        starts += [np.concatenate([one, *[two] * (len(groups) - 1)]) for one in pairs[::2]
                   for two in pairs[::2] if one is not two]  # fmt: skip
    structure = Structure(
        StructureKind.STATIC_DECOUPLING, plant, central_blocks(plant, task.uncertainty),
        (M / own,), (tuple(owner[unit] for unit in range(n)),),
        tuple(f"group {index + 1}" for index in range(len(groups))), None, starts,
    )  # fmt: skip
    return structure, own


@dataclass(frozen=True)
class _Asked:
    """What the search begins with.

    Attributes
    ----------
    first : Structure
        That of PI controllers.
    units : (n,)
        Gain of each loop times its own of these is 1 in units of the structure; of its sign.
    groups : Groups
        Loops that share settings.

    """

    first: Structure
    units: NDArray[np.float64]
    groups: Groups

    def planes(
        self, task: Specification, kind: ControllerKind
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return rows and limits of bounds and demands, for logarithms as the structure has them.

        Bounds keep 2e-9 of a logarithm to either side, as the demands do.
        """
        names, count = kind.parameters, len(self.groups)
        rows, limits = planes(task.demands, kind, count)
        sides = [
            (sign * np.eye(len(names))[place], sign * math.log(end) - BELOW)
            for place, name in enumerate(names)
            for sign, end in zip((-1.0, 1.0), getattr(task.bounds, name) or (), strict=False)
        ]
        if sides:
            rows = np.vstack([rows, np.kron(np.eye(count), np.array([row for row, _ in sides]))])
            limits = np.append(limits, np.tile([limit for _, limit in sides], count))
        return (rows, limits + rows @ self._gains(names)) if limits.size else None

    def theta(self, task: Specification) -> NDArray[np.float64]:
        """Return the start that the task gives.

        Raises
        ------
        InvalidInputError
            Another number of settings, a gain of the other sign, no integral action, or unlike
            settings in a group.

        """
        start, names = task.start or (), task.kind.parameters
        found = []
        for group in self.groups:
            loop, where = start[group[0]], f"/search/start/{group[0]}"
            if loop.gain * self.units[group[0]] <= 0:
                message = "with mixing.inputs the gains have the signs that the plant has at rest"
                raise InvalidInputError(message, f"{where}/gain")
            if loop.integral_time is None:
                message = "with mixing.inputs every loop has integral action"
                raise InvalidInputError(message, f"{where}/integral_time")
            for unit in group[1:]:
                if start[unit] != loop:
                    message = f"loop {unit + 1} shares the settings of loop {group[0] + 1}"
                    raise InvalidInputError(message, f"/search/start/{unit}")
            idle = loop.integral_time * IDLE
            found += [abs(loop.gain), *(getattr(loop, name) or idle for name in names[1:])]
        return np.log(found) + self._gains(names)

    def _gains(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return what the logarithms of settings differ by from those of the structure."""
        own = [math.log(abs(self.units[group[0]])) for group in self.groups]
        return np.kron(own, np.eye(len(names))[0])


def _searched(
    task: Specification, asked: _Asked, performance: Performance, clock: Clock
) -> tuple[Status, StructuredController | None, Structure]:
    """Return the best settings found, and the structure that they are settings of.

    PI controllers first; then all parameters of the kind, beginning beside these with times that
    do next to nothing, so that nothing is lost, and with some that do; then the other one of two
    optima that come in pairs, as long as that leads on. From given settings: the best beside them.
    """
    kept = asked.planes(task, task.kind)
    if task.start is not None:
        structure = replace(
            asked.first, parameters=task.kind.parameters, starts=[asked.theta(task)]
        )
        status, found, of = _run(task, structure, performance, clock, kept)
        return Status.LOCAL if status is Status.OPTIMAL else status, found, of
    of_pi = asked.planes(task, ControllerKind.PI)
    status, found, of = _run(task, asked.first, performance, clock, of_pi)
    if task.kind is ControllerKind.PI or status is Status.TIME_LIMIT:
        return status, found, of
    starts = []
    for theta in asked.first.starts if found is None else [found.theta]:
        rows = theta.reshape(-1, 2)
        for shares in _SHARES[task.kind]:
            more = rows[:, 1:] + np.log([shares])
            starts.append(np.hstack([rows, more]).ravel())
    if task.bounds.derivative_time or task.bounds.filter_time:
        found = None  # PI has neither, so it keeps no bounds of theirs
    while starts:
        richer = replace(asked.first, parameters=task.kind.parameters, starts=starts)
        status, better, _ = _run(task, richer, performance, clock, kept)
        if better is None or (found is not None and better.value >= found.value):
            break
        found, of = better, richer
        if status is Status.TIME_LIMIT:
            break
        starts = _swapped(better.theta, task.kind)
    return status, found, of


def _swapped(theta: NDArray[np.float64], kind: ControllerKind) -> list[NDArray[np.float64]]:
    """Return settings with tau_I and tau_D in each other's place, k/tau_I being the same.

    The cascade form is nearly symmetric in the two, so optima come in pairs.
    """
    if "derivative_time" not in kind.parameters:
        return []
    rows = theta.reshape(-1, len(kind.parameters)).copy()
    rows[:, 0] += rows[:, 2] - rows[:, 1]
    rows[:, 1:3] = rows[:, 2:0:-1]
    return [rows.ravel()]


def _run(
    task: Specification,
    structure: Structure,
    performance: Performance,
    clock: Clock,
    kept: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
) -> tuple[Status, StructuredController | None, Structure]:
    """Return the best settings of one structure that keep the planes."""
    search = StructureSearch(structure, task.uncertainty, performance, clock.tick, kept)
    try:
        return Status.OPTIMAL, search.run(), structure
    except OutOfTimeError:
        clock.grant(GRACE)
        found = None
        with suppress(OutOfTimeError):
            found = search.kept()
        return Status.TIME_LIMIT, found, structure


def _scaled(element: TransferFunction, factor: float) -> TransferFunction:
    if element.is_zero:
        return element
    num = [factor * c for c in element.num]
    return TransferFunction(num, element.den, element.dead_time)


def _result(
    task: Specification,
    groups: Groups,
    found: StructuredController,
    settings: Sequence[Controller],
    units: NDArray[np.float64],
) -> Tuning:
    loops: list[Controller | None] = [None] * task.plant.n
    for group, own in zip(groups, settings, strict=True):
        for unit in group:
            loops[unit] = replace(own, gain=own.gain / float(units[unit]))
    return Tuning(
        status=Status.OPTIMAL,
        objective=task.objective.value,
        tau_p=found.tau_p,
        peaks=found.robustness.peaks,
        loops=tuple(loop for loop in loops if loop is not None),
        groups=groups,
        nominally_stable=True,
        search=SearchSummary(STARTS, (), task.seed, 0.0),
        curves=found.robustness.curves,
        guarantee=found.robustness.guarantee,
        warnings=found.robustness.warnings,
    )


def _nothing(
    task: Specification, groups: Groups, clock: Clock, reason: str, status: Status
) -> Tuning:
    return Tuning(
        status=status,
        objective=task.objective.value,
        tau_p=None,
        peaks=None,
        loops=(),
        groups=groups,
        nominally_stable=False,
        search=SearchSummary(0, (), task.seed, clock.elapsed),
        curves=None,
        reason=reason,
    )
