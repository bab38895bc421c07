"""Tuners beside the best known settings: ``python -m bench.zoo [--tuner MODULE:FUNCTION] ...``.

A tuner is a function of a tuning request (the JSON of the API, as a dict) and a seed that returns
the loops, one dict a unit, or None; mutune's own is the default. Its settings are judged by the
zoo: the least tau_P at which their peak of mu over all frequencies is 1, whatever the tuner says.
``bench/zoo/best.json`` has the best known settings and who found them, and the best that each tuner
has reached; ``--record`` adds better ones, after AB13MD on a long fine grid has agreed. ``--table``
shows what is recorded. `bench.finders` has searches that know nothing of the tuner's.
"""

import argparse
import importlib
import json
import math
import time
from pathlib import Path

import numpy as np
from ctrlsys import ab13md

from bench import zoo_cases
from service.schemas.tunings import TuningRequest
from solver.model.blocks import group_loops
from solver.model.controllers import Controller
from solver.mu.scaling import sweep
from solver.robustness.axis import proven_peaks
from solver.stability.closed_loop import unstable_poles
from solver.tuning.goals import TauGoal
from solver.tuning.tuner import tune

BEST = Path(__file__).parent / "zoo" / "best.json"
MISSED = 1.001
FINE = 2000  # frequencies at which AB13MD agrees, fewer the more loops there are
LOOPS = 3  # above so many, since its time grows as their fourth power
AGREEMENT = 1e-6


def mutune(request, seed):
    """Return the settings that mutune finds."""
    wanted = {**request, "search": {**request["search"], "seed": seed}}
    result = tune(TuningRequest.model_validate_json(json.dumps(wanted)).build())
    return [settings_of(loop) for loop in result.loops] or None


def settings_of(loop):
    """Return a controller as a dict."""
    return {
        "gain": loop.gain, "integral_time": loop.integral_time,
        "derivative_time": loop.derivative_time, "filter_time": loop.filter_time,
    }  # fmt: skip


def value(task, settings):
    """Return the least tau_P that settings reach, its peak proven; infinite where none serves."""
    loops = [Controller(**each) for each in settings]
    if unstable_poles(task.plant, loops):
        return math.inf
    low, tau_p = 0.0, least(task, loops, np.geomspace(1e-9, 1e9, 1500))
    for _ in range(20):
        if not math.isfinite(tau_p):
            break
        performance = task.performance.with_tau_p(tau_p)
        top = proven_peaks(task.plant, task.uncertainty, performance, loops).peaks
        peak = top.robust_performance
        if peak.value <= 1 + 2e-8:
            break
        low, tau_p = tau_p, max(tau_p, least(task, loops, np.array([peak.omega])))
        if tau_p <= low:
            break
    return tau_p


def least(task, loops, omega):
    """Return the tau_P that the frequencies demand."""
    return float(np.exp(least_of(task, loops, omega).max()))


def least_of(task, loops, omega):
    """Return log of the tau_P that each frequency demands, (k,)."""
    goal = TauGoal(task.performance)
    outputs = task.performance.output_scale
    blocks, controllers = group_loops(task.plant, loops, task.uncertainty, outputs)
    c = np.stack([each.response(omega) for each in controllers], axis=-1)
    level = levels(blocks, c, blocks.squared(task.uncertainty, omega), omega)
    return goal.attained(level, omega)


def levels(blocks, c, u, omega):
    """Log of the largest permitted |w_P|^2, (k,)."""
    y = np.zeros((omega.size, blocks.n_scales))
    all_free = False
    cold = True
    return sweep(
        blocks.packed(omega), c, u, np.ones_like(omega), blocks.layout, all_free, 1e-9, cold, y
    )[0]


def agrees(task, settings, tau_p):
    """Whether AB13MD finds mu <= 1 on a long fine grid."""
    loops = [Controller(**each) for each in settings]
    n = task.plant.n
    times = [each.integral_time for each in loops] + [tau_p]
    omega = np.geomspace(
        1e-3 / max(times), 1e3 / min(times), round(FINE * min((LOOPS / n) ** 3, 1))
    )
    G = task.plant.response(omega)
    c = np.stack([each.response(omega) for each in loops], axis=1)
    S = np.linalg.inv(np.eye(n) + G * c[:, None, :])
    CS = c[:, :, None] * S
    # The inputs in units in which the plant's columns are alike: mu is the same, and AB13MD, which
    # fails on numbers far apart, finds it.
    unit = np.linalg.norm(G, axis=1)
    e = np.array(task.performance.output_scale or (1.0,) * n)
    w_I = task.uncertainty.magnitude(omega)[:, None, None]
    w_P = task.performance.with_tau_p(tau_p).magnitude(omega)[:, None, None]
    CS, G = unit[:, :, None] * CS, G / unit[:, None, :]
    # Outputs in units of the errors permitted.
    S, CS, G = S * e / e[:, None], CS * e, G / e[:, None]
    N = np.block([[w_I * CS @ G, w_I * CS], [w_P * S @ G, w_P * S]])
    sizes, kinds = np.array([1] * n + [n], np.int32), np.full(n + 1, 2, np.int32)
    return max(ab13md(each, sizes, kinds)[0] for each in N) <= 1 + AGREEMENT


