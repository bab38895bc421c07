"""The matrix F of a level of mu, enclosed over boxes of frequencies and of a plant's parameters.

With E = I + G C, X = diag(d_i^2) and the diagonal M = |w_I|^2 C^H X C + |w_P|^2 I,

    F = gamma^2 E M^-1 E^H - G X^-1 G^H - I

is positive definite iff sigma_max(D N_RP D^-1) < gamma (`solver.certificate.enclosed_loop`). It has
no inverse of G, so the parameters of the plant enter by a few sums and products: as Taylor models
(`solver.robustness.box_models`) in them and in the frequency. Columns of E are multiplied by s
against the poles of the controllers and of w_P there, rows against those of the plant; on boxes
that reach infinity the variable is 1/s, and dead time there has any phase.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.model.mixed_plant import MixedPlant
from solver.model.plants import ParallelPlant
from solver.mu.kernel import FINE
from solver.mu.scaling import sweep
from solver.robustness.box_models import BoxModel, constant, phasor, variable

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks, WeightedElement
    from solver.model.controllers import Controller
    from solver.model.deviations import Parameter
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Performance, Uncertainty

__all__ = ["BoxLoop", "Boxes"]

INTERACTION = "interaction"
Matrix = list[list[BoxModel]]


class Boxes(NamedTuple):
    """k boxes: from the frequency low to high, and shares -1..1 of each parameter's deviation.

    Attributes
    ----------
    low, high : (k, 1 + parameters)
        Ends. Frequencies in rad per time unit; where the upper one is infinite, for all boxes.

    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @property
    def number(self) -> int:
        """Their number."""
        return len(self.low)

    @property
    def tails(self) -> NDArray[np.bool_]:
        """Which reach the frequency infinity, (k,)."""
        return np.isinf(self.high[:, 0])

    def part(self, which: NDArray[np.bool_] | slice) -> Boxes:
        """Return some of them."""
        return Boxes(self.low[which], self.high[which])

    def spans(self) -> NDArray[np.float64]:
        """Return log(ratio) of the frequencies, (k,); infinite where they reach 0 or infinity."""
        found = np.full(self.number, np.inf)
        inner = ~self.tails & (self.low[:, 0] > 0)
        found[inner] = np.log(self.high[inner, 0] / self.low[inner, 0])
        return found

    def middles(self) -> Boxes:
        """Return the point in the middle of each, as boxes of no width."""
        with np.errstate(invalid="ignore"):
            point = 0.5 * (self.low + self.high)
        point[:, 0] = np.where(self.tails, 2 * self.low[:, 0], point[:, 0])
        return Boxes(point, point.copy())


@dataclass(frozen=True)
class _Frame:
    """s or 1/s over boxes, and the factor of each parameter; sigma is s in units of `rate`."""

    tail: bool
    s: BoxModel
    rate: NDArray[np.float64]
    factors: tuple[BoxModel, ...]

    @property
    def one(self) -> BoxModel:
        return constant(np.ones(self.rate.size, dtype=complex), self.variables)

    @property
    def variables(self) -> int:
        return 0 if len(self.s.P) == 1 else 1 + len(self.factors)

    def sigma(self, power: int) -> BoxModel:
        """Return sigma^power; 1 where the variable is 1/s."""
        found = self.one
        if not self.tail:
            unit = self.s.times(np.asarray(1 / self.rate, dtype=complex))
            for _ in range(power):
                found = found * unit
        return found


