"""A relay experiment in lines and grids."""

from __future__ import annotations

from service.analyses.relay.result import (
    LimitCycle,
    PeriodicSolution,
    Regime,
    RelayExperimentResult,
    RelayTheory,
)
from service.printing import Grid, Line, Part, warning_lines
from service.wording import number

__all__ = ["table"]

_ENDS = {
    "limit_cycle": "Limit cycle.",
    "constant": "The relay stopped switching, the outputs rest: take calmer settings in the "
    "other loops, or another loop for the relay.",
    "stopped": "The relay stopped switching, the outputs still move: simulate longer.",
    "no_switching": "The relay never switched: take less hysteresis, more amplitude, or the "
    "other sign of the amplitude.",
    "irregular": "No period is seen: simulate longer.",
    "diverged": "An output left its bound: the loops under control are unstable.",
    "step_limit": "Too many steps: give the relay more hysteresis, or simulate less long.",
}


def table(result: RelayExperimentResult) -> list[Part]:
    """Return how the experiment ended, its limit cycle, settings and theory."""
    parts: list[Part] = [Line(_ENDS[result.behaviour], "strong")]
    if len(result.regimes) > 1:
        parts.append(_regimes(result.regimes))
    if result.cycle is not None:
        parts += _cycle(result.cycle)
    else:
        final = ", ".join(map(number, result.final_outputs))
        parts.append(Line(f"Outputs at the end: {final}."))
    return [*parts, *_theory(result.theory)]


def _regimes(regimes: list[Regime]) -> Grid:
    rows = [
        (number(regime.start), number(regime.end), number(regime.period), str(regime.switchings))
        for regime in regimes
    ]
    return Grid(("from", "to", "period", "switchings in a period"), rows)


def _cycle(cycle: LimitCycle) -> list[Part]:
    rows = [
        (str(index + 1), number(amplitude), number(gain))
        for index, (amplitude, gain) in enumerate(
            zip(cycle.amplitudes, cycle.cross_gains, strict=True)
        )
    ]
    parts: list[Part] = [
        Line(f"Period {number(cycle.period)}, {cycle.switchings} switchings in it."),
        Grid(("output", "amplitude", "cross gain"), rows),
    ]
    if cycle.remark is not None:
        parts += warning_lines([cycle.remark])
    if cycle.settings is not None and cycle.ultimate is not None:
        point = cycle.ultimate
        rules = [
            (name, number(loop.gain), number(loop.integral_time))
            for name, loop in (
                ("Ziegler and Nichols", cycle.settings.ziegler_nichols),
                ("Tyreus and Luyben", cycle.settings.tyreus_luyben),
            )
        ]
        parts += [
            Line(f"Ultimate gain {number(point.gain)} at {number(point.omega)} rad per time unit."),
            Grid(("PI settings", "K", "Ti"), rules),
        ]
    return parts


def _theory(theory: RelayTheory) -> list[Part]:
    parts: list[Part] = []
    if theory.solutions:
        rows = [
            (
                number(solution.half_period),
                "yes" if solution.exists else "no",
                {True: "yes", False: "no", None: "not known"}[solution.stable],
                _largest(solution),
            )
            for solution in theory.solutions
        ]
        parts.append(Grid(("half period", "exists", "stable", "largest eigenvalue"), rows))
    for name, each in (
        ("Ultimate point of the process", theory.ultimate),
        ("Predicted by the describing function", theory.described),
        ("Among equal loops", None if theory.mcavoy is None else theory.mcavoy.exact),
    ):
        if each is not None:
            where = f"gain {number(each.gain)} at {number(each.omega)} rad/time"
            parts.append(Line(f"{name}: {where}."))
    mcavoy = theory.mcavoy
    if mcavoy is not None:
        for name, rules in (("McAvoy", mcavoy.rough_settings), ("exact", mcavoy.exact_settings)):
            if rules is not None:
                loop = rules.ziegler_nichols
                text = f"K {number(loop.gain)}, Ti {number(loop.integral_time)}"
                parts.append(
                    Line(f"Ziegler and Nichols for equal loops, {name} ultimate point: {text}.")
                )
    return parts


def _largest(solution: PeriodicSolution) -> str:
    if not solution.eigenvalues:
        return number(None)
    first = solution.eigenvalues[0]
    return number(abs(complex(first.re or 0.0, first.im or 0.0)))
