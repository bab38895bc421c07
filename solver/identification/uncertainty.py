"""The uncertainty of a fitted plant: every source as a curve, and the weight above all of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.cover import cover, cover_by_error
from solver.identification.elements import frequency_responses
from solver.identification.errors import ErrorCurve, matrix_errors, parallel_errors
from solver.identification.neglected import neglected
from solver.identification.problem import PlantStructure
from solver.model.weights import Structure, Uncertainty

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from solver.identification.row_fit import RowFit

__all__ = ["Cover", "Family", "cover_family", "matrix_responses", "row_responses"]

FREQUENCIES = 400
# Plants drawn: with 4 coefficients of a weight above all of 800, the next plant is below with 99.4
# per cent (Campi and Garatti, SIAM J. Optim. 19 (2008) 1211: expected violation d/(N + 1)).
DRAWS = 800
MEMBER_DRAWS = 100
# Where an error is above 2 no loop may have any gain, whatever the weight says there.
HOPELESS = 2.0
TOO_LARGE = 1.0  # relative error at steady state at which a gain may change its sign


@dataclass(frozen=True, eq=False)
class Family:
    """Fits that belong to one plant.

    Attributes
    ----------
    nominal : list of RowFit
        Row by row; one of a parallel plant.
    members : mapping of str to list of RowFit
        The same forms fitted to parts of the data: units, records.
    structure : PlantStructure
        Which elements the rows hold.
    n : int
        Number of inputs.

    """

    nominal: list[RowFit]
    members: Mapping[str, list[RowFit]]
    structure: PlantStructure
    n: int


@dataclass(frozen=True, eq=False)
class Cover:
    """The errors of a plant and the weight above them.

    Attributes
    ----------
    omega : (k,) ndarray
        Where the errors were computed.
    curves : tuple of ErrorCurve
        Every source.
    total : (k,) ndarray
        The largest error.
    weight : Uncertainty
        Above all of them: the recommended order.
    orders : tuple of Uncertainty
        The smallest weights of order 0, 1 and 2.
    own : Uncertainty or None
        Above what errs of the nominal plant itself, units and records of their own left out: the
        weight where those are scenarios; None where there are none.
    epsilon, theta : float or None
        The smallest weight of that form; None where errors reach 2, which it cannot.
    advice : tuple of str
        What the curves say.

    """

    omega: NDArray[np.float64]
    curves: tuple[ErrorCurve, ...]
    total: NDArray[np.float64]
    weight: Uncertainty
    orders: tuple[Uncertainty, ...]
    own: Uncertainty | None
    epsilon: float | None
    theta: float | None
    advice: tuple[str, ...]


def cover_family(family: Family, seed: int) -> Cover:
    """Return the curves of all errors and the weights above them."""
    omega = _grid(family.nominal)
    generator = np.random.default_rng(seed)
    nominal = row_responses(family.nominal, [fit.parameters[None] for fit in family.nominal], omega)
    curves = []
    draws = [fit.draws(DRAWS, generator) for fit in family.nominal]
    drawn = row_responses(family.nominal, draws, omega)
    curves.append(_curve("statistical error", family, nominal, drawn))
    for name, fits in family.members.items():
        own = [np.vstack([fit.parameters, fit.draws(MEMBER_DRAWS, generator)]) for fit in fits]
        curves.append(_curve(name, family, nominal, row_responses(fits, own, omega)))
    lacking = _lacking(family, nominal, omega)
    if lacking is not None:
        curves.append(lacking)
    return _covered(omega, tuple(curves), family)


def _covered(omega: NDArray[np.float64], curves: tuple[ErrorCurve, ...], family: Family) -> Cover:
    advice = []
    total = np.max([curve.size for curve in curves], axis=0)
    if not np.all(np.isfinite(total)):
        advice.append(
            "the nominal plant is singular at some frequencies: no weight covers it there"
        )
    form = Structure.FULL if family.n > 1 else Structure.DIAGONAL
    shape = _to_cover(total)
    orders = tuple(_weight(omega, shape, order, form) for order in (0, 1, 2))
    own = None
    if family.members:
        itself = [curve.size for curve in curves if curve.source not in family.members]
        own = _weight(omega, _to_cover(np.max(itself, axis=0)), 1, form)
    epsilon, theta = cover_by_error(omega, shape) or (None, None)
    if shape[0] >= TOO_LARGE:
        advice.append(
            f"the relative error at steady state is {shape[0]:.2g}: no integral action holds for "
            "all such plants. The error comes mostly from "
            f"{max(curves, key=lambda curve: float(curve.size[0])).source}; take the plants as "
            "scenarios instead, or make the test that is advised"
        )
    return Cover(omega, curves, total, orders[1], orders, own, epsilon, theta, tuple(advice))


def _to_cover(total: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the errors as a weight has to cover them: between the frequencies of the grid too."""
    finite = np.isfinite(total)
    shape = np.maximum(np.where(finite, total, np.max(total[finite], initial=0.0)), LEAST)
    # Between two frequencies the errors may be larger by what neighbours differ.
    between = np.maximum(shape, np.maximum(np.roll(shape, 1), np.roll(shape, -1)))
    between[[0, -1]] = shape[[0, -1]]
    return between


