"""Are plants found again within their own intervals, and do covers hold: a count.

    python -m bench.recovery [--plants 30] [--auto]

Draws plants of two inputs and two outputs of every form, moves both inputs at random, adds noise of
several colours, identifies, and counts: true parameters within their 95 per cent intervals, new
plants of the fitted distribution below the weight at every frequency, true plants below it. With
--auto the forms are chosen by the data too; intervals are then counted where the form is right.
"""

import argparse
import math
import time as clock

import numpy as np

import mutune
from solver.identification.selection import Allowed

SAMPLES = 600
NEW = 1000  # plants drawn to try a weight
NOISE = 0.05  # of the output's range


def moves(generator):
    """Return a staircase that holds its levels from 10 to 80 samples."""
    u = np.zeros(SAMPLES)
    at = int(generator.integers(5, 20))
    while at < SAMPLES:
        length = int(generator.integers(10, 80))
        u[at : at + length] = generator.choice([-1.0, 0.0, 1.0])
        at += length
    return u


def first(t, lag):
    """Return the step response of 1/(lag s + 1)."""
    return -np.expm1(-np.maximum(t, 0) / lag)


def draw_first(g):
    """Return parameters and step response of a gain with one lag."""
    K, lag, dead = gain(g), log_uniform(g, 4, 60), g.uniform(0, 15)
    return {"gain": K, "time_constant": lag, "dead_time": dead}, lambda t: K * first(t - dead, lag)


def draw_second(g):
    """Return the same with two lags."""
    K, a, dead = gain(g), log_uniform(g, 6, 60), g.uniform(0, 15)
    b = a * g.uniform(0.2, 0.7)
    told = {"gain": K, "time_constant_sum": a + b, "first_time_constant": a,
            "second_time_constant": b, "dead_time": dead}  # fmt: skip
    return told, lambda t: K * (a * first(t - dead, a) - b * first(t - dead, b)) / (a - b)


def draw_integrator(g):
    """Return the same of an integrator."""
    K, dead = gain(g) / 20, g.uniform(0, 15)
    return {"velocity_gain": K, "dead_time": dead}, lambda t: K * np.maximum(t - dead, 0)


def draw_integrator_lag(g):
    """Return the same of an integrator with a lag."""
    K, lag, dead = gain(g) / 20, log_uniform(g, 4, 40), g.uniform(0, 15)
    return (
        {"velocity_gain": K, "time_constant": lag, "dead_time": dead},
        lambda t: K * (np.maximum(t - dead, 0) - lag * first(t - dead, lag)),
    )


def gain(g):
    """Return a gain of either sign."""
    return float(g.choice([-1, 1]) * g.uniform(0.5, 3))


def log_uniform(g, low, high):
    """Return a number with uniform logarithm."""
    return math.exp(g.uniform(math.log(low), math.log(high)))


FORMS = {
    "first": (draw_first, Allowed(1, integrating=False)),
    "second": (draw_second, Allowed(2, integrating=False)),
    "integrator": (draw_integrator, Allowed(1, integrating=True)),
    "integrator, lag": (draw_integrator_lag, Allowed(2, integrating=True)),
}


def forgetting(generator, memory):
    """Return noise of deviation 1 that forgets within `memory` samples."""
    keep = math.exp(-1 / memory)
    d = generator.standard_normal(SAMPLES)
    for k in range(1, SAMPLES):
        d[k] = keep * d[k - 1] + math.sqrt(1 - keep * keep) * d[k]
    return d


NOISES = {
    "white": lambda g: g.standard_normal(SAMPLES),
    "memory 5": lambda g: forgetting(g, 5),
    "memory 30": lambda g: forgetting(g, 30),
    "memory 30 + white": lambda g: 0.8 * forgetting(g, 30) + 0.6 * g.standard_normal(SAMPLES),
}


def record(form, noise, seed):
    """Return elements by row and their record."""
    g = np.random.default_rng(seed)
    draw = FORMS[form][0]
    truth = [[draw(g) for _ in range(2)] for _ in range(2)]
    time = np.arange(float(SAMPLES))
    u = [moves(g) for _ in range(2)]
    outputs = {}
    for i, row in enumerate(truth):
        y = np.zeros(SAMPLES)
        for (_, step), moved in zip(row, u, strict=True):
            for k in np.flatnonzero(np.diff(moved)) + 1:
                y += (moved[k] - moved[k - 1]) * step(time - time[k])
        outputs[f"y{i}"] = y + NOISE * np.ptp(y) * NOISES[noise](g)
    return truth, mutune.Record(time, {"u0": u[0], "u1": u[1]}, outputs)


def below(found, responses):
    """Return the share of plants whose every error is below the weight."""
    cover = found.cover
    G = found.plant.response(cover.omega)
    E = np.linalg.solve(np.broadcast_to(G, responses.shape), responses - G)
    size = np.linalg.norm(E, 2, axis=(-2, -1))
    return float(np.mean(np.all(size <= cover.weight.magnitude(cover.omega), axis=1)))


def count(truth, found):
    """Return how many of the true parameters lie in their intervals, and how many there are."""
    hits = total = 0
    for (told, _), element in zip([e for row in truth for e in row], found.elements, strict=True):
        estimates = {e.name: e for e in element.estimates}
        if estimates.keys() != told.keys():
            continue
        for name, value in told.items():
            one = estimates[name]
            if one.low is not None:
                hits += one.low <= value <= one.high
                total += 1
    return hits, total


def true_response(truth, omega):
    """Return G(j omega) of the true elements."""
    s = 1j * omega
    G = np.empty((omega.size, 2, 2), complex)
    for i, row in enumerate(truth):
        for j, (told, _) in enumerate(row):
            value = np.exp(-told["dead_time"] * s) * told.get("gain", 1.0)
            if "velocity_gain" in told:
                value = value * told["velocity_gain"] / s
            lags = (
                [told["first_time_constant"], told["second_time_constant"]]
                if "first_time_constant" in told
                else [told.get("time_constant", 0.0)]
            )
            for lag in lags:
                value = value / (lag * s + 1)
            G[:, i, j] = value
    return G


def main():
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--plants", type=int, default=30)
    parser.add_argument("--auto", action="store_true")
    parser.add_argument("--noise", choices=NOISES, action="append")
    asked = parser.parse_args()
    print("form              noise              parameters  in interval  new below  true below  s")
    whole = np.zeros(2)
    for form in FORMS:
        for noise in asked.noise or NOISES:
            hits = np.zeros(2)
            new, true = [], []
            begin = clock.perf_counter()
            for seed in range(asked.plants):
                truth, one = record(form, noise, seed)
                allowed = Allowed() if asked.auto else FORMS[form][1]
                found = mutune.identify([one], allowed=allowed)
                hits += count(truth, found)
                generator = np.random.default_rng(1000 + seed)
                new.append(below(found, found.draw(NEW, generator, found.cover.omega)))
                true.append(below(found, true_response(truth, found.cover.omega)[None]))
            whole += hits
            each = (clock.perf_counter() - begin) / asked.plants
            print(
                f"{form:16}  {noise:17}  {hits[1]:10.0f}  {hits[0] / max(hits[1], 1):11.3f}"
                f"  {np.mean(new):9.4f}  {np.mean(true):10.2f}  {each:.2f}",
                flush=True,
            )
    print(f"all: {whole[0] / whole[1]:.3f} of {whole[1]:.0f}")


if __name__ == "__main__":
    main()
