"""Decoupling and PI design of the decoupled loops.

Astrom and Hagglund, chapter 11.3: u = D u_bar with D = P(0)^-1 leaves the loops Q(s) = P(s) D,
Q(0) = I, whose remaining interaction is q_ij(s) = kappa_ij s + ... Each loop gets the PI
controller u_bar_j = b_j k_j y_sp_j - k_j y_j + (k_Ij/s)(y_sp_j - y_j).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.interaction.decoupled_loops import DecoupledLoops
from solver.interaction.detuning import detuned
from solver.interaction.dynamic_decoupler import DynamicDecoupler
from solver.interaction.loop_shape import RobustnessLimits
from solver.interaction.pi_design import DesignStatus, LoopDesigner, PIDesign
from solver.interaction.relative_gain import relative_gain_array, relative_gain_at
from solver.interaction.weighted_sum import WeightedSum
from solver.model.equality import ByValue
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.frequencies import corners_of
from solver.model.neighbours import refuse_many
from solver.model.peaks import highest
from solver.model.plants import MAX_MATRIX_SIZE, ParallelPlant, Plant
from solver.model.transfer_function import LARGEST
from solver.model.validation import MAX_FREQUENCIES, frequencies, instance, real, reals, settle
from solver.stability.singular import is_singular

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import ParallelForm
    from solver.model.transfer_function import TransferFunction

__all__ = ["DecoupledClosedLoop", "Decoupling", "DecouplingSpecification", "decouple"]

INPUT_ERROR = 0.2  # relative error of an input, that of the default uncertainty weight
NOISE = 1e-12  # of the largest peak: what an exact zero leaves
MUCH_LOST = 0.5  # of the integral gain: the integrated error is doubled
_LOST = (
    "Loop {} gives up {:.0%} of its integral gain for the others: much performance is lost to "
    "interaction. Compare a dynamic decoupler, single loops (mutune tune) and any controller "
    "(mutune limit)."
)
_UNLIKE = 2.0  # factor between index and peak from which the estimate misleads
_MATTERS = 0.1  # interaction below this is small whatever the estimate says
_POINTS = 200  # of the curves; the peaks are read off a dense grid


@dataclass(frozen=True, eq=False)
class DecouplingSpecification(ByValue):
    """What is to be decoupled, and how tightly.

    Parameters
    ----------
    plant : Plant
        Stable, static gain regular, at most `MAX_MATRIX_SIZE` loops.
    limits : RobustnessLimits
        Permitted peaks of |S| and |T| of each loop.
    max_index : float or None
        Peak of |h_ij| that no loop j may exceed at any other output i; the integral gains are
        reduced to keep it.
    set_point_weights : tuple of float or None
        b, one a loop, 0 to 1; None: zero, which disturbs the other loops least.
    omega : (k,) or None
        Frequencies of the curves, rad per time unit, > 0, in any order, which the curves keep;
        None: chosen from the plant.
    gains : tuple of ParallelForm or None
        Own settings k and k_I of the decoupled loops, one a loop, analysed as they are; None: they
        are designed.
    dynamic : bool
        A dynamic decoupler, for two loops whose own elements can be inverted; else P(0)^-1.
    derivative_times : tuple of float or None
        tau_D of each loop, zero for PI: the loop is the PI controller in series with
        (1 + tau_D s)/(1 + 0.1 tau_D s), the cascade form of `Controller`. PI settings are designed
        for the process behind that.
    slower : float or None
        Factor >= 1 by which the integral gains are divided after the design, the proportional
        gains by its square root: eq. (7.27) of Astrom and Hagglund, as Example 11.6 uses it. The
        integrated error after a load step grows by that factor.

    """

    plant: Plant
    limits: RobustnessLimits = field(default_factory=RobustnessLimits)
    max_index: float | None = None
    set_point_weights: tuple[float, ...] | None = None
    omega: NDArray[np.float64] | None = None
    gains: tuple[ParallelForm, ...] | None = None
    dynamic: bool = False
    derivative_times: tuple[float, ...] | None = None
    slower: float | None = None

    def __post_init__(self) -> None:
        self._settle()
        self._check_plant()
        self._check_gains()
        self._check_slower()
        self._check_derivative_times()
        if self.max_index is not None and not 0 < self.max_index <= 1e6:
            message = "the interaction index must be positive and at most 1e6"
            raise InvalidInputError(message, "/max_index")
        weights = self.weights
        if len(weights) != self.plant.n:
            message = f"{len(weights)} set-point weights for {self.plant.n} loops"
            raise InvalidInputError(message, "/set_point_weights")
        for index, weight in enumerate(weights):
            if not 0 <= weight <= 1:
                message = "a set-point weight lies in 0..1"
                raise InvalidInputError(message, f"/set_point_weights/{index}")

    def _settle(self) -> None:
        instance(self.plant, Plant, "/plant")
        refuse_many(self.plant, "decoupling")
        instance(self.limits, RobustnessLimits, "/limits")
        if self.max_index is not None:
            settle(self, max_index=real(self.max_index, "/max_index"))
        if self.set_point_weights is not None:
            weights = reals(self.set_point_weights, "/set_point_weights")
            settle(self, set_point_weights=weights)
        if self.omega is not None:
            settle(self, omega=frequencies(self.omega, most=MAX_FREQUENCIES))

    def _check_plant(self) -> None:
        n = self.plant.n
        if n > MAX_MATRIX_SIZE:
            message = f"decoupling is for at most {MAX_MATRIX_SIZE} loops"
            raise InvalidInputError(message, "/plant/n")
        if any(np.any(element.poles.real >= 0) for element in self.plant.elements):
            message = "static decoupling needs a stable plant; this one integrates or is unstable"
            raise UnsupportedPlantError(message, "/plant")
        if is_singular(self.plant.static_gain()):
            message = "the static gain is singular: it has no inverse to decouple with"
            raise InvalidInputError(message, "/plant")

    def _check_derivative_times(self) -> None:
        if self.derivative_times is None:
            return
        settle(self, derivative_times=reals(self.derivative_times, "/derivative_times"))
        if len(self.derivative_times) != self.plant.n:
            message = f"{len(self.derivative_times)} derivative times for {self.plant.n} loops"
            raise InvalidInputError(message, "/derivative_times")
        for index, time in enumerate(self.derivative_times):
            if not 0 <= time <= LARGEST:
                message = "a derivative time must be zero or positive"
                raise InvalidInputError(message, f"/derivative_times/{index}")

    def _check_slower(self) -> None:
        if self.slower is None:
            return
        settle(self, slower=real(self.slower, "/slower"))
        if not 1 <= self.slower <= 1e6:
            message = "the factor must lie in 1..1e6"
            raise InvalidInputError(message, "/slower")
        if self.max_index is not None or self.gains is not None:
            message = "designed loops are made slower: leave max_index and gains out"
            raise InvalidInputError(message, "/slower")

    def _check_gains(self) -> None:
        if self.gains is None:
            return
        if len(self.gains) != self.plant.n:
            message = f"{len(self.gains)} settings for {self.plant.n} loops"
            raise InvalidInputError(message, "/gains")
        if self.max_index is not None:
            message = "given settings are analysed, not detuned: leave one of the two out"
            raise InvalidInputError(message, "/max_index")
        for index, gains in enumerate(self.gains):
            if gains.derivative_gain:
                message = "give derivative_times: derivative action stands in series with PI"
                raise InvalidInputError(message, f"/gains/{index}/derivative_gain")
            # Q(0) = I: each loop has a positive static gain.
            if not 0 < gains.integral_gain <= LARGEST:
                message = f"the integral gain must be positive and at most {LARGEST:g}"
                raise InvalidInputError(message, f"/gains/{index}/integral_gain")
            if not abs(gains.proportional_gain) <= LARGEST:
                message = f"the proportional gain must be at most {LARGEST:g} in magnitude"
                raise InvalidInputError(message, f"/gains/{index}/proportional_gain")

    @property
    def weights(self) -> tuple[float, ...]:
        """Set-point weights, (n,)."""
        if self.set_point_weights is None:
            return (0.0,) * self.plant.n
        return self.set_point_weights


@dataclass(frozen=True)
class DecoupledClosedLoop:
    """The loops together.

    Attributes
    ----------
    stable : bool
        Whether they are stable with the interaction that the design of each loop neglects.
    omega : (k,)
        Frequencies of the curves, rad per time unit.
    approximate, exact : (k, n, n) complex
        H and H_bar: from set point j to output i.
    approximate_peaks, exact_peaks : (n, n)
        Peaks of |h_ij| over all frequencies.
    indices : (n, n)
        Interaction indices |kappa_ij k_Ij| M_si, eq. 11.10: a crude estimate of the peaks off
        the diagonal, how loop j disturbs loop i. Zero on the diagonal.
    process : (k, n, n) complex
        Q = P D, the decoupled process.
    tolerated_input_error : float or None
        Relative error of every input at once, of any phase, up to which the loops stay stable;
        None where they are not.

    """

    stable: bool
    omega: NDArray[np.float64]
    approximate: NDArray[np.complex128]
    exact: NDArray[np.complex128]
    approximate_peaks: NDArray[np.float64]
    exact_peaks: NDArray[np.float64]
    indices: NDArray[np.float64]
    process: NDArray[np.complex128]
    tolerated_input_error: float | None


@dataclass(frozen=True, eq=False)
class Decoupling(ByValue):
    """Outcome of a decoupling.

    Attributes
    ----------
    decoupler : (n, n)
        D = P(0)^-1, of a dynamic one its static gain.
    elements : tuple of TransferFunction or None
        Of a dynamic decoupler: -p_12/p_11 and -p_21/p_22.
    kappa : (n, n)
        Q'(0), dead time exact; time units. Off the diagonal the kappa_ij of the book. Zero for a
        dynamic decoupler.
    loops : tuple of PIDesign
        Settings, one a loop.
    set_point_weights : tuple of float
        b, one a loop.
    closed_loop : DecoupledClosedLoop or None
        None where a design is unbounded.
    input_error_gain : float
        Greatest relative change of a loop's gain per relative error of the inputs, over the
        frequencies up to the loops' bandwidth: the largest sum of a row's relative gains in
        magnitude. An inverse-based controller is dangerous where it is large (Skogestad,
        Lundstrom and Hovd, section 4.2).
    warnings : tuple of str
        What to look at twice.

    """

    decoupler: NDArray[np.float64]
    elements: tuple[TransferFunction, TransferFunction] | None
    kappa: NDArray[np.float64]
    loops: tuple[PIDesign, ...]
    set_point_weights: tuple[float, ...]
    closed_loop: DecoupledClosedLoop | None
    input_error_gain: float
    warnings: tuple[str, ...] = field(default=())


def decouple(specification: DecouplingSpecification) -> Decoupling:
    """Decouple a plant statically and design its loops.

    Parameters
    ----------
    specification : DecouplingSpecification
        Plant and limits.

    Returns
    -------
    Decoupling
        With an unbounded loop (a first-order process without dead time, say) there is no
        closed loop; give `max_index`, or a model that holds what limits the loop.

    Raises
    ------
    InvalidInputError
        No such specification, which checks itself.

    """
    instance(specification, DecouplingSpecification, "")
    plant = specification.plant
    D = np.asarray(np.linalg.inv(plant.static_gain()), dtype=np.float64)
    dynamic = DynamicDecoupler.of(plant) if specification.dynamic else None
    kappa = np.zeros_like(D) if dynamic else _first_coefficients(plant, D)
    decoupler = D if dynamic is None else dynamic
    loops = _loops(specification, decoupler, kappa)
    closed_loop = _closed_loop(specification, decoupler, kappa, loops)
    error_gain = _input_error_gain(plant, loops)
    return Decoupling(
        decoupler=D,
        elements=None if dynamic is None else (dynamic.first, dynamic.second),
        kappa=kappa,
        loops=tuple(loops),
        set_point_weights=specification.weights,
        closed_loop=closed_loop,
        input_error_gain=error_gain,
        warnings=_warnings(loops, closed_loop, error_gain, specification.max_index),
    )


def _first_coefficients(plant: Plant, D: NDArray[np.float64]) -> NDArray[np.float64]:
    """Q'(0) = P'(0) D, (n, n), with zeros where only rounding is left."""
    size = range(plant.n)
    slope = np.array([[plant.element(r, c).derivative_at_zero() for c in size] for r in size])
    kappa = slope @ D
    noise = 1e-13 * (np.abs(slope) @ np.abs(D))
    return np.where(np.abs(kappa) <= noise, 0.0, kappa)


def _designers(
    specification: DecouplingSpecification, D: NDArray[np.float64] | DynamicDecoupler
) -> list[LoopDesigner]:
    """Return the designers of all loops; of units that are alike one."""
    plant = specification.plant
    size = range(plant.n)
    if isinstance(D, DynamicDecoupler):
        designers = [LoopDesigner(process, specification.limits) for process in D.processes]
    elif isinstance(plant, ParallelPlant):  # all loops are alike
        others = (plant.n - 1) * float(D[0, -1]) if plant.n > 1 else 0.0
        process = WeightedSum((float(D[0, 0]), others), (plant.process, plant.interaction))
        designers = [LoopDesigner(process, specification.limits)] * plant.n
    else:
        designers = [
            LoopDesigner(
                WeightedSum(
                    tuple(float(d) for d in D[:, loop]),
                    tuple(plant.element(loop, column) for column in size),
                ),
                specification.limits,
            )
            for loop in size
        ]
    times = specification.derivative_times
    if times is not None:
        return [
            LoopDesigner(designer.process.led(time), specification.limits)
            for designer, time in zip(designers, times, strict=True)
        ]
    return designers


def _loops(
    specification: DecouplingSpecification,
    D: NDArray[np.float64] | DynamicDecoupler,
    kappa: NDArray[np.float64],
) -> list[PIDesign]:
    """Return the loops as given, as designed, or detuned by the exact peaks."""
    plant, times = specification.plant, specification.derivative_times or ()
    designers = _designers(specification, D)
    if specification.gains is not None:
        return [
            designer.given(gains)
            for designer, gains in zip(designers, specification.gains, strict=True)
        ]

    def designs(limits: NDArray[np.float64]) -> list[PIDesign]:
        known: dict[tuple[LoopDesigner, float], PIDesign] = {}
        for key in zip(designers, limits.tolist(), strict=True):
            if key not in known:
                known[key] = key[0].design(key[1])
        return [known[key] for key in zip(designers, limits.tolist(), strict=True)]

    free = designs(np.full(plant.n, math.inf))
    if specification.slower is not None:
        return [
            _slower(designer, design, specification.slower)
            for designer, design in zip(designers, free, strict=True)
        ]
    if specification.max_index is None:
        return free

    def peaks(loops: Sequence[PIDesign]) -> NDArray[np.float64] | None:
        gains = tuple(loop.gains for loop in loops if loop.gains is not None)
        system = DecoupledLoops(plant, D, gains, specification.weights, times)
        return _peaks(system.exact, system.frequencies()) if system.is_stable() else None

    # Where nothing in the model bounds a loop, the estimate is where the search begins.
    start = np.where(
        [loop.gains is None for loop in free],
        _integral_gain_limits(kappa, specification, specification.max_index),
        math.inf,
    )
    return detuned(designs, peaks, specification.max_index, start)


def _slower(designer: LoopDesigner, design: PIDesign, factor: float) -> PIDesign:
    """Return a design with k_I over the factor and k over its square root, eq. (7.27)."""
    if design.gains is None:
        return design
    gains = replace(
        design.gains,
        integral_gain=design.gains.integral_gain / factor,
        proportional_gain=design.gains.proportional_gain / math.sqrt(factor),
    )
    return replace(designer.given(gains), status=DesignStatus.DETUNED)


def _integral_gain_limits(
    kappa: NDArray[np.float64], specification: DecouplingSpecification, max_index: float
) -> NDArray[np.float64]:
    """Estimated integral gain of each loop j: max_index/(|kappa_ij| M_s) for every other i."""
    coupling = np.abs(kappa)
    np.fill_diagonal(coupling, 0.0)
    strongest = np.max(coupling, axis=0) * specification.limits.max_sensitivity
    with np.errstate(divide="ignore"):
        return np.asarray(max_index / strongest, dtype=np.float64)


def _closed_loop(
    specification: DecouplingSpecification,
    D: NDArray[np.float64] | DynamicDecoupler,
    kappa: NDArray[np.float64],
    loops: list[PIDesign],
) -> DecoupledClosedLoop | None:
    gains = tuple(loop.gains for loop in loops if loop.gains is not None)
    peaks = [math.inf if loop.sensitivity is None else loop.sensitivity.value for loop in loops]
    if len(gains) < len(loops):
        return None
    plant = specification.plant
    times = specification.derivative_times or ()
    system = DecoupledLoops(plant, D, gains, specification.weights, times)
    omega = specification.omega
    if omega is None:
        bends = corners_of(plant.elements)
        omega = np.geomspace(bends[0] / 100, bends[-1] * 100, _POINTS)
    dense = system.frequencies()
    coupling = np.abs(kappa * [g.integral_gain for g in gains])
    indices = np.where(coupling == 0, 0.0, coupling) * np.array(peaks)[:, None]
    np.fill_diagonal(indices, 0.0)
    stable = system.is_stable()
    exact_peaks = np.full((plant.n, plant.n), math.inf)
    if stable:
        exact_peaks = _peaks(system.exact, dense)
        exact_peaks[exact_peaks < NOISE * exact_peaks.max()] = 0.0
    return DecoupledClosedLoop(
        stable=stable,
        omega=omega,
        approximate=system.approximate(omega),
        exact=system.exact(omega),
        approximate_peaks=_peaks(system.approximate, dense),
        exact_peaks=exact_peaks,
        indices=indices,
        process=system.process(omega),
        tolerated_input_error=system.tolerated_input_error(dense) if stable else None,
    )


def _peaks(
    response: Callable[[NDArray[np.float64]], NDArray[np.complex128]], omega: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Peaks of the magnitudes (n, n) of a response (k, n, n), refined from the samples `omega`."""
    samples = np.abs(response(omega))
    n = samples.shape[-1]
    places = list(np.ndindex(n, n))

    def side_by_side(parts: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        # One part at a time: all together take half a gigabyte for ten loops.
        return [
            np.abs(response(part)[:, *place]) for part, place in zip(parts, places, strict=True)
        ]

    found = highest(side_by_side, [(omega, samples[:, *place]) for place in places])
    return np.array([peak.value for peak in found]).reshape(n, n)


def _input_error_gain(plant: Plant, loops: list[PIDesign]) -> float:
    """Largest row sum of |relative gains| from steady state up to the loops' bandwidth.

    P (I + Delta) P^-1 has the diagonal 1 + sum_j lambda_ij delta_j.
    """
    gains = [np.abs(relative_gain_array(plant.static_gain()))[None]]
    bandwidths = [
        loop.sensitivity.omega
        for loop in loops
        if loop.sensitivity is not None and math.isfinite(loop.sensitivity.omega)
    ]
    if bandwidths:
        omega = np.geomspace(max(bandwidths) / 1e3, max(bandwidths), 50)
        gains.append(np.abs(relative_gain_at(plant.response(omega))))
    return float(np.nanmax(np.concatenate(gains).sum(axis=2)))


TOO_STRONG = "the interaction left by the static decoupler is too strong"
SMALLER_INDEX = "Give a smaller max_index."


_UNHELPED = "Nor does max_index: the interaction stays below it. Give own gains, a lower one"


def _warnings(
    loops: list[PIDesign],
    closed_loop: DecoupledClosedLoop | None,
    error_gain: float,
    max_index: float | None,
) -> tuple[str, ...]:
    advice = "Give max_index" if max_index is None else _UNHELPED
    warnings = [
        f"Loop {index + 1} has no finite optimum: its model has nothing that limits the "
        f"integral gain. {advice}, or add the dead time that the model neglects."
        for index, loop in enumerate(loops)
        if loop.status is DesignStatus.UNBOUNDED
    ]
    unstable_alone = [
        index + 1
        for index, loop in enumerate(loops)
        if loop.status is DesignStatus.GIVEN and loop.sensitivity is None
    ]
    warnings += [
        f"Loop {number} is unstable with its settings, even alone." for number in unstable_alone
    ]
    if closed_loop is not None and closed_loop.stable:
        warnings += _interaction_warnings(closed_loop, max_index)
    warnings += _fragile(closed_loop)
    warnings += [
        _LOST.format(index + 1, lost)
        for index, loop in enumerate(loops)
        if (lost := _lost(loop)) > MUCH_LOST
    ]
    if closed_loop is not None and not closed_loop.stable:
        why = "" if unstable_alone else f": {TOO_STRONG}"
        advice = "Give lower gains." if loops[0].status is DesignStatus.GIVEN else SMALLER_INDEX
        warnings.append(f"The loops are unstable together{why}. {advice}")
    if INPUT_ERROR * error_gain > 1:
        warnings.append(
            f"Relative gains are large: an error of {INPUT_ERROR:.0%} in the inputs changes the "
            f"gain of a loop by up to {INPUT_ERROR * error_gain:.0%}, so a decoupler is "
            "dangerous here. Prefer single loops tuned for robust performance."
        )
    return tuple(warnings)


def _fragile(closed_loop: DecoupledClosedLoop | None) -> list[str]:
    """Say how small an error of the inputs can make the loops unstable."""
    tolerated = None if closed_loop is None else closed_loop.tolerated_input_error
    if tolerated is None or tolerated >= INPUT_ERROR:
        return []
    text = (
        f"An error of {tolerated:.1%} in the inputs can make the loops unstable: the decoupler is "
        "fragile. Compare with single loops tuned for robust performance (mutune tune)."
    )
    return [text]


def _lost(loop: PIDesign) -> float:
    """Return the share of the greatest integral gain that detuning took."""
    if loop.status is not DesignStatus.DETUNED or loop.gains is None:
        return 0.0
    if not loop.greatest_integral_gain:
        return 0.0
    return 1 - loop.gains.integral_gain / loop.greatest_integral_gain


def _interaction_warnings(closed_loop: DecoupledClosedLoop, max_index: float | None) -> list[str]:
    """Say where the peaks exceed the bound, and where the estimate of them fails."""
    warnings = []
    n = len(closed_loop.indices)
    exact = np.where(np.eye(n, dtype=bool), 0.0, closed_loop.exact_peaks)
    if max_index is not None and np.max(exact) > max_index:
        warnings.append(
            f"The interaction still reaches {np.max(exact):.3g}: lower integral gains did not "
            f"bring it to {max_index:.3g}."
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(exact > 0, closed_loop.indices / exact, 1.0)
    matters = np.maximum(exact, closed_loop.indices) > _MATTERS
    wrong = matters & ((ratio > _UNLIKE) | (ratio < 1 / _UNLIKE))
    if np.any(wrong):
        size = np.where(wrong, np.abs(np.log(np.maximum(ratio, 1e-300))), -1.0)
        i, j = np.unravel_index(int(np.argmax(size)), size.shape)
        warnings.append(
            f"The index of loop {j + 1} on output {i + 1} says {closed_loop.indices[i, j]:.3g}, "
            f"the true peak is {exact[i, j]:.3g}: the estimate fails where the loops' bandwidths "
            "are unlike. Go by the exact peaks."
        )
    return warnings
