"""Callers share the workers: what begins, and what makes room."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from service.jobs.records import Priority, TakenJob, Waiting
from service.jobs.shares import to_begin, to_stop

OWN, BATCH = Priority.INTERACTIVE, Priority.BATCH


def queue(**jobs: list[Priority]) -> dict[str, list[Waiting]]:
    """Return waiting jobs of callers; their sequence is that of writing."""
    found: dict[str, list[Waiting]] = {}
    sequence = 0
    for owner, priorities in jobs.items():
        for priority in sorted(priorities):
            sequence += 1
            found.setdefault(owner, []).append(Waiting(f"{sequence}", owner, priority, sequence))
    return found


def claims(**jobs: list[Priority]) -> list[TakenJob]:
    """Return running jobs of callers; what is written later began later."""
    found = []
    for owner, priorities in jobs.items():
        for priority in priorities:
            number = len(found)
            found.append(TakenJob(f"r{number}", "", 1.0, 0, priority, float(number), owner))
    return found


def test_one_caller_has_all_workers_in_the_order_of_its_queue() -> None:
    """Its own tunings first, then those of batches, each in turn."""
    waiting = queue(a=[BATCH, OWN, OWN])
    assert [job.sequence for job in to_begin(waiting, {}, 3, None)] == [1, 2, 3]
    assert to_begin(waiting, {}, 3, None)[-1].priority is BATCH


def test_who_runs_less_goes_first() -> None:
    """A hundred jobs in the queue give nobody more than a share."""
    begun = to_begin(queue(a=[OWN] * 100, b=[BATCH] * 3), {"a": 1}, 4, None)
    assert Counter(job.owner for job in begun) == {"b": 2, "a": 2}
    assert begun[0].owner == "b"


def test_number_of_running_jobs_of_a_caller_can_be_limited() -> None:
    """Workers stay idle then."""
    begun = to_begin(queue(a=[OWN] * 9, b=[OWN]), {"a": 1}, 6, 2)
    assert Counter(job.owner for job in begun) == {"a": 1, "b": 1}
    assert to_stop(queue(a=[OWN]), claims(a=[BATCH], b=[OWN] * 4), 0, 1) == []


def test_batch_makes_room_for_a_tuning() -> None:
    """Of the same caller, or of one that runs less; the youngest goes."""
    assert [c.id for c in to_stop(queue(a=[OWN]), claims(a=[BATCH, BATCH]), 0, None)] == ["r1"]
    assert [c.id for c in to_stop(queue(b=[OWN]), claims(a=[BATCH]), 0, None)] == ["r0"]
    assert to_stop(queue(b=[OWN]), claims(a=[BATCH], b=[OWN]), 0, None) == []
    assert to_stop(queue(a=[BATCH]), claims(a=[BATCH, BATCH]), 0, None) == []


def test_four_long_tunings_of_one_caller_do_not_hold_all_workers() -> None:
    """Another caller gets up to its half of the workers, and no more."""
    running = claims(a=[OWN] * 4)
    stopped = to_stop(queue(b=[OWN] * 4), running, 0, None)
    assert [claim.id for claim in stopped] == ["r3", "r2"]
    assert to_stop(queue(b=[OWN]), claims(a=[OWN]), 0, None) == []


def test_what_is_being_stopped_is_room_already() -> None:
    """The same job waits at the next look too, and nobody else is stopped for it."""
    waiting = queue(b=[OWN])
    assert len(to_stop(waiting, claims(a=[OWN] * 4), 0, None)) == 1
    assert to_stop(waiting, claims(a=[OWN] * 3), 1, None) == []


_JOBS = st.dictionaries(
    st.sampled_from("abcd"), st.lists(st.sampled_from([OWN, BATCH]), max_size=6), max_size=4
)


@given(waiting=_JOBS, running=_JOBS)
def test_room_is_made_once_and_for_all(
    waiting: dict[str, list[Priority]], running: dict[str, list[Priority]]
) -> None:
    """Whoever begins in the room that was made is not stopped for those who had to give way."""
    queued, held = queue(**waiting), claims(**running)
    stopped = to_stop(queued, held, 0, None)
    left = [claim for claim in held if claim not in stopped]
    begun = to_begin(queued, Counter(claim.owner for claim in left), len(stopped), None)
    assert len(begun) == len(stopped)
    after = left + [TakenJob(job.id, "", 1.0, 0, job.priority, 99.0, job.owner) for job in begun]
    back: dict[str, list[Waiting]] = {}
    for number, claim in enumerate(stopped):
        job = Waiting(claim.id, claim.owner, claim.priority, -number)
        back.setdefault(claim.owner, []).append(job)
    assert to_stop(back, after, 0, None) == []
