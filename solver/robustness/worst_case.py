"""The worst perturbation of a loop: at its frequency, and as a stable real system.

A lower bound of mu comes with the perturbation that attains it (`solver.mu.lower_bound`). Here
it is found for a loop with its symmetry, and its complex numbers at the worst frequency are
interpolated by first-order all-pass factors, so that the perturbed loop can be simulated.

Symmetry: the perturbation may differ between units of equal settings. Each group of m >= 2 units
is therefore split in up to three parts, m/2 + m/2 or (m-1)/2 + (m-1)/2 + 1, within which it is
constant. Nothing is lost for one or two groups, where the bound found equals mu for any number
of units (docs/robustness.md has the proof); any perturbation found is admissible in any case.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.blocks import KNOWN, acting, reduce
from solver.model.transfer_function import MAX_ORDER, TransferFunction
from solver.model.weights import Structure
from solver.mu.lower_bound import MuLowerBound, lower_bound
from solver.mu.structure import BlockStructure, bound_of_scales

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.controllers import Controller
    from solver.model.weights import Performance, Uncertainty

__all__ = [
    "DiagonalPerturbation",
    "Entry",
    "RankOnePerturbation",
    "WorstCase",
    "all_pass",
    "interconnection",
    "lower_bounds",
    "worst_case",
]

# Radians. A phase this near to 0 or pi is taken for it, which lowers the bound by its square;
# the all-pass factor would otherwise turn a million times slower or faster than omega.
SMALLEST_PHASE = 1e-6
DISAGREEMENT = 0.05  # relative gap between the bounds that the user is told of


@dataclass(frozen=True)
class Entry:
    """One number of a perturbation, shared by `units`, and a stable system that has it.

    `transfer` is a real all-pass times |value| with transfer(j omega) = value.
    """

    units: tuple[int, ...]
    value: complex
    transfer: TransferFunction


@dataclass(frozen=True)
class DiagonalPerturbation:
    """Delta_I = diag(delta_1 .. delta_n).

    `entries`: one for units with equal delta. `actuators`: 1 + w_I delta of each entry, what
    multiplies those inputs of the plant in a simulation; None where its order would exceed
    `MAX_ORDER`.
    """

    entries: tuple[Entry, ...]
    actuators: tuple[TransferFunction | None, ...]


@dataclass(frozen=True)
class RankOnePerturbation:
    """Delta(s) = left(s) right(s)^T, the worst perturbation of a full block."""

    left: tuple[Entry, ...]
    right: tuple[Entry, ...]


@dataclass(frozen=True)
class WorstCase:
    """The perturbation that attains the lower bound `mu` of the peak, at `omega`.

    `outputs` are the errors of the outputs, (I + w_O Delta_O), None where they are known; its
    `actuators` then are 1 + w_O delta, what multiplies those outputs. `performance` acts on outputs
    in units of their permitted errors where there are any.

    Its size is 1/mu. With it the uncertainty (I + w_O Delta_O) G (I + w_I Delta_I), the weights
    without their dead time if they have one, gives sigma_max(w_P S_p) = mu at `omega`, and the loop
    closed by `performance` is on the verge of instability there. `upper_bound` is mu's at the same
    frequency, and `gap` the relative distance of the two.
    """

    omega: float
    mu: float
    upper_bound: float
    gap: float
    uncertainty: DiagonalPerturbation | RankOnePerturbation
    performance: RankOnePerturbation
    outputs: DiagonalPerturbation | None = None

    @property
    def warning(self) -> str | None:
        """What to tell the user where the bounds disagree by more than 5 per cent."""
        if self.gap <= DISAGREEMENT:
            return None
        return (
            f"the bounds of mu disagree by {100 * self.gap:.1f} %: the peak lies between "
            f"{self.mu:.6g} and {self.upper_bound:.6g} at omega = {self.omega:.6g}"
        )


def worst_case(
    blocks: LoopBlocks,
    controllers: Sequence[Controller],
    uncertainty: Uncertainty,
    performance: Performance,
    *,
    omega: NDArray[np.float64],
    scales: NDArray[np.float64],
) -> WorstCase:
    """Return the worst perturbation of robust performance over the frequencies `omega`.

    Parameters
    ----------
    blocks, controllers
        A nominally stable loop, as `solver.model.blocks.group_loops` returns it.
    uncertainty, performance : Uncertainty, Performance
        The weights.
    omega : (k,) rad per time unit, > 0
        Frequencies, the peak of the upper bound among them.
    scales : (k, blocks.n_scales) float
        D-scales of the upper bound, performance scaled to one.

    """
    attained = _attained(blocks, controllers, uncertainty, performance, omega, scales)
    worst = int(np.argmax(attained.bound.mu))
    at, mu = float(omega[worst]), float(attained.bound.mu[worst])
    upper = float(
        bound_of_scales(attained.N[[worst]], attained.d[[worst]], attained.structure).mu[0]
    )
    Delta = attained.bound.Delta[worst] / mu
    units, inputs, size = attained.units, attained.inputs, len(attained.inputs)
    uncertain, outputs = attained.structure.size - attained.structure.performance, None
    if uncertainty.outputs is not None:
        outputs = _diagonal(units, np.diag(Delta)[size:uncertain], at, uncertainty.outputs)
    return WorstCase(
        omega=at,
        mu=mu,
        upper_bound=upper,
        gap=max(1 - mu / upper, 0.0),
        uncertainty=_rank_one(inputs, Delta[:size, :size], at)
        if uncertainty.structure is Structure.FULL
        else _diagonal(inputs, np.diag(Delta)[:size], at, uncertainty),
        performance=_rank_one(units, Delta[uncertain:, uncertain:], at),
        outputs=outputs,
    )


def lower_bounds(
    blocks: LoopBlocks,
    controllers: Sequence[Controller],
    uncertainty: Uncertainty,
    performance: Performance,
    *,
    omega: NDArray[np.float64],
    scales: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Lower bound of mu of robust performance at each frequency (k,); see `worst_case`."""
    return _attained(blocks, controllers, uncertainty, performance, omega, scales).bound.mu


