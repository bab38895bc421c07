"""What the tuner makes small, as one batched evaluation with exact gradients.

With the skewed level p*(omega) of theory section "skewed form" every frequency demands

    |w_P(j omega; tau_P)|^2 <= p*(omega; parameters),

so the objective tau_P is the plain minimax problem  max over omega of tau_P(omega; parameters)
(Skogestad, Lundstrom and Hovd 1989, eq. 32, without its outer search). The objective mu has the
same form with mu^2 in the place of tau_P. Both are written: the least s with
``demand(s) <= level`` at every frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from solver.model.controllers import Controller
from solver.model.sums import Entry, sums
from solver.mu.kernel import FINE
from solver.tuning.judged_loop import FORBIDDEN, judged_loop, judged_loops, judged_with_peaks
from solver.tuning.loop_levels import loop_levels
from solver.tuning.loop_samples import Sources, samples
from solver.tuning.specification import ControllerKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.weights import Uncertainty
    from solver.tuning.alone import LoopsAlone
    from solver.tuning.goals import Goal
    from solver.tuning.loop_samples import Samples
    from solver.tuning.service_sets import ServiceSets

MISSED = 1e-5  # of log |1 + g c|^2: far less than the margin that the demand keeps

__all__ = ["PENALTY", "Evaluation", "Levels", "LoopObjective"]

PENALTY = 30.0  # price in s of a missing level; more than its multiplier as a rule


@dataclass(frozen=True)
class Evaluation:
    """The loop at one point of the parameter space.

    Attributes
    ----------
    theta : (m,)
        Parameters, logarithms of the magnitudes, controller by controller.
    value : float
        The least s; infinite where a frequency permits none or the loop is unstable.
    s, merit : float
        The least s of the frequencies below saturation, and that s with a penalty for what the
        others miss: finite where `value` is not, and equal to it where nothing is missed.
    level, gradient : (k,), (k, m)
        Level of each frequency, and its gradient in theta; between the grid and the followed
        peaks those of the loops alone.
    demand, demand_slope : (k,)
        Level that s demands of each frequency, and its slope in s.
    y : (k, scales)
        The D-scales, a start for a neighbour's evaluation.
    peaks : (p,)
        Where the followed peaks are: the last p frequencies.
    parts : tuple of Evaluation
        Of several loops under the same settings: that of each, at the s of all; else empty.

    """

    theta: NDArray[np.float64]
    value: float
    s: float
    merit: float
    level: NDArray[np.float64]
    gradient: NDArray[np.float64]
    demand: NDArray[np.float64]
    demand_slope: NDArray[np.float64]
    y: NDArray[np.float64]
    peaks: NDArray[np.float64]
    parts: tuple[Evaluation, ...] = ()

    @property
    def of_each(self) -> tuple[Evaluation, ...]:
        """That of each loop: this itself, where there is one."""
        return self.parts or (self,)


@dataclass(frozen=True)
class Levels:
    """Level (k,) of each frequency, its gradient (k, m), and the least s, as of `Evaluation`."""

    value: float
    level: NDArray[np.float64]
    gradient: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LoopObjective:
    """Levels of all frequencies for given parameters, and their gradients.

    Parameters
    ----------
    blocks : LoopBlocks
        Plant and grouping.
    uncertainty : Uncertainty
        w_I.
    goal : Goal
        What is made small.
    kind : ControllerKind
        PI or PID.
    signs : (controllers,)
        Sign of each gain.
    omega : (k,)
        Frequencies, rad per time unit, ascending.
    nu : float
        Last barrier parameter: levels are right to about its square, to itself where eigenvalues
        meet.
    followed : (p,)
        Peaks between those frequencies, which every evaluation follows from where its neighbour
        saw them. The greatest levels then bend with the settings as they really do, which no
        fixed frequency shows.
    penalty : float
        Price in s of a missing level.
    alone : LoopsAlone or None
        The loops alone, where their sensitivity is limited.
    service : ServiceSets or None
        Sets of loops in service, where integrity is asked for.

    """

    blocks: LoopBlocks
    uncertainty: Uncertainty
    goal: Goal
    kind: ControllerKind
    signs: NDArray[np.float64]
    omega: NDArray[np.float64]
    nu: float = FINE
    followed: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    penalty: float = PENALTY
    alone: LoopsAlone | None = None
    service: ServiceSets | None = None

    @property
    def per_controller(self) -> int:
        """Number of parameters of a controller."""
        return len(self.kind.parameters)

    @property
    def _lead(self) -> bool:
        return "derivative_time" in self.kind.parameters

    @cached_property
    def _restless(self) -> bool:
        """Whether the loop gain need not settle before infinity: something is fed through."""
        return any(element.feedthrough for element in self.blocks.plant.elements)

    @cached_property
    def _grid(self) -> Samples:
        return self._samples(self.omega)

    @cached_property
    def _sources(self) -> Sources:
        """Where what does not depend on the settings comes from."""
        return Sources(
            self.blocks.sums,
            self.blocks.weights(self.uncertainty),
            sums([Entry(0, 0, 1.0, self.goal.weight)]),
            *self.blocks.shape,
            self.goal.target,
            self.goal.saturation(self.penalty),
        )

    def _samples(self, omega: NDArray[np.float64]) -> Samples:
        found: Samples = samples(self._sources, omega)
        return found

    def controllers(self, theta: NDArray[np.float64]) -> tuple[Controller, ...]:
        """Return the controllers that `theta` stands for."""
        values = np.exp(theta).reshape(-1, self.per_controller)
        found = []
        for sign, row in zip(self.signs, values, strict=True):
            settings = dict(zip(self.kind.parameters, map(float, row), strict=True))
            settings["gain"] *= float(sign)
            found.append(Controller(**settings))
        return tuple(found)

    def evaluate(
        self,
        theta: NDArray[np.float64],
        *,
        near: Evaluation | None = None,
    ) -> Evaluation:
        """Evaluate at `theta`.

        Parameters
        ----------
        theta : (m,)
            Parameters.
        near : Evaluation or None
            A neighbouring evaluation of this objective, whose scales and peaks are the start.

        """
        grid, peaks, cold = self._grid, self.followed, near is None
        count = grid.omega.size + peaks.size
        y = np.zeros((count, self.blocks.n_scales)) if near is None else near.y.copy()
        if peaks.size:
            peaks, found = judged_with_peaks(
                theta, self.signs, self._lead, grid, self._sources, self.blocks.layout,
                self.goal.terms, self.nu, cold, y, peaks if near is None else near.peaks,
                math.inf if near is None else near.s, near is not None,
            )  # fmt: skip
        else:
            found = judged_loop(
                theta, self.signs, self._lead, grid, self.blocks.layout, self.goal.terms, count,
                self.nu, cold, y,
            )  # fmt: skip
        level, gradient, demand, slope, value, s, missing, winds, rests = found
        stable = self._is_stable(theta, winds=winds, rests=rests)
        limits: tuple[LoopsAlone | ServiceSets | None, ...] = (self.alone, self.service)
        for beside in limits:
            if beside is None:
                continue
            own, own_gradient, sound = beside.levels(theta, self.signs, lead=self._lead)
            stable = stable and sound
            if not own.size:
                continue
            if float(own.min()) < beside.demand - MISSED:
                value = math.inf
            # After the grid; the peaks stay last.
            place = self.omega.size
            level = np.insert(level, place, own)
            gradient = np.insert(gradient, place, own_gradient, axis=0)
            demand = np.insert(demand, place, np.full(own.size, beside.demand))
            slope = np.insert(slope, place, np.zeros(own.size))
            missing = max(missing, beside.demand - float(own.min()))
        merit = s + self.penalty * missing
        if not stable:
            value = merit = math.inf
        return Evaluation(theta, value, s, merit, level, gradient, demand, slope, y, peaks)

    def levels_at(self, thetas: NDArray[np.float64]) -> list[Levels]:
        """Return the levels on the grid for several settings (t, m), each from its own scales.

        Of the loops together: nothing of loops alone or of sets of loops in service.
        """
        level, gradient, values, winds, rests = judged_loops(
            thetas, self.signs, self._lead, self._grid, self.blocks.layout, self.goal.terms,
            self.nu, self.blocks.n_scales,
        )  # fmt: skip
        found = []
        for i, theta in enumerate(thetas):
            stable = self._is_stable(theta, winds=bool(winds[i]), rests=bool(rests[i]))
            found.append(Levels(float(values[i]) if stable else math.inf, level[i], gradient[i]))
        return found

    def _is_stable(self, theta: NDArray[np.float64], *, winds: bool, rests: bool) -> bool:  # noqa: ARG002 - where the grid alone does not tell
        """Whether det(I + G C) turns on the grid as that of a stable loop, and ends there."""
        return winds and (self._restless or rests)

    def with_s(self, here: Evaluation, s: float) -> Evaluation:
        """Return an evaluation with the demands of another s; its merit stays."""
        demand, slope = here.demand.copy(), here.demand_slope.copy()
        fixed, moving = slice(self.omega.size), slice(here.level.size - here.peaks.size, None)
        demand[fixed], slope[fixed] = self.goal.demand(s, self.omega)
        demand[moving], slope[moving] = self.goal.demand(s, here.peaks)
        return replace(here, s=s, demand=demand, demand_slope=slope)

    def levels(self, theta: NDArray[np.float64], omega: NDArray[np.float64]) -> NDArray[np.float64]:
        """Level at `theta` of any frequencies `omega` (k,), (k,), as exact as the kernel gives it.

        `FORBIDDEN` where there is none. Says nothing about stability.
        """
        y, cold = np.zeros((omega.size, self.blocks.n_scales)), True
        here = self._samples(omega)
        level = loop_levels(
            theta, self.signs, self._lead, omega, here.G, here.u, here.b,
            self.blocks.layout, not self.goal.skewed, FINE, cold, y,
        )[0]  # fmt: skip
        return np.asarray(np.maximum(level, FORBIDDEN))
