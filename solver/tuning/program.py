"""Compiled: the quadratic program of a step of the minimax search, and its curvature."""

import numpy as np

from solver.mu.workspace import compiled

__all__ = ["NEAR_ACTIVE", "mirrored_planes", "program", "room_planes", "updated"]

CURVATURE_OF_S = 1e-2  # makes the program strictly convex; of no effect as ds goes to 0
LEAST_CURVATURE = 1e-3  # keeps B regular; the radius, not this, limits the step
NEAR_ACTIVE = 4.0  # frequencies with more room than this cannot become active in one step
BESIDE_THE_BEND = 0.1  # frequencies with more room have no mirrored planes,
NEARLY_EQUAL = 1.0  # nor have settings that differ by more in a logarithm
FARTHEST_S = 3.0  # change of s in one step
MOST_MISSED = 1e3
NEVER = -1e30


@compiled
def room_planes(gradient, room, other, base, slope, A, limits, filled):
    """Write the planes of one evaluation behind the first `filled` rows of a program.

    Parameters
    ----------
    gradient : (k, m)
        Of that evaluation's levels.
    room, other : (k,)
        Level less demand of the present point, and of that evaluation: planes are written where
        neither has more than `NEAR_ACTIVE`.
    base : (k,)
        What the planes have at the present point.
    slope : (k,)
        Of the demand in s.
    A, limits : (rows, m + 2), (rows,)
        Rows of the program and their upper limits.
    filled : int
        How many are written already.

    Returns
    -------
    int
        How many are written now.

    """
    size = gradient.shape[1]
    for k in range(room.size):
        if room[k] < NEAR_ACTIVE and other[k] < NEAR_ACTIVE:
            for i in range(size):
                A[filled, i] = -gradient[k, i]
            A[filled, size] = slope[k]
            A[filled, size + 1] = -1.0
            limits[filled] = base[k]
            filled += 1
    return filled


@compiled
def mirrored_planes(gradient, room, slope, theta, per, pairs, A, limits, filled):
    """Write the planes that the present point has with two controllers in each other's place.

    Levels are what they were there, and their slopes have changed places too. Where the settings of
    the two are equal the levels bend, and these are the planes on the other side.

    Parameters
    ----------
    gradient, room, slope : (k, m), (k,), (k,)
        Of the present point, as for `room_planes`.
    theta, per : (m,), int
        The present point, and how many of its parameters a controller has.
    pairs : (p, 2)
        Controllers that may change places.
    A, limits, filled
        As for `room_planes`.

    Returns
    -------
    int
        How many rows are written now.

    """
    size = gradient.shape[1]
    for pair in range(pairs.shape[0]):
        i, j = pairs[pair, 0] * per, pairs[pair, 1] * per
        apart = 0.0
        for m in range(per):
            apart = max(apart, abs(theta[i + m] - theta[j + m]))
        if apart > NEARLY_EQUAL:
            continue
        for k in range(room.size):
            if room[k] > BESIDE_THE_BEND:
                continue
            limit = room[k]
            for m in range(per):
                limit += (gradient[k, j + m] - gradient[k, i + m]) * (theta[i + m] - theta[j + m])
            if limit < room[k]:  # no bend between them: the plane would cut off the present point
                continue
            for m in range(size):
                A[filled, m] = -gradient[k, m]
            for m in range(per):
                A[filled, i + m], A[filled, j + m] = -gradient[k, j + m], -gradient[k, i + m]
            A[filled, size] = slope[k]
            A[filled, size + 1] = -1.0
            limits[filled] = limit
            filled += 1
    return filled


@compiled
def program(B, penalty, theta, low, high, radius, limits):
    """Hessian and gradient in the step, ds and e, and bounds of these and of the rows behind them.

    Parameters
    ----------
    B : (m, m)
        Curvature.
    penalty : float
        Price of e.
    theta, low, high : (m,)
        The present point and its bounds.
    radius : float
        Longest step.
    limits : (rows,)
        Upper limits of the rows.

    Returns
    -------
    H, f, lower, upper : (m + 2, m + 2), (m + 2,), (m + 2 + rows,), (m + 2 + rows,)

    """
    size, rows = theta.size, limits.size
    H, f = np.zeros((size + 2, size + 2)), np.zeros(size + 2)
    lower, upper = np.full(size + 2 + rows, NEVER), np.empty(size + 2 + rows)
    for i in range(size):
        for j in range(size):
            H[i, j] = B[i, j]
        H[i, i] += LEAST_CURVATURE
        lower[i] = max(low[i] - theta[i], -radius)
        upper[i] = min(high[i] - theta[i], radius)
    H[size, size] = H[size + 1, size + 1] = CURVATURE_OF_S
    f[size], f[size + 1] = 1.0, penalty
    lower[size], upper[size] = -FARTHEST_S, FARTHEST_S
    lower[size + 1], upper[size + 1] = 0.0, MOST_MISSED
    upper[size + 2 :] = limits
    return H, f, lower, upper


@compiled
def updated(B, d, multipliers, before, after):
    """Powell's damped BFGS update (m, m) with the Lagrangian -sum multipliers * level.

    Parameters
    ----------
    B, d : (m, m), (m,)
        Curvature so far, and the step.
    multipliers : (k,)
        Of the frequencies.
    before, after : (k, m)
        Gradients of the levels.

    """
    size = d.size
    change, Bd = np.zeros(size), np.zeros(size)
    for k in range(multipliers.size):
        if multipliers[k] != 0.0:
            for i in range(size):
                change[i] -= multipliers[k] * (after[k, i] - before[k, i])
    curvature = inner = 0.0
    for i in range(size):
        for j in range(size):
            Bd[i] += B[i, j] * d[j]
        curvature += d[i] * Bd[i]
        inner += d[i] * change[i]
    found = B.copy()
    if not curvature > 0.0:
        return found
    weight = 1.0
    if inner < 0.2 * curvature:
        weight = 0.8 * curvature / (curvature - inner)
    change = weight * change + (1.0 - weight) * Bd
    inner = weight * inner + (1.0 - weight) * curvature
    for i in range(size):
        for j in range(size):
            found[i, j] += change[i] * change[j] / inner - Bd[i] * Bd[j] / curvature
    return found
