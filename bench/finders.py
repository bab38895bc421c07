"""Searches that know nothing of the tuner's, for ``python -m bench.zoo --tuner bench.finders:...``.

Differential evolution (Storn and Price 1997, scipy) and CMA-ES (Hansen and Ostermeier 2001, cma),
in a box of their own: gains and times `SPAN` times over and below what the plant's own numbers are.
"""

import json
import math
import warnings

import numpy as np
from scipy.optimize import differential_evolution

from bench.zoo import least_of, settings_of
from service.schemas.tunings import TuningRequest
from solver.model.controllers import Controller
from solver.model.frequencies import resonances
from solver.stability.closed_loop import unstable_poles

SPAN = 1e4
EVALUATIONS = 400  # a parameter
FREQUENCIES = 150
UNSTABLE, FORBIDDEN = 1e3, 500.0  # merits, above those of any log tau_P


class Search:
    """A request as a function of places in the cube [-1, 1]^m.

    Parameters
    ----------
    request : dict
        A tuning request, with PI or PID controllers, identical or independent.

    """

    def __init__(self, request):
        self.task = TuningRequest.model_validate_json(json.dumps(request)).build()
        plant, elements = self.task.plant, self.task.plant.elements
        self.derivative = request["controller"]["kind"] == "PID"
        self.identical = request["controller"]["arrangement"] == "identical"
        times = [1 / abs(p) for f in elements for p in f.poles if abs(p) > 0]
        times += [f.dead_time for f in elements if f.dead_time > 0]
        times.append(request["uncertainty"]["theta"])
        self.middle = math.exp(np.mean(np.log(times)))
        usual = np.geomspace(1e-4 / self.middle, 1e5 / self.middle, FREQUENCIES)
        self.omega = np.union1d(usual, resonances(plant))
        self.gains = []
        for unit in range(1 if self.identical else plant.n):
            own = plant.element(unit, unit)
            sign = -1 if own.static_gain < 0 else 1
            self.gains.append(sign / float(abs(own.response(1 / self.middle)[0])))
        self.size = len(self.gains) * (3 if self.derivative else 2)

    def loops(self, place):
        """Return the controllers of a place (m,), one a unit."""
        rows = (np.clip(place, -1, 1) * math.log(SPAN)).reshape(len(self.gains), -1)
        made = [
            Controller(gain * math.exp(row[0]), self.middle * math.exp(row[1]),
                       self.middle * math.exp(row[2]) if self.derivative else None)
            for gain, row in zip(self.gains, rows, strict=True)
        ]  # fmt: skip
        return made * self.task.plant.n if self.identical else made

    def merit(self, place):
        """Return log tau_P, or what leads out of places that are unstable or meet no demand."""
        outside = float(np.abs(place - np.clip(place, -1, 1)).sum())
        loops = self.loops(place)
        if unstable_poles(self.task.plant, loops):
            return UNSTABLE + float(np.mean(place)) + outside
        found = least_of(self.task, loops, self.omega)
        broken = ~np.isfinite(found)
        return (FORBIDDEN + 100 * broken.mean() if broken.any() else found.max()) + outside

    def settings(self, place):
        """Return the settings of a place, or None where they meet no demand."""
        if not self.merit(place) < FORBIDDEN:
            return None
        return [settings_of(each) for each in self.loops(place)]


def cma_es(request, seed):
    """Return the settings that CMA-ES finds, from new places as long as evaluations are left."""
    from cma import CMAEvolutionStrategy  # noqa: PLC0415 - of the extra bench, for this alone

    warnings.simplefilter("ignore")
    search, rng = Search(request), np.random.default_rng(seed)
    left, best, lowest = EVALUATIONS * search.size, None, math.inf
    while left > 0:
        strategy = CMAEvolutionStrategy(
            rng.uniform(-0.5, 0.5, search.size), 0.3,
            {"seed": int(rng.integers(1, 2**31)), "maxfevals": left, "verbose": -9,
             "tolfun": 1e-7},
        )  # fmt: skip
        strategy.optimize(search.merit)
        left -= strategy.result.evaluations
        if strategy.result.fbest < lowest:
            best, lowest = strategy.result.xbest, strategy.result.fbest
    return search.settings(best)


def evolution(request, seed):
    """Return the settings that differential evolution finds, or None."""
    search = Search(request)
    population = 8
    found = differential_evolution(
        search.merit, [(-1, 1)] * search.size, rng=seed, popsize=population, polish=False,
        maxiter=EVALUATIONS // population - 1, tol=1e-9, init="sobol",
    )  # fmt: skip
    return search.settings(found.x)
