r"""Compiled: weights that show that linear conditions have no common point in a box.

Conditions b_k + a_k e >= 0 on e in [-1, 1]^m have no common point if weights w >= 0 exist with

    sum_k w_k b_k + |sum_k w_k a_k|_1 < 0

(Farkas 1902). The weights of least value, of sum 1, are found by the simplex method.
"""

import math

import numpy as np

from solver.mu.workspace import compiled

__all__ = ["least_weights"]

MAX_PIVOTS = 80
IMPROVES = 1e-9  # reduced cost, relative to conditions near 1, that is worth a pivot


@compiled
def least_weights(a, b):
    """Weights w (k,) of least value, and the point e (m,) where the worst condition is best.

    Columns of the linear program: the conditions (a_k, 1) at cost b_k, then +-unit vectors at cost
    1, which make the modulus; right side (0, ..., 0, 1).
    """
    count, m = a.shape
    w = np.zeros(count)
    e = np.zeros(m)
    first, best = 0, math.inf
    for k in range(count):
        value = b[k]
        for i in range(m):
            value += abs(a[k, i])
        if value < best:
            first, best = k, value
    # Basis: the condition that excludes most by itself, and the unit vectors of its signs.
    basis = np.empty(m + 1, np.int64)
    inverse = np.zeros((m + 1, m + 1))
    amount = np.empty(m + 1)
    for i in range(m):
        negative = a[first, i] >= 0.0
        basis[i] = count + 2 * i + (0 if negative else 1)
        sign = -1.0 if negative else 1.0
        inverse[i, i] = sign
        inverse[i, m] = -sign * a[first, i]
        amount[i] = abs(a[first, i])
    basis[m] = first
    inverse[m, m] = 1.0
    amount[m] = 1.0
    price = np.empty(m + 1)
    column = np.empty(m + 1)
    for _ in range(MAX_PIVOTS):
        for i in range(m + 1):
            price[i] = 0.0
            for j in range(m + 1):
                price[i] += (b[basis[j]] if basis[j] < count else 1.0) * inverse[j, i]
        entering, least = -1, -IMPROVES
        for k in range(count):
            cost = b[k] - price[m]
            for i in range(m):
                cost -= price[i] * a[k, i]
            if cost < least:
                entering, least = k, cost
        for i in range(m):
            if 1.0 + price[i] < least:
                entering, least = count + 2 * i, 1.0 + price[i]
            if 1.0 - price[i] < least:
                entering, least = count + 2 * i + 1, 1.0 - price[i]
        if entering < 0:
            break
        for i in range(m + 1):
            if entering < count:
                column[i] = inverse[i, m]
                for j in range(m):
                    column[i] += inverse[i, j] * a[entering, j]
            else:
                j = (entering - count) // 2
                column[i] = -inverse[i, j] if (entering - count) % 2 == 0 else inverse[i, j]
        leaving, step = -1, math.inf
        for i in range(m + 1):
            if column[i] > 1e-11 and amount[i] / column[i] < step:
                leaving, step = i, amount[i] / column[i]
        if leaving < 0:
            break
        pivot = column[leaving]
        for j in range(m + 1):
            inverse[leaving, j] /= pivot
        for i in range(m + 1):
            if i != leaving:
                for j in range(m + 1):
                    inverse[i, j] -= column[i] * inverse[leaving, j]
                amount[i] = max(amount[i] - column[i] * step, 0.0)
        amount[leaving] = step
        basis[leaving] = entering
    for i in range(m + 1):
        if basis[i] < count:
            w[basis[i]] = amount[i]
    for i in range(m):
        e[i] = min(max(-price[i], -1.0), 1.0)
    return w, e
