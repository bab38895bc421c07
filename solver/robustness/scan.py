"""Whether a digital controller's scan is fast beside its loops: a dead time stands for it then."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.model.arranged import SCAN_DELAY
from solver.model.blocks import group_loops
from solver.robustness.margins import loop_frequencies

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.model.controllers import Controller
    from solver.model.plants import Plant

__all__ = ["scan_remark"]

SLOW_SCAN = 0.25  # rad: hold and dead time agree to 0.3 % of the gain there


def scan_remark(plant: Plant, loops: Sequence[Controller], scan_time: float) -> str | None:
    """Return what to look at where the scan is not small; None where it is.

    Parameters
    ----------
    plant : Plant
        With the dead time that stands for the scan.
    loops : sequence of Controller
        One a unit.
    scan_time : float
        Time between two scans, time unit of the plant.

    """
    if not scan_time > 0:
        return None
    omega = loop_frequencies(plant, loops)
    blocks, controllers = group_loops(plant, loops)
    c = np.stack([controller.response(omega) for controller in controllers], axis=1)
    gain = np.max(
        [
            np.linalg.norm(G * c[:, None, list(block.channels)], 2, axis=(1, 2))
            for block, G in zip(blocks.blocks, blocks.response(omega), strict=True)
        ],
        axis=0,
    )
    above = omega[gain >= 1]
    turn = scan_time * float(above[-1]) if above.size else 0.0
    if not turn > SLOW_SCAN:
        return None
    return (
        f"the scan time {scan_time:g} is not small: up to {above[-1]:.4g} rad per time unit the "
        f"gain of the loops exceeds 1, where a scan is {turn:.2g} rad. A dead time of "
        f"{SCAN_DELAY:g} scans stands for hold and computation; look at the sampled loop before "
        "relying on it"
    )
