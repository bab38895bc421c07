"""Counts of unstable poles for many loops at once, against the roots of the polynomials."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.stability.encirclements import INFINITELY_MANY, LoopBatch, count_unstable

# num, den of L, den without roots in the open right half plane.
LOOPS = [
    ([1.0], [1.0, 1.0]),
    ([-2.0], [1.0, 1.0]),
    ([8.5], [1.0, 3.0, 3.0, 1.0]),
    ([7.5], [1.0, 3.0, 3.0, 1.0]),
    ([100.0], [1.0, 3.0, 3.0, 1.0]),
    ([1.0, 1.0], [1.0, 0.0, 0.0]),
    ([1.0], [1.0, 1.0, 0.0, 0.0]),
    ([0.1, 1.0], [1.0, 1.0, 0.0, 0.0]),
    ([2.0, 4.0, 2.0], [1.0, 0.0, 0.0, 0.0]),
    ([0.2, 0.4, 0.2], [1.0, 0.0, 0.0, 0.0]),
    ([-0.1], [1.0, 0.0]),
    ([-3.0, 1.0], [1.0, 2.0]),
    ([-0.5, 1.0], [1.0, 2.0]),
]
BENDS = np.array([0.05, 20.0])


def scalar_loops(loops: list[tuple[list[float], list[float]]], dead_time: float = 0.0) -> LoopBatch:
    """The given scalar loops as one batch."""

    def loop_gain(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        s = 1j * omega
        values = [np.polyval(num, s) / np.polyval(den, s) for num, den in loops]
        return (np.stack(values, axis=-1) * np.exp(-dead_time * s)[:, None])[:, :, None, None]

    direct = [num[0] / den[0] if len(num) == len(den) else 0.0 for num, den in loops]
    return LoopBatch(loop_gain, BENDS, np.array([]), np.array(direct)[:, None, None])


def test_counts_are_those_of_the_closed_loop_polynomial() -> None:
    """Stable, unstable, integrating and biproper loops, all in one batch."""
    expected = [np.count_nonzero(np.roots(np.polyadd(num, den)).real > 0) for num, den in LOOPS]
    assert len(set(expected)) == 3
    assert count_unstable(scalar_loops(LOOPS)).tolist() == expected


def test_each_loop_counts_as_it_does_alone() -> None:
    """What stands beside a loop in its batch does not matter."""
    together = count_unstable(scalar_loops(LOOPS)).tolist()
    assert together == [count_unstable(scalar_loops([loop]))[0] for loop in LOOPS]


def test_a_pole_on_the_axis_counts_as_unstable() -> None:
    """L = 8/(s + 1)^3 is on the verge; its neighbours in the batch are not touched."""
    verge = [([8.0], [1.0, 3.0, 3.0, 1.0]), ([7.0], [1.0, 3.0, 3.0, 1.0])]
    found = count_unstable(scalar_loops(verge))
    assert found[0] > 0
    assert found[1] == 0


@pytest.mark.parametrize(("gain", "count"), [(1.5, 0), (1.6, 2), (8.0, 4)])
def test_dead_time(gain: float, count: int) -> None:
    """L = k e^(-s)/s loses two poles to the right at k = pi/2, two more at 5 pi/2."""
    assert count_unstable(scalar_loops([([gain], [1.0, 0.0])], 1.0)).tolist() == [count]


@pytest.mark.parametrize("dead_time", [1.0, 100.0, 1e3, 1e4])
def test_a_dead_time_that_turns_many_times_from_point_to_point(dead_time: float) -> None:
    """2 e^(-theta s)/(s + 1) has a pair to the right for each turn of its phase while above one."""
    batch = dataclasses.replace(scalar_loops([([2.0], [1.0, 1.0])], dead_time), dead_time=dead_time)
    phase = np.sqrt(3) * dead_time + np.arctan(np.sqrt(3))  # where the gain is one
    assert count_unstable(batch).tolist() == [2 * np.floor((phase + np.pi) / (2 * np.pi))]


def test_no_dead_time_is_too_long_where_the_gain_stays_below_one() -> None:
    """0.9 e^(-theta s)/(s + 1) is stable for any theta; 3 in its place has too many to count."""
    loops = [([gain], [1.0, 1.0]) for gain in (0.9, 3.0)]
    stable, unstable = (
        count_unstable(dataclasses.replace(scalar_loops([loop], 1e9), dead_time=1e9))[0]
        for loop in loops
    )
    assert (stable, unstable) == (0, INFINITELY_MANY)


def test_coupled_loops_count_by_their_determinant() -> None:
    """A triangular 2 x 2 loop has the unstable poles of both its diagonal elements."""

    def loop_gain(omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        s = 1j * omega
        L = np.zeros((omega.size, 1, 2, 2), dtype=complex)
        L[:, 0, 0, 0] = 100 / (s + 1) ** 3
        L[:, 0, 1, 1] = -2 / (s + 1)
        L[:, 0, 0, 1] = 5 / (s + 2)
        return L

    found = count_unstable(LoopBatch(loop_gain, BENDS, np.array([]), np.zeros((1, 2, 2))))
    assert found.tolist() == [3]