@dataclass(frozen=True)
class BoxLoop:
    """A loop whose plant is any of a box.

    Parameters
    ----------
    blocks : LoopBlocks
        Of the plant in the middle, without errors of the outputs.
    controllers : tuple of Controller
        One a group.
    uncertainty, performance : Uncertainty, Performance
        The weights; `performance.tau_p` is needed.
    parameters : tuple of Parameter
        What spreads.
    known_delay : float
        Part of every dead time that does not spread.

    """

    blocks: LoopBlocks
    controllers: tuple[Controller, ...]
    uncertainty: Uncertainty
    performance: Performance
    parameters: tuple[Parameter, ...]
    known_delay: float = 0.0

    def scales(self, boxes: Boxes) -> NDArray[np.float64]:
        """Optimal squared D-scales (k, scales) in the middle of each box."""
        frame = self._frame(boxes, widths=False)
        omega = frame.rate
        G = self._centres(frame)
        c = np.stack([controller.response(omega) for controller in self.controllers], axis=-1)
        u = self.blocks.squared(self.uncertainty, omega)
        b = np.ascontiguousarray(np.abs(self.performance.weight.response(omega)) ** 2)
        y = np.zeros((omega.size, self.blocks.n_scales))
        all_free = cold = True  # named here: positional booleans say nothing
        sweep(G, c, u, b, self.blocks.layout, all_free, FINE, cold, y)
        return np.asarray(np.exp(y))

    def forms(
        self, boxes: Boxes, X: NDArray[np.float64], level: float
    ) -> list[tuple[NDArray[np.complex128], NDArray[np.float64]]]:
        """Return F of each block by its coefficients, F in the middle of each box being I.

        Returns
        -------
        list of ((coefficients, k, m, m) complex, (k, m, m))
            The radius is not finite where nothing is known, as where F in the middle is not
            positive definite: the coefficients are then of no use.

        """
        frame = self._frame(boxes, widths=True)
        parts = _Parts(self, frame)
        found = []
        for index, block in enumerate(self.blocks.blocks):
            first = int(self.blocks.layout.first[index])
            G = self._plant(index, parts)
            rows = [self._integrators(index, row) for row in range(block.size)]
            powers = [self._raised(channel) for channel in block.channels]
            C = [parts.controller(*each) for each in zip(block.channels, powers, strict=True)]
            M = []
            for j, (channel, power) in enumerate(zip(block.channels, powers, strict=True)):
                error, wanted = parts.squares(channel, power, self._weights[first + j])
                M.append(error.times(X[:, block.scales[j]]) + wanted)
            sigma = [parts.sigma(power) for power in rows]
            E = [
                [
                    G[r][j] * C[j] + sigma[r] * parts.sigma(powers[j]) if r == j else G[r][j] * C[j]
                    for j in range(block.size)
                ]
                for r in range(block.size)
            ]
            found.append(_form((G, E), M, sigma, X[:, list(block.scales)], level))
        return found

    def _frame(self, boxes: Boxes, *, widths: bool) -> _Frame:
        """Return the variables over boxes, all of which reach infinity or none of which does."""
        tail = bool(boxes.tails.any())
        count = 1 + len(self.parameters) if widths else 0
        low, high = boxes.low[:, 0], boxes.high[:, 0]
        if tail:
            low, high = np.zeros_like(low), 1 / low * (1 + 1e-15)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        s = self._variable(middle, half, 0, count).times(-1j if tail else 1j)
        factors = []
        for number, parameter in enumerate(self.parameters, start=1):
            a, b = boxes.low[:, number], boxes.high[:, number]
            share = 0.5 * (a + b), 0.5 * (b - a)
            factors.append(
                self._variable(
                    1 + parameter.width * share[0], parameter.width * share[1], number, count
                )
            )
        return _Frame(tail, s, 1 / middle if tail else middle, tuple(factors))

    @staticmethod
    def _variable(
        middle: NDArray[np.float64], half: NDArray[np.float64], number: int, count: int
    ) -> BoxModel:
        if not count:
            return constant(middle.astype(complex), 0)
        return variable(middle, half, number, count)

    def _centres(self, frame: _Frame) -> NDArray[np.complex128]:
        """Return the plants in the middle, as `LoopBlocks.packed`."""
        first = self.blocks.layout.first
        widest = max(block.size for block in self.blocks.blocks)
        G = np.zeros((frame.rate.size, int(first[-1]), widest), dtype=complex)
        finite = _Frame(
            tail=False,
            s=constant((1j * frame.rate).astype(complex), 0),
            rate=frame.rate,
            factors=frame.factors,
        )
        parts = _Parts(self, finite)
        for index, block in enumerate(self.blocks.blocks):
            rows = self._plant(index, parts, raised=False)
            for r in range(block.size):
                for c in range(block.size):
                    G[:, int(first[index]) + r, c] = rows[r][c].P[0]
        return G

    def _plant(self, index: int, parts: _Parts, *, raised: bool = True) -> Matrix:
        """Return the entries of a block, rows multiplied by powers of sigma if `raised`."""
        rows = self.blocks.terms(index)
        return [
            [
                self._entry(
                    index, (r, c), terms, parts, self._integrators(index, r) if raised else 0
                )
                for c, terms in enumerate(row)
            ]
            for r, row in enumerate(rows)
        ]

    def _entry(
        self,
        index: int,
        place: tuple[int, int],
        terms: Sequence[WeightedElement],
        parts: _Parts,
        power: int,
    ) -> BoxModel:
        frame = parts.frame
        total = constant(np.zeros(frame.rate.size, dtype=complex), frame.variables)
        for number, (factor, element) in enumerate(terms):
            if factor != 0 and not element.is_zero:
                acting = self._acting(index, place, number)
                total = total + parts.element(element, acting, power).times(factor)
        return total

    def _acting(self, index: int, place: tuple[int, int], term: int) -> dict[str, list[int]]:
        """Return which parameters act on a term of an entry, by their names."""
        row, column = place
        plant = self.blocks.plant
        if isinstance(plant, MixedPlant):  # what deviates is the plant that is combined
            row, column = plant.acting(row, column)[term]
        if self.blocks.modes:  # the first section's own element is the first term
            other = row != column or term > 0
        elif isinstance(plant, ParallelPlant):
            other = term == 1 or (index == 0 and row != column)
        else:
            other = row != column
        found: dict[str, list[int]] = {}
        for number, (name, _, unit) in enumerate(self.parameters):
            if (unit is None or unit == column) and (other or name != INTERACTION):
                found.setdefault("gain" if name == INTERACTION else name, []).append(number)
        return found

    def element(
        self,
        element: TransferFunction,
        acting: dict[str, list[int]],
        frame: _Frame,
        power: int,
    ) -> BoxModel:
        """Return an element of the plant, the parameters `acting` on it by their names."""
        slower = _product(frame, acting.get("time_constant", []))
        found = _rational(element.num, element.den, frame, power, slower)
        for number in acting.get("gain", []):
            found = found * frame.factors[number]
        theta = element.dead_time
        if theta > 0:
            if frame.tail:
                turn = BoxModel(np.zeros_like(found.P), np.ones(frame.rate.size))
            else:
                late = frame.one.times(theta)
                if theta > self.known_delay:
                    for number in acting.get("dead_time", []):
                        known = frame.one.times(self.known_delay)
                        late = known + frame.factors[number].times(theta - self.known_delay)
                turn = phasor(late * frame.s.times(-1j))
            found = found * turn
        return found

    def _integrators(self, index: int, row: int) -> int:
        """Powers of sigma of a row: as many as its elements have poles at s = 0."""
        return max(
            (
                max(element.integrators, 0)
                for terms in self.blocks.terms(index)[row]
                for factor, element in terms
                if factor != 0 and not element.is_zero
            ),
            default=0,
        )

    @cached_property
    def wanted(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Numerator and denominator of w_P."""
        weight = self.performance.weight
        return weight.num, weight.den

    def _raised(self, channel: int) -> int:
        """Powers of sigma of a column: those of its controller or of w_P."""
        own = self.controllers[channel].integral_time is not None
        return max(int(own), int(self.wanted[1][-1] == 0))

    @cached_property
    def _weights(self) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
        """Numerator and denominator of w_I of each row; only its magnitude matters."""
        units = [part[0] for part in self.blocks.parts]
        if self.blocks.modes:  # each part has a scale of its own
            units = [units[scale] for scale in self.blocks.layout.scales.tolist()]
            found = [self.uncertainty.weight_of(unit) for unit in units]
            return [(weight.num, weight.den) for weight in found]
        units += [part[0] for part in self.blocks.parts if len(part) > 1]
        found = [self.uncertainty.weight_of(unit) for unit in units]
        return [(weight.num, weight.den) for weight in found]


def _form(
    plant_and_loop: tuple[Matrix, Matrix],
    M: list[BoxModel],
    sigma: list[BoxModel],
    X: NDArray[np.float64],
    level: float,
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return T F T^H of G, E = I + G C and M, with T such that it is I in the middle."""
    G, E = plant_and_loop
    size, boxes = len(M), X.shape[0]
    over = [each.reciprocal() for each in M]
    E0, G0 = (
        np.moveaxis(np.array([[each.P[0] for each in row] for row in rows]), -1, 0)
        for rows in (E, G)
    )
    over0 = np.stack([each.P[0].real for each in over], axis=-1)
    middle = level**2 * (E0 * over0[:, None, :]) @ E0.conj().swapaxes(1, 2)
    middle -= (G0 / X[:, None, :]) @ G0.conj().swapaxes(1, 2)
    diagonal = np.arange(size)
    middle[:, diagonal, diagonal] -= np.abs(np.stack([s.P[0] for s in sigma], axis=-1)) ** 2
    T, sound = _whitening(middle)
    own = [[sigma[r] if r == c else None for c in range(size)] for r in range(size)]
    wide = [[*E[r], *G[r], *own[r]] for r in range(size)]
    lines = _combined(T, wide)
    signs = [each.times(level**2) for each in over]
    signs += [constant((-1 / X[:, j]).astype(complex), M[0].variables) for j in range(size)]
    signs += [constant(np.full(boxes, -1.0 + 0j), M[0].variables)] * size
    P = np.zeros((len(M[0].P), boxes, size, size), dtype=complex)
    radius = np.zeros((boxes, size, size))
    for r in range(size):
        left = [each * sign for each, sign in zip(lines[r], signs, strict=True)]
        for c in range(r + 1):
            total = left[0] * lines[c][0].conj()
            for j in range(1, len(signs)):
                total = total + left[j] * lines[c][j].conj()
            P[:, :, r, c], P[:, :, c, r] = total.P, total.P.conj()
            radius[:, r, c] = radius[:, c, r] = total.radius
    radius[~sound] = np.inf
    return P, radius


class _Parts:
    """What several entries and blocks of a loop are made of, each enclosed once."""

    def __init__(self, loop: BoxLoop, frame: _Frame) -> None:
        self.loop, self.frame = loop, frame
        self._kept: dict[tuple[object, ...], BoxModel] = {}

    def _once(self, key: tuple[object, ...], made: Callable[[], BoxModel]) -> BoxModel:
        if key not in self._kept:
            self._kept[key] = made()
        return self._kept[key]

    def sigma(self, power: int) -> BoxModel:
        """Return sigma^power."""
        return self._once(("sigma", power), lambda: self.frame.sigma(power))

    def element(
        self, element: TransferFunction, acting: dict[str, list[int]], power: int
    ) -> BoxModel:
        """Return an element of the plant with what acts on it, times sigma^power."""
        key = ("element", element, tuple((k, tuple(v)) for k, v in acting.items()), power)
        return self._once(key, lambda: self.loop.element(element, acting, self.frame, power))

    def controller(self, channel: int, power: int) -> BoxModel:
        """Return a controller times sigma^power."""
        return self._once(
            ("controller", channel, power),
            lambda: _rational(*self.loop.controllers[channel].polynomials, self.frame, power),
        )

    def squares(
        self, channel: int, power: int, weight: tuple[tuple[float, ...], tuple[float, ...]]
    ) -> tuple[BoxModel, BoxModel]:
        """Return |w_I c|^2 and |w_P|^2, times |sigma^power|^2."""

        def squared(model: BoxModel) -> BoxModel:
            return model * model.conj()

        return (
            self._once(
                ("error", channel, power, weight),
                lambda: squared(
                    _rational(*weight, self.frame, 0) * self.controller(channel, power)
                ),
            ),
            self._once(
                ("wanted", power),
                lambda: squared(_rational(*self.loop.wanted, self.frame, power)),
            ),
        )


def _product(frame: _Frame, numbers: Sequence[int]) -> BoxModel | None:
    found: BoxModel | None = None
    for number in numbers:
        found = frame.factors[number] if found is None else found * frame.factors[number]
    return found


def _rational(
    num: Sequence[float],
    den: Sequence[float],
    frame: _Frame,
    power: int,
    slower: BoxModel | None = None,
) -> BoxModel:
    """Return sigma^power times num/den, descending in s, with s times `slower` for s."""
    upper, lower = list(num), list(den)
    while upper[-1] == 0 and lower[-1] == 0:
        upper, lower = upper[:-1], lower[:-1]
    poles = 0
    while not frame.tail and lower[-1] == 0:
        lower, poles = lower[:-1], poles + 1
    degree = max(len(upper), len(lower)) - 1
    up, down = (_homogeneous(each, degree, frame, slower) for each in (upper, lower))
    found = up * down.reciprocal()
    if frame.tail:
        return found
    found = found.times((frame.rate ** -float(poles)).astype(complex))
    for _ in range(poles):
        if slower is not None:
            found = found * slower.reciprocal()
    if power >= poles:
        return found * frame.sigma(power - poles)
    over = frame.sigma(poles - power).reciprocal()
    return found * over


def _homogeneous(
    coefficients: Sequence[float], degree: int, frame: _Frame, slower: BoxModel | None
) -> BoxModel:
    """Return sum_k a_k (slower s)^k, on boxes that reach infinity divided by s^degree."""
    padded = [0.0] * (degree + 1 - len(coefficients)) + list(coefficients)
    if frame.tail:
        # Ascending in 1/s: a_degree slower^degree + ... + a_0 s^-degree.
        x, y = frame.s, slower
    else:
        x, y = None, frame.s if slower is None else frame.s * slower
    found = frame.one.times(padded[0])
    low: BoxModel | None = None
    for value in padded[1:]:
        if x is not None:
            low = x if low is None else low * x
        found = found if y is None else found * y
        term = frame.one if low is None else low
        found = found + term.times(value)
    return BoxModel(found.P, found.radius * (1 + 1e-15))


def _whitening(middle: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return T with T F T^H = I, (k, m, m), and where there is one."""
    size = middle.shape[1]
    usable = np.asarray(np.isfinite(middle).all(axis=(1, 2)))
    safe = np.where(usable[:, None, None], middle, np.eye(size))
    diagonal = np.abs(np.einsum("kii->ki", safe))
    root = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(safe / (root[:, :, None] * root[:, None, :]))
    sound = usable & (values[:, 0] > 0)
    values = np.where(sound[:, None], values, 1.0)
    T = vectors.conj().swapaxes(1, 2) / np.sqrt(values)[:, :, None] / root[:, None, :]
    return np.asarray(T, dtype=complex), sound


def _combined(T: NDArray[np.complex128], rows: Sequence[Sequence[BoxModel | None]]) -> Matrix:
    """Return T times a matrix; None stands for zero."""
    found = []
    for r in range(len(rows)):
        line = []
        for c in range(len(rows[0])):
            total: BoxModel | None = None
            for k, row in enumerate(rows):
                entry = row[c]
                if entry is None:
                    continue
                term = entry.times(T[:, r, k])
                total = term if total is None else total + term
            assert total is not None  # noqa: S101 - each column holds something
            line.append(total)
        found.append(line)
    return found
