"""One convex step towards the least mu, in the Youla parameter and the D-scales together.

With v = d^-2 and R(v) = (I + G diag(v) G^H)^-1, mu <= gamma at a frequency is

    A(Q)^H diag(gamma^2 v, gamma^2 I)^-1 A(Q) <= R(v),      A = [w_I Q; w_P (I - G Q)].

The left side is convex in (Q, v) jointly, and R is an operator-convex function of v: its tangent
R0 - R0 G diag(v - v0) G^H R0 lies below it. Replacing R by its tangent at the present scales gives
a convex program whose solutions are all feasible for the true problem, so that mu falls with every
step (convex-concave procedure). D-K iteration is the same with v held in the program, and stalls
where no change of Q or of D alone gains.

Scalar blocks are second-order cones (cvxpy, parametrised once); a matrix block is one linear
matrix inequality a frequency. It goes to Clarabel directly: cvxpy's parametrised form of it holds
every product of a parameter with a coefficient, a hundred times the data of the program itself.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import clarabel
import cvxpy as cp
import numpy as np
from scipy import sparse

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["AffineBlock", "MatrixProgram", "Proposal", "ScalarProgram"]

LARGEST_RISE = 20.0  # of v in one step: a scale that does not matter would run away
TOLERANCE = 1e-7  # of the normalised program; a bound is recomputed from what it returns
SMALLEST_LEFT = 1e-3  # of v after one step


@dataclass(frozen=True)
class AffineBlock:
    """Q of one block, affine in the coefficients.

    Attributes
    ----------
    G : (k, m, m) complex
        The block's plant.
    offset : (k, m, m) complex
        Q for zero coefficients.
    slope : (k, j, m, m) complex
        By each function b_j: Q = offset + sum_j slope_j X_j with X_j (m, m).
    scales : tuple of int
        Scale of each channel.

    """

    G: NDArray[np.complex128]
    offset: NDArray[np.complex128]
    slope: NDArray[np.complex128]
    scales: tuple[int, ...]

    def parameter(self, X: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Q (k, m, m) for the coefficients X (j, m, m)."""
        return np.asarray(self.offset + np.einsum("kjab,jbc->kac", self.slope, X))


@dataclass(frozen=True)
class Proposal:
    """What a program proposes.

    Attributes
    ----------
    X : list of (j, m, m)
        Coefficients of each block.
    slack : float
        About the relative fall of mu^2 that it promises.

    """

    X: list[NDArray[np.float64]]
    slack: float


