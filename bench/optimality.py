"""How near is the proven lower bound, and what does it cost? ``python -m bench.optimality [s]``.

The plants of SLH tables 1 and 3 and others, with dead time or many units, with identical PI
settings and with two different ones; then the least peak of mu at tau_P = 10 and 30. Every proof
gets at most `s` CPU seconds.
"""

import math
import sys
import time
from contextlib import suppress

from solver.model.errors import Cancelled
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty
from solver.optimality.bound import BranchAndBound
from solver.tuning.groupings import groupings
from solver.tuning.search import Freedom, GroupingSearch
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

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
COLUMN = MatrixPlant(  # SLH eq. 3
    [[TransferFunction((gain,), (75, 1)) for gain in row]
     for row in ((0.878, -0.864), (-1.082, 1.096))]
)  # fmt: skip
GROUPS = {
    "n = 3, a = -0.45: 1 and 2": (first_order(3, 1, 100, -0.45), (1, 2)),
    "n = 5, a = -0.2: 2 and 3": (first_order(5, 1, 100, -0.2), (2, 3)),
    "n = 50, a = -0.015, dead time: 1 and 49": (first_order(50, 1, 50, -0.015, 0.5), (1, 49)),
    "n = 50, a = 0.5: 10 and 40": (first_order(50, 1, 100, 0.5), (10, 40)),
    "n = 50, a = 0.949: 25 and 25": (first_order(50, 1, 100, 0.949), (25, 25)),
}


def measure(name, plant, limit, arrangement, sizes=None, uncertainty=USUAL, tau_p=None):
    """Tune, prove for at most `limit` CPU seconds, and print a line."""
    specification = Specification(
        plant, uncertainty, Performance(tau_p=tau_p), arrangement=arrangement, group_sizes=sizes,
        objective="tau_p" if tau_p is None else "mu",
    )  # fmt: skip
    result = tune(specification)
    value = result.tau_p if tau_p is None else result.peaks.robust_performance.value
    search = GroupingSearch(
        specification,
        Freedom.usual(specification, groupings(specification)[0]),
        lambda: None,
    )
    for theta in search.starts(4 * search.box.low.size):
        search.descend(theta)
    peaks = min(search.polish(math.inf), key=lambda candidate: candidate.value).peaks
    started = time.process_time()

    def checkpoint():
        if time.process_time() - started > limit:
            raise Cancelled

    bound = BranchAndBound(search.problem, peaks=peaks, value=value)
    with suppress(Cancelled):
        bound.run(checkpoint)
    proof = bound.result()
    print(
        f"| {name} | {value:.5g} | {proof.lower_bound:.5g} | {100 * proof.gap:.3g} % "
        f"| {proof.boxes} | {time.process_time() - started:.2f} |",
        flush=True,
    )


def main():
    """Print a line a case."""
    limit = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    for arrangement in (Arrangement.IDENTICAL, Arrangement.INDEPENDENT):
        print(arrangement)
        measure("(first use)", first_order(2, 1, 10, 0.5), limit, arrangement)
        for tau in (10, 100):
            for a in (0, 0.827, 0.949, 0.984, 0.995):
                measure(f"tau = {tau}, a = {a}", first_order(2, 1, tau, a), limit, arrangement)
        for name, plant in OTHERS.items():
            if plant.n == 2 or arrangement is Arrangement.IDENTICAL:
                measure(name, plant, limit, arrangement)
    full = Uncertainty.from_error(0.2, 1, Structure.FULL)
    plant = first_order(2, 1, 100, 0.949)
    measure("tau = 100, a = 0.949, full block", plant, limit, arrangement, uncertainty=full)
    measure("column", COLUMN, limit, arrangement)
    for name, (plant, sizes) in GROUPS.items():
        measure(name, plant, limit, Arrangement.GROUPED, sizes)
    least_peaks(limit)


def least_peaks(limit):
    """Print a line a case with the objective mu."""
    for arrangement in (Arrangement.IDENTICAL, Arrangement.INDEPENDENT):
        print(f"mu, {arrangement}")
        for tau_p in (10, 30):
            for tau in (10, 100):
                for a in (0, 0.827, 0.949, 0.984, 0.995):
                    name, plant = f"tau = {tau}, a = {a}", first_order(2, 1, tau, a)
                    measure(f"{name}: {tau_p}", plant, limit, arrangement, tau_p=tau_p)
        measure("column: 10", COLUMN, limit, arrangement, tau_p=10)
    for name, (plant, sizes) in GROUPS.items():
        measure(f"{name}: 30", plant, limit, Arrangement.GROUPED, sizes, tau_p=30)


if __name__ == "__main__":
    main()
