"""Kinds of controllers between single loops and a full one: decoupling, inverse, modes, pairs.

Each is C = W diag(c_1, c_2, ...) block by block, W a constant matrix, the c_i scalar. With
P = G(0)^-1 (of an integrating input: of s G at s = 0):

- static decoupling: W = P, PI controllers c_i; one for all of a parallel plant, whose symmetry it
  keeps (Astrom and Hagglund, section 11.3);
- one-way decoupling, two units: W = [1, -g_12/g_11(0); 0, 1] or its mirror image;
- inverse: c = k/(s m(s)), where all elements are multiples of one minimum-phase m(s);
- mode control: one PI controller on the sum of all units, one on their differences;
- pairs: units two by two, each pair decoupled; in a parallel plant one PI controller on the sum
  and one on the difference within a pair.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from solver.model.blocks import Block, LoopBlocks
from solver.model.controllers import Controller
from solver.model.frequencies import corners
from solver.model.mode_controller import ModeController
from solver.model.plants import MatrixPlant
from solver.model.state_space import StateSpace, from_polynomials
from solver.robustness.centralised_curves import central_blocks
from solver.stability.singular import is_singular

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.limits.youla import YoulaBlock
    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Uncertainty

__all__ = ["Structure", "StructureKind", "structures"]

SPEEDS = (0.02, 0.07, 0.2, 0.6)  # crossover over the bandwidth: where searches begin
INTEGRAL = 3.0  # integral time over the inverse crossover, for plants slower than the loop
FILTER = 1e3  # corner of the filter that makes an inverse proper, over the bandwidth
SMALLEST_ENTRY = 1e-9  # of the product of its row and column: a gain that is zero but for rounding
LARGEST_FULL = 100  # units of a plant whose pairs are also given as a full matrix


class StructureKind(StrEnum):
    """What lies between single loops and a full controller."""

    STATIC_DECOUPLING = "static_decoupling"
    ONE_WAY_DECOUPLING = "one_way_decoupling"
    INVERSE = "inverse"
    MODE_CONTROL = "mode_control"
    PAIRS = "pairs"


@dataclass(frozen=True, eq=False)
class Structure:
    """One structure: how its settings make it.

    Attributes
    ----------
    kind : StructureKind
        Its name.
    plant : Plant
        The plant that its blocks stand for.
    blocks : LoopBlocks
        Blocks that it splits the plant into.
    mixing : tuple of (m, m)
        W of each block.
    channels : tuple of tuple of int
        Number of the scalar controller of each channel, by block.
    acts_on : tuple of str
        What each scalar controller acts on, in words.
    base : tuple of StateSpace or None
        Scalar controllers that only a gain is free of; None: PI controllers, gain and integral
        time free.
    starts : list of (p,)
        Logarithms of settings to begin with: gain, integral time of each controller.

    """

    kind: StructureKind
    plant: Plant
    blocks: LoopBlocks
    mixing: tuple[NDArray[np.float64], ...]
    channels: tuple[tuple[int, ...], ...]
    acts_on: tuple[str, ...]
    base: tuple[StateSpace, ...] | None
    starts: list[NDArray[np.float64]]

    def settings(self, theta: NDArray[np.float64]) -> list[tuple[float, float | None]]:
        """Gain and integral time of each scalar controller for the logarithms `theta` (p,)."""
        values = np.exp(theta).tolist()
        if self.base is not None:
            return [(gain, None) for gain in values]
        return list(zip(values[::2], values[1::2], strict=True))

    def scalars(self, theta: NDArray[np.float64]) -> list[StateSpace]:
        """Scalar controllers for the logarithms `theta` (p,)."""
        found = []
        for number, (gain, integral_time) in enumerate(self.settings(theta)):
            if integral_time is None:
                assert self.base is not None  # noqa: S101 - settings() says so
                found.append(self.base[number].times(gain))
            else:
                found.append(StateSpace([[0.0]], [[1.0]], [[gain / integral_time]], [[gain]]))
        return found

    def controllers(self, theta: NDArray[np.float64]) -> tuple[StateSpace, ...]:
        """Return controllers, one a block, for the logarithms `theta` (p,)."""
        scalars = self.scalars(theta)
        return tuple(
            _diagonal([scalars[number] for number in channels]).times(W)
            for W, channels in zip(self.mixing, self.channels, strict=True)
        )

    def responses(
        self, theta: NDArray[np.float64], omega: NDArray[np.float64]
    ) -> list[NDArray[np.complex128]]:
        """Return the same at `omega` (k,): (k, m, m) each."""
        s = np.complex128(1j) * omega
        if self.base is None:
            scalars = [
                gain * (1 + 1 / (integral_time * s))
                for gain, integral_time in self.settings(theta)
                if integral_time is not None
            ]
        else:
            scalars = [each.response(omega)[:, 0, 0] for each in self.scalars(theta)]
        return [
            np.asarray(W * np.stack([scalars[number] for number in channels], axis=-1)[:, None, :])
            for W, channels in zip(self.mixing, self.channels, strict=True)
        ]

    def full(self, theta: NDArray[np.float64]) -> StateSpace | ModeController | None:
        """Return the controller in the form that analyses take; None where it is too large."""
        parts = self.controllers(theta)
        if not self.blocks.plant.interchangeable:
            return parts[0]
        if self.kind is not StructureKind.PAIRS:
            return ModeController(parts[0], parts[-1])
        n = self.blocks.plant.n
        if n > LARGEST_FULL:
            return None
        half = np.eye(n // 2)
        pair = _diagonal([parts[0], parts[-1]])
        turn = np.array([[1.0, 1.0], [1.0, -1.0]]) / math.sqrt(2.0)
        pair = StateSpace(pair.A, pair.B @ turn, turn @ pair.C, turn @ pair.D @ turn)
        return StateSpace(*(np.kron(half, each) for each in (pair.A, pair.B, pair.C, pair.D)))


def structures(
    plant: Plant,
    uncertainty: Uncertainty,
    youla: tuple[YoulaBlock, ...],
    bandwidth: float,
    identical: Controller | None = None,
) -> list[Structure]:
    """Return the structures that this plant can have.

    Parameters
    ----------
    plant : Plant
        Stable or integrating.
    uncertainty : Uncertainty
        Its structure is that of the blocks.
    youla : tuple of YoulaBlock
        P of each block.
    bandwidth : float
        Where the uncertainty or the dead time ends every loop, rad per time unit.
    identical : Controller or None
        A PI controller to begin with where a structure can give it to all loops.

    """
    if plant.n < 2:
        return []
    blocks = central_blocks(plant, uncertainty)
    inverses = tuple(block.inverse for block in youla)
    integrating = any(block.integrating.any() for block in youla)
    lag = 1.0 if integrating else 1 / float(corners(plant).min())
    pairs = [
        np.log([max(speed * bandwidth * lag, 1e-2) if not integrating else speed * bandwidth, time])
        for speed in SPEEDS
        for time in sorted({INTEGRAL / (speed * bandwidth), lag} if not integrating else
                           {INTEGRAL / (speed * bandwidth)})
    ]  # fmt: skip
    make = _Maker(plant, uncertainty, blocks, inverses, pairs, bandwidth, identical)
    found = [make.static()]
    if not integrating:
        found += make.inverse()
    if plant.interchangeable:
        found += make.modes()
    elif plant.n > 2:
        found += make.matrix_pairs()
    if plant.n == 2 and not integrating:
        found += make.one_way()
    return found


@dataclass(frozen=True, eq=False)
class _Maker:
    plant: Plant
    uncertainty: Uncertainty
    blocks: LoopBlocks
    inverses: tuple[NDArray[np.float64], ...]
    pairs: list[NDArray[np.float64]]
    bandwidth: float
    identical: Controller | None

    def static(self) -> Structure:
        if self.plant.interchangeable or _common(self.plant) is not None:
            # What is alike in all directions is left so: unlike gains would couple the outputs.
            channels: tuple[tuple[int, ...], ...] = tuple((0,) * len(W) for W in self.inverses)
            acts_on: tuple[str, ...] = ("each decoupled output",)
        else:
            channels = (tuple(range(self.plant.n)),)
            acts_on = tuple(f"output {unit + 1}" for unit in range(self.plant.n))
        return self._pi(StructureKind.STATIC_DECOUPLING, self.inverses, channels, acts_on)

    def inverse(self) -> list[Structure]:
        base = _inverse_of_dynamics(self.plant, self.bandwidth)
        if base is None:
            return []
        starts = [np.log([speed * self.bandwidth]) for speed in SPEEDS]
        channels = tuple((0,) * len(W) for W in self.inverses)
        kind = StructureKind.INVERSE
        words = ("the plant's inverse times 1/s",)
        return [
            Structure(
                kind, self.plant, self.blocks, self.inverses, channels, words, (base,), starts
            )
        ]

    def modes(self) -> list[Structure]:
        ratio = float(abs(self.inverses[1][0, 0] / self.inverses[0][0, 0]))
        # The direction in which the plant is weaker may be the slower one; with gains in
        # inverse proportion all loops have equal settings.
        starts = [
            np.concatenate([pair, pair - [shift, 0.0]])
            for pair in self.pairs
            for shift in (0.0, math.log(ratio) / 2, math.log(ratio))
        ]
        alike = self._alike((0, 1))
        found = [
            self._pi(
                StructureKind.MODE_CONTROL,
                self.inverses,
                ((0,), (1,)),
                ("sum of all units", "differences between units"),
                starts + alike,
            )
        ]
        if self.plant.n >= 4 and self.plant.n % 2 == 0:
            # The sums of the pairs have a mean and differences between them, both under the
            # first controller; the differences within pairs are under the second.
            half = self.plant.n // 2
            mean, between, within = (Block((0,), (0,), count) for count in (1, half - 1, half))
            blocks = LoopBlocks(
                self.plant, self.blocks.groups, (mean, between, within), 1, self.blocks.parts
            )
            weak = self.inverses[1]
            words = ("sum of each pair", "difference within each pair")
            found.append(
                Structure(
                    StructureKind.PAIRS, self.plant, blocks, (weak, weak, weak),
                    ((0,), (0,), (1,)), words, None, starts + self._alike((1, 1)),
                )
            )  # fmt: skip
        return found

    def _alike(self, modes: tuple[int, ...]) -> list[NDArray[np.float64]]:
        """Return settings that make all loops identical, W being P of these modes."""
        loop = self.identical
        if loop is None or loop.integral_time is None:
            return []
        gains = [loop.gain / self.inverses[mode][0, 0] for mode in modes]
        if min(gains) <= 0:
            return []
        return [np.log([each for gain in gains for each in (gain, loop.integral_time)])]

    def matrix_pairs(self) -> list[Structure]:
        n = self.plant.n
        G = np.linalg.inv(self.inverses[0])
        sizes = [slice(first, min(first + 2, n)) for first in range(0, n, 2)]
        W = np.zeros((n, n))
        for part in sizes:
            if is_singular(G[part, part]):
                return []
            W[part, part] = np.linalg.inv(G[part, part])
        words = tuple(f"output {unit + 1} in its pair" for unit in range(n))
        return [self._pi(StructureKind.PAIRS, (W,), (tuple(range(n)),), words)]

    def one_way(self) -> list[Structure]:
        units = range(2)
        matrix = MatrixPlant([[self.plant.element(row, col) for col in units] for row in units])
        gain = matrix.static_gain()
        lagging = self.pairs[1::2]  # of integral times as long as the plant's lag, or the loop's
        starts = [np.tile(pair, 2) for pair in self.pairs]
        starts += [np.concatenate([one, two]) for one in lagging for two in lagging]
        found = []
        parallel = self.plant.interchangeable
        for row in units[:1] if parallel else units:  # the mirror image is as good there
            other = 1 - row
            D = np.eye(2)
            if abs(gain[row, row]) <= SMALLEST_ENTRY * np.abs(gain[row]).max():
                continue
            D[row, other] = -gain[row, other] / gain[row, row]
            own = np.diag(gain @ D)
            if (np.abs(own) <= SMALLEST_ENTRY * np.abs(np.diag(gain)).max()).any():
                continue
            words = ("output 1", "output 2")
            W = D / own  # each loop alone sees a static gain of 1
            found.append(
                Structure(
                    StructureKind.ONE_WAY_DECOUPLING, matrix,
                    central_blocks(matrix, self.uncertainty), (W,), ((0, 1),), words,
                    None, starts,
                )
            )  # fmt: skip
        return found

    def _pi(
        self,
        kind: StructureKind,
        mixing: tuple[NDArray[np.float64], ...],
        channels: tuple[tuple[int, ...], ...],
        acts_on: tuple[str, ...],
        starts: list[NDArray[np.float64]] | None = None,
    ) -> Structure:
        if starts is None:
            starts = [np.tile(pair, len(acts_on)) for pair in self.pairs]
        return Structure(kind, self.plant, self.blocks, mixing, channels, acts_on, None, starts)


def _inverse_of_dynamics(plant: Plant, bandwidth: float) -> StateSpace | None:
    """1/(s m(s)), m(0) = 1, without m's dead time; None where elements differ or it is unstable."""
    model = _common(plant)
    if model is None or (model.zeros.real >= 0).any():
        return None
    num, den = np.array(model.num) / model.static_gain, np.array(model.den)
    below = np.append(num, 0.0)
    for _ in range(max(len(den) - len(below), 0)):
        below = np.convolve(below, [1 / (FILTER * bandwidth), 1.0])
    return from_polynomials(den, below)


def _common(plant: Plant) -> TransferFunction | None:
    """Return an element of which all others are multiples; None without one."""
    elements = [element for element in plant.elements if not element.is_zero]
    model = elements[0]
    return model if all(_shape(element) == _shape(model) for element in elements) else None


def _shape(element: TransferFunction) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Everything but the gain."""
    scale = element.num[0]
    num = tuple(np.round(np.array(element.num) / scale, 12).tolist())
    den = tuple(np.round(np.array(element.den) / element.den[0], 12).tolist())
    return num, den, element.dead_time


def _diagonal(systems: list[StateSpace]) -> StateSpace:
    parts = [linalg.block_diag(*(getattr(system, name) for system in systems)) for name in "ABCD"]
    return StateSpace(*parts)
