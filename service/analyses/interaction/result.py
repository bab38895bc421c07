"""The result of an interaction analysis as JSON."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, JsonValue

from service.schemas.complex import Complex
from service.schemas.fields import (
    IdentifiedResult,
)
from service.schemas.integral_controllability import IntegralControllability

__all__ = [
    "GainInterval",
    "InteractionResult",
    "LoopEffectResult",
    "LoopLimit",
    "LoopReading",
    "Matrix",
    "NearestParallel",
    "Numbers",
    "Pairing",
    "PairingRanking",
    "ParallelForms",
    "RelativeGainCurves",
    "StaticEffect",
    "TransmissionZeros",
    "Zero",
]

Numbers = list[float | None]

Matrix = list[Numbers]


class LoopReading(BaseModel):
    """What the relative gain of a loop means."""

    loop: int = Field(description="The loop, from 0.", examples=[0])
    relative_gain: float | None = Field(description="Its relative gain.", examples=[3.0])
    meaning: Literal["unaffected", "helped", "fought", "reversed", "dependent"] = Field(
        description="What closing the other loops does to its gain.", examples=["fought"]
    )
    within_band: bool = Field(
        description="Whether the relative gain lies in 0.67..1.5, where single loops usually do.",
        examples=[False],
    )
    text: str = Field(
        description="The same in words.",
        examples=["Loop 1 is fought by the other loops: its gain falls to 0.333 times ..."],
    )


_PAIRING: JsonValue = {
    "inputs": [0, 1],
    "relative_gains": [3.0, 3.0],
    "niederlinski_index": 0.333,
    "admissible": True,
    "within_band": False,
    "distance": 2.2,
    "integral_controllability": "guaranteed",
}


class Pairing(BaseModel):
    """One way of pairing outputs with inputs."""

    inputs: list[int] = Field(
        description="The input that controls each output, from 0.", examples=[[0, 1]]
    )
    relative_gains: Numbers = Field(
        description="Relative gains of the pairs.", examples=[[3.0, 3.0]]
    )
    niederlinski_index: float | None = Field(
        description="Negative: unstable with integral action in all loops. Null: a pair has no "
        "gain.",
        examples=[0.333],
    )
    admissible: bool = Field(
        description="Whether all relative gains and the index are positive.", examples=[True]
    )
    within_band: bool = Field(
        description="Whether all relative gains lie in 0.67..1.5.", examples=[False]
    )
    distance: float | None = Field(
        description="Sum of |ln| of the relative gains: 0 without interaction; above 1000 with "
        "one that is not positive.",
        examples=[2.2],
    )
    integral_controllability: Literal["guaranteed", "impossible", "undecided"] | None = Field(
        description="Whether loops so paired may be detuned or switched off one by one; null: the "
        "plant is not stable, or enough better pairings passed.",
        examples=["guaranteed"],
    )


class PairingRanking(BaseModel):
    """Pairings, best first."""

    pairings: list[Pairing] = Field(
        description="The best ones, at most 120.", examples=[[_PAIRING]]
    )
    examined: int = Field(description="How many were compared.", examples=[2])
    exhaustive: bool = Field(description="Whether these are all there are.", examples=[True])


class Zero(BaseModel):
    """A transmission zero."""

    value: Complex = Field(
        description="Where it lies, 1 per time unit.", examples=[{"re": 1.0, "im": 0.0}]
    )
    multiplicity: int = Field(description="How often.", examples=[1])
    direction: Literal["plant", "sum", "differences"] = Field(
        description="Of the whole plant, or of a mode of parallel units.", examples=["plant"]
    )
    right_half_plane: bool = Field(
        description="Whether it limits the bandwidth of any controller.", examples=[True]
    )
    bandwidth_limit: float | None = Field(
        description="Greatest bandwidth, rad per time unit, for a peak of the sensitivity of 2.",
        examples=[0.5],
    )
    near_cancellation: bool = Field(
        description="Whether it exists by rounding only: it is gone when poles of the elements "
        "that differ by less than a per cent are equal.",
        examples=[False],
    )


_ZERO: JsonValue = {
    "value": {"re": 1.0, "im": 0.0},
    "multiplicity": 1,
    "direction": "plant",
    "right_half_plane": True,
    "bandwidth_limit": 0.5,
    "near_cancellation": False,
}


class TransmissionZeros(BaseModel):
    """Zeros by rising magnitude."""

    zeros: list[Zero] = Field(description="The zeros.", examples=[[_ZERO]])
    method: Literal["exact", "search"] = Field(
        description="exact: all of them. search: those of the right half plane up to "
        "searched_radius, because dead times do not factor out (or the order is high).",
        examples=["exact"],
    )
    degenerate: bool = Field(
        description="Whether the outputs depend on each other at all frequencies.",
        examples=[False],
    )
    searched_radius: float | None = Field(
        description="Rad per time unit; null for the exact method.", examples=[None]
    )


class LoopLimit(BaseModel):
    """What right-half-plane zeros of its own element forbid a loop alone."""

    units: list[int] = Field(description="Loops with this element, from 0.", examples=[[0, 1]])
    zeros: list[Complex] = Field(
        description="The zeros, rad per time unit.", examples=[[{"re": 1.0, "im": 0.0}]]
    )
    alone: float = Field(
        description="Greatest bandwidth of the loop alone, for a peak of its sensitivity of 2.",
        examples=[0.5],
        json_schema_extra={"x-unit": "rad/time"},
    )
    together: float | None = Field(
        description="The limit of all loops together; null: zeros do not limit them.",
        examples=[None],
        json_schema_extra={"x-unit": "rad/time"},
    )
    text: str = Field(
        description="The same in words.", examples=["Loops 1, 2 alone: limited to 0.5 ..."]
    )


class StaticEffect(BaseModel):
    """How the static gain of a loop changes as the gain of another one grows."""

    loop: int = Field(description="The loop looked at, from 0.", examples=[0])
    other: int = Field(description="The loop whose gain grows, from 0.", examples=[1])
    open_gain: float | None = Field(description="Gain with the other open.", examples=[1.0])
    closed_gain: float | None = Field(
        description="Gain with the other perfect; null: infinite.", examples=[0.333]
    )
    reversal_gain: float | None = Field(
        description="Gain of the other beyond which this loop acts the wrong way; null: none.",
        examples=[None, 1.0],
    )


class RelativeGainCurves(BaseModel):
    """Relative gain array over frequency."""

    omega: list[float] = Field(
        description="Frequencies, rad per time unit.", examples=[[0.01, 0.1]]
    )
    relative_gains: list[list[list[Complex]]] | None = Field(
        description="The array at each frequency; null above 10 units, see parallel.",
        examples=[None],
    )


class ParallelForms(BaseModel):
    """Closed forms of the static gain of n identical units, any n."""

    interaction: float | None = Field(
        description="a; null: the own gain is zero.", examples=[0.949]
    )
    determinant: float | None = Field(
        description="Determinant; null: it overflows.", examples=[0.0994]
    )
    log_determinant: float | None = Field(
        description="Natural logarithm of its magnitude; null: zero.", examples=[-2.31]
    )
    own_relative_gain: float | None = Field(
        description="Diagonal element of the array; null: singular.", examples=[10.06]
    )
    other_relative_gain: float | None = Field(
        description="Off-diagonal element of the array; null: singular.", examples=[-9.06]
    )
    own_inverse: float | None = Field(
        description="Diagonal element of the inverse; null: singular.", examples=[10.06]
    )
    other_inverse: float | None = Field(
        description="Off-diagonal element of the inverse; null: singular.", examples=[-9.55]
    )
    sum_eigenvalue: float = Field(
        description="Eigenvalue of the sum of all signals, once.", examples=[1.949]
    )
    difference_eigenvalue: float = Field(
        description="Eigenvalue of differences, n - 1 times.", examples=[0.051]
    )
    condition_number: float | None = Field(
        description="Largest over smallest singular value; null: singular.", examples=[38.2]
    )
    own_relative_gains: list[Complex] = Field(
        description="Diagonal element over frequency.", examples=[[{"re": 10.06, "im": 0.0}]]
    )
    other_relative_gains: list[Complex] = Field(
        description="Off-diagonal element over frequency.", examples=[[{"re": -9.06, "im": 0.0}]]
    )
    interactions: list[Complex] = Field(
        description="The degree of interaction a over frequency.",
        examples=[[{"re": 0.949, "im": 0.0}]],
    )
    deviation: float | None = Field(
        description="Greatest relative difference from dense matrix computations; null above 10 "
        "units.",
        examples=[1e-15],
    )


class NearestParallel(BaseModel):
    """The plant of identical units nearest to a matrix plant, in the units given."""

    own: float = Field(description="Static gain k of a unit.", examples=[0.987])
    interaction: float = Field(
        description="Degree of interaction a at steady state; a and -a are one plant of two units.",
        examples=[-0.986],
    )
    output_signs: list[int] = Field(
        description="-1: the output is counted the other way round.", examples=[[1, -1]]
    )
    input_signs: list[int] = Field(
        description="-1: the input is counted the other way round.", examples=[[1, 1]]
    )
    distance: float = Field(
        description="Norm of the difference of the static gains over that of the gain.",
        examples=[0.11],
    )
    greatest_distance: float = Field(
        description="The largest one over the frequencies of the curves.", examples=[0.11]
    )
    interactions: list[Complex] = Field(
        description="The degree of interaction a over frequency.",
        examples=[[{"re": -0.986, "im": 0.0}]],
    )
    near: bool = Field(
        description="Whether the greatest distance is at most 0.15.", examples=[True]
    )


class GainInterval(BaseModel):
    """Gains between two limits."""

    low: float | None = Field(description="Lower end; null: none.", examples=[0.0])
    high: float | None = Field(description="Upper end; null: none.", examples=[4.0])


class LoopEffectResult(BaseModel):
    """What a proportional gain in one loop does to another; lists have an entry a gain."""

    loop: int = Field(description="The loop looked at, from 0.", examples=[0])
    other: int = Field(description="The loop whose gain is varied, from 0.", examples=[1])
    gains: list[float] = Field(description="Its gains.", examples=[[0.0, 1.0]])
    static_gains: Numbers = Field(
        description="Static gain of the loop looked at; null: not finite.", examples=[[1.0, 0.5]]
    )
    poles: list[list[Complex]] = Field(
        description="Closed-loop poles.", examples=[[[{"re": -1.0, "im": 0.0}]]]
    )
    stable: list[bool] = Field(
        description="Whether all of them lie in the left half plane.", examples=[[True, True]]
    )
    stable_gains: list[GainInterval] = Field(
        description="All gains, of the sign of the process, with which both loops are stable.",
        examples=[[{"low": 0.0, "high": 4.0}]],
    )


class InteractionResult(IdentifiedResult):
    """Interaction between the loops of a plant; loop k connects output k to input k."""

    n: int = Field(description="Number of loops.", examples=[2])
    gain_status: Literal["regular", "integrating", "singular"] = Field(
        description="What is known of the static gain.", examples=["regular"]
    )
    static_gain: Matrix | None = Field(
        description="Static gain, null where it integrates; null above 10 units.",
        examples=[[[1.0, 0.667], [1.0, 1.0]]],
    )
    relative_gains: Matrix | None = Field(
        description="Relative gain array, as a limit for integrating plants; null: singular.",
        examples=[[[3.0, -2.0], [-2.0, 3.0]]],
    )
    bristol_index: float | None = Field(
        description="Bristol's interaction index of a 2 x 2 plant.", examples=[3.0]
    )
    sign: Literal["none", "positive", "negative"] | None = Field(
        description="positive: the loops help each other. negative: they fight.",
        examples=["negative"],
    )
    loops: list[LoopReading] = Field(
        description="What each relative gain means; one entry for all of more than 10 units.",
        examples=[[]],
    )
    niederlinski_index: float | None = Field(
        description="Of the pairing as numbered.", examples=[0.333]
    )
    singular_values: Numbers | None = Field(
        description="Of the static gain, descending; they depend on units.",
        examples=[[1.86, 0.18]],
    )
    condition_number: float | None = Field(
        description="Of the static gain; depends on units.", examples=[10.3]
    )
    ranking: PairingRanking | None = Field(
        description="Pairings, best first.",
        examples=[{"pairings": [_PAIRING], "examined": 2, "exhaustive": True}],
    )
    recommended: Pairing | None = Field(
        description="The best pairing whose loops may be detuned or switched off one by one, as "
        "far as is known; null: none of those examined.",
        examples=[_PAIRING],
    )
    integral_controllability: IntegralControllability | None = Field(
        description="Null for plants that are not stable.",
        examples=[
            {
                "verdict": "guaranteed",
                "reasons": [],
                "failing_subsets": [],
                "smallest_eigenvalue": 0.18,
                "scaling": [0.5, 0.5],
                "lower_limit": None,
                "upper_limit": None,
            }
        ],
    )
    zeros: TransmissionZeros = Field(
        description="Transmission zeros.",
        examples=[
            {"zeros": [_ZERO], "method": "exact", "degenerate": False, "searched_radius": None}
        ],
    )
    loop_limits: list[LoopLimit] = Field(
        description="What zeros of its own element forbid a loop alone.", examples=[[]]
    )
    effects: list[StaticEffect] = Field(
        description="What the gain of each loop does to each other one.", examples=[[]]
    )
    curves: RelativeGainCurves = Field(
        description="The relative gain array over frequency.",
        examples=[{"omega": [0.01], "relative_gains": None}],
    )
    parallel: ParallelForms | None = Field(
        description="Closed forms for identical units.", examples=[None]
    )
    nearest_parallel: NearestParallel | None = Field(
        default=None,
        description="How near a matrix plant is to identical units; null: a loop has no finite "
        "static gain of its own.",
        examples=[None],
    )
    effect: LoopEffectResult | None = Field(description="The effect asked for.", examples=[None])
    actions: list[Literal["reverse", "direct"] | None] = Field(
        default=[],
        description="How the controller of each loop, as numbered, must act. reverse: its output "
        "falls when its measurement rises. null: the process has no gain.",
        examples=[["reverse", "direct"]],
    )
    signals: list[str] = Field(
        default=[],
        description="What happens in two loops when the set point of the first one falls, signal "
        "by signal; or why nothing goes round.",
        examples=[["Controller 1 is reverse acting, controller 2 direct acting."]],
    )
    warnings: list[str] = Field(description="What to look at twice.", examples=[[]])
