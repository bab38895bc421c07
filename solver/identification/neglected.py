"""Dynamics that the elements leave in the residual (model error modelling: Ljung 1999).

The residual is regressed on lags of each input at times spread over what the record resolves. Only
where that predicts readings kept back is anything said to be neglected; then its frequency response
is an error of the plant, up to the frequency that the samples resolve.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.elements import ElementKind, frequency_responses, responses
from solver.identification.row import orthonormal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.identification.row_fit import RowFit

__all__ = ["neglected"]

LAGS = 6
FOLDS = 4
BLOCKS = 16
# Directions that the record tells less than a hundredth as well as the best one are left alone.
TOLD = 1e-2
ERRORS = 1.5
READINGS = 3000


def neglected(fit: RowFit, omega: NDArray[np.float64]) -> NDArray[np.complex128] | None:
    """Return the response that each input's element lacks, (inputs, k), or None if none is seen."""
    step = max(fit.row.readings // READINGS, 1)
    lags = np.log(np.geomspace(fit.limits.sample, fit.limits.longest, LAGS))
    blocks, targets, folds = [], [], []
    inputs = fit.row.inputs
    count = 0
    for whole, left in zip(fit.row.segments, fit.residuals(), strict=True):
        segment = whole.thinned(step)
        columns = np.hstack(
            [
                responses(ElementKind.FIRST, (lag, 0.0), segment.time, *moves)
                for moves in segment.changes
                for lag in lags
            ]
        )
        own = fit.row.own_columns(segment, fit.solved.kinds, fit.solved.shapes)
        base = orthonormal(own * segment.weight[:, None])
        weighted = columns * segment.weight[:, None]
        target = left[::step] * segment.weight
        blocks.append(weighted - base @ (base.T @ weighted))
        targets.append(target - base @ (base.T @ target))
        each = max(math.ceil(BLOCKS / len(fit.row.segments)), 2)
        folds.append(count + np.arange(target.size) * each // target.size)
        count += each
    block, target, label = np.concatenate(blocks), np.concatenate(targets), np.concatenate(folds)
    size = np.linalg.norm(block, axis=0)
    size[size == 0] = 1.0
    block = block / size
    gain = np.zeros(count)
    for fold in range(FOLDS):
        held = label % FOLDS == fold
        share = np.linalg.lstsq(block[~held], target[~held], rcond=TOLD)[0]
        won = target[held] ** 2 - (target[held] - block[held] @ share) ** 2
        gain += np.bincount(label[held], won, minlength=count)
    if not gain.sum() > ERRORS * gain.std(ddof=1) * math.sqrt(count):
        return None
    share = np.linalg.lstsq(block, target, rcond=TOLD)[0] / size
    shapes = np.stack([lags, np.zeros(LAGS)], axis=1)
    lacking = np.empty((inputs, omega.size), dtype=complex)
    for index in range(inputs):
        gains = share[index * LAGS : (index + 1) * LAGS, None]
        lacking[index] = frequency_responses(ElementKind.FIRST, shapes, gains, omega).sum(axis=0)
    return lacking
