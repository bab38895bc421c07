r"""Identical loops on a parallel plant: the best scale in closed form.

Such a loop falls into one or two blocks of one row that share their only scale
(`solver.model.blocks`). With the squared scale x, alpha = |S g|^2 and beta = |S|^2 of a block, and
the same p = |w_I c|^2 and b for both, a block demands

    Q W <= 1,   W = beta + alpha/x,   Q = p x + b level  or  (p x + b) level.

The level that a block permits has a single optimum in x. Q is common to the blocks, so their
demands cross where W_1 = W_2, which is linear in x. The best scale is one of these three points.
"""

import math

from solver.mu.workspace import inner, square

__all__ = ["solve"]

FARTHEST = 1e150  # scales stay within this and its inverse


@inner
def solve(cols, rest, p, b, all_free, nu, A, mixed):
    """Level and scale of one frequency, and how they answer to changes of the loop.

    Parameters
    ----------
    cols, rest : (blocks, 1) complex
        S g and S of each block.
    p, b : float
        |w_I c|^2, and the weight of the performance rows; S = 0 where that is 0.
    all_free : bool
        Whether the level scales all of N or its performance rows only.
    nu : float
        Barrier parameter: where the blocks meet, the scale is that of the barrier, so that the
        distances of the blocks from the level tell their shares of the dual. 0: the best scale.
    A, mixed : (blocks,)
        Filled in, in the scaling of `solver.mu.kernel.sensitivities`.

    Returns
    -------
    t : float
        Log of the level, as of `solver.mu.kernel.solve`.
    x : float
        Squared scale.
    total : float
        dh/dt.

    """
    last = A.size - 1
    alpha_1, beta_1 = square(cols[0, 0]), square(rest[0, 0])
    alpha_2, beta_2 = square(cols[last, 0]), square(rest[last, 0])
    if not all_free and not p * max(alpha_1, alpha_2) < 1.0:
        return -math.inf, 1.0, 1.0
    x_1 = _own_optimum(alpha_1, beta_1, p, b, all_free)
    x_2 = _own_optimum(alpha_2, beta_2, p, b, all_free)
    x, level = x_1, _level(x_1, alpha_1, beta_1, alpha_2, beta_2, p, b, all_free)
    share = 1.0 if alpha_1 + beta_1 * x_1 >= alpha_2 + beta_2 * x_1 else 0.0
    other = _level(x_2, alpha_1, beta_1, alpha_2, beta_2, p, b, all_free)
    if other > level:
        x, level = x_2, other
        share = 1.0 if alpha_1 + beta_1 * x_2 > alpha_2 + beta_2 * x_2 else 0.0
    between = (alpha_1 - alpha_2) / (beta_2 - beta_1)
    if min(x_1, x_2) < between < max(x_1, x_2):
        other = _level(between, alpha_1, beta_1, alpha_2, beta_2, p, b, all_free)
        if other > level:
            x, level = between, other
            # Of log Q W in log x, the blocks' slopes cancel.
            Q = p * x + (b if all_free else b * level)
            rise = p * x / Q
            fall_1 = alpha_1 / (alpha_1 + beta_1 * x)
            fall_2 = alpha_2 / (alpha_2 + beta_2 * x)
            share = min(max((rise - fall_2) / (fall_1 - fall_2), 0.0), 1.0)
            if nu > 0.0:
                apart = nu * (1.0 / (1.0 - share) - 1.0 / share) / (fall_2 - fall_1)
                if not all_free:
                    apart *= b * level / Q
                x = min(max(x * math.exp(apart), min(x_1, x_2)), max(x_1, x_2))
                level = _level(x, alpha_1, beta_1, alpha_2, beta_2, p, b, all_free)
    if not level > 0.0:
        return -math.inf, 1.0, 1.0
    Q = (p * x + b) * level if all_free else p * x + b * level
    A[0] = share / Q
    mixed[0] = share * cols[0, 0]
    if last:
        A[1] = (1.0 - share) / Q
        mixed[1] = (1.0 - share) * cols[1, 0]
    return math.log(level), x, 1.0 if all_free else b * level / Q


@inner
def _own_optimum(alpha, beta, p, b, all_free):
    """Scale at which one block permits most."""
    x = math.sqrt(b * alpha / (p * beta)) if all_free else (math.sqrt(alpha / p) - alpha) / beta
    return 1.0 if math.isnan(x) else min(max(x, 1.0 / FARTHEST), FARTHEST)  # 0/0: any will do


@inner
def _level(x, alpha_1, beta_1, alpha_2, beta_2, p, b, all_free):
    """Level that both blocks permit at the scale x."""
    W = max(beta_1 + alpha_1 / x, beta_2 + alpha_2 / x)
    return 1.0 / ((p * x + b) * W) if all_free else (1.0 / W - p * x) / b
