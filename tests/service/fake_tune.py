"""A tuner that does as it is told, loaded into worker processes as a Dask preload.

The seed of the request says what: end at once, take a time, run until it is stopped, ignore its
callback, kill its process. One that is HELD runs until the file is there that the environment of
its process names as FAKE_TUNER_HOLDS, and ends at once where there is no such name.
"""

import os
import time
from pathlib import Path

from solver.model.controllers import Controller
from solver.model.errors import UnsupportedPlantError
from solver.tuning import tuner
from solver.tuning.record import LocalOptimum, Progress, SearchSummary, Status, Tuning

SLOW, STUCK, DEADLY, UNSUPPORTED, BROKEN, ENDLESS, HELD = 1, 2, 3, 4, 5, 6, 7


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
        case s if s == ENDLESS:
            stopped = _is_stopped(progress, "no such file")
        case s if s == HELD and (end := os.environ.get("FAKE_TUNER_HOLDS")):
            stopped = _is_stopped(progress, end)
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


def _is_stopped(progress, end):
    """Run until the file `end` is there, or `progress` wants no more; return whether it did."""
    step = 0
    while not Path(end).exists():
        if progress(Progress(step / (step + 100), 100.0, step, step + 1)):
            return True
        time.sleep(0.01)
        step += 1
    return False


def dask_setup(_worker):
    """Put it in place, in a worker process only."""
    tuner.tune = tune
