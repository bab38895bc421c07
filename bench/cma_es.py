"""Does another method find better settings? ``python -m bench.cma_es [runs]``.

CMA-ES (Hansen and Ostermeier 2001), which knows neither gradients nor the structure, on the same
objective with the same bounds, for all plants of SLH tables 1 to 4: `runs` long runs a case (3)
from different points, each ended by the tuner's last descent, since the grid misses what lies
between its points. Prints tau_P of the tuner, of CMA-ES, and by how many per cent the tuner is
behind; needs the extra `bench`.
"""

import sys
import warnings

import numpy as np
from cma import CMAEvolutionStrategy
from seeds import USUAL, cases, tau_p

from solver.model.plants import first_order
from solver.model.weights import Performance
from solver.tuning.groupings import groupings
from solver.tuning.search import Freedom, GroupingSearch
from solver.tuning.specification import Specification

EVALUATIONS = 1000  # a parameter and run
UNSTABLE = 1e3


def evolve(search, seed):
    """Return the value of s at which one run of CMA-ES ends; infinite where none is feasible."""
    box = search.box
    width = box.high - box.low

    def merit(place):
        theta = box.low + width * np.clip(place, 0, 1)
        outside = np.abs(place - np.clip(place, 0, 1)).sum()
        value = search.objective.evaluate(theta).merit
        # An unstable loop has no value; lower gains lead out.
        size = UNSTABLE + theta[:: search.objective.per_controller].sum()
        return (value if np.isfinite(value) else size) + 10 * outside

    budget = EVALUATIONS * width.size
    strategy = CMAEvolutionStrategy(
        np.random.default_rng(seed).random(width.size), 0.3,
        {"seed": seed + 1, "maxfevals": budget, "verbose": -9, "tolfun": 1e-9},
    )  # fmt: skip
    strategy.optimize(merit)
    theta = box.low + width * np.clip(strategy.result.xbest, 0, 1)
    candidate = search.exact.descend(theta)
    return np.inf if candidate is None else candidate.value


def main():
    """Print a line a case."""
    warnings.simplefilter("ignore")
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    worst = 0.0
    for kind, arrangement, tau, a in cases():
        plant = first_order(2, 1, tau, a)
        task = Specification(plant, USUAL, Performance(), kind=kind, arrangement=arrangement)
        search = GroupingSearch(task, Freedom.usual(task, groupings(task)[0]), lambda: None)
        found = min(evolve(search, seed) for seed in range(runs))
        ours = tau_p(plant, kind, arrangement, 0)
        behind = 100 * (ours / np.exp(found) - 1)
        worst = max(worst, behind)
        print(
            f"{kind.value:4}{arrangement.value:12} tau = {tau:<4} a = {a:<6} "
            f"tuner {ours:<9.6g} CMA-ES {np.exp(found):<9.6g} behind {behind:+.4f} %",
            flush=True,
        )
    print(f"the tuner is behind by {worst:.4f} % at most")


if __name__ == "__main__":
    main()