def guarantee(task, entry):
    """Return whether recorded settings are proven stable, with mu at its level everywhere."""
    loops = [Controller(**each) for each in entry["loops"]]
    performance = task.performance.with_tau_p(entry["tau_p"] * (1 + AGREEMENT))
    axis = proven_peaks(task.plant, task.uncertainty, performance, loops)
    if axis.peaks.robust_performance.value > 1 + AGREEMENT:
        return "broken"
    return axis.guarantee.status.value


def table(best):
    """Print what is recorded, proven anew, and by how many per cent each tuner is behind."""
    requests = {case: request for case, _, request in zoo_cases.cases()}
    names = sorted({name for entry in best.values() for name in entry["reached"]})
    print("| case | best known tau_P | guarantee | " + " | ".join(names) + " |")
    print("| --- | ---: | --- |" + " ---: |" * len(names))
    for case, entry in best.items():
        task = TuningRequest.model_validate_json(json.dumps(requests[case])).build()
        behind = [
            f"{100 * (entry['reached'][name] / entry['tau_p'] - 1):.2f}"
            if name in entry["reached"]
            else "-"
            for name in names
        ]
        proven = guarantee(task, entry)
        print(f"| {case} | {entry['tau_p']:.6g} | {proven} | " + " | ".join(behind) + " |")


def record(entry, name, seed, tau_p, settings, source):
    """Return the entry of a case with what a tuner has reached, and its settings if better."""
    entry = entry or {"tau_p": math.inf, "reached": {}}
    reached = min(tau_p, entry["reached"].get(name, math.inf))
    entry = {**entry, "reached": {**entry["reached"], name: float(f"{reached:.9g}")}}
    if tau_p < entry["tau_p"] * (1 - 1e-6):
        entry |= {"tau_p": float(f"{tau_p:.9g}"), "loops": settings,
                  "found_by": f"{name}, seed {seed}", "source": source}  # fmt: skip
    return entry


def main():
    """Print a line a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tuner", default="bench.zoo:mutune", help="MODULE:FUNCTION")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--only", default="", help="cases whose name has this text")
    parser.add_argument("--record", action="store_true", help="keep what is reached")
    parser.add_argument("--table", action="store_true", help="print what is recorded, no more")
    arguments = parser.parse_args()
    if arguments.table:
        table(json.loads(BEST.read_text()))
        return
    module, _, name = arguments.tuner.partition(":")
    call = getattr(importlib.import_module(module), name)
    missed = total = 0
    for case, source, request in zoo_cases.cases():
        if arguments.only not in case:
            continue
        task = TuningRequest.model_validate_json(json.dumps(request)).build()
        for seed in range(arguments.seeds):
            started = time.process_time()
            settings = call(request, seed)
            seconds = time.process_time() - started
            tau_p = value(task, settings) if settings else math.inf
            best = json.loads(BEST.read_text())  # another tuner may be at work beside
            known = best.get(case, {}).get("tau_p", math.inf)
            total += 1
            missed += tau_p > MISSED * known or not math.isfinite(tau_p)
            mark = " MISSED" if tau_p > MISSED * known else ""
            print(f"{case:48} seed {seed} tau_P {tau_p:<11.6g} best known {known:<11.6g} "
                  f"{seconds:6.2f} s{mark}", flush=True)  # fmt: skip
            better = tau_p < known * (1 - 1e-6)
            if arguments.record and math.isfinite(tau_p) and (
                not better or agrees(task, settings, tau_p)
            ):  # fmt: skip
                best[case] = record(best.get(case), name, seed, tau_p, settings, source)
                BEST.write_text(json.dumps(best, indent=1, sort_keys=True) + "\n")
    print(f"{total} tunings, {missed} more than 0.1 % behind the best known, or without settings")


if __name__ == "__main__":
    main()
