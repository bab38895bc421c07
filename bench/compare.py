"""mu bounds and whole tunings beside their peers: ``python -m bench.compare [--long SECONDS]``.

Prints tables and writes bench/results.json. Times are medians on one thread; the unit is one
sweep of SLICOT's AB13MD over 61 frequencies, timed in the same run. ``--long`` adds differential
evolution and multi-start Nelder-Mead over AB13MD.
"""

import argparse
import contextlib
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from ctrlsys import ab13md
from rich.console import Console
from rich.table import Table
from scipy.optimize import differential_evolution, minimize

from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.mu import sdp
from solver.mu.kernel import FINE
from solver.mu.scaling import sweep, upper_bound
from solver.mu.structure import BlockStructure
from solver.robustness.curves import LoopAnalysis
from solver.stability.closed_loop import is_stable
from solver.tuning.specification import Arrangement, ControllerKind, Specification
from solver.tuning.tuner import tune

USUAL = Uncertainty.from_error(0.2, 1)
OMEGA = np.geomspace(1e-4, 1e2, 61)
SEED_PLANT = first_order(2, 1, 100, 0.949)


def median_time(call, repeats):
    """Median seconds of processor time of `call`, after one run that is not counted."""
    call()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return statistics.median(times)


def slicot(N, n):
    """Upper bounds of AB13MD for n scalars and one full n x n block."""
    sizes, kinds = np.array([1] * n + [n], np.int32), np.full(n + 1, 2, np.int32)
    return np.array([ab13md(matrix, sizes, kinds)[0] for matrix in N])


def independent_loop(n):
    """n different PI controllers on the seed case's plant, stable, a scaled to n."""
    plant = first_order(n, 1, 100, 0.949 if n == 2 else 0.5)
    loops = [Controller(30 / n + 3 * i, 20 + 9 * i) for i in range(n)]
    blocks, controllers = group_loops(plant, loops)
    return LoopAnalysis(blocks, controllers, USUAL, Performance(tau_p=30))


def bounds():
    """Time a frequency of every way to the bound, accuracy checked first."""
    rows = []
    for n in (2, 3, 5, 10):
        analysis = independent_loop(n)
        N, structure = analysis.matrices(OMEGA)[0], BlockStructure(tuple(range(n)), n)
        peer, ours = slicot(N, n), analysis.robust_performance(OMEGA)
        c = np.stack([k.response(OMEGA) for k in analysis.controllers], axis=1)
        G, u = analysis.blocks.packed(OMEGA), analysis.blocks.squared(USUAL, OMEGA)
        b = analysis.performance.magnitude(OMEGA) ** 2
        y = np.zeros((OMEGA.size, n))

        def cold(G=G, c=c, u=u, b=b, layout=analysis.blocks.layout, y=y):
            y[:] = 0
            sweep(G, c, u, b, layout, all_free=True, nu=FINE, cold=True, y=y)

        def warm(G=G, c=c, u=u, b=b, layout=analysis.blocks.layout, y=y):
            sweep(G, c, u, b, layout, all_free=True, nu=FINE, cold=False, y=y)

        few = N[30:31]
        rows.append({
            "n": n,
            "difference": float(np.abs(ours / peer - 1).max()),
            "not_worse": bool((ours <= peer * (1 + 1e-8)).all()),
            "ab13md_us": 1e6 / OMEGA.size * median_time(lambda N=N, n=n: slicot(N, n), 1),
            "cold_us": 1e6 / OMEGA.size * median_time(cold, 30),
            "warm_us": 1e6 / OMEGA.size * median_time(warm, 30),
            "matrix_us": 1e6 / OMEGA.size * median_time(
                lambda N=N, s=structure: upper_bound(N, s), 2),
            "sdp_us": 1e6 / few.shape[0] * median_time(
                lambda few=few, s=structure: sdp.upper_bound(few, s), 1),
        })  # fmt: skip
    return rows


def tunings():
    """Whole tunings, in AB13MD sweeps of 61 frequencies, one before each: speeds change."""
    N = independent_loop(2).matrices(OMEGA)[0]
    cases = {
        "PI identical": (SEED_PLANT, Arrangement.IDENTICAL, ControllerKind.PI, None),
        "PI independent": (SEED_PLANT, Arrangement.INDEPENDENT, ControllerKind.PI, None),
        "PID independent": (SEED_PLANT, Arrangement.INDEPENDENT, ControllerKind.PID, None),
        "n = 2, two groups": (first_order(2, 1, 100, -0.9), Arrangement.GROUPED,
                              ControllerKind.PI, (1, 1)),
        "n = 50, two groups": (first_order(50, 1, 100, -0.9 / 49), Arrangement.GROUPED,
                               ControllerKind.PI, (25, 25)),
        "n = 1000, two groups": (first_order(1000, 1, 100, -0.9 / 999), Arrangement.GROUPED,
                                 ControllerKind.PI, (500, 500)),
    }  # fmt: skip
    rows = []
    for name, (plant, arrangement, kind, sizes) in cases.items():
        task = Specification(
            plant, USUAL, Performance(), kind=kind, arrangement=arrangement, group_sizes=sizes
        )
        result = tune(task)
        pairs = [
            (median_time(lambda: slicot(N, 2), 1), median_time(lambda task=task: tune(task), 1))
            for _ in range(5)
        ]
        sweeps = statistics.median(seconds / unit for unit, seconds in pairs)
        seconds = statistics.median(seconds for _, seconds in pairs)
        rows.append({"case": name, "tau_p": result.tau_p, "seconds": seconds, "sweeps": sweeps})
    return rows


