"""``mutune interaction``: how the loops of a plant interact, in this process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.analyses.interaction.models import (
    InteractionRequest,
    InteractionResult,
    LoopEffectResult,
    PairingRanking,
    ParallelForms,
    TransmissionZeros,
    interaction_to_json,
)
from service.cli.analysis import answer, matrix_table
from service.cli.outcomes import ExitCode, reported
from service.wording import number
from solver.interaction.analysis import analyse_interaction
from solver.interaction.loop_effect import loop_effect

__all__ = ["analyse_file"]

_SIGNS = {
    "none": "No interaction.",
    "positive": "Positive interaction: the loops help each other.",
    "negative": "Negative interaction: the loops fight each other.",
}
_SHOWN = 5  # pairings worth a line; the others are in the JSON result


@reported
def analyse_file(path: Path, *, as_json: bool) -> ExitCode:
    """Analyse the plant in `path` and print the result.

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
    return answer(path, InteractionRequest, _compute, InteractionResult, _shown, as_json=as_json)


def _compute(request: InteractionRequest) -> dict[str, Any]:
    task = request.build()
    effect = None if task.effect is None else loop_effect(task.effect)
    return interaction_to_json(analyse_interaction(task.plant, task.omega), effect)


def _shown(result: InteractionResult) -> RenderableType:
    headline = _SIGNS.get(result.sign or "", "The gain is singular: there are no relative gains.")
    parts: list[RenderableType] = [Text(headline, style="bold")]
    if result.relative_gains is not None:
        parts.append(matrix_table("Relative gains", result.relative_gains, "output", "input"))
    parts += [Text(loop.text) for loop in result.loops]
    if result.parallel is not None:
        parts.append(_parallel(result.n, result.parallel))
    if result.ranking is not None:
        parts.append(_pairings(result.ranking))
    if result.recommended is None:
        parts.append(Text("No pairing is admissible."))
    if result.integral_controllability is not None:
        verdict = result.integral_controllability.verdict
        parts.append(Text(f"Decentralised integral control with any gains reduced: {verdict}."))
    parts.append(_zeros(result.zeros))
    if result.effect is not None:
        parts += _effect(result.effect)
    parts += [Text(f"Warning: {warning}", style="yellow") for warning in result.warnings]
    return Group(*parts)


def _parallel(n: int, forms: ParallelForms) -> RenderableType:
    table = Table(f"{n} identical units", "", box=SIMPLE_HEAD)
    for name, value in (
        ("interaction a", forms.interaction),
        ("relative gain, own", forms.own_relative_gain),
        ("relative gain, other", forms.other_relative_gain),
        ("eigenvalue of the sum", forms.sum_eigenvalue),
        ("eigenvalue of differences", forms.difference_eigenvalue),
        ("condition number", forms.condition_number),
    ):
        table.add_row(name, number(value))
    return table


def _pairings(ranking: PairingRanking) -> RenderableType:
    table = Table("Inputs of outputs 1, 2, ...", box=SIMPLE_HEAD)
    for heading in ("relative gains", "Niederlinski", "admissible"):
        table.add_column(heading, justify="right")
    for pairing in ranking.pairings[:_SHOWN]:
        gains = pairing.relative_gains[:4]
        more = ", ..." if len(pairing.relative_gains) > len(gains) else ""
        inputs = ", ".join(str(index + 1) for index in pairing.inputs[:10])
        table.add_row(
            inputs + (", ..." if len(pairing.inputs) > 10 else ""),
            ", ".join(map(number, gains)) + more,
            number(pairing.niederlinski_index),
            "yes" if pairing.admissible else "no",
        )
    return table


def _zeros(zeros: TransmissionZeros) -> RenderableType:
    if zeros.degenerate:
        return Text("The outputs depend on each other at all frequencies.")
    where = "" if zeros.searched_radius is None else " in the right half plane, as far as sought"
    if not zeros.zeros:
        return Text(f"No transmission zeros{where}.")
    table = Table("Zero", box=SIMPLE_HEAD)
    for heading in ("imaginary part", "times", "of", "bandwidth at most"):
        table.add_column(heading, justify="right")
    for zero in zeros.zeros:
        table.add_row(
            number(zero.value.re),
            number(zero.value.im),
            str(zero.multiplicity),
            zero.direction,
            number(zero.bandwidth_limit),
        )
    return table


def _effect(effect: LoopEffectResult) -> list[RenderableType]:
    table = Table(f"Gain of loop {effect.other + 1}", box=SIMPLE_HEAD)
    for heading in (f"static gain of loop {effect.loop + 1}", "stable", "slowest pole"):
        table.add_column(heading, justify="right")
    for gain, static, stable, poles in zip(
        effect.gains, effect.static_gains, effect.stable, effect.poles, strict=True
    ):
        real = [pole.re for pole in poles if pole.re is not None]
        table.add_row(
            number(gain),
            number(static),
            "yes" if stable else "no",
            number(max(real)) if real else "-",
        )
    limits = ", ".join(
        " to ".join("no limit" if end is None else number(end) for end in (each.low, each.high))
        for each in effect.stable_gains
    )
    return [table, Text(f"Stable for gains of loop {effect.other + 1}: {limits or 'none'}.")]
