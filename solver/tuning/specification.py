"""What is to be tuned: plant, weights, controller kind, arrangement of the loops, objective."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Literal

from solver.model.arranged import SCAN_DELAY, check_pairing, paired, sampled
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.given import require_fit
from solver.model.mixing import Mixing, mixed
from solver.model.plants import Plant
from solver.model.transfer_function import LARGEST
from solver.model.validation import (
    choice,
    flag,
    instance,
    instances,
    integer,
    integers,
    items,
    real,
    reals,
    settle,
)
from solver.model.weights import Performance, Uncertainty
from solver.tuning.demands import NO_DEMANDS, Demands
from solver.tuning.resolution import Resolution
from solver.tuning.scenarios import AS_GIVEN, MAX_CASES, Case, Scenario, cases_of, check_scenarios
from solver.tuning.spread import MOST_AXES, SPREAD, Spread

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = [
    "BEST_PAIRING",
    "Arrangement",
    "Bounds",
    "ControllerKind",
    "Objective",
    "Signs",
    "Specification",
]

MAX_STARTS = 1000
BEST_PAIRING = "best"
MOST_PROVEN = 3  # different controllers up to which optimality is proven
MOST_PROVEN_UNITS = 6  # of a matrix plant


class ControllerKind(StrEnum):
    """Which of a controller's parameters are sought, in cascade form.

    PI: gain and integral time. PID: and derivative time, its filter a tenth of it. PIF, PIDF: the
    filter time is free too.
    """

    PI = "PI"
    PID = "PID"
    PIF = "PIF"
    PIDF = "PIDF"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of one controller's parameters, in their order in the search."""
        names: tuple[str, ...] = ("gain", "integral_time")
        if self in (ControllerKind.PID, ControllerKind.PIDF):
            names += ("derivative_time",)
        if self in (ControllerKind.PIF, ControllerKind.PIDF):
            names += ("filter_time",)
        return names

    @property
    def contained(self) -> tuple[ControllerKind, ...]:
        """Kinds that are this one with a filter tied to the derivative, or a time that vanishes.

        With one parameter less, the nearest first.
        """
        PI, PID, PIF = ControllerKind.PI, ControllerKind.PID, ControllerKind.PIF
        return {PI: (), PID: (PI,), PIF: (PI,)}.get(self, (PID, PIF))


class Signs(StrEnum):
    """Signs of the gains.

    USUAL: those of the units' own steady-state gains, which loops that are to work alone need.
    ANY: where no settings with those signs meet the demand, the others are tried too.
    """

    USUAL = "usual"
    ANY = "any"


class Arrangement(StrEnum):
    """Which loops share their settings.

    IDENTICAL: all. INDEPENDENT: none. GROUPED: the units of each group, the sizes being given.
    BEST: the grouping is sought too; identical is kept unless another gains at least 1 per cent.
    """

    IDENTICAL = "identical"
    INDEPENDENT = "independent"
    GROUPED = "grouped"
    BEST = "best"


class Objective(StrEnum):
    """What is made small.

    TAU_P: the performance time constant that robust performance permits ("Approach 2" of
    Skogestad, Lundstrom and Hovd 1989, eq. 32). MU: the peak of mu at a given time constant.
    """

    TAU_P = "tau_p"
    MU = "mu"


@dataclass(frozen=True)
class Bounds:
    """Permitted range (low, high) of each parameter's magnitude; None: chosen from the plant.

    Of the `gain` (input unit per output unit), the `integral_time`, the `derivative_time` and the
    `filter_time` (time unit of the plant).
    """

    gain: tuple[float, float] | None = None
    integral_time: tuple[float, float] | None = None
    derivative_time: tuple[float, float] | None = None
    filter_time: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name in ("gain", "integral_time", "derivative_time", "filter_time"):
            pair = getattr(self, name)
            if pair is None:
                continue
            pair = reals(pair, f"/{name}")
            if not (len(pair) == 2 and 0 < pair[0] < pair[1] <= 1e9):
                message = "bounds must be two numbers that satisfy 0 < low < high <= 1e9"
                raise InvalidInputError(message, f"/{name}")
            settle(self, **{name: pair})