class _EnoughError(Exception):
    """A peer has come within 0.1 % of the best, or its time is over."""


class Day:
    """tau_P as a competent user computes it in a day: AB13MD on 61 frequencies, bisection.

    Counts its calls, and ends the search by an exception once 0.1 % above `best` or after `limit`
    seconds of processor time.
    """

    bounds = ((-2, 8), (-4, 7)) * 2  # logarithms of gain and integral time

    def __init__(self, best, limit):
        self.best, self.limit = best, limit
        self.calls, self.found, self.start = 0, np.inf, time.process_time()
        self.G = SEED_PLANT.response(OMEGA)
        self.w_I = USUAL.magnitude(OMEGA)[:, None, None]

    def __call__(self, theta):
        """Return tau_P, 1e4 where the loop is unstable."""
        self.calls += 1
        if time.process_time() - self.start > self.limit:
            raise _EnoughError
        values = np.exp(theta)
        loops = [Controller(values[0], values[1]), Controller(values[2], values[3])]
        if not is_stable(SEED_PLANT, loops):
            return 1e4
        c = np.stack([loop.response(OMEGA) for loop in loops], axis=1)
        S = np.linalg.inv(np.eye(2) + self.G * c[:, None, :])
        CS = c[:, :, None] * S
        low, high = np.log(1.0), np.log(1e4)
        for _ in range(12):  # mu = 1 by bisection in log tau_P
            middle = (low + high) / 2
            w_P = Performance(tau_p=float(np.exp(middle))).magnitude(OMEGA)[:, None, None]
            N = np.block([[self.w_I * CS @ self.G, self.w_I * CS], [w_P * S @ self.G, w_P * S]])
            low, high = (low, middle) if slicot(N, 2).max() <= 1 else (middle, high)
        self.found = min(self.found, float(np.exp(high)))
        if self.found <= 1.001 * self.best:
            raise _EnoughError
        return float(np.exp(high))


def evolution(tau_p):
    """Differential evolution."""
    differential_evolution(tau_p, Day.bounds, rng=0, popsize=15, maxiter=10**6, polish=False)


def simplices(tau_p):
    """Nelder and Mead's simplices from one random start after another."""
    rng = np.random.default_rng(0)
    low, high = np.array(Day.bounds).T
    while True:
        minimize(tau_p, rng.uniform(low, high), method="Nelder-Mead", bounds=Day.bounds)


def peers(best, seconds, limit):
    """Let both searches run over AB13MD; `ratio` is their time over `seconds`."""
    rows = []
    for search in (evolution, simplices):
        tau_p = Day(best, limit)
        with contextlib.suppress(_EnoughError):
            search(tau_p)
        used = time.process_time() - tau_p.start
        rows.append({"method": search.__name__, "calls": tau_p.calls, "tau_p": tau_p.found,
                     "reached": tau_p.found <= 1.001 * best, "seconds": used,
                     "ratio": used / seconds})  # fmt: skip
    return rows


def process(code):
    """Seconds and peak memory (MB) of a fresh interpreter that runs `code`."""
    # The system counts the parent's memory in a child's ru_maxrss; VmHWM begins at the exec.
    script = f"{code}\nprint(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])"
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return {"seconds": time.perf_counter() - start, "mb": int(done.stdout.split()[-1]) / 1024}


def show(title, rows):
    """Print rows of one shape as a table."""
    table = Table(*rows[0], title=title)
    for row in rows:
        table.add_row(*(f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values()))
    Console().print(table)


def main():
    """Run everything, print, write the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--long", type=float, metavar="SECONDS",
        help="searches over AB13MD as well, each until it is there or for so long",
    )  # fmt: skip
    arguments = parser.parse_args()
    bound_rows = bounds()
    tuning_rows = tunings()
    task = (
        "from solver.model.plants import first_order; from solver.tuning.specification import *\n"
        "from solver.model.weights import *; from solver.tuning.tuner import tune\n"
        "usual = Uncertainty.from_error(0.2, 1)\n"
        "tune(Specification(first_order(2, 1, 100, 0.949), usual, Performance()))"
    )
    starts = [
        {"process": "import solver.tuning.tuner", **process("import solver.tuning.tuner")},
        {"process": "first tuning", **process(task)},
    ]
    show("mu bound, microseconds a frequency", bound_rows)
    show("tunings, in AB13MD sweeps of 61 frequencies", tuning_rows)
    show("fresh processes", starts)
    results = {"bounds": bound_rows, "tunings": tuning_rows, "processes": starts}
    if arguments.long:
        independent = tuning_rows[1]
        results["peers"] = peers(independent["tau_p"], independent["seconds"], arguments.long)
        show("searches over AB13MD, PI independent", results["peers"])
    Path(__file__).with_name("results.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
