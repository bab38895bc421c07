"""How near is the proven lower bound, and what does it cost? ``python bench/optimality.py [s]``.

The plants of SLH tables 1 and 3 with identical PI settings, others with dead time or many units,
and the published case with two different settings, for which the proof gets `s` CPU seconds.
"""

import sys
import time
from contextlib import suppress

import numpy as np

from solver.errors import Cancelled
from solver.optimality import LowerBound
from solver.plants import ParallelPlant, first_order
from solver.transfer_function import TransferFunction
from solver.tuning import Arrangement, Specification, tune
from solver.tuning.groupings import groupings
from solver.tuning.search import GroupingSearch
from solver.weights import Performance, Uncertainty

USUAL = Uncertainty.from_error(0.2, 1)
INTEGRATING = ParallelPlant(2, TransferFunction((1,), (1, 0)), TransferFunction((0.5,), (1, 0)))
OTHERS = {
    "dead time 2, tau = 20, a = 0.5": first_order(2, 1, 20, 0.5, 2),
    "one unit, dead time 3": first_order(1, 2, 30, 0, 3),
    "n = 50, a = -0.015, dead time": first_order(50, 1, 50, -0.015, 0.5),
    "n = 3, a = -0.45": first_order(3, 1, 100, -0.45),
    "integrating": INTEGRATING,
    "a = 0.9999": first_order(2, 1, 100, 0.9999),
}


def measure(name, plant, arrangement, limit):
    """Tune, prove for at most `limit` CPU seconds, and print a line."""
    specification = Specification(plant, USUAL, Performance(), arrangement=arrangement)
    tau_p = tune(specification).tau_p
    search = GroupingSearch(specification, groupings(specification)[0], 1.0, lambda _: None)
    for theta in search.starts(search.default_starts):
        search.descend(theta)
    peaks = min(search.polish(), key=lambda candidate: candidate.value).peaks
    started = time.process_time()

    def checkpoint():
        if time.process_time() - started > limit:
            raise Cancelled

    bound = LowerBound(search.objective, search.box, peaks=peaks, tau_p=tau_p)
    with suppress(Cancelled):
        bound.run(checkpoint)
    proof = bound.result()
    print(
        f"| {name} | {tau_p:.5g} | {proof.lower_bound:.5g} | {100 * proof.gap:.3g} % "
        f"| {proof.boxes} | {time.process_time() - started:.2f} |",
        flush=True,
    )


def main():
    """Print a line a case."""
    limit = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    measure("(first use)", first_order(2, 1, 10, 0.5), Arrangement.IDENTICAL, np.inf)
    for tau in (10, 100):
        for a in (0, 0.827, 0.949, 0.984, 0.995):
            plant = first_order(2, 1, tau, a)
            measure(f"tau = {tau}, a = {a}", plant, Arrangement.IDENTICAL, np.inf)
    for name, plant in OTHERS.items():
        measure(name, plant, Arrangement.IDENTICAL, np.inf)
    plant = first_order(2, 1, 100, 0.949)
    measure("tau = 100, a = 0.949, two settings", plant, Arrangement.INDEPENDENT, limit)


if __name__ == "__main__":
    main()
