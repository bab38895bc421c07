"""The conditions of a loop on its settings: cuts at points of the right half plane, box by box."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.controllers import DERIVATIVE_FILTER
from solver.mu.scaling import sweep
from solver.optimality.cuts import NU, Cuts, cuts
from solver.optimality.settings_box import Demand, demands, narrow

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.model.blocks import LoopBlocks
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
        Lower bound of s, the logarithm of what is sought, over the box.
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
        The points; where mu is sought, with u over mu^2 at the target.
    demand : Demand
        What s makes of the demand.
    signs : (controllers,)
        Sign of each gain.
    target : float
        s that is to be excluded.
    cone : (rows, 2 controllers)
        Conditions cone v >= 0 on k and k/tau_I of the controllers.

    """

    blocks: LoopBlocks
    samples: Samples
    demand: Demand
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
        if low.size == 3 * self.signs.size:
            leads = np.stack([low[2::3], high[2::3]], axis=1)
            limits = robust_limits(self.blocks, self.samples, self.signs, leads)
            high = np.minimum(high, limits)
            if (high < low).any():
                return Examination(self.target, None, low, high, used)
        v, s = np.sqrt(low * high), known
        y = np.zeros((used.size, self.blocks.n_scales))
        found: list[Cuts] = []
        cold = True
        for _ in range(ROUNDS):
            points, G, u = self.samples.s[used], self.samples.G[used], self.samples.u[used]
            rows = np.repeat(u[:, None], G.shape[1], axis=1)
            p = demands(self.target, points, self.demand)
            # Of |E Z - G v| at |c| = 1: |v| <= sqrt(u) |c Z|.
            reach = self.samples.size[used] * (1 + np.sqrt(u))
            c = self._controllers(v, points)
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
                low, high, cut, p, points, reach, self.signs, self.cone, self.demand, self.target, s
            )
            if excluded:
                return Examination(self.target, None, low, high, used)
            v = np.clip(middle + half * e, low, high)
            kept = np.argsort(room, kind="stable")[:KEPT]
            used, y = used[kept], y[kept]
            found = [Cuts(made.above[kept], made.norm[kept], made.size[kept]) for made in found]
        return Examination(s, int((high / low).argmax()), low, high, used)

    def _controllers(
        self, v: NDArray[np.float64], s: NDArray[np.complex128]
    ) -> NDArray[np.complex128]:
        """Return the controllers (k, controllers) at points s (k,)."""
        own = v.size // self.signs.size
        c = self.signs * (v[::own] + v[1::own] / s[:, None])
        if own == 3:
            lead = v[2::own] * s[:, None]
            c = c * (1 + lead) / (1 + DERIVATIVE_FILTER * lead)
        return c

    @property
    def all_points(self) -> NDArray[np.int64]:
        """All points."""
        return np.arange(self.samples.s.size)


def cone(
    blocks: LoopBlocks, shortest: NDArray[np.float64], longest: NDArray[np.float64], per: int
) -> NDArray[np.float64]:
    """Rows a of conditions a v >= 0: tau_I within its limits; groups of one size in order.

    `per` is the number of variables of one controller.
    """
    groups = blocks.groups
    size = len(groups)
    rows = np.zeros((2 * size, per * size))
    for j in range(size):
        rows[2 * j, per * j : per * j + 2] = 1, -shortest[j]
        rows[2 * j + 1, per * j : per * j + 2] = -1, longest[j]
    if blocks.plant.interchangeable and bool((blocks.ratios == 1).all()):
        for j in range(size):
            alike = [i for i in range(j) if len(groups[i]) == len(groups[j])]
            if alike:
                row = np.zeros(per * size)
                row[per * alike[-1]], row[per * j] = 1, -1
                rows = np.vstack([rows, row])
    return rows


def robust_limits(
    blocks: LoopBlocks,
    samples: Samples,
    signs: NDArray[np.float64],
    leads: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Greatest settings of each controller with which a loop can be robustly stable, (m,).

    Of k and k/tau_I; `leads` are least and greatest derivative times, (controllers, 2), or empty
    for PI.

    Where |w_I| >= 1 the uncertainty can take out all of C but one row of a block, so what is left
    must be robustly stable: with zeta = G e and v = C zeta + e, e the unit vector of the row,
    E zeta - G v = 0, hence |v_s| > |w_I (C zeta)_s|, or |c + y|^2 > u |c|^2 with y = 1/G_ee: c is
    in a disc.
    """
    channels, first = blocks.layout.channels, blocks.layout.first
    per = 3 if leads.size else 2
    limits = np.full(per * signs.size, np.inf)
    for row, channel in enumerate(channels):
        direct = samples.G[:, row, row - first[first <= row].max()]
        at = (samples.s.real == 0) & (samples.u > 1 + CLEARLY) & (direct != 0)
        if not at.any():
            continue
        omega, u = samples.s[at].imag, samples.u[at]
        centre = signs[channel] / direct[at] / (u - 1)
        radius = np.sqrt(u) * np.abs(centre) * (1 + OUTWARD)
        # sign c = L (k - j (k/tau_I)/omega), with PI L = 1
        real, imag = centre.real + radius, radius - centre.imag
        if leads.size:
            least, angles = _lead(omega[:, None] * leads[channel])
            turned = np.angle(centre)[:, None] - angles
            real, imag = (
                (np.abs(centre) * _highest_cosine(turned + turn) + radius) / least
                for turn in (0.0, np.pi / 2)
            )
        limit = np.array([real.min(), (omega * imag).min()])
        own_limits = limits[per * channel : per * channel + 2]
        np.minimum(own_limits, limit, out=own_limits)
    return limits


def _lead(times: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least modulus (k,) and angles' range (k, 2) of L = (1 + j x)/(1 + j x/10), x in (k, 2)."""
    modulus = np.hypot(1, times) / np.hypot(1, DERIVATIVE_FILTER * times)
    angles = np.arctan(times) - np.arctan(DERIVATIVE_FILTER * times)
    # The angle rises up to x = sqrt(10) and falls from there.
    top = DERIVATIVE_FILTER**-0.5
    highest = np.where((times[:, 0] < top) & (times[:, 1] > top),
                       np.arctan(top) - np.arctan(DERIVATIVE_FILTER * top),
                       angles.max(axis=1))  # fmt: skip
    return modulus[:, 0] * (1 - OUTWARD), np.stack([angles.min(axis=1), highest], axis=1)


def _highest_cosine(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Greatest cosine, at least 0, of angles between two, (k, 2) in either order."""
    ends = np.cos(angles).max(axis=1)
    low, high = angles.min(axis=1), angles.max(axis=1)
    whole = np.floor(high / (2 * np.pi)) >= np.ceil(low / (2 * np.pi))
    return np.where(whole, 1.0, np.maximum(ends, 0.0)) + OUTWARD
