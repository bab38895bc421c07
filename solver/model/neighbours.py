"""Units in a row or a ring, each disturbing those beside it: cross-directional control, zones.

Element (r, c) depends on the distance c - r alone: a banded Toeplitz matrix for a row of units, a
circulant one for a ring. Under loops whose settings repeat every p units around a ring of n = q p,
turning the ring by p units changes nothing, so the discrete Fourier transform over the q sections
splits the loop into modes k = 0 .. q - 1 with the p x p plants

    G_k = sum_m G(., . + m p) exp(2 pi i k m/q)

that share one D-scale for each place in a section (by convexity the best scales are equal in all
sections). Modes k and q - k are one real block [Re G_k, -Im G_k; Im G_k, Re G_k]; where the
imaginary part vanishes, as for equal neighbours on both sides and p = 1, it is G_k twice.

A row has two ends and no such symmetry. But where its neighbours are equal on both sides and differ
by real factors r_d alone (one dynamic response, a profile over the distance d), its matrix is
g I + i A with the symmetric A(r, c) = r_|r - c|. Under equal settings and errors, with one D-scale
for all units, it splits into the plants

    g + a_k i,    a_k the eigenvalues of A:  2 cos(pi k/(n + 1)) with one neighbour, k = 1 .. n.

One scale for all is an upper bound of mu, not the best: scales of their own gain the units at the
ends a little (2e-5 of mu at most for 12 and 20 units).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant, PlacedElement, Plant
from solver.model.transfer_function import TransferFunction
from solver.model.validation import flag, instance, instances, integer, settle

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Sequence

    from numpy.typing import NDArray

__all__ = [
    "MAX_LINE",
    "MAX_RING",
    "Mode",
    "NeighbourPlant",
    "modes",
    "period",
    "refuse_many",
    "sections",
]

MAX_RING, MAX_LINE = 100, 20  # of a row whose units share no scale
ZERO = TransferFunction((0.0,), (1.0,))
SAME = 4e-16  # relative: coefficients that differ by the rounding of a quotient
VANISHES = 1e-15  # a factor that is zero but for the rounding of pi


@dataclass(frozen=True)
class NeighbourPlant(Plant):
    """Equal units in a row or a ring.

    Parameters
    ----------
    n : int
        Number of units: 2..`MAX_RING`; in a row whose neighbours are not equal on both sides, or
        differ in more than a factor, 2..`MAX_LINE`, since its ends leave no symmetry.
    process : TransferFunction
        From a unit's input to its own output.
    ahead : tuple of TransferFunction
        From the inputs of the units 1, 2, .. places further on to a unit's output.
    behind : tuple of TransferFunction or None
        The same of the units before it; None: as `ahead`.
    ring : bool
        Whether the last unit stands beside the first.

    """

    n: int
    process: TransferFunction
    ahead: tuple[TransferFunction, ...]
    behind: tuple[TransferFunction, ...] | None = None
    ring: bool = True

    def __post_init__(self) -> None:
        settle(self, n=integer(self.n, "/n"), ring=flag(self.ring, "/ring"))
        instance(self.process, TransferFunction, "/process")
        settle(self, ahead=instances(self.ahead, TransferFunction, "/ahead"))
        if self.behind is not None:
            settle(self, behind=instances(self.behind, TransferFunction, "/behind"))
        if not 2 <= self.n <= MAX_RING:
            message = f"the number of units in a {self._kind} must lie in 2..{MAX_RING}"
            raise InvalidInputError(message, "/n")
        if self.n > MAX_LINE and not self.ring and self.profile is None:
            message = (
                f"a row of more than {MAX_LINE} units must have the same neighbours on both sides, "
                "which differ from each other by a factor alone (one response in time)"
            )
            raise InvalidInputError(message, "/ahead" if self.behind is None else "/behind")
        if self.process.is_zero:
            message = "the process is zero: its input has no effect on its output"
            raise InvalidInputError(message, "/process/num")
        reach = len(self.ahead) + len(self._behind)
        if reach > self.n - 1 if self.ring else max(len(self.ahead), len(self._behind)) >= self.n:
            message = f"{reach} neighbours in a {self._kind} of {self.n} units: some are one unit"
            raise InvalidInputError(message, "/ahead")

    @property
    def _kind(self) -> str:
        return "ring" if self.ring else "row"

    @property
    def _behind(self) -> tuple[TransferFunction, ...]:
        return self.ahead if self.behind is None else self.behind

    @property
    def profile(self) -> tuple[float, ...] | None:
        """Factors of the neighbours 1, 2, .. places off on the first, of a row that they split.

        None where neighbours differ on the two sides, or in more than a factor.
        """
        if self.ring or not self.ahead or self._behind != self.ahead:
            return None
        found = [_factor(element, self.ahead[0]) for element in self.ahead]
        known = tuple(factor for factor in found if factor is not None)
        return known if len(known) == len(found) else None

    @property
    def interchangeable(self) -> bool:
        """Whether any two units may change places: no, a unit has its neighbours."""
        return False

    @property
    def places(self) -> tuple[PlacedElement, ...]:
        """The process and what the neighbours do."""
        found = [PlacedElement("process", "/process", self.process)]
        sides = [("ahead", self.ahead)] + ([("behind", self.behind)] if self.behind else [])
        found += [
            PlacedElement(f"{name} {index + 1}", f"/{name}/{index}", element)
            for name, side in sides
            for index, element in enumerate(side)
        ]
        return tuple(found)

    def element(self, row: int, column: int) -> TransferFunction:
        """Return the transfer function from input `column` to output `row`."""
        distance = column - row
        if self.ring:
            distance %= self.n
            if distance and distance > len(self.ahead):
                distance -= self.n
        if distance == 0:
            return self.process
        side = self.ahead if distance > 0 else self._behind
        return side[abs(distance) - 1] if abs(distance) <= len(side) else ZERO

    def part(self, units: Sequence[int]) -> Plant:
        """Return the plant between the inputs and outputs of `units`, at least one.

        Raises
        ------
        UnsupportedPlantError
            More of them than a matrix plant has, and not a part of a row.

        """
        if list(units) == list(range(self.n)):
            return self
        count = len(units)
        if count <= MAX_MATRIX_SIZE:
            return MatrixPlant([[self.element(row, column) for column in units] for row in units])
        if not self.ring and list(units) == list(range(units[0], units[0] + count)):
            return replace(self, n=count)  # neighbours of each other, as in the whole row
        message = (
            f"in a {self._kind} of more than {MAX_MATRIX_SIZE} units the sets of loops in service "
            f"have at most {MAX_MATRIX_SIZE} loops"
        )
        message += "" if self.ring else ", or those of neighbours"
        raise UnsupportedPlantError(message, "/in_service")

    def mapped(self, change: Callable[[TransferFunction], TransferFunction]) -> NeighbourPlant:
        """Return the plant with every element changed."""
        behind = None if self.behind is None else tuple(map(change, self.behind))
        return NeighbourPlant(
            self.n, change(self.process), tuple(map(change, self.ahead)), behind, ring=self.ring
        )


def refuse_many(plant: Plant, what: str) -> None:
    """Refuse rings and rows of more units than a matrix plant has, which would take hours.

    Raises
    ------
    UnsupportedPlantError
        So it is.

    """
    if isinstance(plant, NeighbourPlant) and plant.n > MAX_MATRIX_SIZE:
        message = (
            f"{what} is for up to {MAX_MATRIX_SIZE} units of a ring or a row: take a shorter one, "
            "with the same neighbours"
        )
        raise UnsupportedPlantError(message, "/plant/n")


@dataclass(frozen=True, eq=False)
class Mode:
    """One block of a ring or row: G = sum over sections m of weights[m] times their elements.

    Attributes
    ----------
    cosines, sines : (q,)
        Real and imaginary parts of the weights; without an imaginary part the block is p x p,
        else 2 p x 2 p.
    multiplicity : int
        How often the block occurs.

    """

    cosines: NDArray[np.float64]
    sines: NDArray[np.float64] | None
    multiplicity: int


def modes(plant: NeighbourPlant, places: int) -> tuple[Mode, ...]:
    """Return the blocks of a ring whose settings repeat every `places` units, or of a row."""
    if not plant.ring:
        return tuple(Mode(np.array([1.0, a]), None, 1) for a in _eigenvalues(plant).tolist())
    count = plant.n // places
    mirrored = places == 1 and plant.behind is None
    found = []
    for k in range(count // 2 + 1):
        angle = 2 * math.pi * k * np.arange(count) / count
        cosines, sines = np.cos(angle), np.sin(angle)
        cosines[np.abs(cosines) < VANISHES] = 0.0
        if k == 0 or 2 * k == count:
            found.append(Mode(np.asarray(np.round(cosines), dtype=float), None, 1))
        elif mirrored:
            found.append(Mode(cosines, None, 2))
        else:
            found.append(Mode(cosines, sines, 1))
    return tuple(found)


def _eigenvalues(plant: NeighbourPlant) -> NDArray[np.float64]:
    """Return those of A, (n,), of a row g I + i A."""
    n, profile = plant.n, plant.profile
    assert profile is not None  # noqa: S101 - for the type checker: who calls knows
    if len(profile) == 1:
        return np.asarray(2 * np.cos(math.pi * np.arange(1, n + 1) / (n + 1)))
    factors = np.array([0.0, *profile, *[0.0] * (n - 1 - len(profile))])
    distances = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    return np.asarray(np.linalg.eigvalsh(factors[distances]))


def _factor(element: TransferFunction, first: TransferFunction) -> float | None:
    """Return by which real factor an element is another one; None: by none."""
    if element.is_zero:
        return 0.0
    if first.is_zero or element.dead_time != first.dead_time:
        return None
    own, its = (np.trim_zeros(np.asarray(each.num), "f") for each in (element, first))
    if own.size != its.size or len(element.den) != len(first.den):
        return None
    factor = float(own[0] / its[0]) * first.den[0] / element.den[0]
    alike = np.allclose(own / own[0], its / its[0], rtol=SAME, atol=0) and np.allclose(
        np.array(element.den) / element.den[0],
        np.array(first.den) / first.den[0],
        rtol=SAME,
        atol=0,
    )
    return factor if alike else None


def period(plant: Plant, marks: Sequence[Hashable]) -> int | None:
    """Return after how many units a ring repeats itself, less than all; None: it does not.

    Of a row with more units than a matrix 1, where a profile splits it.

    Parameters
    ----------
    plant : Plant
        Any; None for all but rings and rows.
    marks : sequence
        What tells the loops and errors of a unit from those of others, (n,).

    """
    if not isinstance(plant, NeighbourPlant):
        return None
    n = plant.n
    if not plant.ring:
        split = plant.profile is not None and n > MAX_MATRIX_SIZE and len(set(marks)) == 1
        return 1 if split else None
    for places in range(1, n):
        if n % places == 0 and all(marks[i] == marks[i % places] for i in range(n)):
            return places
    return None


def sections(plant: NeighbourPlant, places: int) -> list[list[list[TransferFunction]]]:
    """Return the elements (q, p, p) from the first section's outputs to every section's inputs.

    Of a row those that its modes are sums of.
    """
    if not plant.ring:
        return [[[plant.process]], [[plant.ahead[0]]]]
    return [
        [[plant.element(a, b + m * places) for b in range(places)] for a in range(places)]
        for m in range(plant.n // places)
    ]
