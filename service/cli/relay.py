"""``mutune relay``: a relay experiment, in this process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

import solver.relay
from service.analyses.relay.models import (
    LimitCycle,
    PeriodicSolution,
    Regime,
    RelayExperimentRequest,
    RelayExperimentResult,
    RelayTheory,
    relay_experiment_to_json,
)
from service.cli.analysis import answer
from service.cli.outcomes import ExitCode, reported
from service.wording import number

__all__ = ["relay_file"]

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


@reported
def relay_file(path: Path, *, as_json: bool) -> ExitCode:
    """Carry out the experiment in `path` and print its outcome.

    Parameters
    ----------
    path : Path
        Request file, or ``-`` for standard input.
    as_json : bool
        Print the JSON result alone, instead of tables.

    Returns
    -------
    ExitCode
        BAD_INPUT where the request is at fault, else DONE.

    """
    return answer(
        path, RelayExperimentRequest, _compute, RelayExperimentResult, _shown, as_json=as_json
    )


def _compute(request: RelayExperimentRequest) -> dict[str, Any]:
    return relay_experiment_to_json(solver.relay.relay_experiment(request.build()))


def _shown(result: RelayExperimentResult) -> RenderableType:
    parts: list[RenderableType] = [Text(_ENDS[result.behaviour], style="bold")]
    if len(result.regimes) > 1:
        parts.append(_regimes(result.regimes))
    if result.cycle is not None:
        parts += _cycle(result.cycle)
    else:
        final = ", ".join(map(number, result.final_outputs))
        parts.append(Text(f"Outputs at the end: {final}."))
    parts += _theory(result.theory)
    return Group(*parts)


def _regimes(regimes: list[Regime]) -> RenderableType:
    table = Table("from", box=SIMPLE_HEAD)
    for heading in ("to", "period", "switchings in a period"):
        table.add_column(heading, justify="right")
    for regime in regimes:
        table.add_row(
            number(regime.start), number(regime.end), number(regime.period), str(regime.switchings)
        )
    return table


def _cycle(cycle: LimitCycle) -> list[RenderableType]:
    parts: list[RenderableType] = [
        Text(f"Period {number(cycle.period)}, {cycle.switchings} switchings in it.")
    ]
    outputs = Table("output", box=SIMPLE_HEAD)
    for heading in ("amplitude", "cross gain"):
        outputs.add_column(heading, justify="right")
    for index, (amplitude, gain) in enumerate(
        zip(cycle.amplitudes, cycle.cross_gains, strict=True)
    ):
        outputs.add_row(str(index + 1), number(amplitude), number(gain))
    parts.append(outputs)
    if cycle.settings is not None:
        point = cycle.ultimate
        parts.append(
            Text(f"Ultimate gain {number(point.gain)} at {number(point.omega)} rad per time unit.")
        )
        settings = Table("PI settings", box=SIMPLE_HEAD)
        for heading in ("K", "Ti"):
            settings.add_column(heading, justify="right")
        for name, loop in (
            ("Ziegler and Nichols", cycle.settings.ziegler_nichols),
            ("Tyreus and Luyben", cycle.settings.tyreus_luyben),
        ):
            settings.add_row(name, number(loop.gain), number(loop.integral_time))
        parts.append(settings)
    return parts


def _theory(theory: RelayTheory) -> list[RenderableType]:
    parts: list[RenderableType] = []
    if theory.solutions:
        table = Table("half period", box=SIMPLE_HEAD)
        for heading in ("exists", "stable", "largest eigenvalue"):
            table.add_column(heading, justify="right")
        for solution in theory.solutions:
            table.add_row(
                number(solution.half_period),
                "yes" if solution.exists else "no",
                {True: "yes", False: "no", None: "not known"}[solution.stable],
                _largest(solution),
            )
        parts.append(table)
    for name, each in (
        ("Ultimate point of the process", theory.ultimate),
        ("Predicted by the describing function", theory.described),
        ("Among equal loops", None if theory.mcavoy is None else theory.mcavoy.exact),
    ):
        if each is not None:
            parts.append(
                Text(f"{name}: gain {number(each.gain)} at {number(each.omega)} rad/time.")
            )
    return parts


def _largest(solution: PeriodicSolution) -> str:
    if not solution.eigenvalues:
        return "-"
    first = solution.eigenvalues[0]
    return number(abs(complex(first.re or 0.0, first.im or 0.0)))