def _weight(
    omega: NDArray[np.float64], shape: NDArray[np.float64], order: int, form: Structure
) -> Uncertainty:
    weight = cover(omega, shape, order, tight_below=HOPELESS, hold_first=order > 0)
    return Uncertainty(weight, form)


LEAST = 1e-3  # a weight of zero is none: no valve repeats better than this


def _grid(fits: Sequence[RowFit]) -> NDArray[np.float64]:
    """Return frequencies from the slowest element's plateau to beyond the quickest's."""
    slow, quick = 0.0, math.inf
    for fit in fits:
        for element in fit.elements:
            times = [t for t in (element.lag, element.dead_time) if t > fit.limits.sample / 4]
            slow = max(slow, *times, fit.limits.sample)
            quick = min(quick, *times, fit.limits.longest)
    return np.asarray(np.geomspace(0.01 / slow, 100 / quick, FREQUENCIES))


def row_responses(
    fits: Sequence[RowFit], drawn: Sequence[NDArray[np.float64]], omega: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return the elements of each row, (draws, rows, inputs, k)."""
    rows = []
    for fit, parameters in zip(fits, drawn, strict=True):
        rows.append(
            np.stack(
                [
                    frequency_responses(kind, parameters[:, shapes], parameters[:, gains], omega)
                    for kind, (shapes, gains) in zip(fit.solved.kinds, fit.places(), strict=True)
                ],
                axis=1,
            )
        )
    return np.stack(rows, axis=1)


def _curve(
    source: str,
    family: Family,
    nominal: NDArray[np.complex128],
    other: NDArray[np.complex128],
) -> ErrorCurve:
    size, diagonal = _errors(family, nominal, other)
    return ErrorCurve(source, np.max(size, axis=0), np.max(diagonal, axis=0))


def _errors(
    family: Family, nominal: NDArray[np.complex128], other: NDArray[np.complex128]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if family.structure is PlantStructure.PARALLEL:
        g, G = other[:, 0], nominal[:, 0]
        if family.n == 1:
            g, G = np.repeat(g, 2, axis=1), np.repeat(G, 2, axis=1)
        return parallel_errors(family.n, G, g)
    G, others = (matrix_responses(p, family.structure, family.n) for p in (nominal, other))
    return matrix_errors(G[0], others)


def matrix_responses(
    parts: NDArray[np.complex128], structure: PlantStructure, n: int
) -> NDArray[np.complex128]:
    """Return the matrices, (draws, k, n, n), of which `row_responses` gives the elements."""
    if structure is PlantStructure.MATRIX:
        return np.moveaxis(parts, -1, 1)
    own, other = (np.moveaxis(parts[:, :, place], -1, 1)[..., None] for place in (0, -1))
    return np.where(np.eye(n, dtype=bool), own, other)


def _lacking(
    family: Family, nominal: NDArray[np.complex128], omega: NDArray[np.float64]
) -> ErrorCurve | None:
    parts = [neglected(fit, omega) for fit in family.nominal]
    if all(part is None for part in parts):
        return None
    missing = np.stack([np.zeros_like(nominal[0, 0]) if part is None else part for part in parts])
    size, diagonal = _errors(family, nominal, nominal + missing[None])
    # Beyond a quarter of the sampling frequency the residual says nothing of any input.
    told = omega < math.pi / (2 * max(fit.limits.sample for fit in family.nominal))
    return ErrorCurve(
        "neglected dynamics", np.where(told, size[0], 0.0), np.where(told, diagonal[0], 0.0)
    )
