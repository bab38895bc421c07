"""A loop as independent blocks, exactly: what is proven in place of the n-channel statement.

Let a parallel plant have m_a units under settings a = 1..G, with equal D-scales for equal
settings. Exchanging equal units then changes nothing, so the loop splits into one block of the
groups' means and, for each group with m_a >= 2, m_a - 1 equal scalar blocks of the differences
within it, whose plant is g - i. The plant of the means is (g - i) I + i 1 m^T. Its left
eigenvectors are m^T, with g + (n-1) i, and the differences of two groups, with g - i; outputs
combined along them keep an ill-conditioned plant harmless, and all factors are rational.

Permitted errors E = diag(e_i) of the outputs turn G into E^-1 G E. For a parallel plant the
combinations T of before, times E, serve: T E (E^-1 G E) = T G E, so that each column of T and of
T G takes its factor e.

Where the outputs err too, (I + w_O Delta_O) G, the loop is twice as wide: the plant
[[0, I], [-G, 0]] under diag(C, I), with w_I on its first inputs and w_O on the others. Both halves
of its outputs are combined by T, so that T G stands there again. Each of the settings then has a
second entry: the controller 1, and a D-scale of its own.

Loops that move combinations M_u of the inputs, and control combinations M_y of the outputs, leave
the errors with the inputs (`solver.model.mixing`): the plant [[0, E^-1 M_y G], [-M_u E, 0]] under
diag(C, I). What the loops move does not err: in the sums
over the inputs those columns are left out that an error would come in by.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from flint import fmpq

from solver.certificate.enclosures import ExactResponse, exact
from solver.model.mixed_plant import MixedPlant, shares_inputs
from solver.model.plants import ParallelPlant
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Structure

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Uncertainty

__all__ = [
    "MAX_SETTINGS",
    "ExactBlock",
    "GroupSettings",
    "blocks",
    "scale_count",
    "settings_of",
    "width_of",
]

# The work grows with the cube: 10 take seconds, 20 half a minute. Outputs that err double them.
MAX_SETTINGS = 20


@dataclass(frozen=True)
class GroupSettings:
    """Controller settings that have one D-scale, and how many loops have them.

    `error` is the permitted error of their outputs, `weight` the uncertainty of their inputs,
    `outputs` that of their outputs, if these err. Loops that share inputs have no uncertainty of
    their own: `weight` is None.
    """

    controller: Controller
    loops: int
    error: float
    weight: TransferFunction | None
    outputs: TransferFunction | None


@dataclass(frozen=True, eq=False)
class ExactBlock:
    """Part of the loop that shares only settings and D-scales with the rest.

    Parameters
    ----------
    settings : tuple of int
        Which settings act on each of the k inputs.
    demanded : tuple of bool
        Whether a demand is made on each of the k outputs; the controllers of the others are 1.
    weights : tuple of fmpq
        How much each input counts in sums over the inputs, (k,).
    combination : tuple of tuples of fmpq
        T, which combines the outputs, (k, k) by rows.
    factors, responses : tuples of tuples of fmpq, ExactResponse
        Elements of T G are a factor times a response, (k, k) by rows.
    multiplicity : int
        How often the block occurs.
    exact : int
        How many of the inputs do not err: the first ones.

    """

    settings: tuple[int, ...]
    demanded: tuple[bool, ...]
    weights: tuple[fmpq, ...]
    combination: tuple[tuple[fmpq, ...], ...]
    factors: tuple[tuple[fmpq, ...], ...]
    responses: tuple[tuple[ExactResponse, ...], ...]
    multiplicity: int = 1
    exact: int = 0

    @cached_property
    def integrators(self) -> tuple[int, ...]:
        """Poles at s = 0 in each row of T G, (k,)."""
        return tuple(max(response.integrators for response in row) for row in self.responses)


def settings_of(
    plant: Plant,
    loops: Sequence[Controller],
    uncertainty: Uncertainty,
    output_scale: Sequence[float] | None,
) -> tuple[GroupSettings, ...]:
    """Return the settings that have a D-scale of their own, in the order of the loops.

    Equal settings on a parallel plant share one where the permitted errors of their outputs and the
    uncertainty of their inputs are equal too; on a matrix plant each loop has its own.
    """
    weights: list[TransferFunction | None] = [None] * len(loops)
    if not shares_inputs(plant):
        weights = [uncertainty.weight_of(unit) for unit in range(len(loops))]
    given = uncertainty.outputs
    outputs = [None if given is None else given.weight_of(unit) for unit in range(len(loops))]
    errors = output_scale or (1.0,) * len(loops)
    own = list(zip(loops, errors, weights, outputs, strict=True))
    counts = Counter(own).items() if plant.interchangeable else [(each, 1) for each in own]
    return tuple(GroupSettings(loop, count, e, w_I, w_O) for (loop, e, w_I, w_O), count in counts)


def scale_count(
    plant: Plant,
    loops: Sequence[Controller],
    uncertainty: Uncertainty,
    output_scale: Sequence[float] | None,
) -> int:
    """Return the number of D-scales: one for a full block."""
    if uncertainty.structure is Structure.FULL:
        return 1
    if shares_inputs(plant):
        return plant.plant.n
    return width_of(plant, loops, uncertainty, output_scale)


def width_of(
    plant: Plant,
    loops: Sequence[Controller],
    uncertainty: Uncertainty,
    output_scale: Sequence[float] | None,
) -> int:
    """Return the number of different settings; twice that where outputs err, inputs are shared."""
    count = len(settings_of(plant, loops, uncertainty, output_scale))
    if shares_inputs(plant):
        return count + plant.plant.n
    return count if uncertainty.outputs is None else 2 * count


def blocks(
    plant: Plant, settings: Sequence[GroupSettings], *, known: bool = False
) -> tuple[ExactBlock, ...]:
    """Return the independent blocks of the loop; `known`: without the errors of shared inputs."""
    errors = [exact(group.error) for group in settings]
    if shares_inputs(plant) and not known:
        return (_shared_block(plant, errors),)
    if isinstance(plant, ParallelPlant):
        found = _parallel_blocks(plant, [group.loops for group in settings], errors)
    else:
        found = (_matrix_block(plant, errors),)
    if any(group.outputs is not None for group in settings):
        return tuple(_doubled(block, len(settings)) for block in found)
    return found


def _doubled(block: ExactBlock, count: int) -> ExactBlock:
    """Return the block of the loop whose outputs err, of `count` settings."""
    size = len(block.settings)
    rows, none = range(size), (fmpq(0),) * size
    one = ExactResponse.combined([(1, TransferFunction((1.0,), (1.0,)))])
    T, factors = block.combination, block.factors
    return ExactBlock(
        settings=block.settings + tuple(a + count for a in block.settings),
        demanded=(True,) * size + (False,) * size,
        weights=block.weights * 2,
        combination=(*((*T[r], *none) for r in rows), *((*none, *T[r]) for r in rows)),
        factors=(
            *((*none, *T[r]) for r in rows),
            *((*(-factor for factor in factors[r]), *none) for r in rows),
        ),
        responses=(
            *((one,) * (2 * size) for _ in rows),
            *((*block.responses[r], *block.responses[r]) for r in rows),
        ),
        multiplicity=block.multiplicity,
    )


def _parallel_blocks(
    plant: ParallelPlant, sizes: Sequence[int], errors: Sequence[fmpq]
) -> tuple[ExactBlock, ...]:
    groups = range(len(sizes))
    mean = ExactResponse.combined([(1, plant.process), (plant.n - 1, plant.interaction)])
    difference = ExactResponse.combined([(1, plant.process), (-1, plant.interaction)])
    left = [[fmpq(size, plant.n) for size in sizes]]
    left += [[fmpq((b == a) - (b == a + 1)) for b in groups] for a in groups[:-1]]
    # Outputs divided by the group's size: the outer products then need the weights m_a only.
    combination = tuple(
        tuple(entry / size * e for entry, size, e in zip(row, sizes, errors, strict=True))
        for row in left
    )
    modes = (mean, *[difference] * (len(sizes) - 1))
    means = ExactBlock(
        settings=tuple(groups),
        demanded=(True,) * len(sizes),
        weights=tuple(fmpq(size) for size in sizes),
        combination=combination,
        factors=combination,
        responses=tuple((mode,) * len(sizes) for mode in modes),
    )
    one = ((fmpq(1),),)
    return (
        means,
        *(
            ExactBlock(
                (a,), (True,), (fmpq(1),), one, one, ((difference,),), multiplicity=sizes[a] - 1
            )
            for a in groups
            if sizes[a] > 1
        ),
    )


def _matrix_block(plant: Plant, errors: Sequence[fmpq]) -> ExactBlock:
    size = range(plant.n)
    return ExactBlock(
        settings=tuple(size),
        demanded=(True,) * plant.n,
        weights=(fmpq(1),) * plant.n,
        combination=tuple(tuple(fmpq(r == c) for c in size) for r in size),
        factors=tuple(tuple(errors[c] / errors[r] for c in size) for r in size),
        responses=tuple(tuple(_sum(_exact_terms(plant, r, c)) for c in size) for r in size),
    )


def _exact_terms(plant: Plant, row: int, column: int) -> Iterator[tuple[fmpq, TransferFunction]]:
    """Yield what an entry is the sum of: no product of its factors is rounded."""
    if not isinstance(plant, MixedPlant):
        yield fmpq(1), plant.element(row, column)
        return
    for output, each in plant.acting(row, column):
        factor = exact(plant.outputs[row][output]) * exact(plant.inputs[each][column])
        yield factor, plant.plant.element(output, each)


def _sum(terms: Iterable[tuple[fmpq, TransferFunction]]) -> ExactResponse:
    """Return a sum of elements, equal ones taken together first."""
    found: dict[TransferFunction, fmpq] = {}
    for factor, element in terms:
        found[element] = found.get(element, fmpq(0)) + factor
    return ExactResponse.combined([(factor, element) for element, factor in found.items()])


def _shared_block(plant: MixedPlant, errors: Sequence[fmpq]) -> ExactBlock:
    """Return the block of the loop wider by the inputs, which err, that its loops share."""
    loops, inputs = range(plant.n), range(plant.plant.n)
    size = plant.n + plant.plant.n
    none = ExactResponse.combined([(1, TransferFunction((1.0,), (1.0,)))])
    return ExactBlock(
        settings=tuple(range(size)),
        demanded=(True,) * plant.n + (False,) * plant.plant.n,
        weights=(fmpq(1),) * size,
        combination=tuple(tuple(fmpq(r == c) for c in range(size)) for r in range(size)),
        factors=(
            *((*(fmpq(0) for _ in loops), *(1 / errors[r] for _ in inputs)) for r in loops),
            *(
                (
                    *(-exact(m) * e for m, e in zip(row, errors, strict=True)),
                    *(fmpq(0) for _ in inputs),
                )
                for row in plant.inputs
            ),
        ),
        responses=(
            *(
                (
                    *(none for _ in loops),
                    *(
                        _sum((exact(f), plant.plant.element(k, c)) for k, f in enumerate(row))
                        for c in inputs
                    ),
                )
                for row in plant.outputs
            ),
            *((none,) * size for _ in inputs),
        ),
        exact=plant.n,
    )
