"""Does every seed find the best optimum? ``python -m bench.seeds [seeds]``.

All plants of SLH tables 1 to 4: tau = 10 and 100, a from 0 to 0.995, PI and PID, identical and
independent, from every seed 0, 1, ...; prints the best tau_P, the spread over the seeds, how many
end more than 0.1 per cent above the best, and the mean CPU milliseconds of a tuning.
"""

import sys
import time

import numpy as np

from solver.model.plants import first_order
from solver.model.weights import Performance, Uncertainty
from solver.tuning.specification import Arrangement, ControllerKind, Specification
from solver.tuning.tuner import tune

USUAL = Uncertainty.from_error(0.2, 1)
MISSED = 1.001


def tau_p(plant, kind, arrangement, seed):
    """Return tau_P of one tuning; infinite where none was found."""
    task = Specification(plant, USUAL, Performance(), kind=kind, arrangement=arrangement, seed=seed)
    return tune(task).tau_p or np.inf


def cases():
    """Yield kind, arrangement, tau and a of every case."""
    for kind in (ControllerKind.PI, ControllerKind.PID):
        for arrangement in (Arrangement.IDENTICAL, Arrangement.INDEPENDENT):
            for tau in (10, 100):
                for a in (0, 0.827, 0.949, 0.984, 0.995):
                    yield kind, arrangement, tau, a


def main():
    """Print a line a case."""
    seeds = range(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
    for kind, arrangement, tau, a in cases():
        started = time.process_time()
        plant = first_order(2, 1, tau, a)
        found = np.array([tau_p(plant, kind, arrangement, seed) for seed in seeds])
        milliseconds = 1e3 * (time.process_time() - started) / len(seeds)
        best = found.min()
        print(
            f"{kind.value:4}{arrangement.value:12} tau = {tau:<4} a = {a:<6} tau_P = {best:<9.6g} "
            f"spread {found.max() / best - 1:.1e}  missed {(found > MISSED * best).sum()}  "
            f"{milliseconds:.0f} ms",
            flush=True,
        )


if __name__ == "__main__":
    main()
