"""Tuners beside the best known settings: ``python -m bench.zoo [--tuner MODULE:FUNCTION] ...``.

A tuner is a function of a tuning request (the JSON of the API, as a dict) and a seed that returns
the loops, one dict a unit, or None; mutune's own is the default. Its settings are judged by the
zoo: the least tau_P at which their peak of mu over all frequencies is 1, whatever the tuner says.
``bench/zoo/best.json`` has the best known settings and who found them; ``--record`` adds better
ones, after AB13MD on a long fine grid has agreed. ``--finder`` searches with CMA-ES in a box of its
own, which knows nothing of the tuner's.
"""

import argparse
import importlib
import json
import math
import time
import warnings
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
FINE = 2000  # frequencies at which AB13MD agrees
AGREEMENT = 1e-6
SPAN = 1e4  # the finder's box: times and gains over and below what the plant's own numbers are
EVALUATIONS = 400  # of the finder, a parameter


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
    goal = TauGoal(task.performance)
    blocks, controllers = group_loops(task.plant, loops, task.uncertainty)
    c = np.stack([each.response(omega) for each in controllers], axis=-1)
    level = levels(blocks, c, task.uncertainty.squared(omega, blocks.units), omega)
    return float(np.exp(goal.attained(level, omega).max()))


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
    omega = np.geomspace(1e-3 / max(times), 1e3 / min(times), FINE)
    G = task.plant.response(omega)
    c = np.stack([each.response(omega) for each in loops], axis=1)
    S = np.linalg.inv(np.eye(n) + G * c[:, None, :])
    CS = c[:, :, None] * S
    # The inputs in units in which the plant's columns are alike: mu is the same, and AB13MD, which
    # fails on numbers far apart, finds it.
    unit = np.linalg.norm(G, axis=1)
    w_I = task.uncertainty.magnitude(omega)[:, None, None]
    w_P = task.performance.with_tau_p(tau_p).magnitude(omega)[:, None, None]
    CS, G = unit[:, :, None] * CS, G / unit[:, None, :]
    N = np.block([[w_I * CS @ G, w_I * CS], [w_P * S @ G, w_P * S]])
    sizes, kinds = np.array([1] * n + [n], np.int32), np.full(n + 1, 2, np.int32)
    return max(ab13md(each, sizes, kinds)[0] for each in N) <= 1 + AGREEMENT


def finder(request, seed):
    """Return the settings that CMA-ES finds in a box of its own, or None."""
    from cma import CMAEvolutionStrategy  # noqa: PLC0415 - of the extra bench, for this alone

    warnings.simplefilter("ignore")
    task = TuningRequest.model_validate_json(json.dumps(request)).build()
    plant, derivative = task.plant, request["controller"]["kind"] == "PID"
    identical = request["controller"]["arrangement"] == "identical"
    times = [1 / abs(p) for f in plant.elements for p in f.poles if abs(p) > 0]
    times += [f.dead_time for f in plant.elements if f.dead_time > 0] + [
        request["uncertainty"]["theta"]
    ]
    middle = math.exp(np.mean(np.log([t for t in times if t > 0])))
    scale, omega = [], np.geomspace(1e-4 / middle, 1e5 / middle, 150)
    for unit in range(1 if identical else plant.n):
        own = plant.element(unit, unit)
        sign = -1 if own.static_gain < 0 else 1
        scale.append((sign, 1 / float(abs(own.response(1 / middle)[0]))))

    def loops_of(place):
        rows = (np.asarray(place) * math.log(SPAN)).reshape(len(scale), -1)
        made = [
            Controller(sign * gain * math.exp(row[0]), middle * math.exp(row[1]),
                       middle * math.exp(row[2]) if derivative else None)
            for (sign, gain), row in zip(scale, rows, strict=True)
        ]  # fmt: skip
        return made * plant.n if identical else made

    def merit(place):
        outside = float(np.abs(place - np.clip(place, -1, 1)).sum())
        loops = loops_of(np.clip(place, -1, 1))
        if unstable_poles(plant, loops):
            return 1e3 + float(np.mean(place)) + outside
        found = least(task, loops, omega)
        return (math.log(found) if math.isfinite(found) else 500.0) + outside

    size = len(scale) * (3 if derivative else 2)
    strategy = CMAEvolutionStrategy(
        np.random.default_rng(seed).uniform(-0.5, 0.5, size), 0.3,
        {"seed": seed + 1, "maxfevals": EVALUATIONS * size, "verbose": -9, "tolfun": 1e-9},
    )  # fmt: skip
    strategy.optimize(merit)
    return [settings_of(each) for each in loops_of(np.clip(strategy.result.xbest, -1, 1))]


def main():
    """Print a line a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tuner", default="", help="MODULE:FUNCTION; mutune if absent")
    parser.add_argument("--finder", action="store_true", help="CMA-ES in the place of a tuner")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--only", default="", help="cases whose name has this text")
    parser.add_argument("--record", action="store_true", help="keep better settings")
    arguments = parser.parse_args()
    name, call = "mutune", mutune
    if arguments.finder:
        name, call = "CMA-ES", finder
    elif arguments.tuner:
        module, _, function = arguments.tuner.partition(":")
        name, call = arguments.tuner, getattr(importlib.import_module(module), function)
    best = json.loads(BEST.read_text()) if BEST.exists() else {}
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
            known = best.get(case, {}).get("tau_p", math.inf)
            total += 1
            missed += tau_p > MISSED * known or not math.isfinite(tau_p)
            mark = " MISSED" if tau_p > MISSED * known else ""
            print(f"{case:48} seed {seed} tau_P {tau_p:<11.6g} best known {known:<11.6g} "
                  f"{seconds:6.2f} s{mark}", flush=True)  # fmt: skip
            better = tau_p < known * (1 - 1e-6)
            if arguments.record and better and agrees(task, settings, tau_p):
                best[case] = {"tau_p": float(f"{tau_p:.9g}"), "loops": settings,
                              "found_by": f"{name}, seed {seed}", "source": source}  # fmt: skip
                BEST.write_text(json.dumps(best, indent=1, sort_keys=True) + "\n")
    print(f"{total} tunings, {missed} more than 0.1 % behind the best known, or without settings")


if __name__ == "__main__":
    main()