class ScalarProgram:
    """Blocks of one channel that share their only scale."""

    def __init__(self, blocks: list[AffineBlock]) -> None:
        self.blocks = blocks
        count, functions = blocks[0].slope.shape[:2]
        self.x = [cp.Variable(functions) for _ in blocks]
        slack = cp.Variable()
        change = cp.Variable(count)  # of v over v0, minus 1
        self.parts: list[dict[str, cp.Parameter]] = []
        constraints = [change <= LARGEST_RISE, change >= SMALLEST_LEFT - 1]
        for block, x in zip(blocks, self.x, strict=True):
            names = ("uncertain", "performing", "tangent")
            parts = {name: cp.Parameter(count, nonneg=True) for name in names}
            offset, slope = block.offset[:, 0, 0], block.slope[:, :, 0, 0]
            # Q in units of its own size: no coefficient is far from 1.
            unit = np.abs(offset)
            G = block.G[:, 0, 0]
            Q = (offset / unit, slope / unit[:, None])
            S = (1 - G * offset, -G[:, None] * slope)
            a, b = (
                [
                    cp.multiply(weight, part(value[0]) + part(value[1]) @ x)
                    for part in (np.real, np.imag)
                ]
                for weight, value in ((parts["uncertain"], Q), (parts["performing"], S))
            )
            share = cp.Variable(count)
            rest = 1 - cp.multiply(parts["tangent"], change) - slack - share
            constraints += [_product(a, share, 1 + change), _product(b, rest, np.ones(count))]
            self.parts.append(parts)
        self.slack = slack
        self.problem = cp.Problem(cp.Maximize(slack), constraints)

    def solve(
        self,
        v: NDArray[np.float64],
        level: float,
        w_I: NDArray[np.float64],
        w_P: NDArray[np.float64],
    ) -> Proposal | None:
        """Return a step from the scales v (k, 1) at mu = `level`; None where the solver gave none.

        Parameters
        ----------
        v : (k, 1)
            d^-2.
        level : float
            gamma.
        w_I, w_P : (k,)
            Magnitudes of the weights.

        """
        for block, parts in zip(self.blocks, self.parts, strict=True):
            gain = np.abs(block.G[:, 0, 0]) ** 2 * v[:, 0]
            root = np.sqrt(1 + gain) / level  # R(v)^(-1/2) over gamma
            unit = np.abs(block.offset[:, 0, 0])
            parts["uncertain"].value = w_I * unit * root / np.sqrt(v[:, 0])
            parts["performing"].value = w_P * root
            parts["tangent"].value = gain / (1 + gain)
        if not _survives(self._run):
            return None
        values = [x.value for x in self.x]
        if any(value is None or not np.isfinite(value).all() for value in values):
            return None
        return Proposal([value[:, None, None] for value in values], float(self.slack.value))

    def _run(self) -> None:
        with warnings.catch_warnings():
            # "may be inaccurate" is of no account: mu is recomputed from what is returned.
            warnings.simplefilter("ignore", UserWarning)
            self.problem.solve(
                solver=cp.CLARABEL, tol_gap_abs=TOLERANCE, tol_gap_rel=TOLERANCE,
                tol_feas=TOLERANCE,
            )  # fmt: skip


