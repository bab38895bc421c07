"""Peaks proven over all frequencies: ``python -m bench.axis [LOOPS [FIRST]]``.

First what a proof costs: seconds for the three peaks of mu with their brackets, for certain plants,
medians of five runs in CPU seconds of one thread. Then random loops far from the usual (LOOPS of
them, 2,000 unless given, from the seed FIRST on; the generators of the tests: PI alone, and every
kind of controller with diagonal and full uncertainty in turn): how many of the stable ones are
proven, how many have a higher value on a dense grid of 20,000 points with refinement than was
reported, and how many have another stability than an independent winding count. The last two
should be 0.
Last, plants of up to 300 units in two groups: whether a perturbation reaches the peak (the share
that it reaches) and whether the certificate of its level is accepted by the verifier.
Writes bench/axis.json too.
"""

import itertools
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from solver.certificate.verify import check
from solver.model.controllers import Controller
from solver.model.errors import UnsupportedPlantError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.axis import proven_peaks
from solver.robustness.record import GuaranteeStatus
from solver.stability.closed_loop import is_stable

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.solver.robustness.unusual_loops import dense_peak, draw, draw_any, unstable_count

HERE = Path(__file__).parent
RUNS = 5
FINER = 200_000
LARGE, EACH = (40, 120, 300), 4
COLUMNS = ("n", "stable", "peak", "guarantee", "reached", "verified")
USUAL = Uncertainty.from_error(0.2, 1)
PUBLISHED = (Controller(46.3, 101), Controller(22.8, 3.15))
WOOD_BERRY = MatrixPlant(
    [
        [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
        [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
    ]
)
NINE_DEAD_TIMES = MatrixPlant(
    [
        [
            TransferFunction([1.0 if row == column else 0.3], [10 + 2 * column, 1], dead_time)
            for column, dead_time in enumerate(times)
        ]
        for row, times in enumerate([(1.0, 2.0, 3.0), (1.3, 2.2, 3.1), (1.6, 2.4, 3.2)])
    ]
)
PLANTS = {
    "n = 2, no dead time (published)": (
        first_order(2, 1, 100, 0.949), USUAL, Performance(tau_p=19), PUBLISHED,
    ),
    "n = 2, dead time": (first_order(2, 1, 100, 0.949, 1), USUAL, Performance(tau_p=30), PUBLISHED),
    "Wood and Berry": (
        WOOD_BERRY, Uncertainty.from_error(0.1, 0.5), Performance(tau_p=20),
        (Controller(0.2, 4.44), Controller(-0.04, 2.67)),
    ),
    "3 x 3, nine dead times": (
        NINE_DEAD_TIMES, Uncertainty.from_error(0.1, 0.5), Performance(tau_p=20),
        (Controller(1.5, 10), Controller(1.2, 12), Controller(1, 14)),
    ),
}  # fmt: skip


def prices():
    """Return the rows of the first table."""
    rows = []
    for name, task in PLANTS.items():
        found = proven_peaks(*task)
        seconds = []
        for _ in range(RUNS):
            start = time.process_time()
            proven_peaks(*task)
            seconds.append(time.process_time() - start)
        rows.append(
            {
                "plant": name,
                "peak": found.peaks.robust_performance.value,
                "guarantee": found.guarantee.status.value,
                "seconds": statistics.median(seconds),
            }
        )
    return rows


def unusual(first, count):
    """Return the counts of the second table."""
    names = ("stable", "proven", "higher on a grid", "other stability", "stability not checked")
    found = dict.fromkeys(names, 0)
    for seed in range(first, first + count):
        drawn = (draw_any if seed % 2 else draw)(np.random.default_rng(seed))
        try:
            stable = is_stable(drawn.plant, drawn.loops)
        except UnsupportedPlantError:
            continue
        counted = unstable_count(drawn)
        if counted is not None and stable != (counted == 0):
            # Lightly damped loops may pass between the points of the independent count.
            counted = unstable_count(drawn, FINER)
        found["stability not checked"] += counted is None
        found["other stability"] += counted is not None and stable != (counted == 0)
        if not stable:
            continue
        found["stable"] += 1
        axis = proven_peaks(drawn.plant, drawn.uncertainty, drawn.performance, drawn.loops)
        found["proven"] += axis.guarantee.status is GuaranteeStatus.PROVEN
        peak = axis.peaks.robust_performance.value
        found["higher on a grid"] += dense_peak(drawn, peak) > peak * (1 + 1e-6)
    return found


def many():
    """Return the rows of the third table."""
    rows = []
    for n, seed in itertools.product(LARGE, range(EACH)):
        rng = np.random.default_rng([n, seed])
        lag, size, coupling = (
            10 ** rng.uniform(-3, 3),
            10 ** rng.uniform(-6, 6),
            rng.uniform(0, 0.9),
        )
        dead_time = rng.choice([0.0, rng.uniform(0.01, 0.2)]) * lag
        plant = first_order(n, size, lag, coupling * rng.choice([1.0, 1 / n]), dead_time)
        slots = [
            Controller(10 ** rng.uniform(-1, 0.5) / size / n, lag * 10 ** rng.uniform(-0.5, 0.5))
            for _ in range(2)
        ]
        loops = tuple(slots[unit < n // 3] for unit in range(n))
        uncertainty = Uncertainty.from_error(10 ** rng.uniform(-2, -0.5), 0.05 * lag)
        performance = Performance(tau_p=lag * 10 ** rng.uniform(0, 2))
        found = analyse(plant, uncertainty, performance, loops, certificate=True)
        row = {"n": n, "stable": found.nominally_stable, "peak": None, "guarantee": None}
        if found.peaks is not None:
            row["peak"] = found.peaks.robust_performance.value
            row["guarantee"] = found.guarantee.status.value
            row["reached"] = found.lower_bound.value / row["peak"]
            row["verified"] = found.certificate is not None and check(found.certificate).ok
        rows.append(row)
    return rows


def main():
    """Print both tables and write them."""
    console = Console()
    rows = prices()
    table = Table("plant", "peak of mu", "guarantee", "seconds")
    for row in rows:
        table.add_row(row["plant"], f"{row['peak']:.6f}", row["guarantee"], f"{row['seconds']:.3f}")
    console.print(table)
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 2_000
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    found = unusual(first, count)
    table = Table("random loops", str(count))
    for name, number in found.items():
        table.add_row(name, str(number))
    console.print(table)
    units = many()
    table = Table("units", "stable", "peak of mu", "guarantee", "reached", "certificate verified")
    for row in units:
        table.add_row(*(str(row.get(name, "")) for name in COLUMNS))
    console.print(table)
    document = {"prices": rows, "first": first, "loops": count, "found": found, "many": units}
    (HERE / "axis.json").write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
