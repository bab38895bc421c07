"""A tuner that only waits, loaded into worker processes as a Dask preload: what remains is ours.

The time limit of the request says how long: a thousandth of it.
"""

import time

from solver.model.controllers import Controller
from solver.tuning import tuner
from solver.tuning.record import LocalOptimum, Progress, SearchSummary, Status, Tuning
from solver.tuning.specification import Specification


def tune(specification: Specification, progress: object = None) -> Tuning:
    """Stand in for `solver.tuning.tuner.tune`."""
    seconds = specification.time_limit / 1000
    began = time.monotonic()
    while (left := seconds - (time.monotonic() - began)) > 0:
        time.sleep(min(left, 0.1))
        if callable(progress):
            progress(Progress(1 - left / seconds, None, 0, 1))
    loops = tuple(Controller(1.0 + unit, 100.0) for unit in range(specification.plant.n))
    return Tuning(
        status=Status.OPTIMAL,
        objective="tau_p",
        tau_p=float(specification.seed),
        peaks=None,
        loops=loops,
        groups=tuple((unit,) for unit in range(specification.plant.n)),
        nominally_stable=True,
        search=SearchSummary(1, (LocalOptimum(1.0, 1, loops),), specification.seed, seconds),
        curves=None,
    )


def dask_setup(_worker: object) -> None:
    """Put it in place, in a worker process only."""
    tuner.tune = tune