@dataclass(frozen=True)
class Specification:
    """A tuning task.

    Parameters
    ----------
    plant : Plant
        Open-loop stable, or integrating.
    uncertainty, performance : Uncertainty, Performance
        The weights. `performance.tau_p` is given for the objective MU, and only then.
    kind, arrangement, group_sizes, objective
        See the enums; their values will do. `group_sizes` is given for GROUPED, and only then;
        the sizes sum to `plant.n` and the first group holds the first units.
    groups : tuple of tuple of int or None
        The units, from 0, of each group, each unit once: for GROUPED, instead of `group_sizes`.
    pairing : tuple of int, "best" or None
        Input of each output, from 0; "best": those that may have integral action are tried. The
        result then speaks of loops by their outputs. None: as the plant is given.
    scan_time : float
        Of digital controllers, time unit of the plant; see `solver.model.arranged`.
    mixing : Mixing or None
        Combinations of outputs that the loops control, and of inputs that they move; loop i is
        then that of the i-th combinations, in everything that is said of loops.
    bounds : Bounds
        Parameter bounds; none of a parameter that the kind does not have.
    signs : Signs
        Signs of the gains.
    demands : Demands
        Hard constraints beside robust performance.
    scenarios : tuple of Scenario
        Further plants, and sets of loops in service, that the same settings must serve.
    spread : Spread or None
        Box of parameters around the plant, and around those of the scenarios, that they must serve.
    starts : int or None
        Starts of the search, 1..1000; None: until no further optimum is to be expected.
    seed : int
        The same specification and seed give the same digits.
    time_limit : float or None
        Seconds, > 0.
    certificate : bool
        Whether the result carries a proof, for all frequencies, of a level just above its peak.
    model_tolerance : bool
        Whether the result tells how wrong each parameter of the plant may be.
    start : tuple of Controller or None
        One loop a unit: only the best settings beside these are sought.
    rough : bool
        Whether to end the search beside `start` where its grid of frequencies does. What the
        settings reach is right on the whole axis as ever; they are not quite the best ones. Not
        told: what `remarks` are about.
    remarks : bool
        Whether the result tells how far its settings may be moved, what loops in manual mean, and
        what its numbers advise.
    resolution : Resolution or None
        Numbers that the controllers accept: the best settings among them are returned.
    as_found : tuple of Controller or None
        Today's settings, one loop a unit, of any kind: the result tells what they do.
    optimality_gap : bool
        Whether to prove how far the objective is from the least possible one. For PI with at most
        three different controllers or PID with one; a matrix plant has at most six units.

    """

    plant: Plant
    uncertainty: Uncertainty
    performance: Performance
    _: KW_ONLY
    kind: ControllerKind = ControllerKind.PI
    arrangement: Arrangement = Arrangement.INDEPENDENT
    group_sizes: tuple[int, ...] | None = None
    objective: Objective = Objective.TAU_P
    bounds: Bounds = Bounds()
    signs: Signs = Signs.USUAL
    demands: Demands = NO_DEMANDS
    scenarios: tuple[Scenario, ...] = ()
    spread: Spread | None = None
    starts: int | None = None
    seed: int = 0
    time_limit: float | None = None
    certificate: bool = False
    model_tolerance: bool = False
    optimality_gap: bool = False
    start: tuple[Controller, ...] | None = None
    rough: bool = False
    remarks: bool = True
    groups: tuple[tuple[int, ...], ...] | None = None
    pairing: tuple[int, ...] | Literal["best"] | None = None
    scan_time: float = 0.0
    resolution: Resolution | None = None
    as_found: tuple[Controller, ...] | None = None
    mixing: Mixing | None = None

    def __post_init__(self) -> None:
        self._settle()
        self._check_groups()
        self._check_start()
        self._check_demands()
        if self.optimality_gap:
            self._check_optimality_gap()
        if self.objective is Objective.MU and self.performance.tau_p is None:
            message = "the objective mu needs a time constant"
            raise InvalidInputError(message, "/performance/tau_p")
        if self.objective is Objective.TAU_P and self.performance.tau_p is not None:
            message = "the objective tau_p seeks the time constant: leave it out, or take mu"
            raise InvalidInputError(message, "/performance/tau_p")
        for name in ("derivative_time", "filter_time"):
            if getattr(self.bounds, name) is not None and name not in self.kind.parameters:
                message = f"of a {self.kind} controller the {name.replace('_', ' ')} is not sought"
                raise InvalidInputError(message, f"/controller/bounds/{name}")
        if self.starts is not None and not 1 <= self.starts <= MAX_STARTS:
            message = f"the number of starts must lie in 1..{MAX_STARTS}"
            raise InvalidInputError(message, "/search/starts")
        if not 0 <= self.seed < 2**63:
            message = "the seed must lie in 0..2^63 - 1"
            raise InvalidInputError(message, "/search/seed")
        if self.time_limit is not None and not self.time_limit > 0:
            message = "the time limit must be positive"
            raise InvalidInputError(message, "/search/time_limit")

    @property
    def brief(self) -> bool:
        """Whether the result is without what `remarks` are about."""
        return self.rough or not self.remarks

    @property
    def interchangeable(self) -> bool:
        """Whether units may change places: those of a parallel plant of which the same is asked."""
        unlike = (
            self.performance.unlike_outputs
            or self.uncertainty.unlike_units
            or len(set(self.demands.gain_ratios or ())) > 1
        )
        scenarios_alike = all(
            scenario.in_service is None
            and (scenario.plant is None or scenario.plant.interchangeable)
            and not (scenario.uncertainty or self.uncertainty).unlike_units
            for scenario in self.scenarios
        )
        return self.plant.interchangeable and not unlike and scenarios_alike

    def cases(self, groups: Sequence[Sequence[int]]) -> tuple[Case, ...]:
        """Return what all scenarios come down to under settings equal within `groups`.

        Raises
        ------
        InvalidInputError
            Too many cases.

        """
        given = cases_of(
            self.scenarios, self.plant, self.uncertainty, self.performance,
            tuple(tuple(group) for group in groups),
        )  # fmt: skip
        if self.spread is None:
            return given
        number = len(self.scenarios) + 1
        found = {case.key: case for case in given}
        for case in given:
            for corner in self.spread.corners(case.plant):
                beside = case.deviating(self.spread, corner, number)
                found.setdefault(beside.key, beside)
        if len(found) > MAX_CASES:
            message = f"the corners of the spread make more than {MAX_CASES} different cases"
            raise InvalidInputError(message, "/spread")
        return tuple(found.values())

    def name_of(self, case: Case) -> str:
        """Return the name of the first scenario that asks for a case."""
        names = [AS_GIVEN, *(scenario.name for scenario in self.scenarios), SPREAD]
        return names[case.scenarios[0]]

    @property
    def absent_from_spread(self) -> tuple[str, ...]:
        """Which parameters of a spread there are none of, in sentences."""
        absent = () if self.spread is None else self.spread.absent(self.plants)
        return tuple(
            f"spread: the plant has no {name.replace('_', ' ')} that could spread: it changes "
            "nothing"
            for name in absent
        )

    @property
    def plants(self) -> tuple[Plant, ...]:
        """Every plant that the settings must serve, that of the task first."""
        return (self.plant, *(each.plant for each in self.scenarios if each.plant is not None))

    def arranged(self, pairing: tuple[int, ...] | None) -> Specification:
        """Return the same task as the loops see it: inputs paired, scan time as dead time.

        `pairing` is that of the result; None: the given one, if it is one.
        """
        if pairing is None and not isinstance(self.pairing, str):
            pairing = self.pairing
        plant = _arranged(self.plant, self.scan_time, None, self.mixing)
        if pairing is not None:
            plant = paired(plant, pairing)
        if plant is self.plant and self.pairing is None and self.mixing is None:
            return self
        order = pairing if self.mixing is None else self.mixing.own_inputs
        scenarios = tuple(
            replace(
                each,
                plant=each.plant and _arranged(each.plant, self.scan_time, pairing, self.mixing),
                uncertainty=each.uncertainty and each.uncertainty.paired(order),
            )
            for each in self.scenarios
        )
        spread = self.spread
        if spread is not None:  # what the controllers' scan delays is as it is
            spread = replace(spread, known_delay=SCAN_DELAY * self.scan_time)
        return replace(
            self, plant=plant, uncertainty=self.uncertainty.paired(order), pairing=None,
            scan_time=0.0, scenarios=scenarios, mixing=None, spread=spread,
        )  # fmt: skip

    @property
    def uncertainties(self) -> tuple[Uncertainty, ...]:
        """The uncertainty of each of the `plants`."""
        own = (each for each in self.scenarios if each.plant is not None)
        return (self.uncertainty, *(each.uncertainty or self.uncertainty for each in own))

    def _check_spread(self) -> None:
        if self.spread is None:
            return
        instance(self.spread, Spread, "/spread")
        for index, scenario in enumerate(self.scenarios):
            if scenario.name == SPREAD:
                message = f"{SPREAD!r} is what is told of the spread: take another name"
                raise InvalidInputError(message, f"/scenarios/{index}/name")
        count = max(len(self.spread.axes(plant)) for plant in self.plants)
        if count > MOST_AXES:
            message = (
                f"{count} parameters spread, at most {MOST_AXES} are searched: let all units "
                "deviate together, or fewer parameters"
            )
            raise InvalidInputError(message, "/spread/each_unit")

    def _settle(self) -> None:
        instance(self.plant, Plant, "/plant")
        require_fit(self.plant, self.uncertainty, self.performance)
        settle(self, scenarios=instances(self.scenarios, Scenario, "/scenarios"))
        self._check_spread()
        check_scenarios(self.scenarios, self.plant, self.uncertainty, self.performance)
        instance(self.bounds, Bounds, "/controller/bounds")
        instance(self.demands, Demands, "/demands")
        settle(
            self,
            kind=choice(ControllerKind, self.kind, "/controller/kind"),
            arrangement=choice(Arrangement, self.arrangement, "/controller/arrangement"),
            objective=choice(Objective, self.objective, "/objective"),
            signs=choice(Signs, self.signs, "/controller/signs"),
            seed=integer(self.seed, "/search/seed"),
            certificate=flag(self.certificate, "/certificate"),
            model_tolerance=flag(self.model_tolerance, "/model_tolerance"),
            optimality_gap=flag(self.optimality_gap, "/search/optimality_gap"),
            rough=flag(self.rough, "/search/rough"),
            remarks=flag(self.remarks, "/search/remarks"),
        )
        if self.group_sizes is not None:
            sizes = integers(self.group_sizes, "/controller/group_sizes")
            settle(self, group_sizes=sizes)
        self._settle_arrangement()
        if self.starts is not None:
            settle(self, starts=integer(self.starts, "/search/starts"))
        if self.start is not None:
            settle(self, start=instances(self.start, Controller, "/search/start"))
        if self.resolution is not None:
            instance(self.resolution, Resolution, "/controller/resolution")
        if self.as_found is not None:
            found = instances(self.as_found, Controller, "/as_found")
            settle(self, as_found=found)
            if len(found) != self.plant.n:
                message = f"{len(found)} loops as found, the plant has {self.plant.n} units"
                raise InvalidInputError(message, "/as_found")
        if self.time_limit is not None:
            settle(self, time_limit=real(self.time_limit, "/search/time_limit"))

    def _check_groups(self) -> None:
        where = "/controller/group_sizes"
        if self.arrangement is not Arrangement.GROUPED:
            for name in ("group_sizes", "groups"):
                if getattr(self, name) is not None:
                    message = f"{name.replace('_', ' ')} are for the arrangement 'grouped'"
                    raise InvalidInputError(message, f"/controller/{name}")
            return
        if self.groups is not None:
            self._check_members(self.groups)
            return
        if not self.group_sizes:
            message = "the arrangement 'grouped' needs groups, or group sizes"
            raise InvalidInputError(message, where)
        for index, size in enumerate(self.group_sizes):
            if size < 1:
                message = "a group has at least one unit"
                raise InvalidInputError(message, f"{where}/{index}")
        if sum(self.group_sizes) != self.plant.n:
            message = f"group sizes sum to {sum(self.group_sizes)}, the plant has {self.plant.n}"
            raise InvalidInputError(message, where)

    def _settle_arrangement(self) -> None:
        if self.groups is not None:
            given = items(self.groups, "/controller/groups")
            groups = [integers(g, f"/controller/groups/{i}") for i, g in enumerate(given)]
            settle(self, groups=tuple(groups))
        if isinstance(self.pairing, str):
            if self.pairing != BEST_PAIRING:
                message = f"a pairing is a list of inputs, or {BEST_PAIRING!r}"
                raise InvalidInputError(message, "/pairing")
        elif self.pairing is not None:
            settle(self, pairing=check_pairing(self.pairing, self.plant.n))
            paired(self.plant, self.pairing)
        if self.mixing is not None:
            instance(self.mixing, Mixing, "/mixing")
            self.mixing.require_size(self.plant.n, "/mixing")
            if self.uncertainty.outputs is not None:
                message = "sensors err in outputs as they are, not in combinations of them"
                raise InvalidInputError(message, "/uncertainty/outputs")
            if self.pairing is not None:
                message = "with combinations of signals, order their rows and columns instead"
                raise InvalidInputError(message, "/pairing")
        settle(self, scan_time=real(self.scan_time, "/controller/scan_time"))
        if not 0 <= self.scan_time <= LARGEST:
            message = f"the scan time must lie in 0..{LARGEST:g}"
            raise InvalidInputError(message, "/controller/scan_time")

    def _check_members(self, groups: tuple[tuple[int, ...], ...]) -> None:
        where, n = "/controller/groups", self.plant.n
        if self.group_sizes is not None:
            message = "give groups or group sizes, not both"
            raise InvalidInputError(message, "/controller/group_sizes")
        owner: dict[int, int] = {}
        for index, group in enumerate(groups):
            if not group:
                message = "a group has at least one unit"
                raise InvalidInputError(message, f"{where}/{index}")
            for place, unit in enumerate(group):
                if not 0 <= unit < n:
                    message = f"the plant has {n} loops"
                    raise InvalidInputError(message, f"{where}/{index}/{place}")
                if unit in owner:
                    message = f"loop {unit + 1} is in group {owner[unit] + 1} already"
                    raise InvalidInputError(message, f"{where}/{index}/{place}")
                owner[unit] = index
        missing = [unit for unit in range(n) if unit not in owner]
        if missing:
            message = f"loop {missing[0] + 1} is in no group"
            raise InvalidInputError(message, where)

    def _check_start(self) -> None:
        if self.start is None:
            return
        if len(self.start) != self.plant.n:
            message = f"{len(self.start)} loops to start from, the plant has {self.plant.n} units"
            raise InvalidInputError(message, "/search/start")
        for index, loop in enumerate(self.start):
            for name in ("integral_time", "derivative_time", "filter_time"):
                if getattr(loop, name) is not None and name not in self.kind.parameters:
                    message = f"a {self.kind} controller has no {name}"
                    raise InvalidInputError(message, f"/search/start/{index}/{name}")

    def _check_demands(self) -> None:
        gain, times = self.bounds.gain, self.bounds.integral_time
        most = self.demands.max_controller_gain
        ratios = self.demands.gain_ratios
        if ratios is not None and len(ratios) != self.plant.n:
            message = f"{len(ratios)} ratios of spans, the plant has {self.plant.n} loops"
            raise InvalidInputError(message, "/demands/gain_ratios")
        lead = 10.0 if self.kind is ControllerKind.PID else 1.0
        lead *= self.demands.gain_ratio(range(self.plant.n))
        if most is not None and gain is not None and lead * gain[0] > most:
            message = f"the bounds ask for gains that amplify at least {lead * gain[0]:g}"
            raise InvalidInputError(message, "/demands/max_controller_gain")
        error = self.demands.max_load_error
        if error is None:
            return
        highest = min(
            gain[1] if gain is not None else math.inf, math.inf if most is None else most / lead
        )
        if times is not None and times[0] > error * highest:
            message = (
                "the bounds, and the greatest gain, leave an integrated error of at least "
                f"{times[0] / highest:g}"
            )
            raise InvalidInputError(message, "/demands/max_load_error")

    def _check_optimality_gap(self) -> None:
        where = "/search/optimality_gap"
        if self.kind not in {ControllerKind.PI, ControllerKind.PID}:
            message = "the optimality gap is proven for PI and PID only; tune those too to compare"
            raise InvalidInputError(message, where)
        if self.scenarios or self.spread is not None:
            message = "the optimality gap is proven for one plant, without scenarios or spread"
            raise InvalidInputError(message, where)
        if self.demands.names:
            message = "the optimality gap is proven for robust performance alone, without demands"
            raise InvalidInputError(message, where)
        if self.mixing is not None and self.mixing.own_inputs is None:
            message = "the optimality gap is proven for loops that have an input each only"
            raise InvalidInputError(message, where)
        if self.uncertainty.unlike_inputs or self.uncertainty.outputs is not None:
            message = (
                "the optimality gap is proven for inputs of one uncertainty, and outputs without "
                "errors, only"
            )
            raise InvalidInputError(message, where)
        different = {
            Arrangement.IDENTICAL: 1,
            Arrangement.GROUPED: len(self.groups or self.group_sizes or ()),
        }.get(self.arrangement, self.plant.n)
        if self.kind is ControllerKind.PID and different > 1:
            message = "the optimality gap of PID is proven for identical settings only"
            raise InvalidInputError(message, where)
        if different > MOST_PROVEN:
            message = (
                f"the optimality gap is proven for at most {MOST_PROVEN} different controllers; "
                "use the arrangement 'identical', or 'grouped' with two or three sizes"
            )
            raise InvalidInputError(message, where)
        if not self.interchangeable and self.plant.n > MOST_PROVEN_UNITS:
            message = (
                "the optimality gap is proven for matrix plants, and for unlike output scales, "
                f"up to {MOST_PROVEN_UNITS} units"
            )
            raise InvalidInputError(message, where)


def _arranged(
    plant: Plant, scan_time: float, pairing: tuple[int, ...] | None, mixing: Mixing | None
) -> Plant:
    try:
        plant = sampled(plant, scan_time)
    except InvalidInputError as error:
        where = "/controller"
        raise error.within(where) from None
    if mixing is not None:
        plant = mixed(plant, mixing)
    return plant if pairing is None else paired(plant, pairing)
