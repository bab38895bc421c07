"""Upper bound of mu by semidefinite programming: the reference that the fast path is held to.

The smallest gamma with N^H X N <= gamma^2 X, X = diag(D^2, I), is a generalised eigenvalue
problem. It is solved as a sequence of plain programs: at the bound gamma of the present scales,

    maximise s   subject to   gamma^2 X - N^H X N >= s I,

take the X found as the new scales, absorb them in N (so that X = I again, which is what keeps the
programs well conditioned), and repeat until gamma no longer falls. This is Dinkelbach's method;
it converges faster than linearly.
"""

from __future__ import annotations

import warnings
from functools import lru_cache
from typing import TYPE_CHECKING

import cvxpy as cp
import numpy as np

from solver.mu.structure import BlockStructure, Bound, bound_of_scales

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["upper_bound"]

MAX_PROGRAMS = 25
TOLERANCE = 1e-11
SETTINGS = {
    "tol_gap_abs": TOLERANCE,
    "tol_gap_rel": TOLERANCE,
    "tol_feas": TOLERANCE,
    # What is solved when the tolerance cannot be met is still a better set of scales.
    "reduced_tol_gap_abs": 1e-4,
    "reduced_tol_gap_rel": 1e-4,
    "reduced_tol_feas": 1e-6,
    "equilibrate_enable": False,
    # Clarabel 0.11's default factorisation starts from nonsense on some balanced 20 x 20 cases.
    "direct_solve_method": "qdldl",
}
LARGEST_FACTOR = 1e2  # of x in one program; further changes come with the next one
STALLED = 1e-10  # relative fall of gamma below which another program gains nothing


def upper_bound(N: NDArray[np.complex128], structure: BlockStructure) -> Bound:
    """Upper bound of mu(N), min over D of sigma_max(D N D^-1).

    Parameters
    ----------
    N : (k, p, p) complex
        Frequency is axis 0.
    structure : BlockStructure
        The perturbation's blocks.

    Returns
    -------
    Bound
        mu (k,), recomputed from the scales returned with it, so a bound even where a program
        failed.

    Raises
    ------
    InvalidInputError
        N has another shape, or an entry that is not finite.

    """
    N = np.asarray(N, dtype=complex)
    structure.check(N)
    d = np.ones((N.shape[0], structure.n_scales))
    if structure.n_scales:
        for k, matrix in enumerate(N):
            d[k] = _scales(matrix, structure)
    return bound_of_scales(N, d, structure)


def _scales(N: NDArray[np.complex128], structure: BlockStructure) -> NDArray[np.float64]:
    """Return the optimal scales d of one matrix."""
    d = _balance(N, structure)
    best = bound_of_scales(N[None], d[None], structure).mu[0]
    program = _Program.of(structure)
    for _ in range(MAX_PROGRAMS):
        if best == 0:
            break
        D = structure.diagonal(d[None])[0]
        x = program.solve(D[:, None] * N / D / best)
        if x is None:
            break
        trial = d * np.sqrt(x)
        gamma = bound_of_scales(N[None], trial[None], structure).mu[0]
        if gamma < best:
            d, fall, best = trial, 1 - gamma / best, gamma
            if fall > STALLED:
                continue
        break
    return d


def _balance(N: NDArray[np.complex128], structure: BlockStructure) -> NDArray[np.float64]:
    """Osborne's balancing: scales that make the Frobenius norm of D N D^-1 small."""
    size = np.abs(N) ** 2
    owner = np.array([*structure.scales, *[-1] * structure.performance])
    d = np.ones(structure.n_scales)
    for _ in range(10):
        for scale in range(structure.n_scales):
            D = structure.diagonal(d[None])[0] ** 2
            mine = owner == scale
            rows = (size[mine][:, ~mine] / D[~mine]).sum()
            columns = (size[~mine][:, mine] * D[~mine, None]).sum()
            if rows > 0 and columns > 0:
                d[scale] = (columns / rows) ** 0.25
    return d


class _Program:
    """maximise s subject to sum_s x_s M_s + M_performance >= s I, built once a structure.

    Complex Hermitian matrices enter as real symmetric ones of twice the size.
    """

    def __init__(self, structure: BlockStructure) -> None:
        self.structure = structure
        size = 2 * structure.size
        self.x = cp.Variable(structure.n_scales, pos=True)
        level = cp.Variable()
        self.parts = [cp.Parameter((size, size), symmetric=True) for _ in range(len(self.x_all))]
        total = sum(x * M for x, M in zip(self.x_all, self.parts, strict=True))
        # Without a limit the scales of channels that do not matter may run away.
        constraints = [total - level * np.eye(size) >> 0, self.x <= LARGEST_FACTOR]
        if not structure.performance:
            # The constraint is homogeneous in x: any multiple is as good.
            constraints.append(cp.sum(self.x) == structure.n_scales)
        self.problem = cp.Problem(cp.Maximize(level), constraints)

    @staticmethod
    @lru_cache(maxsize=32)
    def of(structure: BlockStructure) -> _Program:
        return _Program(structure)

    @property
    def x_all(self) -> list[cp.Expression | float]:
        """The x of every part; the performance part's is 1."""
        return [*self.x, *([1.0] if self.structure.performance else [])]

    def solve(self, N: NDArray[np.complex128]) -> NDArray[np.float64] | None:
        """Return x for N, scaled so that the bound is 1; None where the solver gave none."""
        owner = np.array([*self.structure.scales, *[-1] * self.structure.performance])
        for index, part in enumerate(self.parts):
            mine = owner == (index if index < self.structure.n_scales else -1)
            M = np.diag(mine.astype(float)) - N[mine].conj().T @ N[mine]
            part.value = np.block([[M.real, -M.imag], [M.imag, M.real]])
        try:
            with warnings.catch_warnings():
                # "may be inaccurate" is of no account: the bound is recomputed from the scales.
                warnings.simplefilter("ignore", UserWarning)
                self.problem.solve(solver=cp.CLARABEL, **SETTINGS)
        except cp.SolverError:
            return None
        except BaseException as error:
            # Clarabel's panics pass through PyO3 as a BaseException of a class it does not export.
            if type(error).__name__ == "PanicException":
                return None
            raise
        x = self.x.value
        return None if x is None or not (np.isfinite(x).all() and (x > 0).all()) else x