@dataclass(frozen=True)
class _Attained:
    """N (k, 2r, 2r) of the split loop, the units of its r channels, and its bounds.

    Where outputs err N is (k, 3r, 3r). `units` are those that are demanded something of, `inputs`
    those that err.
    """

    units: list[tuple[int, ...]]
    inputs: list[tuple[int, ...]]
    N: NDArray[np.complex128]
    structure: BlockStructure
    d: NDArray[np.float64]
    bound: MuLowerBound


def _attained(  # noqa: PLR0917 - as its two callers have them
    blocks: LoopBlocks,
    controllers: Sequence[Controller],
    uncertainty: Uncertainty,
    performance: Performance,
    omega: NDArray[np.float64],
    scales: NDArray[np.float64],
) -> _Attained:
    full = uncertainty.structure is Structure.FULL
    if blocks.inputs_shared:
        return _of_shared(blocks, controllers, uncertainty, performance, omega, scales)
    halves = [(half, part) for part, units in enumerate(blocks.parts) for half in _split(units)]
    split = reduce(blocks.plant, [half for half, _ in halves], uncertainty, blocks.output_scale)
    channels = [halves[channel] for channel in split.blocks[0].channels if channel != KNOWN]
    size, uncertain = len(channels), split.blocks[0].size
    group = blocks.blocks[0].channels
    c = np.stack([controllers[group[part]].response(omega) for _, part in channels], axis=1)
    errors = [uncertainty] if uncertainty.outputs is None else [uncertainty, uncertainty.outputs]
    weights = [_rational(each.weight_of(half[0])) for each in errors for half, _ in channels]
    N = interconnection(
        split.response(omega)[0],
        np.concatenate([c, np.ones((omega.size, uncertain - size))], axis=1),
        np.stack([weight.response(omega) for weight in weights], axis=1),
        performance.weight.response(omega),
        size,
    )
    parts = [part for _, part in channels]
    owner = [0] if full else parts
    if uncertainty.outputs is not None:
        owner = [*parts, *(part + len(blocks.parts) for part in parts)]
    structure = BlockStructure((0,) * size if full else tuple(range(uncertain)), size)
    d = scales[:, owner]
    units = [half for half, _ in channels]
    return _Attained(units, units, N, structure, d, lower_bound(N, structure, d))


def _of_shared(  # noqa: PLR0917 - as its caller has them
    blocks: LoopBlocks,
    controllers: Sequence[Controller],
    uncertainty: Uncertainty,
    performance: Performance,
    omega: NDArray[np.float64],
    scales: NDArray[np.float64],
) -> _Attained:
    """Return the same of loops that share inputs: the rows of what does not err are left out."""
    block, loops = blocks.blocks[0], blocks.plant.n
    c = np.stack([controller.response(omega) for controller in controllers], axis=-1)
    inputs = range(block.size - loops)
    weights = [_rational(uncertainty.weight_of(unit)).response(omega) for unit in inputs]
    N = interconnection(
        blocks.response(omega)[0],
        acting(c, block.channels),
        np.stack([*(np.zeros(omega.size) for _ in range(loops)), *weights], axis=1),
        performance.weight.response(omega),
        loops,
    )[:, loops:, loops:]
    full = uncertainty.structure is Structure.FULL
    structure = BlockStructure((0,) * len(inputs) if full else tuple(inputs), loops)
    d = scales[:, [0] if full else list(inputs)]
    return _Attained(
        [(unit,) for unit in range(loops)], [(unit,) for unit in inputs], N, structure, d,
        lower_bound(N, structure, d),
    )  # fmt: skip


