"""A tuner that does as it is told, loaded into worker processes as a Dask preload.

The seed of the request says what: end at once, take a time, ignore its callback, kill its process.
"""

import os
import time

from solver.model.controllers import Controller
from solver.model.errors import UnsupportedPlantError
from solver.tuning import tuner
from solver.tuning.record import LocalOptimum, Progress, SearchSummary, Status, Tuning

SLOW, STUCK, DEADLY, UNSUPPORTED, BROKEN = 1, 2, 3, 4, 5


def tune(specification, progress=None):
    """Stand in for `solver.tuning.tuner.tune`; SLOW runs for `starts` hundredths of a second."""
    stopped = False
    match specification.seed:
        case s if s == SLOW:
            steps = specification.starts or 1
            for step in range(steps):
                if progress(Progress(step / steps, 100.0 - step, step, steps)):
                    stopped = True
                    break
                time.sleep(0.01)
        case s if s == STUCK:
            time.sleep(3600)
        case s if s == DEADLY:
            os._exit(1)
        case s if s == UNSUPPORTED:
            message = "open-loop unstable"
            raise UnsupportedPlantError(message, "/plant/process/den")
        case s if s == BROKEN:
            message = "a fault of the solver"
            raise RuntimeError(message)
    loops = tuple(
        Controller(1.0 + unit, specification.plant.process.den[0])
        for unit in range(specification.plant.n)
    )
    return Tuning(
        status=Status.TIME_LIMIT if stopped else Status.OPTIMAL,
        objective="tau_p",
        tau_p=float(specification.seed),
        peaks=None,
        loops=loops,
        groups=tuple((unit,) for unit in range(specification.plant.n)),
        nominally_stable=True,
        search=SearchSummary(1, (LocalOptimum(1.0, 1, loops),), specification.seed, 0.0),
        curves=None,
    )


def dask_setup(_worker):
    """Put it in place, in a worker process only."""
    tuner.tune = tune
