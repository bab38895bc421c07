"""An identification as text."""

from __future__ import annotations

from service.analyses.identify.models import IdentificationResult
from service.printing import Grid, Line, Part
from service.wording import number

__all__ = ["table"]


def table(result: IdentificationResult) -> list[Part]:
    """Return the elements, how well they fit and predict, the weight, and what to do next."""
    parts: list[Part] = []
    rows = []
    for element in result.elements:
        for index, one in enumerate(element.estimates):
            name = f"{element.output} from {element.input}" if index == 0 else ""
            interval = (
                "not told" if one.low is None else f"{number(one.low, 3)} to {number(one.high, 3)}"
            )
            rows.append((name, one.name.replace("_", " "), number(one.value, 4), interval))
    parts.append(Grid(["element", "parameter", "value", "95 %"], rows, frozenset({0, 1})))
    parts.extend(
        Line(f"{element.output} from {element.input}: {words}.", "warning")
        for element in result.elements
        for words in element.untold
    )
    parts.append(
        Grid(
            ["record", "output", "fit, %", ""],
            [
                (
                    one.record, one.output, number(one.normalised_fit, 3),
                    "kept back" if one.kept_back else "",
                )
                for one in result.predictions
            ],
            frozenset({0, 1, 3}),
        )
    )  # fmt: skip
    if result.equality is not None:
        words = "may be identical" if result.equality.plausible else "differ by more than noise"
        parts.append(
            Line(f"The units {words} (probability {number(result.equality.probability, 2)}).")
        )
    weight = result.uncertainty.weight
    num, den = (", ".join(number(v, 4) for v in weight[key]) for key in ("num", "den"))
    parts.append(
        Line(
            f"Uncertainty ({result.uncertainty.structure}): weight ({num}) / ({den}); relative "
            f"error {number(result.weight_magnitude[0], 3)} at steady state.",
            "strong",
        )
    )
    parts.extend(Line(f"{words[0].upper()}{words[1:]}.") for words in result.advice)
    return parts
