"""Interaction in lines and grids."""

from __future__ import annotations

import math

from service.analyses.interaction.result import (
    InteractionResult,
    LoopEffectResult,
    PairingRanking,
    ParallelForms,
    TransmissionZeros,
)
from service.printing import Grid, Line, Part, matrix, warning_lines
from service.schemas.complex import Complex
from service.wording import number

__all__ = ["table"]

_SIGNS = {
    "none": "Hardly any interaction: each loop keeps its gain when the others close.",
    "positive": "Positive interaction: the loops help each other.",
    "negative": "Negative interaction: the loops fight each other.",
}
_DEPENDENT = (
    "As numbered, some loops act through the others alone; paired anew they hardly interact."
)
_DETUNABLE = {
    "guaranteed": "As numbered, some integral controllers stay stable with any gains reduced or "
    "loops opened: guaranteed.",
    "impossible": "As numbered, no integral controllers stay stable with any gains reduced or "
    "loops opened.",
    "undecided": "As numbered, whether integral controllers can stay stable with any gains reduced "
    "or loops opened is not decided.",
}
_SHOWN = 5  # pairings worth a line; the others are in the JSON result


def table(result: InteractionResult) -> list[Part]:
    """Return relative gains, pairings, zeros and the effect asked for."""
    headline = _SIGNS.get(result.sign or "", "The gain is singular: there are no relative gains.")
    if result.sign == "none" and any(loop.meaning == "dependent" for loop in result.loops):
        headline = _DEPENDENT
    parts: list[Part] = [Line(headline, "strong")]
    if result.relative_gains is not None:
        parts.append(matrix("Relative gains", result.relative_gains, "output", "input"))
    parts += [Line(loop.text) for loop in result.loops]
    parts += [Line(text) for text in result.signals]
    if result.parallel is not None:
        parts.append(_parallel(result.n, result.parallel))
    if result.ranking is not None:
        parts.append(_pairings(result.ranking))
    if result.recommended is None:
        parts.append(Line("No pairing is recommended."))
    if result.integral_controllability is not None:
        parts.append(Line(_DETUNABLE[result.integral_controllability.verdict]))
    parts.append(_zeros(result.zeros))
    if result.effect is not None:
        parts += _effect(result.effect)
    return [*parts, *warning_lines(result.warnings)]


def _parallel(n: int, forms: ParallelForms) -> Grid:
    rows = [
        (name, number(value))
        for name, value in (
            ("interaction a", forms.interaction),
            ("largest |a| over frequency", _largest(forms.interactions)),
            ("relative gain, own", forms.own_relative_gain),
            ("relative gain, other", forms.other_relative_gain),
            ("eigenvalue of the sum", forms.sum_eigenvalue),
            ("eigenvalue of differences", forms.difference_eigenvalue),
            ("condition number", forms.condition_number),
        )
    ]
    return Grid((f"{n} identical units", ""), rows, frozenset({0, 1}))


def _largest(curve: list[Complex]) -> float | None:
    return max(
        (
            math.hypot(each.re, each.im)
            for each in curve
            if each.re is not None and each.im is not None
        ),
        default=None,
    )


def _pairings(ranking: PairingRanking) -> Grid:
    rows = []
    for pairing in ranking.pairings[:_SHOWN]:
        gains = pairing.relative_gains[:4]
        more = ", ..." if len(pairing.relative_gains) > len(gains) else ""
        inputs = ", ".join(str(index + 1) for index in pairing.inputs[:10])
        rows.append(
            (
                inputs + (", ..." if len(pairing.inputs) > 10 else ""),
                ", ".join(map(number, gains)) + more,
                number(pairing.niederlinski_index),
                "yes" if pairing.admissible else "no",
                pairing.integral_controllability or "not tested",
            )
        )
    heads = ("Inputs of outputs 1, 2, ...", "relative gains", "Niederlinski", "admissible")
    return Grid((*heads, "detunable"), rows)


def _zeros(zeros: TransmissionZeros) -> Part:
    if zeros.degenerate:
        return Line("The outputs depend on each other at all frequencies.")
    where = (
        ""
        if zeros.searched_radius is None
        else " in the right half plane, within the radius searched"
    )
    if not zeros.zeros:
        return Line(f"No transmission zeros{where}.")
    rows = [
        (
            number(zero.value.re),
            number(zero.value.im),
            str(zero.multiplicity),
            zero.direction,
            number(zero.bandwidth_limit),
            "rounding" if zero.near_cancellation else "",
        )
        for zero in zeros.zeros
    ]
    return Grid(("Zero", "imaginary part", "times", "of", "bandwidth at most", "exists by"), rows)


def _effect(effect: LoopEffectResult) -> list[Part]:
    rows = []
    for gain, static, stable, poles in zip(
        effect.gains, effect.static_gains, effect.stable, effect.poles, strict=True
    ):
        real = [pole.re for pole in poles if pole.re is not None]
        rows.append(
            (
                number(gain),
                number(static),
                "yes" if stable else "no",
                number(max(real) if real else None),
            )
        )
    limits = ", ".join(
        " to ".join("no limit" if end is None else number(end) for end in (each.low, each.high))
        for each in effect.stable_gains
    )
    other = effect.other + 1
    heads = (f"Gain of loop {other}", f"static gain of loop {effect.loop + 1}", "stable")
    return [
        Grid((*heads, "slowest pole"), rows),
        Line(f"Stable for gains of loop {other}: {limits or 'none'}."),
    ]
