"""The interior-point method of the limit, against cvxpy with Clarabel on the same inequalities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cvxpy as cp
import numpy as np
import pytest

from solver.limits import interior
from solver.limits.interior import Inequalities, Inequality, largest_slack

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Clarabel says so where the last digit of 1e-7 is out of reach; 1e-5 is asked of it here.
INACCURATE = pytest.mark.filterwarnings("ignore:Solution may be inaccurate:UserWarning")


def _drawn(rng: np.random.Generator, *shape: int) -> NDArray[np.complex128]:
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def _problem(rng: np.random.Generator, sizes: list[int], scales: int, *, faster: bool):
    """Five frequencies and two functions, which cannot make every A vanish."""
    count = 5
    blocks = []
    for m in sizes:
        member = np.zeros((scales, m))
        member[np.arange(m) % scales, np.arange(m)] = 1
        T = 0.3 * _drawn(rng, count, scales, m, m)
        blocks.append(
            Inequality(
                0.3 * _drawn(rng, count, 2 * m, m), 0.3 * _drawn(rng, count, 2 * m, m),
                np.eye(m) + 0.3 * _drawn(rng, count, m, m), T @ T.conj().swapaxes(2, 3), member,
            )
        )  # fmt: skip
    rise = rng.uniform(0, 1, count) if faster else np.zeros(count)
    return Inequalities(blocks, _drawn(rng, count, 2), 20.0, 0.1 if faster else 1.0, rise)


def _by_conic_solver(problem: Inequalities) -> float:
    """Return the greatest slack of the Schur complements' linear matrix inequalities."""
    count, functions = problem.functions.shape
    c = [cp.Variable(problem.blocks[0].T.shape[1]) for _ in range(count)]
    slack = cp.Variable()
    rules = [change <= problem.most for change in c]
    for own in problem.blocks:
        m = own.size
        X = [cp.Variable((m, m)) for _ in range(functions)]
        for k in range(count):
            Y = sum(problem.functions[k, j] * X[j] for j in range(functions))
            A = own.A[k] + own.U[k] @ Y @ own.L[k]
            corner = (1 - problem.fall * slack) * np.eye(m) - sum(
                c[k][i] * own.T[k, i] for i in range(len(own.scales))
            )
            below = [
                cp.diag(1 + own.scales.T @ c[k]),
                (1 - problem.rise[k] * slack) * np.eye(m),
            ]
            none = np.zeros((m, m))
            whole = cp.bmat([
                [corner, cp.conj(A[:m]).T, cp.conj(A[m:]).T],
                [A[:m], below[0], none],
                [A[m:], none, below[1]],
            ])  # fmt: skip
            rules.append(whole >> 0)
    whole_program = cp.Problem(cp.Maximize(slack), rules)
    digits = 1e-7  # as the method under test; Clarabel's own 1e-8 is out of reach for some of these
    return float(
        whole_program.solve(cp.CLARABEL, tol_gap_abs=digits, tol_gap_rel=digits, tol_feas=digits)
    )


@INACCURATE
@pytest.mark.parametrize(
    ("sizes", "scales", "faster"),
    [([1], 1, True), ([2], 2, False), ([2], 1, True), ([2, 1], 2, True)],
)
def test_the_greatest_slack_is_that_of_a_conic_solver(
    sizes: list[int], scales: int, faster: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks alone and side by side, scales of their own and shared, mu or tau_P to fall."""
    monkeypatch.setattr(interior, "SHARE", 0.0)
    monkeypatch.setattr(interior, "SMALLEST_GAP", 1e-7)
    rng = np.random.default_rng(10 * sum(sizes) + scales)
    problem = _problem(rng, sizes, scales, faster=faster)
    start = [rng.normal(size=(2, m, m)) for m in sizes]
    X, slack = largest_slack(problem, start)
    assert slack == pytest.approx(_by_conic_solver(problem), abs=1e-5)
    for own, coefficients in zip(problem.blocks, X, strict=True):
        assert coefficients.shape == (2, own.size, own.size)


@INACCURATE
def test_a_step_leaves_at_most_a_fifth_of_what_it_could_gain() -> None:
    """The path ends early, by the share that the module states, and never promises too much."""
    problem = _problem(np.random.default_rng(4), [2], 2, faster=False)
    _, slack = largest_slack(problem, [np.zeros((2, 2, 2))])
    exact = _by_conic_solver(problem)
    assert slack <= exact + 1e-6
    assert exact - slack <= max(1e-4, 0.25 * abs(slack))
