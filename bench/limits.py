"""Seconds that limits take, beside a sweep of AB13MD: python -m bench.limits [NAME...].

Processor time of this process, one thread; an AB13MD sweep is 200 frequencies of the column.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from ctrlsys import ab13md

from solver.limits.multivariable import multivariable_limit
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty

UNCERTAINTY = Uncertainty.from_error(0.2, 1.0)


def drawn(n: int) -> MatrixPlant:
    """Unlike gains, lags of 5 to 50 and dead times of 0 to 2."""
    rng = np.random.default_rng(0)
    gain = rng.normal(size=(n, n)) + 2 * np.eye(n)
    return MatrixPlant(
        [
            [
                TransferFunction([each], [rng.uniform(5, 50), 1], float(rng.uniform(0, 2)))
                for each in row
            ]
            for row in gain
        ]
    )


def column() -> MatrixPlant:
    """Skogestad, Lundstrom and Hovd (1989), eq. 3."""
    gain = [[0.878, -0.864], [-1.082, 1.096]]
    return MatrixPlant([[TransferFunction([k], [75, 1]) for k in row] for row in gain])


def integrating() -> ParallelPlant:
    """Two units that integrate, with a lag each."""
    own, other = (TransferFunction([k], [100, 1, 0]) for k in (1.0, 0.5))
    return ParallelPlant(2, own, other)


def one_integrates() -> MatrixPlant:
    """Two units, the first input integrates and meets a dead time towards the second output."""
    rows = [([1], [1, 0], 0), ([0.5], [3, 1], 0)], [([0.3], [1, 0], 1), ([-2], [4, 1], 0)]
    return MatrixPlant([[TransferFunction(*each) for each in row] for row in rows])


CASES = {
    "parallel": (first_order(2, 1.0, 100.0, 0.949), None),
    "parallel, dead time": (first_order(2, 1.0, 100.0, 0.949, 1.0), None),
    "parallel, 1000 units": (first_order(1000, 1.0, 100.0, 0.95), None),
    "integrating": (integrating(), None),
    "one integrates": (one_integrates(), None),
    "column": (column(), 10.0),
    **{f"matrix {n}": (drawn(n), None) for n in (2, 3, 4)},
    **{f"matrix {n}, mu": (drawn(n), 20.0) for n in (2, 3, 4, 5, 6)},
}


def sweep() -> float:
    """Processor seconds of AB13MD at 200 frequencies."""
    rng = np.random.default_rng(1)
    matrices = rng.normal(size=(200, 4, 4)) + 1j * rng.normal(size=(200, 4, 4))
    sizes, kinds = np.array([1, 1, 2], dtype=np.int32), np.array([2, 2, 2], dtype=np.int32)
    start = time.process_time()
    for N in matrices:
        ab13md(np.asfortranarray(N), sizes, kinds)
    return time.process_time() - start


def main(names: list[str]) -> None:
    """Print a row a plant."""
    multivariable_limit(first_order(1, 1.0, 10.0, 0.0), UNCERTAINTY, Performance())  # kernels
    for name in names or CASES:
        plant, tau_p = CASES[name]
        start = time.process_time()
        found = multivariable_limit(plant, UNCERTAINTY, Performance(tau_p=tau_p))
        seconds = time.process_time() - start
        built = found.realised
        reached = "none" if built is None else f"{built.tau_p:.4g} ({built.states} states)"
        sweeps = seconds / sweep()
        print(f"{name}: {found.value:.4g}, built {reached}: {seconds:.1f} s, {sweeps:.0f} sweeps")


if __name__ == "__main__":
    main(sys.argv[1:])
