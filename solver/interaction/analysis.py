"""Interaction analysis of a plant: whether its loops fight, and how to pair them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.integral_controllability import (
    ControllabilityVerdict,
    IntegralControllability,
    integral_controllability,
    parallel_integral_controllability,
)
from solver.interaction.interpretation import (
    InteractionSign,
    LoopMeaning,
    LoopReading,
    interaction_sign,
    read_loop,
)
from solver.interaction.loop_effect import StaticEffect, static_effects
from solver.interaction.nearest_parallel import NearestParallel, nearest_parallel
from solver.interaction.own_zeros import LoopLimit, loop_limits
from solver.interaction.pairing import (
    Pairing,
    PairingRanking,
    niederlinski_index,
    rank_pairings,
    rank_parallel_pairings,
)
from solver.interaction.pairing_advice import gain_warnings, pairing_warnings, parallel_warnings
from solver.interaction.parallel_forms import ParallelForms, parallel_forms
from solver.interaction.parallel_matrix import ParallelMatrix
from solver.interaction.relative_gain import (
    GainStatus,
    low_frequency_gain,
    parallel_low_frequency_gain,
    relative_gain_array,
    relative_gain_at,
)
from solver.interaction.signals import Action, controller_actions, one_way, signals
from solver.interaction.zeros import TransmissionZeros, ZeroMethod, transmission_zeros
from solver.model.equality import ByValue
from solver.model.frequencies import corners_of
from solver.model.neighbours import refuse_many
from solver.model.plants import MAX_MATRIX_SIZE, ParallelPlant, Plant
from solver.model.remarks import plant_remarks
from solver.model.validation import MAX_FREQUENCIES, frequencies, instance

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["DENSE_UP_TO", "Interaction", "RelativeGainCurves", "analyse_interaction"]

# Parallel plants above this size are described by their closed forms alone.
DENSE_UP_TO = MAX_MATRIX_SIZE
_SMALL = 0.1  # relative gain below which a sign says little
_POINTS = 100


@dataclass(frozen=True, eq=False)
class RelativeGainCurves(ByValue):
    """Relative gain array over frequency.

    `omega` (k,) rad per time unit; `relative_gains` (k, n, n) complex, NaN where the response
    is singular; None for more than 10 parallel units.
    """

    omega: NDArray[np.float64]
    relative_gains: NDArray[np.complex128] | None


@dataclass(frozen=True, eq=False)
class Interaction(ByValue):
    """Everything that is said about the interaction between the loops of a plant.

    Attributes
    ----------
    n : int
        Number of loops.
    gain_status : GainStatus
        Regular, integrating or singular.
    static_gain : (n, n) or None
        P(0), infinite where an element integrates. None above 10 units, as all matrices here.
    relative_gains : (n, n) or None
        The relative gain array; for an integrating plant its limit. None if singular.
    bristol_index : float or None
        Bristol's interaction index lambda (eq. 11.3) of a 2 x 2 plant.
    sign : InteractionSign or None
        None if singular.
    loops : tuple of LoopReading
        Each loop as numbered; one that stands for all of more than 10 units.
    niederlinski_index : float or None
        As numbered. None if singular.
    singular_values : (n,) or None
        Of P(0), descending; depends on the units of the signals.
    condition_number : float or None
        Of P(0). None if it is not finite.
    ranking : PairingRanking or None
        Pairings, best first.
    recommended : Pairing or None
        The best admissible one.
    integral_controllability : IntegralControllability or None
        None for plants that are not stable: the conditions do not apply.
    zeros : TransmissionZeros
        With the bandwidth limits of those in the right half plane.
    loop_limits : tuple of LoopLimit
        What right-half-plane zeros of its own element forbid a loop alone.
    effects : tuple of StaticEffect
        What the gain of each loop does to each other one; regular gains only.
    curves : RelativeGainCurves
        The array over frequency.
    parallel : ParallelForms or None
        For identical units, n > 1, with a finite gain.
    nearest_parallel : NearestParallel or None
        For a matrix plant, n > 1, with a finite gain in every loop.
    actions : tuple of Action or None
        How the controller of each loop, as numbered, must act; one entry for all of many units.
    signals : tuple of str
        What happens in two loops when one set point moves, signal by signal; or why nothing goes
        round.
    warnings : tuple of str
        What to look at twice.

    """

    n: int
    gain_status: GainStatus
    static_gain: NDArray[np.float64] | None
    relative_gains: NDArray[np.float64] | None
    bristol_index: float | None
    sign: InteractionSign | None
    loops: tuple[LoopReading, ...]
    niederlinski_index: float | None
    singular_values: NDArray[np.float64] | None
    condition_number: float | None
    ranking: PairingRanking | None
    recommended: Pairing | None
    integral_controllability: IntegralControllability | None
    zeros: TransmissionZeros
    loop_limits: tuple[LoopLimit, ...]
    effects: tuple[StaticEffect, ...]
    curves: RelativeGainCurves
    parallel: ParallelForms | None
    nearest_parallel: NearestParallel | None
    warnings: tuple[str, ...] = field(default=())
    actions: tuple[Action | None, ...] = field(default=())
    signals: tuple[str, ...] = field(default=())


def analyse_interaction(plant: Plant, omega: ArrayLike | None = None) -> Interaction:
    """Analyse the interaction between the loops of a plant, loop r from input r to output r.

    Parameters
    ----------
    plant : Plant
        Any plant.
    omega : (k,) or None
        Frequencies of the curves, rad per time unit, > 0, in any order, which the curves keep;
        None: chosen from the plant.

    Raises
    ------
    InvalidInputError
        No plant; frequencies that are not finite and positive.

    """
    instance(plant, Plant, "/plant")
    refuse_many(plant, "the analysis of interaction")
    if omega is None:
        bends = corners_of(set(plant.elements))
        omega = np.geomspace(bends[0] / 10, bends[-1] * 10, _POINTS)
    omega = frequencies(omega, most=MAX_FREQUENCIES)
    if isinstance(plant, ParallelPlant) and plant.n > DENSE_UP_TO:
        return _analyse_many_units(plant, omega)
    low = low_frequency_gain(plant)
    stable = _is_stable(plant)
    regular = low.status is GainStatus.REGULAR
    finite = bool(np.all(np.isfinite(plant.static_gain())))
    relative_gains = index = ranking = None
    if low.status is not GainStatus.SINGULAR:
        relative_gains = relative_gain_array(low.gain)
        index = niederlinski_index(low.gain)
        ranking = rank_pairings(low.gain, stable=stable)
    loops = (
        ()
        if relative_gains is None
        else tuple(read_loop(k, float(value)) for k, value in enumerate(np.diag(relative_gains)))
    )
    parallel = controllability = None
    if isinstance(plant, ParallelPlant) and plant.n > 1 and finite:
        matrix = ParallelMatrix(plant.n, float(low.gain[0, 0]), float(low.gain[0, 1]))
        parallel = parallel_forms(plant, matrix, omega)
        if stable:
            controllability = parallel_integral_controllability(matrix)
    elif stable:
        controllability = integral_controllability(low.gain)
    nearest = None
    if not plant.interchangeable and plant.n > 1 and finite:
        nearest = nearest_parallel(plant, omega)
    zeros = transmission_zeros(plant)
    limits = loop_limits(plant, zeros)
    return Interaction(
        n=plant.n,
        gain_status=low.status,
        static_gain=plant.static_gain(),
        relative_gains=relative_gains,
        bristol_index=(
            float(relative_gains[0, 0]) if relative_gains is not None and plant.n == 2 else None
        ),
        sign=None if relative_gains is None else interaction_sign(relative_gains),
        loops=loops,
        niederlinski_index=index,
        singular_values=_singular_values(low.gain) if finite else None,
        condition_number=float(np.linalg.cond(low.gain)) if finite else None,
        ranking=ranking,
        recommended=None if ranking is None else ranking.recommended,
        integral_controllability=controllability,
        zeros=zeros,
        loop_limits=limits,
        effects=static_effects(low.gain) if regular else (),
        curves=RelativeGainCurves(omega, relative_gain_at(plant.response(omega))),
        parallel=parallel,
        nearest_parallel=nearest,
        warnings=(
            *plant_remarks(plant),
            *_warnings(low.status, stable=stable, loops=loops, controllability=controllability),
            *gain_warnings(relative_gains, loops),
            *pairing_warnings(ranking, controllability),
            *parallel_warnings(nearest),
            *_sign_warnings(relative_gains, relative_gain_at(plant.response(omega))),
            *_zero_warnings(zeros, limits),
        ),
        actions=controller_actions(
            np.array([plant.element(k, k).static_gain for k in range(plant.n)])
        ),
        signals=_signals(plant, low.gain, relative_gains),
    )


def _analyse_many_units(plant: ParallelPlant, omega: NDArray[np.float64]) -> Interaction:
    """Analyse more identical units than matrices are written out for, by the closed forms."""
    status, matrix = parallel_low_frequency_gain(plant)
    stable = _is_stable(plant)
    finite = not math.isinf(plant.process.static_gain) and not math.isinf(
        plant.interaction.static_gain
    )
    ranking = None
    loops: tuple[LoopReading, ...] = ()
    sign = gains = None
    if status is not GainStatus.SINGULAR:
        ranking = rank_parallel_pairings(matrix, stable=stable)
        own, other = np.real(matrix.own_relative_gain), np.real(matrix.other_relative_gain)
        loops = (read_loop(0, float(own)),)
        gains = np.array([own, other])
        sign = interaction_sign(gains)
    controllability = parallel_integral_controllability(matrix) if stable else None
    zeros = transmission_zeros(plant)
    limits = loop_limits(plant, zeros)
    own_pairing = None if ranking is None else next(p for p in ranking.pairings if not p.inputs[0])
    return Interaction(
        n=plant.n,
        gain_status=status,
        static_gain=None,
        relative_gains=None,
        bristol_index=None,
        sign=sign,
        loops=loops,
        niederlinski_index=None if own_pairing is None else own_pairing.niederlinski_index,
        singular_values=None,
        condition_number=matrix.condition_number if finite else None,
        ranking=ranking,
        recommended=None if ranking is None else ranking.recommended,
        integral_controllability=controllability,
        zeros=zeros,
        loop_limits=limits,
        effects=(),
        curves=RelativeGainCurves(omega, None),
        parallel=parallel_forms(plant, matrix, omega) if finite else None,
        nearest_parallel=None,
        warnings=(
            *plant_remarks(plant),
            *_warnings(status, stable=stable, loops=loops, controllability=controllability),
            *gain_warnings(gains, loops),
            *pairing_warnings(ranking, controllability),
            *_zero_warnings(zeros, limits),
        ),
        actions=controller_actions(np.array([plant.process.static_gain])),
    )


def _signals(
    plant: Plant, gain: NDArray[np.float64], relative_gains: NDArray[np.float64] | None
) -> tuple[str, ...]:
    remark = one_way(plant)
    if remark is not None:
        return (remark,)
    if plant.n != 2 or relative_gains is None or not np.isfinite(gain).all():
        return ()
    return signals(gain, float(relative_gains[0, 0]))


def _singular_values(gain: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.svd(gain, compute_uv=False), dtype=np.float64)


def _is_stable(plant: Plant) -> bool:
    return not any(np.any(element.poles.real >= 0) for element in plant.elements)


def _warnings(
    status: GainStatus,
    *,
    stable: bool,
    loops: tuple[LoopReading, ...],
    controllability: IntegralControllability | None,
) -> tuple[str, ...]:
    found = []
    if status is GainStatus.SINGULAR:
        found.append(
            "The static gain is singular: the outputs cannot be held independently. Change an "
            "actuator or a measurement, or drop one of the dependent loops."
        )
    if status is GainStatus.INTEGRATING:
        found.append("The plant integrates: relative gains are their limits as s goes to zero.")
    if not stable:
        found.append(
            "The plant is not stable: the Niederlinski index and integral controllability are "
            "statements about stable plants."
        )
    found += [
        reading.text
        for reading in loops
        if reading.meaning in {LoopMeaning.REVERSED, LoopMeaning.DEPENDENT}
    ]
    if controllability is not None and controllability.verdict is ControllabilityVerdict.IMPOSSIBLE:
        found.append(
            "As numbered, no decentralised integral control survives all changes of the loops' "
            "gains: " + "; ".join(controllability.reasons[:3]) + "."
        )
    return tuple(found)


def _sign_warnings(
    relative_gains: NDArray[np.float64] | None, curves: NDArray[np.complex128]
) -> tuple[str, ...]:
    """Say which own relative gains have another sign far above all dynamics than at rest.

    Johansson (1993), below eq. 8: the behaviour of such a plant changes with the frequency.
    """
    if relative_gains is None or not len(curves):
        return ()
    found = []
    for loop, slow in enumerate(np.diagonal(relative_gains).tolist()):
        fast = complex(curves[-1, loop, loop])
        # A gain that still turns has no sign yet, one near zero none worth a word.
        if not np.isfinite(fast) or abs(fast.imag) > 0.5 * abs(fast.real) or abs(fast) < _SMALL:
            continue
        if slow * fast.real < 0:
            found.append(
                f"The relative gain of loop {loop + 1} changes its sign over frequency, from "
                f"{slow:.3g} at rest to {fast.real:.3g} far above: fast signals see another plant "
                "than slow ones, which makes it hard to control."
            )
    return tuple(found)


def _zero_warnings(zeros: TransmissionZeros, limits: tuple[LoopLimit, ...]) -> tuple[str, ...]:
    found = []
    if zeros.degenerate:
        found.append("The outputs depend on each other at all frequencies.")
    if zeros.bandwidth_limit is not None:
        found.append(
            "A zero in the right half plane limits the bandwidth of the worst direction to "
            f"{zeros.bandwidth_limit:.3g} rad per time unit (peak of the sensitivity below 2)."
        )
    found += [limit.text for limit in limits]
    nearly = [f"{zero.value.real:.3g}" for zero in zeros.zeros if zero.near_cancellation]
    if nearly:
        found.append(
            f"Zeros near a pole ({', '.join(nearly[:5])}) may exist by rounding only: poles or "
            "zeros of the elements agree there within 1 %. Where they are the same thing, type "
            "them alike, and these zeros are gone."
        )
    if zeros.method is ZeroMethod.SEARCH:
        found.append(
            "The dead times do not factor out: zeros were sought in the right half plane up to "
            f"{zeros.searched_radius:.3g} rad per time unit only."
        )
    return tuple(found)
