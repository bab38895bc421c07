"""The outcome of a tuning together with its task: what scripts ask of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from solver.model.errors import InvalidInputError, MutuneError
from solver.model.validation import flag, instance, integer, real
from solver.robustness.margins import loop_margins
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.loops import Loop
from solver.simulation.step_response import step_response
from solver.simulation.worst_actuators import with_worst_actuators
from solver.tuning.record import Status, Tuning
from solver.tuning.specification import Objective, Specification
from solver.workbench.documents import read, write
from solver.workbench.response import Response, by_unit

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike

    from matplotlib.axes import Axes

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.robustness.margins import LoopMargins
    from solver.robustness.model_tolerance import ModelTolerance

__all__ = ["InfeasibleError", "Tuned", "load"]

SAME = 1e-6  # relative difference below which two searches found the same settings


class InfeasibleError(MutuneError):
    """A tuning ended without settings; the message says why and what to try."""


@dataclass(frozen=True, repr=False)
class Tuned:
    """A task and its outcome.

    Two of them are equal where task and outcome are, the duration of the search apart; see
    `isclose` for outcomes of different machines.

    Parameters
    ----------
    specification : Specification
        What was asked for.
    tuning : Tuning
        What was found: peaks, curves, comparison, certificate and all the rest.

    """

    specification: Specification
    tuning: Tuning

    def __post_init__(self) -> None:
        instance(self.specification, Specification, "/specification")
        instance(self.tuning, Tuning, "/tuning")

    @property
    def ok(self) -> bool:
        """Whether the settings meet the demand: the search ended, and mu is at most 1.

        For the objective 'mu' there may be settings whose peak of mu is above 1.
        """
        return self.tuning.status is Status.OPTIMAL and self.tuning.demand_met

    @property
    def plant(self) -> Plant:
        """The plant as the loops see it: inputs paired, a scan time as dead time."""
        return self.specification.arranged(self.tuning.pairing).plant

    @property
    def tau_p(self) -> float:
        """Closed-loop time constant, time unit of the plant; inf without settings, so it sorts."""
        return math.inf if self.tuning.tau_p is None or not self.loops else self.tuning.tau_p

    @property
    def mu(self) -> float:
        """Peak of mu for robust performance; inf without settings."""
        peaks = self.tuning.peaks
        return math.inf if peaks is None else peaks.robust_performance.value

    @property
    def loops(self) -> tuple[Controller, ...]:
        """Settings, one a unit; empty without any."""
        return self.tuning.loops

    @property
    def margins(self) -> tuple[LoopMargins, ...]:
        """Margins, one a unit: ``result.margins[unit].together.phase_margin`` in degrees.

        Raises
        ------
        InfeasibleError
            There are no settings.

        """
        found = loop_margins(self.plant, self._settings())
        of = {unit: each for each in found for unit in each.units}
        return tuple(of[unit] for unit in range(self.plant.n))

    def raise_if_infeasible(self) -> Self:
        """Return this result, or raise where there are no settings.

        Raises
        ------
        InfeasibleError
            There are none.

        """
        self._settings()
        return self

    def simulate(
        self,
        *,
        setpoint: Mapping[int, float] | None = None,
        load: Mapping[int, float] | None = None,
        measurement: Mapping[int, float] | None = None,
        duration: float,
        samples: int = 501,
        worst_case: bool = False,
    ) -> Response:
        """Return the response to steps at time zero, from rest.

        Parameters
        ----------
        setpoint, load, measurement : mapping of int to float, or None
            Size of the step of each unit, from 0: ``{0: 1}``. See `StepKind`.
        duration : float
            Time simulated, > 0, in the time unit of the plant.
        samples : int
            Equidistant samples, both ends included.
        worst_case : bool
            Whether the inputs err in the worst way that the uncertainty permits.

        Returns
        -------
        Response
            ``y[unit]`` over ``time``.

        Raises
        ------
        InfeasibleError
            There are no settings.
        InvalidInputError
            No step at all, a unit that is not there; or as `step_response`.

        """
        loops = tuple(Loop.of(loop) for loop in self._settings())
        given = {"setpoint": setpoint, "load": load, "measurement": measurement}
        steps = []
        for kind, sizes in given.items():
            if sizes is not None and not hasattr(sizes, "items"):
                message = "give the size of each unit's step, such as {0: 1}"
                raise InvalidInputError(message, f"/{kind}")
            for unit, size in (sizes or {}).items():
                if not 0 <= integer(unit, f"/{kind}") < len(loops):
                    message = f"the plant has units 0..{len(loops) - 1}"
                    raise InvalidInputError(message, f"/{kind}/{unit}")
                if real(size, f"/{kind}/{unit}") != 0:
                    steps.append(Step(StepKind(kind), unit, 0.0, size))
        if not steps:
            message = "nothing steps: give setpoint, load or measurement"
            raise InvalidInputError(message, "/setpoint")
        task = self.specification
        experiment = Experiment(task.plant, loops, tuple(steps), duration, samples=samples)
        if flag(worst_case, "/worst_case"):
            demand = task.performance.with_tau_p(self.tau_p)
            experiment = with_worst_actuators(experiment, task.uncertainty, demand)
        return by_unit(step_response(experiment))

    def isclose(self, other: Tuned, *, rtol: float = SAME) -> bool:
        """Whether two outcomes agree: status, objective and settings within `rtol`, relative.

        The units of a parallel plant with unlike settings are compared in their order.
        """
        instance(other, Tuned, "/other")
        rtol = real(rtol, "/rtol")
        if (self.tuning.status, len(self.loops)) != (other.tuning.status, len(other.loops)):
            return False
        pairs = [(self.tau_p, other.tau_p), (self.mu, other.mu)]
        for own, its in zip(self.loops, other.loops, strict=True):
            for name in ("gain", "integral_time", "derivative_time", "lag_time"):
                pair = getattr(own, name), getattr(its, name)
                if (pair[0] is None) != (pair[1] is None):
                    return False
                if pair[0] is not None:
                    pairs.append(pair)
        return all(math.isclose(a, b, rel_tol=rtol) for a, b in pairs)

    def save(self, path: str | PathLike[str]) -> None:
        """Write task and outcome to a file that `mutune.load` reads, as JSON without NaN."""
        Path(path).write_text(write(self), encoding="utf-8")

    def plot_mu(self, ax: Axes | None = None) -> Axes:
        """Draw mu over frequency with matplotlib (``pip install mutune[plot]``).

        Parameters
        ----------
        ax : matplotlib.axes.Axes or None
            Where to draw; None: new axes.

        Returns
        -------
        matplotlib.axes.Axes
            The axes, to go on with.

        Raises
        ------
        InfeasibleError
            There are no settings.

        """
        self._settings()
        curves = self.tuning.curves
        if curves is None:
            message = "the search was cut short before the curves"
            raise InfeasibleError(message)
        if ax is None:
            from matplotlib import pyplot as plt  # noqa: PLC0415 - only who draws needs it

            _, ax = plt.subplots()
        for name in ("robust_performance", "robust_stability", "nominal_performance"):
            ax.semilogx(curves.omega, getattr(curves, name), label=name.replace("_", " "))
        ax.axhline(1.0, color="0.5", linewidth=0.8)
        ax.set_xlabel("frequency (rad per time unit)")
        ax.set_ylabel("μ")
        ax.legend()
        return ax

    def _settings(self) -> tuple[Controller, ...]:
        if not self.loops:
            raise InfeasibleError(self.tuning.reason or "there are no settings")
        return self.loops

    def __repr__(self) -> str:
        n = self.plant.n
        return f"Tuned({self.tuning.status.value}, tau_p={self.tau_p:.6g}, mu={self.mu:.4g}, n={n})"

    def __str__(self) -> str:
        """About eight lines: outcome, settings, peaks, and what to look at twice."""
        tuning, task = self.tuning, self.specification
        kind, arrangement = task.kind.value, task.arrangement.value
        lines = [f"{kind}, {arrangement}, {task.plant.n} units: {tuning.status.value}"]
        if task.objective is Objective.MU and self.loops and not self.ok:
            lines.append("the demand is NOT met: mu above 1")
        if not self.loops:
            return "\n".join([*lines, tuning.reason or "no settings"])
        lines.append(f"tau_p {self.tau_p:.6g}")
        for group in tuning.groups[:4]:
            loop = self.loops[group[0]]
            times = (
                ("tau_I", loop.integral_time),
                ("tau_D", loop.derivative_time),
                ("tau_F", loop.filter_time),
            )
            given = "".join(f", {name} {time:.6g}" for name, time in times if time is not None)
            lines.append(f"{_units(group)}: k {loop.gain:.6g}{given}")
        if len(tuning.groups) > 4:
            lines.append(f"... {len(tuning.groups) - 4} more groups")
        if tuning.peaks is not None:
            lines.append(
                f"mu: robust performance {tuning.peaks.robust_performance.value:.4g}, robust "
                f"stability {tuning.peaks.robust_stability.value:.4g}, nominal performance "
                f"{tuning.peaks.nominal_performance.value:.4g}"
            )
        if tuning.certificate is not None:
            gamma = tuning.certificate.claim.gamma
            lines.append(f"certificate: stable, and mu <= {gamma:.6g} at every frequency")
        if tuning.model_tolerance:
            lines.append(f"model: {_least_tolerated(tuning.model_tolerance)}")
        lines += [f"warning: {warning}" for warning in tuning.warnings[:2]]
        return "\n".join(lines)


def load(path: str | PathLike[str]) -> Tuned:
    """Return the result in a file that `Tuned.save` wrote, its task included.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    Tuned
        Equal to what was saved: nothing is computed again. `verify` checks a certificate.

    Raises
    ------
    InvalidInputError
        No such document, or one whose values the records refuse.

    """
    found = read(Path(path).read_text(encoding="utf-8"))
    instance(found, Tuned, "/type")
    assert isinstance(found, Tuned)  # noqa: S101 - for the type checker
    return found


def _least_tolerated(tolerances: tuple[ModelTolerance, ...]) -> str:
    """Return the smallest error of one parameter that costs something, in words."""
    sides = [
        (abs(error), error, each, what)
        for each in tolerances
        for what, pair in (("the demand", each.demand or ()), ("stability", each.stability))
        for error in pair
        if error is not None
    ]
    if not sides:
        return "no error of one parameter alone, to five times its value, costs anything"
    _, error, each, what = min(sides, key=lambda side: side[0])
    place = "" if each.element is None else f" of element {each.element[0]}, {each.element[1]}"
    return (
        f"beyond {100 * error:+.3g} % in {each.parameter.replace('_', ' ')}{place} {what} is lost"
    )


def _units(group: tuple[int, ...]) -> str:
    if len(group) == 1:
        return f"unit {group[0]}"
    if group == tuple(range(group[0], group[-1] + 1)):
        return f"units {group[0]}..{group[-1]}"
    return "units " + ", ".join(map(str, group[:6])) + (", ..." if len(group) > 6 else "")
