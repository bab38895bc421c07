"""Are the units the same? A test of the shared elements against each unit's own.

Rao's score test at the shared fit: the derivative of each unit's cost by the shared parameters,
divided by its covariance under coloured noise, is chi-squared where the units are the same. It
needs no second fit and stands where a parameter is hardly told.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc

from solver.identification.fitting import fit as least
from solver.identification.fitting import steps
from solver.identification.noise import autoregression, backwards

if TYPE_CHECKING:
    from solver.identification.row_fit import RowFit

__all__ = ["Equality", "test_equality"]


@dataclass(frozen=True)
class Equality:
    """Outcome of the test.

    Attributes
    ----------
    statistic : float
        Of the units' scores.
    freedom : int
        Degrees of freedom.
    probability : float
        Of a statistic as large if the units are the same.

    """

    statistic: float
    freedom: int
    probability: float

    @property
    def plausible(self) -> bool:
        """Whether the data leave room for equal units (5 per cent)."""
        return self.probability >= 0.05


def test_equality(fit: RowFit) -> Equality:
    """Test whether the units of a shared fit are the same."""
    # Under the plain cost: its scores ask for no colour, whose memory is told too poorly.
    row = fit.row.plain()
    solved = least(row, fit.solved.kinds, fit.solved.shapes, fit.limits)
    F = np.hstack([row.jacobian(solved, steps(solved.kinds, fit.limits)), solved.left])
    size = np.linalg.norm(F, axis=0)
    u, s, _ = np.linalg.svd(F[:, size > 0] / size[size > 0], full_matrices=False)
    u = u[:, s > 1e-6 * s[0]]
    units = sorted({segment.unit for segment in row.segments})
    scores = {unit: np.zeros(u.shape[1]) for unit in units}
    spreads = {unit: np.zeros((u.shape[1], u.shape[1])) for unit in units}
    first = 0
    for segment in row.segments:
        last = first + segment.time.size
        seen = segment.weight > 0
        left, part = solved.residual[first:last][seen], u[first:last][seen]
        first = last
        model, innovation = autoregression(left)
        filtered = backwards(model, part)
        scores[segment.unit] += part.T @ left
        spreads[segment.unit] += innovation * filtered.T @ filtered
    statistic = 0.0
    for unit in units:
        V = spreads[unit] + 1e-12 * np.trace(spreads[unit]) * np.eye(u.shape[1])
        statistic += float(scores[unit] @ np.linalg.solve(V, scores[unit]))
    freedom = (len(units) - 1) * u.shape[1]
    return Equality(statistic, freedom, float(chdtrc(freedom, statistic)))
