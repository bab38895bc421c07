"""mu bounds and whole tunings beside their peers: ``python bench/compare.py [--long]``.

Prints tables and writes bench/results.json. Times are medians on one thread; the unit is one
sweep of SLICOT's AB13MD over 61 frequencies, timed in the same run. ``--long`` adds differential
evolution over AB13MD, which takes minutes.
"""

import argparse
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
from scipy.optimize import differential_evolution

from solver.blocks import group_loops
from solver.controllers import Controller
from solver.mu import BlockStructure, sdp, upper_bound
from solver.mu.kernel import COLD, FINE
from solver.mu.scaling import sweep
from solver.plants import first_order
from solver.robustness import LoopAnalysis
from solver.stability import is_stable
from solver.tuning import Arrangement, ControllerKind, Specification, tune
from solver.weights import Performance, Uncertainty

USUAL = Uncertainty.from_error(0.2, 1)
OMEGA = np.geomspace(1e-4, 1e2, 61)
SEED_PLANT = first_order(2, 1, 100, 0.949)


def median_time(call, repeats):
    """Median seconds of `call`, after one run that is not counted."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
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
        G, u = analysis.blocks.packed(OMEGA), USUAL.magnitude(OMEGA) ** 2
        b = analysis.performance.magnitude(OMEGA) ** 2
        y = np.zeros((OMEGA.size, n))

        def cold(G=G, c=c, u=u, b=b, layout=analysis.blocks.layout, y=y):
            y[:] = 0
            sweep(G, c, u, b, layout, True, COLD, FINE, True, y)  # noqa: FBT003

        def warm(G=G, c=c, u=u, b=b, layout=analysis.blocks.layout, y=y):
            sweep(G, c, u, b, layout, True, 1e-7, 1e-7, False, y)  # noqa: FBT003

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


def tunings(sweep_seconds):
    """Whole tunings, in AB13MD sweeps of 61 frequencies."""
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
        seconds = median_time(lambda task=task: tune(task), 1)
        rows.append({"case": name, "tau_p": result.tau_p, "seconds": seconds,
                     "sweeps": seconds / sweep_seconds})  # fmt: skip
    return rows


def evolution(best, limit=900.0):
    """Differential evolution over AB13MD until within 0.1 % of `best`, or `limit` seconds."""
    G = SEED_PLANT.response(OMEGA)
    w_I = USUAL.magnitude(OMEGA)[:, None, None]
    start, calls, found = time.perf_counter(), 0, np.inf

    def tau_p(theta):
        nonlocal calls, found
        calls += 1
        values = np.exp(theta)
        loops = [Controller(values[0], values[1]), Controller(values[2], values[3])]
        if not is_stable(SEED_PLANT, loops):
            return 1e4
        c = np.stack([loop.response(OMEGA) for loop in loops], axis=1)
        S = np.linalg.inv(np.eye(2) + G * c[:, None, :])
        CS = c[:, :, None] * S
        low, high = np.log(1.0), np.log(1e4)
        for _ in range(12):  # mu = 1 by bisection in log tau_P
            middle = (low + high) / 2
            w_P = Performance(tau_p=float(np.exp(middle))).magnitude(OMEGA)[:, None, None]
            N = np.block([[w_I * CS @ G, w_I * CS], [w_P * S @ G, w_P * S]])
            low, high = (low, middle) if slicot(N, 2).max() <= 1 else (middle, high)
        found = min(found, float(np.exp(high)))
        return float(np.exp(high))

    differential_evolution(
        tau_p, [(-2, 8), (-4, 7)] * 2, seed=0, popsize=15, maxiter=1000, polish=False,
        callback=lambda *_: found <= 1.001 * best or time.perf_counter() - start > limit,
    )  # fmt: skip
    return {"seconds": time.perf_counter() - start, "calls": calls, "tau_p": found}


def process(code):
    """Seconds and peak memory (MB) of a fresh interpreter that runs `code`."""
    script = f"{code}\nimport resource\nprint(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
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
    parser.add_argument("--long", action="store_true", help="differential evolution as well")
    arguments = parser.parse_args()
    bound_rows = bounds()
    sweep_seconds = 61e-6 * bound_rows[0]["ab13md_us"]
    tuning_rows = tunings(sweep_seconds)
    task = (
        "from solver.plants import first_order; from solver.tuning import *\n"
        "from solver.weights import *\n"
        "usual = Uncertainty.from_error(0.2, 1)\n"
        "tune(Specification(first_order(2, 1, 100, 0.949), usual, Performance()))"
    )
    starts = [
        {"process": "import solver.tuning", **process("import solver.tuning")},
        {"process": "first tuning", **process(task)},
    ]
    show("mu bound, microseconds a frequency", bound_rows)
    show("tunings, in AB13MD sweeps of 61 frequencies", tuning_rows)
    show("fresh processes", starts)
    results = {"bounds": bound_rows, "tunings": tuning_rows, "processes": starts}
    if arguments.long:
        results["evolution"] = evolution(tuning_rows[1]["tau_p"])
        results["evolution"]["ratio"] = results["evolution"]["seconds"] / tuning_rows[1]["seconds"]
        show("differential evolution over AB13MD, PI independent", [results["evolution"]])
    Path(__file__).with_name("results.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
