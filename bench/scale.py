"""How many jobs a minute one dispatcher takes from acceptance to a written end, with stub jobs.

``python -m bench.scale [--jobs 5000] [--workers 10 100 1000] [--postgresql]`` accepts the jobs as
batches of one caller and of ten, and lets the service's own dispatcher run them on an engine whose
workers return at once what a small tuning returns. Nothing is computed: what remains is the table,
its queue and the dispatcher, in one process. Memory, encryption and the network of Dask are not in
it; `bench/service.py` measures those with real workers.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from bench.chaos import Database
from service.jobs import database
from service.jobs.dispatcher import Dispatcher
from service.jobs.queue import Queue
from service.jobs.records import JobStatus, NewJob, Outcome
from service.jobs.store import Store
from service.jobs.transactions import Transactions
from service.jobs.watch import Watcher

# As long as that of two units with its curves; digits that nothing foretells.
RESULT = json.dumps({"curves": np.random.default_rng(0).random(900).tolist()})


class StubEngine:
    """As many idle workers as wanted, each of which returns a result at once."""

    def __init__(self, workers: int) -> None:
        self.workers = workers

    async def run(
        self,
        resource: str,
        request: str,
        time_limit: float,
        on_progress: Callable[[float, float | None], None],
        enough: asyncio.Event,
    ) -> Outcome:
        """Return a result."""
        del resource, request, time_limit, on_progress, enough
        await asyncio.sleep(0)
        return Outcome(JobStatus.SUCCEEDED, RESULT, best=1.0)


@contextmanager
def connections(*, postgresql: bool) -> Iterator[str]:
    """Yield the URL of an empty database."""
    with tempfile.TemporaryDirectory(prefix="mutune-scale-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        if not postgresql:
            yield f"sqlite:///{folder / 'scale.sqlite3'}"
            return
        (folder / "postgres").mkdir()
        server = Database(folder / "postgres")
        server.start()
        try:
            yield server.url
        finally:
            server.kill()


async def run(url: str, jobs: int, workers: int, callers: int) -> tuple[float, float, float]:
    """Return jobs a minute accepted and ended, and processor seconds a job of both together."""
    engine = database.connect(url)
    database.migrate(engine)
    transactions = Transactions(engine)
    store, queue = Store(transactions, max_queued=10 * jobs), Queue(transactions)
    watcher = Watcher(store)
    stamp = time.time_ns()
    ended = 0
    done = asyncio.Event()

    def on_end(_: object) -> None:
        nonlocal ended
        ended += 1
        if ended == jobs:
            done.set()

    used, begun = time.process_time(), time.perf_counter()
    share = jobs // callers
    for caller in range(callers):
        new = [NewJob(json.dumps({"job": n, "run": stamp}), 60.0) for n in range(share)]
        for start in range(0, share, 1000):
            store.submit_batch(f"caller-{stamp}-{caller}", new[start : start + 1000])
    accepted = time.perf_counter() - begun
    stub = StubEngine(workers)
    dispatcher = Dispatcher(queue, stub, 3, watcher, on_end)  # type: ignore[arg-type]  # a stub
    begun = time.perf_counter()
    task = asyncio.create_task(dispatcher.run())
    await done.wait()
    took = time.perf_counter() - begun
    used = time.process_time() - used
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    engine.dispose()
    return 60 * jobs / accepted, 60 * jobs / took, used / jobs


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=5000)
    parser.add_argument("--workers", type=int, nargs="+", default=[10, 100, 1000])
    parser.add_argument("--postgresql", action="store_true")
    options = parser.parse_args()
    out = sys.stdout.write
    out("| workers | callers | accepted a minute | ended a minute | processor time a job |\n")
    out("| --- | --- | --- | --- | --- |\n")
    with connections(postgresql=options.postgresql) as url:
        for workers in options.workers:
            for callers in (1, 10):
                found = asyncio.run(run(url, options.jobs, workers, callers))
                accepted, ended, used = found
                rates = f"{accepted:,.0f} | {ended:,.0f} | {1000 * used:.2f} ms"
                out(f"| {workers} | {callers} | {rates} |\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