def all_pass(value: complex, omega: float) -> TransferFunction:
    """Return a stable real all-pass times |value| that equals `value` at j omega.

    Parameters
    ----------
    value : complex
        The value wanted.
    omega : float
        Frequency > 0 (rad per time unit).

    Returns
    -------
    TransferFunction
        Of order one, or a constant where `value` is real to a millionth.

    """
    magnitude, phase = cmath.polar(value)
    # (1 - tau s)/(1 + tau s) has the phase -2 atan(omega tau), in (-pi, 0); its negative the rest.
    sign = 1.0 if phase <= 0 else -1.0
    lag = -phase if phase <= 0 else math.pi - phase
    if lag < SMALLEST_PHASE:
        return TransferFunction((sign * magnitude,), (1.0,))
    if math.pi - lag < SMALLEST_PHASE:
        return TransferFunction((-sign * magnitude,), (1.0,))
    gain = sign * magnitude
    ratio = math.tan(lag / 2)
    corner = omega / ratio
    if corner >= 1:  # no coefficient leaves its range, however low or high the frequency
        tau = 1 / corner
        return TransferFunction((-gain * tau, gain), (tau, 1.0))
    return TransferFunction((-gain, gain * corner), (1.0, corner))


def interconnection(
    G: NDArray[np.complex128],
    c: NDArray[np.complex128],
    w_I: NDArray[np.complex128],
    w_P: NDArray[np.complex128],
    outputs: int,
) -> NDArray[np.complex128]:
    """Return N_RP (k, r + outputs, r + outputs), SLH eq. 31, with the sign of negative feedback.

    G : (k, r, r); c : (k, r), the controllers; w_I : (k, r), 0 where an input does not err; w_P :
    (k,); all complex. The demand is made on the first `outputs` outputs.
    """
    size = G.shape[1]
    identity = np.eye(size)
    # C S = (C^-1 + G)^-1 keeps its digits under integral action, where C and G C are huge.
    CS = np.linalg.inv(identity / c[:, None, :] + G)
    S = CS / c[:, :, None]
    # S G = C^-1 - C^-1 C S C^-1. Off the diagonal that is no difference of products, which grow
    # without bound towards zero where one input acts through integrators and another does not.
    SG = -S / c[:, None, :]
    on = np.arange(size)
    SG[:, on, on] = np.einsum("kij,kji->ki", S, G)
    SG *= (w_I != 0)[:, None, :]  # what does not err brings no error in
    left = np.concatenate([SG, S[:, :, :outputs]], axis=2)
    found: NDArray[np.complex128] = np.concatenate(
        [-(w_I * c)[:, :, None] * left, w_P[:, None, None] * left[:, :outputs]], axis=1
    )
    return found


def _rational(weight: TransferFunction) -> TransferFunction:
    """Return a weight of the same magnitude; 1 + w_I delta is then rational."""
    return TransferFunction(weight.num, weight.den)


def _split(units: tuple[int, ...]) -> list[tuple[int, ...]]:
    half = len(units) // 2
    parts = (units[:half], units[half : 2 * half], units[2 * half :])
    return [part for part in parts if part]


def _entry(units: tuple[int, ...], value: complex, omega: float) -> Entry:
    return Entry(units, complex(value), all_pass(complex(value), omega))


def _diagonal(
    units: Sequence[tuple[int, ...]],
    deltas: NDArray[np.complex128],
    omega: float,
    uncertainty: Uncertainty,
) -> DiagonalPerturbation:
    entries = tuple(_entry(part, delta, omega) for part, delta in zip(units, deltas, strict=True))
    return DiagonalPerturbation(
        entries,
        tuple(
            _actuator(_rational(uncertainty.weight_of(entry.units[0])), entry.transfer)
            for entry in entries
        ),
    )


def _rank_one(
    units: Sequence[tuple[int, ...]], Delta: NDArray[np.complex128], omega: float
) -> RankOnePerturbation:
    """Interpolate a rank-one block given in the channels of the split loop.

    A channel is the normed sum over its m units: per unit, both vectors shrink by sqrt(m).
    """
    left, size, right = np.linalg.svd(Delta)
    share = 1 / np.sqrt([len(part) for part in units])
    columns = size[0] * left[:, 0] * share
    rows = right[0] * share
    return RankOnePerturbation(
        tuple(_entry(part, value, omega) for part, value in zip(units, columns, strict=True)),
        tuple(_entry(part, value, omega) for part, value in zip(units, rows, strict=True)),
    )


def _actuator(weight: TransferFunction, delta: TransferFunction) -> TransferFunction | None:
    """Return 1 + w_I delta."""
    den = np.polymul(weight.den, delta.den)
    if den.size > MAX_ORDER + 1:
        return None
    num = np.trim_zeros(np.polyadd(den, np.polymul(weight.num, delta.num)), "f")
    size = np.max(np.abs(den))
    return TransferFunction(num / size, den / size)
