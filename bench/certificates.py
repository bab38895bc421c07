"""Certificates beside a 10,000-point grid: ``python -m bench.certificates``.

For every plant of the tests: the peak of mu on a grid of 10,000 frequencies and the seconds that
takes; the seconds to certify a level 0.1 per cent above it for all frequencies, the number of
intervals, the seconds to verify the document, and its size. Medians of three runs, in CPU seconds
of one thread.
Writes bench/certificates.json too.
"""

import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from solver.certificate.record import Claim
from solver.certificate.search import CertificateFailure, certify
from solver.certificate.verify import verify
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.robustness.curves import LoopAnalysis

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from zoo import ZOO, Case

RUNS = 3
HERE = Path(__file__).parent


def timed(call):
    """Median CPU seconds of `call`, and what it returns."""
    seconds = []
    for _ in range(RUNS):
        start = time.process_time()
        outcome = call()
        seconds.append(time.process_time() - start)
    return statistics.median(seconds), outcome


def grid_peak(case):
    """Largest mu on 10,000 frequencies, nine decades about the loops' own."""
    blocks, controllers = group_loops(case.plant, case.loops, case.uncertainty)
    middle = np.exp(-np.mean([np.log(c.integral_time) for c in controllers]))
    omega = middle * np.geomspace(1e-5, 1e4, 10_000)
    analysis = LoopAnalysis(blocks, controllers, case.uncertainty, case.performance)
    return float(analysis.robust_performance(omega).max())


def row(case):
    """One line of the table."""
    grid_seconds, peak = timed(lambda: grid_peak(case))
    gamma = 1.001 * peak
    claim = Claim(case.plant, case.uncertainty, case.performance, case.loops, gamma)
    seconds, certificate = timed(lambda: certify(claim))
    if isinstance(certificate, CertificateFailure):
        return {
            "case": case.name,
            "grid_s": grid_seconds,
            "peak": peak,
            "failure": str(certificate),
        }
    document = json.dumps(certificate.to_document())
    verify_seconds, outcome = timed(lambda: verify(document))
    return {
        "case": case.name,
        "grid_s": grid_seconds,
        "peak": peak,
        "certify_s": seconds,
        "intervals": len(certificate.intervals),
        "verify_s": verify_seconds,
        "verified": outcome.ok,
        "bytes": len(document),
    }


def larger_cases():
    """Growth with the number of different loops, and a thousand units in two groups."""
    for n in (3, 5, 10):
        loops = tuple(Controller(30 / n + 3 * i, 20 + 9 * i) for i in range(n))
        yield Case(f"{n} different", first_order(n, 1, 100, 0.5), loops)
    two_groups = (*(Controller(10, 40),) * 500, *(Controller(14, 30),) * 500)
    yield Case("1000 in two groups", first_order(1000, 1, 50, -0.0005), two_groups)
    pid = (Controller(46.3, 101, 0.3), Controller(22.8, 3.15, 0.5))
    yield Case("two PID", first_order(2, 1, 100, 0.949), pid)
    lags = [
        [
            TransferFunction([1.0 if r == c else 0.1], [10 + r + 2 * c, 1], 0.5 * (1 + r == c))
            for c in range(6)
        ]
        for r in range(6)
    ]
    yield Case(
        "6 x 6 with dead times",
        MatrixPlant(lags),
        tuple(Controller(2 + i / 9, 10) for i in range(6)),
    )


def main() -> None:
    """Print the table."""
    certify(Claim(ZOO[0].plant, ZOO[0].uncertainty, ZOO[0].performance, ZOO[0].loops, 2.0))  # warm
    rows = [row(case) for case in (*ZOO, *larger_cases())]
    table = Table(title="mu <= 1.001 peak, for all frequencies")
    for heading in ("plant", "grid peak", "grid s", "certify s", "intervals", "verify s", "kB"):
        table.add_column(heading, justify="left" if heading == "plant" else "right")
    for entry in rows:
        cells = [f"{entry['peak']:.6f}", f"{entry['grid_s']:.3f}"]
        if "failure" in entry:
            cells.append("none")
        else:
            cells += [
                f"{entry['certify_s']:.3f}",
                str(entry["intervals"]),
                f"{entry['verify_s']:.3f}",
                f"{entry['bytes'] / 1000:.1f}",
            ]
        table.add_row(entry["case"], *cells)
    Console(width=100).print(table)
    (HERE / "certificates.json").write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
