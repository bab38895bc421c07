"""A plant with its loops as small independent blocks that share their D-scales.

For a parallel plant whose loops fall into groups of equal settings, with sizes m_1..m_G, the
scaled problem splits exactly, by permutation symmetry and convexity of the scaling, into

- one G x G block, the group means, with plant entries (g - i) delta_ab + i sqrt(m_a m_b);
- for each group with m >= 2 a scalar block with plant g - i, standing for m - 1 differences
  within the group.

All share one D-scale per group (diagonal uncertainty) or one for all (full-block uncertainty).
Any other plant is a single block. What works with blocks need not know which it was.

Permitted errors e_i of the outputs, E = diag(e_i), change sigma_max(w_P S) into
sigma_max(w_P E^-1 S E). E commutes with the controllers and with diagonal uncertainty, so that is
the plant E^-1 G E under the same controllers. Of a parallel plant it keeps g on the diagonal, and
the split holds with the units of equal settings, equal permitted errors *and* equal uncertainty of
their inputs as groups.

Errors of the outputs, (I + w_O Delta_O) G, are errors of the inputs of a loop twice as wide, with
the plant [[0, I], [-G, 0]] and the controllers diag(C, I): its second inputs are the outputs of G,
which become those of the plant by (I + w_O Delta_O). det(I + G C) stays, and only of the first
outputs anything is demanded. Each block doubles so, and all else takes it for a block like others.

Loops that move combinations M_u of the inputs, and control combinations M_y of the outputs
(`solver.model.mixing`), leave the errors with the inputs: M_y G (I + w_I Delta) M_u C. That is a
loop wider by the inputs of G, with the plant [[0, M_y G], [-M_u, 0]] and the controllers
diag(C, I): what the loops move does not err, what comes of it does. With permitted errors the plant
is [[0, E^-1 M_y G], [-M_u E, 0]].
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.measured import MeasuredPlant
from solver.model.mixed_plant import MixedPlant, shares_inputs
from solver.model.neighbours import MAX_LINE, Mode, NeighbourPlant, modes, period, sections
from solver.model.plants import ParallelPlant, Plant, WeightedElement
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Structure

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterator, Sequence

    from numpy.typing import ArrayLike, NDArray

    from solver.model.controllers import Controller
    from solver.model.sums import Entry, Sums
    from solver.model.weights import Uncertainty

__all__ = [
    "KNOWN",
    "ONE",
    "Block",
    "Layout",
    "LoopBlocks",
    "WeightedElement",
    "acting",
    "by_settings",
    "group_loops",
    "marks",
    "reduce",
    "with_inputs",
    "with_outputs",
]

ONE = TransferFunction((1.0,), (1.0,))
KNOWN = -1  # controller of a channel where an output, or an input that loops share, errs: it is 1


class Layout(NamedTuple):
    """Where the rows of all blocks, below each other, belong; a named tuple for compiled code.

    Attributes
    ----------
    channels, scales : (rows,)
        Controller and D-scale of each row; `KNOWN` where an output errs, or an input that loops
        share. A row that does not err has any scale, and the weight 0.
    first : (blocks + 1,)
        First row of each block, with the number of rows at the end.

    """

    channels: NDArray[np.int64]
    scales: NDArray[np.int64]
    first: NDArray[np.int64]


@dataclass(frozen=True)
class Block:
    """One independent part of the loop.

    Parameters
    ----------
    channels : tuple of int
        Controller of each channel of the block; `KNOWN` where it is 1.
    scales : tuple of int
        D-scale of each channel.
    multiplicity : int
        How often the block occurs in the full loop.

    """

    channels: tuple[int, ...]
    scales: tuple[int, ...]
    multiplicity: int

    @property
    def size(self) -> int:
        """Number of channels."""
        return len(self.channels)

    @property
    def outputs(self) -> int:
        """Number of channels that are demanded something of: the first ones."""
        return sum(channel != KNOWN for channel in self.channels)


@dataclass(frozen=True)
class LoopBlocks:
    """The blocks of a plant, its loops being grouped.

    Parameters
    ----------
    plant : Plant
        The plant they stand for.
    groups : tuple of tuples of int
        Units that share a controller; group j uses controller j.
    blocks : tuple of Block
        The first one carries the group means (all of a matrix plant).
    n_scales : int
        Number of different D-scales.
    parts : tuple of tuples of int
        Units that each channel of the first block stands for. Parallel plant: those that share a
        controller, a permitted error and an uncertainty, group by group; else each unit alone, in
        their order.
    output_scale : tuple of float or None
        Permitted error of each output; None: all alike.
    outputs_err : bool
        Whether the outputs err too: each block then has twice its channels, and the scales of the
        outputs follow those of the inputs.
    inputs_shared : bool
        Whether the inputs that err are those that the loops of a `MixedPlant` share: its one block
        then has a channel for each loop and one for each input.

    """

    plant: Plant
    groups: tuple[tuple[int, ...], ...]
    blocks: tuple[Block, ...]
    n_scales: int
    parts: tuple[tuple[int, ...], ...]
    output_scale: tuple[float, ...] | None = None
    outputs_err: bool = False
    inputs_shared: bool = False

    @property
    def is_wider(self) -> bool:
        """Whether channels are added where outputs, or shared inputs, err."""
        return self.outputs_err or self.inputs_shared

    @property
    def n_controllers(self) -> int:
        """Number of different controllers."""
        return len(self.groups)

    def response(self, omega: ArrayLike) -> tuple[NDArray[np.complex128], ...]:
        """Plant of each block at `omega` (rad per time unit): (k, m, m) complex each."""
        return self(_points(omega))

    def __call__(self, s: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], ...]:
        """Plant of each block at the complex points `s` (k,): (k, m, m) complex each."""
        G, first = self.packed_at(s), self.layout.first
        return tuple(
            G[:, start : start + block.size, : block.size]
            for start, block in zip(first, self.blocks, strict=False)
        )

    def known(self, s: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], ...]:
        """Return the same without what is added where outputs, or shared inputs, err."""
        if not self.is_wider:
            return self(s)
        if self.outputs_err:
            return tuple(-G[:, G.shape[1] // 2 :, : G.shape[1] // 2] for G in self(s))
        (wide,), loops = self(s), self.plant.n
        return (-wide[:, :loops, loops:] @ wide[:, loops:, :loops],)

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of a ring or row that its blocks are; empty where they are none."""
        ring = isinstance(self.plant, NeighbourPlant) and len(self.blocks) > 1
        return modes(self.plant, len(self.parts)) if ring else ()  # type: ignore[arg-type]  # as told

    @cached_property
    def _sections(self) -> list[tuple[int, list[list[TransferFunction]]]]:
        """The sections of a ring in which anything is, with their numbers."""
        assert isinstance(self.plant, NeighbourPlant)  # noqa: S101 - for the type checker
        every = enumerate(sections(self.plant, len(self.parts)))
        return [(m, part) for m, part in every if not all(e.is_zero for row in part for e in row)]

    def _ring_terms(self, index: int) -> tuple[tuple[tuple[WeightedElement, ...], ...], ...]:
        mode, size = self.modes[index], len(self.parts)
        sine = np.zeros(len(mode.cosines)) if mode.sines is None else mode.sines

        def entry(row: int, column: int) -> tuple[WeightedElement, ...]:
            weights = mode.cosines if row // size == column // size else sine
            weights = -weights if row < column and row // size != column // size else weights
            a, b = row % size, column % size
            return tuple(
                WeightedElement(float(weights[m] * self.ratios[a, b]), part[a][b])
                for m, part in self._sections
                if weights[m] != 0 and not part[a][b].is_zero
            )

        rows = range(self.blocks[index].size)
        return tuple(tuple(entry(row, column) for column in rows) for row in rows)

    def weights(self, uncertainty: Uncertainty) -> Sums:
        """Return the weight of each row, w_I or w_O, as a column.

        `uncertainty` is that which the blocks were made for.
        """
        from solver.model.sums import Entry, sums  # noqa: PLC0415 - the same

        return sums(
            Entry(row, 0, 1.0, weight)
            for row, weight in enumerate(self._weights(uncertainty))
            if weight is not None
        )

    def _weights(self, uncertainty: Uncertainty) -> list[TransferFunction | None]:
        """Return the weight of each row; None where nothing errs."""
        if self.inputs_shared:
            inputs = range(self.blocks[0].size - self.plant.n)
            return [None] * self.plant.n + [uncertainty.weight_of(unit) for unit in inputs]
        units, outputs = [part[0] for part in self.parts], uncertainty.outputs
        if self.modes or outputs is not None:  # each part has a scale of its own
            owners = [units[scale % len(units)] for scale in self.layout.scales.tolist()]
            return [
                (uncertainty if outputs is None or channel != KNOWN else outputs).weight_of(unit)
                for channel, unit in zip(self.layout.channels.tolist(), owners, strict=True)
            ]
        several = [part[0] for part in self.parts if len(part) > 1]
        return [uncertainty.weight_of(unit) for unit in units + several]

    def responses(self, uncertainty: Uncertainty, omega: ArrayLike) -> NDArray[np.complex128]:
        """Return the weight of each row, at `omega` (k,) rad per time unit, (k, rows)."""
        from solver.model.sums import summed  # noqa: PLC0415 - the same

        rows, weights = self.layout.channels.size, self.weights(uncertainty)
        return np.asarray(summed(weights, rows, 1, _points(omega))[:, :, 0])

    def squared(self, uncertainty: Uncertainty, omega: ArrayLike) -> NDArray[np.float64]:
        """Return the square of the weight of each row's magnitude, (k, rows)."""
        from solver.model.sums import squares  # noqa: PLC0415 - the same

        rows, weights = self.layout.channels.size, self.weights(uncertainty)
        return np.asarray(squares(weights, rows, _points(omega)))

    @cached_property
    def ratios(self) -> NDArray[np.float64]:
        """Factors e_c/e_r of the first block's entries, (m, m): E^-1 G E of G."""
        if self.output_scale is None:
            return np.ones((len(self.parts), len(self.parts)))
        e = np.array([self.output_scale[part[0]] for part in self.parts])
        return np.asarray(e / e[:, None])

    def terms(self, index: int) -> tuple[tuple[tuple[WeightedElement, ...], ...], ...]:
        """Return what the entries of block `index` are sums of, row by row: those of `known`."""
        plant = self.plant
        if self.modes:
            return self._ring_terms(index)
        if not isinstance(plant, ParallelPlant):
            size, ratios = range(plant.n), self.ratios.tolist()
            return tuple(
                tuple(
                    tuple(WeightedElement(f * ratios[r][c], e) for f, e in plant.terms(r, c))
                    for c in size
                )
                for r in size
            )
        g, i = plant.process, plant.interaction
        if index:
            return (((WeightedElement(1.0, g), WeightedElement(-1.0, i)),),)
        sizes = [len(part) for part in self.parts]
        coupling = np.sqrt(np.outer(sizes, sizes)) * self.ratios
        return tuple(
            tuple(
                (WeightedElement(float(coupling[a, b]), i),)
                if a != b
                else (
                    WeightedElement(1.0, g),
                    *([WeightedElement(sizes[a] - 1.0, i)] if sizes[a] > 1 else []),
                )
                for b in range(len(sizes))
            )
            for a in range(len(sizes))
        )

    @cached_property
    def layout(self) -> Layout:
        """Controller and scale of each row, and the first row of each block."""
        channels = np.array([c for block in self.blocks for c in block.channels])
        scales = np.array([s for block in self.blocks for s in block.scales])
        first = np.cumsum([0, *(block.size for block in self.blocks)])
        return Layout(channels, scales, first)

    def packed(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Plants of all blocks below each other, (k, rows, widest block) complex."""
        return self.packed_at(_points(omega))

    def packed_at(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the same at the complex points `s` (k,)."""
        if isinstance(self.plant, MeasuredPlant):
            G = self.plant.response(s.imag) * self.ratios
            return with_outputs(G) if self.outputs_err else np.ascontiguousarray(G)
        from solver.model.sums import summed  # noqa: PLC0415 - what reads requests compiles nothing

        return np.asarray(summed(self.sums, *self.shape, s))

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Rows of all blocks, and columns of the widest one."""
        return self.layout.channels.size, max(block.size for block in self.blocks)

    @cached_property
    def sums(self) -> Sums:
        """What the entries of `packed` are sums of."""
        from solver.model.sums import sums  # noqa: PLC0415 - the same

        if self.inputs_shared:
            return sums(self._shared())
        return sums(
            entry
            for index, row in enumerate(self.layout.first[:-1].tolist())
            for entry in self._entries(index, row)
        )

    def _entries(self, index: int, first: int) -> Iterator[Entry]:
        """Yield what the entries of a block, from row `first` on, are sums of."""
        from solver.model.sums import Entry  # noqa: PLC0415 - the same

        below = self.blocks[index].outputs if self.outputs_err else 0
        for row in range(below):
            yield Entry(first + row, below + row, 1.0, ONE)
        for row, entries in enumerate(self.terms(index)):
            for column, terms in enumerate(entries):
                for factor, element in terms:
                    yield Entry(first + below + row, column, -factor if below else factor, element)

    def _shared(self) -> Iterator[Entry]:
        """Yield what the entries of [[0, E^-1 M_y G], [-M_u E, 0]] are sums of."""
        from solver.model.sums import Entry  # noqa: PLC0415 - the same

        plant = self.plant
        assert isinstance(plant, MixedPlant)  # noqa: S101 - for the type checker
        for loop, e in enumerate(self.output_scale or (1.0,) * plant.n):
            for each in range(plant.plant.n):
                yield Entry(plant.n + each, loop, -plant.inputs[each][loop] * e, ONE)
                for output in range(plant.plant.n):
                    factor = plant.outputs[loop][output] / e
                    yield Entry(loop, plant.n + each, factor, plant.plant.element(output, each))

    def renumbered(self, controllers: Sequence[int]) -> LoopBlocks:
        """Return the same, controller j being number `controllers[j]` of a longer list."""
        blocks = (
            replace(
                block, channels=tuple(c if c == KNOWN else controllers[c] for c in block.channels)
            )
            for block in self.blocks
        )
        return replace(self, blocks=tuple(blocks))

    def expand(self, controllers: Sequence[Controller]) -> tuple[Controller, ...]:
        """One controller a unit from one a group."""
        return tuple(map(controllers.__getitem__, self._owners))

    @cached_property
    def _owners(self) -> list[int]:
        """Group of each unit."""
        owners = [0] * self.plant.n
        for index, group in enumerate(self.groups):
            for unit in group:
                owners[unit] = index
        return owners


def _points(omega: ArrayLike) -> NDArray[np.complex128]:
    """Return the points on the imaginary axis."""
    return 1j * np.atleast_1d(np.asarray(omega, dtype=float))


def reduce(
    plant: Plant,
    groups: Sequence[Sequence[int]],
    uncertainty: Uncertainty | None = None,
    output_scale: Sequence[float] | None = None,
) -> LoopBlocks:
    """Return the independent blocks of `plant` under loops that are equal within `groups`.

    Parameters
    ----------
    plant : Plant
        Parallel or general.
    groups : sequence of sequences of int
        A partition of the units 0..n-1.
    uncertainty : Uncertainty or None
        Of the inputs; None: independent and alike.
    output_scale : sequence of float or None
        Permitted error of each output, see `Performance`.

    Raises
    ------
    InvalidInputError
        `groups` is no partition of the units.

    """
    partition = tuple(tuple(group) for group in groups)
    if sorted(itertools.chain.from_iterable(partition)) != list(range(plant.n)):
        message = "the groups must hold each unit exactly once"
        raise InvalidInputError(message, "/groups")
    full = uncertainty is not None and uncertainty.structure is Structure.FULL
    err = uncertainty is not None and uncertainty.outputs is not None
    scales = None if output_scale is None else tuple(output_scale)
    if not isinstance(plant, ParallelPlant):
        owner = {unit: index for index, group in enumerate(partition) for unit in group}
        channels = tuple(owner[unit] for unit in range(plant.n))
        mark = marks(uncertainty, scales)
        places = period(plant, [(owner[unit], mark(unit)) for unit in range(plant.n)])
        if isinstance(plant, NeighbourPlant) and places is not None and not full:
            found = _ring_blocks(plant, partition, channels, places, scales)
            return _doubled(found) if err else found
        if isinstance(plant, NeighbourPlant) and plant.n > MAX_LINE and uncertainty is not None:
            message = (
                f"in a ring of more than {MAX_LINE} units settings, errors and uncertainty "
                "must repeat around it, the uncertainty diagonal"
            )
            if not plant.ring:
                message = (
                    f"in a row of more than {MAX_LINE} units settings, errors and uncertainty must "
                    "be the same for all, the uncertainty diagonal"
                )
            raise InvalidInputError(message, "/plant/n")
        if shares_inputs(plant) and uncertainty is not None:
            return _shared(plant, partition, channels, scales, full=full)
        own = (0,) * plant.n if full else tuple(range(plant.n))
        found = LoopBlocks(
            plant,
            partition,
            (Block(channels, own, 1),),
            1 if full else plant.n,
            plant.kinds,
            scales,
        )
        return _doubled(found) if err else found
    split = [_alike(group, marks(uncertainty, scales)) for group in partition if group]
    owners = tuple(index for index, parts in enumerate(split) for _ in parts)
    parts = tuple(itertools.chain.from_iterable(split))
    size = len(parts)
    blocks = [Block(owners, (0,) * size if full else tuple(range(size)), 1)]
    blocks += [
        Block((owner,), (0,) if full else (index,), len(part) - 1)
        for index, (owner, part) in enumerate(zip(owners, parts, strict=True))
        if len(part) > 1
    ]
    found = LoopBlocks(plant, partition, tuple(blocks), 1 if full else size, parts, scales)
    return _doubled(found) if err else found


def _shared(
    plant: MixedPlant,
    partition: tuple[tuple[int, ...], ...],
    channels: tuple[int, ...],
    scales: tuple[float, ...] | None,
    *,
    full: bool,
) -> LoopBlocks:
    """Return the block of the loop wider by the inputs, which err, that its loops share."""
    inputs = plant.plant.n
    own = (0,) * inputs if full else tuple(range(inputs))
    block = Block(channels + (KNOWN,) * inputs, (0,) * plant.n + own, 1)
    n_scales = 1 if full else inputs
    return LoopBlocks(plant, partition, (block,), n_scales, plant.kinds, scales, inputs_shared=True)


def _doubled(found: LoopBlocks) -> LoopBlocks:
    """Return the blocks of the loop twice as wide, in which the outputs err."""
    blocks = (
        replace(
            block,
            channels=block.channels + (KNOWN,) * block.size,
            scales=block.scales + tuple(scale + found.n_scales for scale in block.scales),
        )
        for block in found.blocks
    )
    return replace(found, blocks=tuple(blocks), n_scales=2 * found.n_scales, outputs_err=True)


def with_outputs(G: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return [[0, I], [-G, 0]] of G (k, m, m): the plant of a loop whose outputs err."""
    m = G.shape[1]
    wide = np.zeros((len(G), 2 * m, 2 * m), dtype=complex)
    wide[:, :m, m:] = np.eye(m)
    wide[:, m:, :m] = -G
    return wide


def with_inputs(G: NDArray[np.complex128], M: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return [[0, G], [-M, 0]] of G (k, m, i), M (i, m) or (k, i, m): loops that share inputs."""
    loops, size = G.shape[1], sum(G.shape[1:])
    wide = np.zeros((len(G), size, size), dtype=complex)
    wide[:, :loops, loops:] = G
    wide[:, loops:, :loops] = -M
    return wide


def acting(c: NDArray[np.complex128], channels: Sequence[int]) -> NDArray[np.complex128]:
    """Return the controller of each channel (k, m) of the responses of all, c (k, controllers)."""
    index = np.array(channels)
    return np.where(index == KNOWN, 1.0, c[:, index])


def _ring_blocks(
    plant: NeighbourPlant,
    partition: tuple[tuple[int, ...], ...],
    channels: tuple[int, ...],
    places: int,
    scales: tuple[float, ...] | None,
) -> LoopBlocks:
    """Return the modes of a ring that repeats itself every `places` units, or of a row."""
    own, places_of = channels[:places], tuple(range(places))
    blocks = tuple(
        Block(own, places_of, mode.multiplicity)
        if mode.sines is None
        else Block(own * 2, places_of * 2, mode.multiplicity)
        for mode in modes(plant, places)
    )
    parts = tuple(tuple(range(place, plant.n, places)) for place in places_of)
    return LoopBlocks(plant, partition, blocks, places, parts, scales)


def marks(
    uncertainty: Uncertainty | None, output_scale: Sequence[float] | None
) -> Callable[[int], Hashable]:
    """Return what tells a unit from others of a parallel plant: its errors, as a key."""
    if output_scale is None and (uncertainty is None or not uncertainty.unlike_units):
        return _no_mark

    def of(unit: int) -> Hashable:
        return (
            None if output_scale is None else output_scale[unit],
            None if uncertainty is None else uncertainty.weight_of(unit),
            None
            if uncertainty is None or uncertainty.outputs is None
            else uncertainty.outputs.weight_of(unit),
        )

    return of


def _no_mark(_: int) -> Hashable:
    """Return the same for every unit."""
    return None


def by_settings(
    loops: Sequence[Controller], mark: Callable[[int], Hashable]
) -> dict[tuple[Controller, Hashable], list[int]]:
    """Return the units with equal settings and equal marks, in their order."""
    groups: dict[tuple[Controller, Hashable], list[int]] = {}
    count = itertools.count()
    for loop, run in itertools.groupby(loops):  # of a thousand units too
        units = [unit for _, unit in zip(run, count, strict=False)]
        if mark is _no_mark:
            groups.setdefault((loop, None), []).extend(units)
            continue
        for unit in units:
            groups.setdefault((loop, mark(unit)), []).append(unit)
    return groups


def _alike(group: tuple[int, ...], mark: Callable[[int], Hashable]) -> list[tuple[int, ...]]:
    """Return the units of a group split by their errors, in the order of the units."""
    if mark is _no_mark:
        return [group]
    parts: dict[Hashable, list[int]] = {}
    for unit in group:
        parts.setdefault(mark(unit), []).append(unit)
    return [tuple(units) for units in parts.values()]


def group_loops(
    plant: Plant,
    loops: Sequence[Controller],
    uncertainty: Uncertainty | None = None,
    output_scale: Sequence[float] | None = None,
) -> tuple[LoopBlocks, tuple[Controller, ...]]:
    """Return the blocks for given loops, and the controller of each of their groups.

    Equal settings share a group, unless the errors of their inputs or outputs differ.

    Raises
    ------
    InvalidInputError
        Not one loop a unit.

    """
    if len(loops) != plant.n:
        message = f"{len(loops)} loops for a plant of {plant.n} units"
        raise InvalidInputError(message, "/loops")
    groups = by_settings(loops, marks(uncertainty, output_scale))
    blocks = reduce(plant, list(groups.values()), uncertainty, output_scale)
    return blocks, tuple(loop for loop, _ in groups)
