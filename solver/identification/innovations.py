"""Innovations of a disturbance that forgets, read with white noise: a Kalman filter of one state.

The disturbance d has the variance 1 and the correlation exp(-|dt|/memory); a reading is d + white
noise of variance `share`. Any distances of the readings and any gaps are exact.
"""

import math

from solver.compiled import compiled

__all__ = ["innovations"]


@compiled(nogil=True)
def innovations(time, seen, memory, share, columns, out):
    """Fill `out` with each column's innovations; return the mean logarithm of their variance.

    Parameters
    ----------
    time : (k,)
        Increasing.
    seen : (k,) of bool
        Which readings count; the others get 0.
    memory : float
        Of the disturbance, > 0.
    share : float
        Variance of the white noise, >= 0.
    columns, out : (c, k)
        The filter is linear: signals, and what of each the past does not tell, divided by the
        standard deviation of that.

    """
    filtered = columns[:, 0] * 0.0
    variance = 1.0
    logarithms = 0.0
    count = 0
    apart = -1.0
    kept = 1.0
    for k in range(time.size):
        if k > 0:
            now = time[k] - time[k - 1]
            if now != apart:
                apart = now
                kept = math.exp(-now / memory)
            variance = kept * kept * variance + 1.0 - kept * kept
        if not seen[k]:
            for c in range(columns.shape[0]):
                filtered[c] *= kept
                out[c, k] = 0.0
            continue
        total = variance + share
        gain = variance / total
        root = math.sqrt(total)
        for c in range(columns.shape[0]):
            told = kept * filtered[c] if k > 0 else 0.0
            new = columns[c, k] - told
            filtered[c] = told + gain * new
            out[c, k] = new / root
        variance -= gain * variance
        logarithms += math.log(total)
        count += 1
    return logarithms / max(count, 1)
