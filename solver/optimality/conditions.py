"""The conditions of a loop on its settings: cuts at points of the right half plane, box by box."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.mu.scaling import sweep
from solver.optimality.cuts import NU, Cuts, cuts
from solver.optimality.settings_box import demands, narrow

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
    from solver.model.weights import Performance
    from solver.optimality.samples import Samples

__all__ = ["Conditions", "Examination", "cone", "robust_limits"]

ROUNDS = 3  # cuts at the centre, then at the points that remained possible
KEPT = 30  # points that take part in the later rounds, those whose conditions are tightest
CLEARLY = 1e-3  # by which |w_I|^2 exceeds 1 where its excess is divided by
OUTWARD = 1e-9  # relative, above the rounding of what was divided by that excess


@dataclass(frozen=True)
class Examination:
    """What is known of a box.

    Attributes
    ----------
    s : float
        Lower bound of s = log tau_P over the box.
    split : int or None
        The variable to cut it in; None where the box is excluded.
    low, high : (m,)
        What is left of it.
    tightest : (k,)
        The points tried last, the ones that exclude most first.

    """

    s: float
    split: int | None
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    tightest: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions at all points.

    Parameters
    ----------
    blocks : LoopBlocks
        Plant and grouping.
    samples : Samples
        The points.
    performance : Performance
        M and A of the demand.
    signs : (controllers,)
        Sign of each gain.
    target : float
        s that is to be excluded.
    cone : (rows, 2 controllers)
        Conditions cone v >= 0 on k and k/tau_I of the controllers.

    """

    blocks: LoopBlocks
    samples: Samples
    performance: Performance
    signs: NDArray[np.float64]
    target: float
    cone: NDArray[np.float64]

    def examine(
        self,
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        used: NDArray[np.int64],
        known: float,
    ) -> Examination:
        """Exclude a box, or tell how to go on.

        Parameters
        ----------
        low, high : (2 controllers,)
            k and k/tau_I, controller by controller, magnitudes > 0.
        used : (j,)
            Points whose cuts are tried.
        known : float
            A lower bound of s over this box.

        """
        low, high = low.copy(), high.copy()
        max_peak, offset = self.performance.max_peak, self.performance.offset
        v, s = np.sqrt(low * high), known
        y = np.zeros((used.size, self.blocks.n_scales))
        found: list[Cuts] = []
        cold = True
        for _ in range(ROUNDS):
            points, G, u = self.samples.s[used], self.samples.G[used], self.samples.u[used]
            rows = np.repeat(u[:, None], G.shape[1], axis=1)
            p = demands(self.target, points, max_peak, offset)
            # Of |E Z - G v| at |c| = 1: |v| <= sqrt(u) |c Z|.
            reach = self.samples.size[used] * (1 + np.sqrt(u))
            c = self.signs * (v[::2] + v[1::2] / points[:, None])
            sweep(G, c, rows, p, self.blocks.layout, all_free=True, nu=NU, cold=cold, y=y)
            cold = False
            found.append(cuts(c, G, u, p, self.blocks.layout, np.exp(y)))
            cut = Cuts(
                np.stack([made.above for made in found], axis=1),
                np.stack([made.norm for made in found], axis=1),
                np.stack([made.size for made in found], axis=1),
            )
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            excluded, s, e, room = narrow(
                low, high, cut, p, points, reach, self.signs, self.cone, max_peak, offset,
                self.target, s,
            )  # fmt: skip
            if excluded:
                return Examination(self.target, None, low, high, used)
            v = np.clip(middle + half * e, low, high)
            kept = np.argsort(room, kind="stable")[:KEPT]
            used, y = used[kept], y[kept]
            found = [Cuts(made.above[kept], made.norm[kept], made.size[kept]) for made in found]
        return Examination(s, int((high / low).argmax()), low, high, used)

    @property
    def all_points(self) -> NDArray[np.int64]:
        """All points."""
        return np.arange(self.samples.s.size)


def cone(
    blocks: LoopBlocks, shortest: NDArray[np.float64], longest: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Rows a of conditions a v >= 0: tau_I within its limits; of equal groups the first leads."""
    groups = blocks.groups
    size = len(groups)
    rows = np.zeros((2 * size, 2 * size))
    for j in range(size):
        rows[2 * j, 2 * j : 2 * j + 2] = 1, -shortest[j]
        rows[2 * j + 1, 2 * j : 2 * j + 2] = -1, longest[j]
    alike = size == 2 and len(groups[0]) == len(groups[1]) and bool((blocks.ratios == 1).all())
    if alike and blocks.plant.interchangeable:
        rows = np.vstack([rows, [1, 0, -1, 0]])
    return rows


def robust_limits(
    blocks: LoopBlocks, samples: Samples, signs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Greatest k and k/tau_I of each controller with which a loop can be robustly stable, (m,).

    Where |w_I| >= 1 the uncertainty can take out all of C but one row of a block, so what is left
    must be robustly stable: with zeta = G e and v = C zeta + e, e the unit vector of the row,
    E zeta - G v = 0, hence |v_s| > |w_I (C zeta)_s|, or |c + y|^2 > u |c|^2 with y = 1/G_ee: c is
    in a disc.
    """
    channels, first = blocks.layout.channels, blocks.layout.first
    limits = np.full(2 * signs.size, np.inf)
    for row, channel in enumerate(channels):
        own = samples.G[:, row, row - first[first <= row].max()]
        at = (samples.s.real == 0) & (samples.u > 1 + CLEARLY) & (own != 0)
        if not at.any():
            continue
        omega, u = samples.s[at].imag, samples.u[at]
        centre = signs[channel] / own[at] / (u - 1)
        radius = np.sqrt(u) * np.abs(centre) * (1 + OUTWARD)
        # sign c = k - j (k/tau_I)/omega
        limit = np.array([(centre.real + radius).min(), (omega * (radius - centre.imag)).min()])
        own_limits = limits[2 * channel : 2 * channel + 2]
        np.minimum(own_limits, limit, out=own_limits)
    return limits
