"""The conditions of a loop on its settings: cuts at points of the right half plane, box by box."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.mu.scaling import sweep
from solver.optimality.cuts import NU, cuts
from solver.optimality.settings_box import demands, in_settings, narrow
from solver.plants import ParallelPlant

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.blocks import LoopBlocks
    from solver.optimality.samples import Samples
    from solver.weights import Performance

__all__ = ["Conditions", "Verdict", "cone"]

ROUNDS = 3  # cuts at the centre, then at the points that remained possible


@dataclass(frozen=True)
class Verdict:
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
        The points tried, the ones that exclude most first.

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
    ) -> Verdict:
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
        points, G, u = self.samples.s[used], self.samples.G[used], self.samples.u[used]
        weight = self.performance.max_peak, self.performance.offset
        p = demands(self.target, points, *weight)
        # Of |E Z - G v| at |c| = 1: |v| <= sqrt(u) |c Z|.
        reach = self.samples.size[used] * (1 + np.sqrt(u))
        y = np.zeros((used.size, self.blocks.n_scales))
        slack = np.full(used.size, np.inf)
        found: list[tuple[NDArray[np.float64], ...]] = []
        v = np.sqrt(low * high)
        s, cold, all_free = known, True, True
        for turn in range(1, ROUNDS + 1):
            c = self.signs * (v[::2] + v[1::2] / points[:, None])
            sweep(G, c, u, p, self.blocks.layout, all_free, NU, cold, y)
            cold = False
            constant, beta, M = cuts(c, G, u, p, self.blocks.layout, np.exp(y))
            value = constant + 2 * (beta * c).sum(axis=1).real
            value += np.einsum("ki,kij,kj->k", c.conj(), M, c).real
            slack = np.minimum(slack, value / p)
            found.append((constant, *in_settings(beta, M, self.signs, points)))
            cut = tuple(np.concatenate(parts) for parts in zip(*found, strict=True))
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            excluded, s, e, hidden, room, w = narrow(
                low, high, cut, np.tile(p, turn), np.tile(points, turn), np.tile(reach, turn),
                self.cone, weight, self.target, s,
            )  # fmt: skip
            if excluded:
                return Verdict(self.target, None, low, high, used)
            # More cuts help only where it is not the curvature that lets the box pass.
            if room < hidden.sum():
                break
            v = np.clip(middle + half * e, low, high)
        slack[np.flatnonzero(w) % used.size] = -1
        ratio = high / low
        split = int(hidden.argmax() if hidden.max() > 0 else ratio.argmax())
        if not ratio[split] > 1 + 1e-12:
            split = int(ratio.argmax())
        return Verdict(s, split, low, high, used[np.argsort(slack, kind="stable")])

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
    alike = size == 2 and len(groups[0]) == len(groups[1])
    if alike and isinstance(blocks.plant, ParallelPlant):
        rows = np.vstack([rows, [1, 0, -1, 0]])
    return rows
