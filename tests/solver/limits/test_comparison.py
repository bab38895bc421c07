"""The comparison of all kinds of controllers: what is true of its parts together."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from solver.limits.comparison import (
    ControllerComparison,
    Entry,
    Family,
    _Deadlines,
    _no_worse,
    _with_contained,
)
from solver.limits.ending import EnoughError
from solver.limits.lower_bound import Limitation, LowerBound
from solver.limits.record import Limit, LimitStatus

BOUND = LowerBound(1.0, 1j, Limitation.UNCERTAINTY)
ENTRIES = [Entry(Family.UNLIKE_PI, 5.0), Entry(Family.MODE_CONTROL, 3.0), Entry(Family.PAIRS, None)]


@pytest.mark.parametrize(
    ("status", "value", "after", "status_after"),
    [
        (LimitStatus.FOUND, 4.0, 3.0, LimitStatus.FOUND),
        (LimitStatus.FOUND, 2.0, 2.0, LimitStatus.FOUND),
        (LimitStatus.INFEASIBLE, None, 3.0, LimitStatus.FOUND),
        (LimitStatus.TIME_LIMIT, 4.0, 3.0, LimitStatus.TIME_LIMIT),
        (LimitStatus.TIME_LIMIT, None, 3.0, LimitStatus.TIME_LIMIT),
        (LimitStatus.UNLIMITED, None, None, LimitStatus.UNLIMITED),
    ],
)
def test_the_limit_of_all_controllers_is_above_none_of_them(
    status: LimitStatus, value: float | None, after: float | None, status_after: LimitStatus
) -> None:
    """A structure is a linear controller too: where it is the best one, the limit is no more."""
    reason = None if value else "none was found"
    limit = _no_worse(Limit(status, "tau_p", value, BOUND, reason=reason), ENTRIES)
    assert limit.value == after
    assert limit.status is status_after
    assert (limit.reason is None) == (after is not None)
    assert any("mode control" in each for each in limit.warnings) == (after == 3.0)


def test_a_comparison_shows_itself_in_a_line() -> None:
    """In a notebook values stand there, not curves and matrices."""
    comparison = ControllerComparison(tuple(ENTRIES), Limit(LimitStatus.FOUND, "tau_p", 2.0, BOUND))
    assert repr(comparison) == (
        "ControllerComparison(unlike_pi 5, mode_control 3, pairs -, "
        "Limit(found, tau_p 2, lower bound 1))"
    )


def test_a_kind_is_no_worse_than_the_one_it_contains() -> None:
    """PI loops are PID loops without derivative action: a search that found less takes theirs."""
    before, worse = Entry(Family.UNLIKE_PI, 3.0), Entry(Family.UNLIKE_PID, 4.0, exhausted=True)
    taken = _with_contained(worse, before)
    assert (taken.family, taken.value, taken.exhausted) == (Family.UNLIKE_PID, 3.0, True)
    assert _with_contained(replace(worse, value=None), before).value == 3.0
    better = replace(worse, value=2.0)
    assert _with_contained(better, before) is better
    assert _with_contained(worse, replace(before, value=None)) is worse


def test_parts_end_at_their_share_of_the_time() -> None:
    """A limit that is over ends them at once; without one only the caller ends them."""
    asked = []
    with pytest.raises(EnoughError):
        _Deadlines(1e-9, lambda: asked.append(1))(0.7)()
    _Deadlines(1e9, lambda: asked.append(1))(0.7)()
    _Deadlines(None, lambda: asked.append(1))(1.0)()
    assert len(asked) == 3
    assert _Deadlines(None, lambda: None).limit == math.inf
