"""Transfer functions as MathML, which browsers set and read aloud without any script."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from solver.model.transfer_function import TransferFunction

__all__ = ["transfer_function"]

_DIGITS = 6


def transfer_function(function: TransferFunction) -> Markup:
    """Return num(s)/den(s) exp(-dead_time s) as a MathML element."""
    num, den = _polynomial(function.num), _polynomial(function.den)
    rational = num if function.den == (1.0,) else f"<mfrac>{num}{den}</mfrac>"
    delay = ""
    if function.dead_time:
        rate = "" if function.dead_time == 1 else _number(function.dead_time)
        power = f"<mrow><mo>−</mo>{rate}<mi>s</mi></mrow>"  # noqa: RUF001 - the sign of MathML
        delay = f"<msup><mi>e</mi>{power}</msup>"
    return Markup(f'<math displaystyle="true">{rational}{delay}</math>')  # noqa: S704 - made of numbers only


def _polynomial(coefficients: Sequence[float]) -> str:
    degree = len(coefficients) - 1
    terms = [
        (coefficient, degree - index)
        for index, coefficient in enumerate(coefficients)
        if coefficient != 0
    ]
    if not terms:
        return "<mn>0</mn>"
    parts = []
    for index, (coefficient, power) in enumerate(terms):
        if coefficient < 0:
            parts.append("<mo>−</mo>")  # noqa: RUF001 - the sign of MathML
        elif index:
            parts.append("<mo>+</mo>")
        if abs(coefficient) != 1 or power == 0:
            parts.append(_number(abs(coefficient)))
        if power:
            parts.append(f"<msup><mi>s</mi><mn>{power}</mn></msup>" if power > 1 else "<mi>s</mi>")
    return f"<mrow>{''.join(parts)}</mrow>"


def _number(value: float) -> str:
    mantissa, _, exponent = f"{value:.{_DIGITS}g}".partition("e")
    if not exponent:
        return f"<mn>{mantissa}</mn>"
    power = f"<msup><mn>10</mn><mn>{int(exponent)}</mn></msup>"
    return f"<mrow><mn>{mantissa}</mn><mo>·</mo>{power}</mrow>"