class MatrixProgram:
    """One block of m channels, each with a scale of its own or all with one."""

    def __init__(self, blocks: list[AffineBlock]) -> None:
        (self.block,) = blocks
        self.size = self.block.G.shape[1]
        self.n_scales = len(set(self.block.scales))
        edge = 6 * self.size  # the inequality has 3 m complex rows, 6 m real ones
        column, row = np.tril_indices(edge)  # the upper triangle column by column
        self.row, self.column = row, column
        self.root = np.where(row == column, 1.0, np.sqrt(2.0))

    def solve(
        self,
        v: NDArray[np.float64],
        level: float,
        w_I: NDArray[np.float64],
        w_P: NDArray[np.float64],
    ) -> Proposal | None:
        """As `ScalarProgram.solve`, v (k, scales)."""
        block, m = self.block, self.size
        count, functions = block.slope.shape[:2]
        own = v[:, list(block.scales)]
        # I + G V G^H = L L^H, so R^(-1/2) may be read as L.
        L = np.linalg.cholesky(
            np.eye(m) + (block.G * own[:, None, :]) @ block.G.conj().swapaxes(1, 2)
        )
        left = w_I[:, None, None] / (level * np.sqrt(own))[:, :, None]
        weight = (w_P / level)[:, None, None]
        first = np.concatenate(
            [left * block.offset @ L, weight * (np.eye(m) - block.G @ block.offset) @ L], axis=1
        )
        # Q = slope_j E_ab X_j[a, b]: column a of the slope times row b of L.
        each = np.concatenate(
            [left[:, None] * block.slope, -weight[:, None] * (block.G[:, None] @ block.slope)],
            axis=2,
        )
        slopes = np.einsum("kjra,kbc->kjabrc", each, L).reshape(count, -1, 2 * m, m)
        tangent = np.linalg.solve(L, block.G) * np.sqrt(own)[:, None, :]
        constant = self._packed(_arrow(first) + np.eye(3 * m))
        coefficients = self._packed(_arrow(slopes))
        change = np.zeros((count, self.n_scales, 3 * m, 3 * m), dtype=complex)
        for channel, scale in enumerate(block.scales):
            column = tangent[:, :, channel]
            change[:, scale, :m, :m] -= column[:, :, None] * column[:, None, :].conj()
            change[:, scale, m + channel, m + channel] += 1
        corner = np.zeros((3 * m, 3 * m), dtype=complex)
        corner[:m, :m] = np.eye(m)
        variables = functions * m * m
        program = _Conic(variables + count * self.n_scales + 1)
        program.add(coefficients, np.broadcast_to(np.arange(variables), (count, variables)))
        places = variables + np.arange(count * self.n_scales).reshape(count, self.n_scales)
        program.add(self._packed(change), places)
        program.add(
            np.broadcast_to(-self._packed(corner[None])[:, None], (count, 1, self.row.size)),
            np.full((count, 1), program.columns - 1),
        )
        x = program.solve(constant, 6 * m, places.ravel())
        if x is None:
            return None
        return Proposal([x[:variables].reshape(functions, m, m)], float(x[-1]))

    def _packed(self, H: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Hermitian matrices (..., q, q) as scaled triangles of real ones twice their size."""
        upper = np.concatenate([H.real, -H.imag], axis=-1)
        lower = np.concatenate([H.imag, H.real], axis=-1)
        real = np.concatenate([upper, lower], axis=-2)
        return np.asarray(real[..., self.row, self.column] * self.root)


class _Conic:
    """maximise the last variable with constant + sum_i x_i coefficient_i >= 0 at each frequency."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.entries: list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]] = []

    def add(self, coefficients: NDArray[np.float64], places: NDArray[np.intp]) -> None:
        """Add the coefficients (k, i, rows) of the variables numbered `places` (k, i)."""
        count, _, rows = coefficients.shape
        row = np.broadcast_to(np.arange(count * rows).reshape(count, 1, rows), coefficients.shape)
        column = np.broadcast_to(places[:, :, None], coefficients.shape)
        filled = coefficients != 0
        self.entries.append((-coefficients[filled], row[filled], column[filled]))

    def solve(
        self, constant: NDArray[np.float64], edge: int, changes: NDArray[np.intp]
    ) -> NDArray[np.float64] | None:
        count = len(constant)
        data, row, column = (
            np.concatenate([entry[part] for entry in self.entries]) for part in range(3)
        )
        A = sparse.csc_matrix((data, (row, column)), shape=(constant.size, self.columns))
        limit = sparse.csc_matrix(
            (np.ones(changes.size), (np.arange(changes.size), changes)),
            shape=(changes.size, self.columns),
        )
        cones = [clarabel.PSDTriangleConeT(edge)] * count
        cones.append(clarabel.NonnegativeConeT(changes.size))
        cost = np.zeros(self.columns)
        cost[-1] = -1
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        settings.direct_solve_method = "qdldl"  # as in `solver.mu.sdp`
        rows = sparse.vstack([A, limit], format="csc")
        right = np.concatenate([constant.ravel(), np.full(changes.size, LARGEST_RISE)])
        found: list[NDArray[np.float64]] = []

        def run() -> None:
            none = sparse.csc_matrix((self.columns, self.columns))
            solver = clarabel.DefaultSolver(none, cost, rows, right, cones, settings)
            found.append(np.asarray(solver.solve().x))

        if not _survives(run) or not np.isfinite(found[0]).all():
            return None
        return found[0]


def _arrow(A: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """[[0, A^H], [A, 0]] of each A (..., 2 m, m)."""
    rows, columns = A.shape[-2:]
    H = np.zeros((*A.shape[:-2], rows + columns, rows + columns), dtype=complex)
    H[..., columns:, :columns] = A
    H[..., :columns, columns:] = A.conj().swapaxes(-1, -2)
    return H


def _product(parts: list[cp.Expression], x: cp.Expression, y: cp.Expression) -> cp.Constraint:
    """Sum of squares of the parts <= x y, x + y >= 0, entry by entry, as second-order cones."""
    return cp.SOC(x + y, cp.vstack([2 * parts[0], 2 * parts[1], x - y]), axis=0)


def _survives(run: Callable[[], None]) -> bool:
    """Whether the solver came back with something."""
    try:
        run()
    except cp.SolverError:
        return False
    except BaseException as error:
        # Clarabel's panics pass through PyO3 as a BaseException of a class it does not export.
        if type(error).__name__ == "PanicException":
            return False
        raise
    return True
