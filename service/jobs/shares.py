"""Whose turn it is: callers share the workers alike, whatever each has in the queue.

A caller with fewer running jobs goes before one with more; at equal numbers a tuning of its own
before one of a batch, and then the one that came first. With one caller that is the order of the
queue.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from service.jobs.records import Priority, TakenJob, Waiting

__all__ = ["to_begin", "to_stop"]


def to_begin(
    waiting: Mapping[str, Sequence[Waiting]],
    running: Mapping[str, int],
    idle: int,
    most: int | None,
) -> list[Waiting]:
    """Return the jobs that may begin.

    Parameters
    ----------
    waiting : mapping
        The next jobs of each caller, in the order of its queue.
    running : mapping
        Number of running jobs of each caller.
    idle : int
        Workers that are free.
    most : int or None
        Jobs of one caller that may run at once.

    """
    held = Counter(running)
    places = dict.fromkeys(waiting, 0)
    found: list[Waiting] = []
    while len(found) < idle:
        nexts = [
            jobs[places[owner]]
            for owner, jobs in waiting.items()
            if places[owner] < len(jobs) and (most is None or held[owner] < most)
        ]
        if not nexts:
            break
        chosen = min(nexts, key=lambda job: (held[job.owner], job.priority, job.sequence))
        found.append(chosen)
        held[chosen.owner] += 1
        places[chosen.owner] += 1
    return found


def to_stop(
    waiting: Mapping[str, Sequence[Waiting]],
    running: Sequence[TakenJob],
    leaving: int,
    most: int | None,
) -> list[TakenJob]:
    """Return the running jobs that go back into the queue, for others that have waited.

    A job of a batch makes room for a tuning of its own caller, and for one of a caller that runs
    less. Any job makes room for one of a caller that then still does not run more.

    Parameters
    ----------
    waiting : mapping
        The next jobs of each caller, in the order of its queue.
    running : sequence of TakenJob
        Jobs that run and are not being stopped.
    leaving : int
        Jobs that are being stopped: workers that will be free.
    most : int or None
        Jobs of one caller that may run at once.

    """
    left = list(running)
    held = Counter(claim.owner for claim in left)
    queues = {owner: list(jobs) for owner, jobs in waiting.items()}
    for job in to_begin(queues, held, leaving, most):
        held[job.owner] += 1
        queues[job.owner].remove(job)
    stopped: list[TakenJob] = []
    while True:
        nexts = [
            jobs[0]
            for owner, jobs in queues.items()
            if jobs and (most is None or held[owner] < most)
        ]
        for job in sorted(nexts, key=lambda job: (held[job.owner], job.priority, job.sequence)):
            victims = [claim for claim in left if _gives_way(claim, job, held)]
            if victims:
                break
        else:
            return stopped
        # Of who runs the most; batches first; what began last has the least to lose.
        victim = max(
            victims, key=lambda claim: (held[claim.owner], claim.priority, claim.started_at)
        )
        stopped.append(victim)
        left.remove(victim)
        held[victim.owner] -= 1
        held[job.owner] += 1
        queues[job.owner].pop(0)


def _gives_way(claim: TakenJob, job: Waiting, held: Mapping[str, int]) -> bool:
    urgent = job.priority is Priority.INTERACTIVE and claim.priority is Priority.BATCH
    if claim.owner == job.owner:
        return urgent
    if urgent and held[job.owner] < held[claim.owner]:
        return True
    return held[job.owner] + 1 < held[claim.owner]
