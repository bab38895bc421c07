"""What forbids settings, told before the search: conditions at steady state.

Integral action makes T(0) = I, so robust stability needs |w_I(0)| < 1, and it needs a steady-state
gain that is regular. For a closed loop that is stable with all loops in service det (G(0) K) must
be positive: with gains of the signs of the loops' own processes, det G(0) of the sign of the
product of its diagonal (Niederlinski 1971). Where elements integrate, G is taken at a small real
s > 0: det (I + G C) is positive at s -> infinity and must not change its sign on the way to 0. A
parallel plant must then satisfy the stricter
-1/(n-1) < a(0) < 1 (Skogestad, Lundstrom and Hovd 1989, eq. 24), outside of which taking loops out
of service destabilises it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.loop_names import loops_text
from solver.model.plants import ParallelPlant
from solver.stability.singular import SINGULAR_CONDITION, equilibrate, is_singular
from solver.tuning.bounds import gain_signs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Uncertainty
    from solver.tuning.groupings import Groups
    from solver.tuning.specification import Specification

__all__ = [
    "ELSE",
    "Impossibility",
    "contrary_signs",
    "impossibility",
    "impossibility_at_rest",
    "needs_usual_signs",
    "other_signs",
]

SLOW = 1e-9  # of the slowest root: there a response is at its limit for omega -> 0
ELSE = "; other signs of the gains ('any') may serve, but some loops cannot run alone then"


@dataclass(frozen=True)
class Impossibility:
    """Why no settings exist, and the frequency (rad per time unit) that forbids them.

    `whatever_signs`: also with other signs of the gains than those of the loops' own processes.
    """

    reason: str
    omega: float
    whatever_signs: bool


def impossibility(specification: Specification) -> Impossibility | None:
    """Return what forbids every setting with integral action, or None."""
    plant = specification.plant
    uncertainty = specification.uncertainty
    for each, of in ((uncertainty, ""), (uncertainty.outputs, " of the outputs")):
        if each is None:
            continue
        error = float(each.magnitude(SLOW * _slowest_pole(each))[0])
        if error >= 1:
            return Impossibility(
                f"the uncertainty{of} is {100 * error:.4g} % at steady state, where integral "
                "action needs less than 100 %",
                0.0, whatever_signs=True,
            )  # fmt: skip
    if isinstance(plant, ParallelPlant):
        return _parallel(plant)
    return impossibility_at_rest(_gains(plant))


def other_signs(specification: Specification, groups: Groups) -> Iterator[tuple[float, ...]]:
    """Signs of the gains, (groups,) each, other than the usual ones, that integral action permits.

    Those with det (G(0) K) > 0; groups alike may change places where units may.
    """
    plant = specification.plant
    index, usual = _niederlinski_index(plant), gain_signs(plant, groups)
    seen = set()
    for flips in itertools.product((1.0, -1.0), repeat=len(groups)):
        key: tuple[object, ...] = flips
        if specification.interchangeable:
            key = tuple(sorted(zip(map(len, groups), flips, strict=True)))
        turned = sum(len(group) for group, flip in zip(groups, flips, strict=True) if flip < 0)
        if key in seen or turned == 0 or index * (-1) ** turned < 0:
            continue
        seen.add(key)
        yield tuple(sign * flip for sign, flip in zip(usual, flips, strict=True))


def needs_usual_signs(specification: Specification) -> bool:
    """Whether the demands permit no gain of another sign than that of the loop's own process.

    They ask for each loop alone to be stable. With integral action 1 + g c is of the sign of
    k g(0) at a small real s > 0 and 1 at s -> infinity where g has no feedthrough, and must not
    change its sign between.
    """
    own = (specification.plant.element(unit, unit) for unit in range(specification.plant.n))
    return specification.demands.each_alone and all(g.feedthrough == 0 for g in own)


def contrary_signs(specification: Specification, groups: Groups) -> str | None:
    """Say which loops cannot have the sign of their own steady-state gain; None: all can.

    Those that share a gain with a loop of the other sign, and those of a scenario's plant that
    have another sign there.
    """
    usual = gain_signs(specification.plant, groups)
    found = []
    for number, plant in enumerate(specification.plants):
        turned = [
            unit
            for sign, group in zip(usual, groups, strict=True)
            for unit in group
            if plant.element(unit, unit).static_gain * sign < 0
        ]
        if not turned:
            continue
        if number == 0:
            others = f"{loops_text(turned)} and loops whose steady-state gains have the other sign"
            found.append(f"there is one gain for {others}")
        else:
            own = [each.name for each in specification.scenarios if each.plant is not None]
            found.append(
                f"in scenario {own[number - 1]!r} the steady-state gain of {loops_text(turned)} "
                "has the other sign"
            )
    return "; ".join(found) or None


def _niederlinski_index(plant: Plant) -> float:
    """Return det G(0) over the product of its diagonal, or its sign; 0 where there is none."""
    s = SLOW * _slowest_root(plant)
    if isinstance(plant, ParallelPlant):
        g, i = _at(plant.process, s), _at(plant.interaction, s) if plant.n > 1 else 0.0
        if g == 0:
            return 0.0
        a = i / g
        return float(np.sign(1 - a) ** (plant.n - 1) * np.sign(1 + (plant.n - 1) * a))
    G = _gains(plant)
    own = np.diag(G)
    return float(np.linalg.det(G / own)) if (own != 0).all() else 0.0


def _at(element: TransferFunction, s: float) -> float:
    """Return the value at a real s > 0."""
    return complex(element(s)).real


def _gains(plant: Plant) -> NDArray[np.float64]:
    """Return G(s), (n, n), at a real s > 0 far below all that the plant has."""
    s = SLOW * _slowest_root(plant)
    size = range(plant.n)
    return np.array(
        [[sum(f * _at(e, s) for f, e in plant.terms(r, c)) for c in size] for r in size],
        dtype=float,
    )


def _parallel(plant: ParallelPlant) -> Impossibility | None:
    if plant.n == 1:
        return _without_gain(plant)
    s = SLOW * _slowest_root(plant)
    g, i = (_at(f, s) for f in (plant.process, plant.interaction))
    if g == 0 or abs(i) * 1e-3 > abs(g) * SINGULAR_CONDITION:
        return _without_gain(plant)
    a, low = i / g, -1 / (plant.n - 1)
    if plant.interaction.integrators > plant.process.integrators:
        reason = (
            "the interaction integrates where the process does not: at steady state it is the "
            "stronger without limit, and the plant is not decentralised integral controllable"
            f"{ELSE}"
        )
        return Impossibility(reason, 0.0, whatever_signs=False)
    # The gains of the difference and of the sum against what they are made of.
    lost_difference = abs(1 - a) * SINGULAR_CONDITION <= 1 + abs(a)
    lost_sum = abs(1 + (plant.n - 1) * a) * SINGULAR_CONDITION <= 1 + (plant.n - 1) * abs(a)
    if lost_difference or lost_sum:
        reason = (
            f"the steady-state interaction is a = {a:.6g}: the gain matrix is singular, so the "
            "outputs cannot be controlled independently"
        )
        if lost_difference:
            reason += " (integral action of units on one load: mutune parallel-drives)"
        return Impossibility(reason, 0.0, whatever_signs=True)
    if low < a < 1:
        return _without_gain(plant)
    reason = (
        f"the steady-state interaction a = {a:.6g} lies outside {low:.6g} < a < 1: the plant "
        f"is not decentralised integral controllable. This is physically impossible for a split "
        f"of one stream: check the model, or pair the loops anew{ELSE}"
    )
    return Impossibility(reason, 0.0, whatever_signs=False)


def _without_gain(plant: ParallelPlant) -> Impossibility | None:
    if plant.process.static_gain == 0:
        return Impossibility(
            "the process has no steady-state gain", 0.0, whatever_signs=plant.n == 1
        )
    return None


def impossibility_at_rest(G: NDArray[np.float64]) -> Impossibility | None:
    """Return what static gains (n, n) forbid every setting with integral action, or None."""
    if is_singular(G):
        reason = "the steady-state gain matrix is singular"
        return Impossibility(reason, 0.0, whatever_signs=True)
    own = np.abs(np.diag(equilibrate(G)))
    if own.min() * SINGULAR_CONDITION <= 1:
        loop = int(own.argmin())
        reason = f"loop {loop + 1} has no steady-state gain of its own: pair it anew"
        return Impossibility(reason, 0.0, whatever_signs=False)
    if np.linalg.det(G / np.diag(G)) < 0:
        reason = (
            "the Niederlinski index is negative: with this pairing, and gains of the signs of the "
            f"loops' own processes, integral action in all loops is unstable{ELSE}"
        )
        return Impossibility(reason, 0.0, whatever_signs=False)
    return None


def _slowest_pole(uncertainty: Uncertainty) -> float:
    poles = np.abs([pole for w in uncertainty.weights for pole in w.poles])
    return float(poles.min()) if poles.size else 1.0


def _slowest_root(plant: Plant) -> float:
    roots = np.abs([root for f in plant.elements for root in (*f.poles, *f.zeros)])
    positive = roots[roots > 0]
    return float(positive.min()) if positive.size else 1.0
