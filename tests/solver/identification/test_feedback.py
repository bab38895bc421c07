"""Records made under control are told from open-loop ones."""

import numpy as np
import pytest
from drawn import Lag, record

from solver.identification.feedback import followed
from solver.identification.identify import identify
from solver.identification.record import Record
from solver.identification.selection import Allowed


def controlled(seed, *, unit=1.0, noise=0.05, period=1.0):
    """Return a record of a lag under PI control, set points moved, with a disturbance."""
    generator = np.random.default_rng(seed)
    count, keep = 800, np.exp(-1 / 20)
    y = total = load = 0.0
    u, read = np.zeros(count), np.zeros(count)
    wanted = np.repeat(generator.choice([0.0, 2.0, 4.0], count // 100), 100)
    for k in range(count):
        read[k] = y + load + noise * generator.standard_normal()
        error = wanted[k] - read[k]
        total += error / 20
        u[k] = 0.8 * (error + total)
        load = 0.95 * load + 0.1 * generator.standard_normal()
        y = keep * y + (1 - keep) * 2 * u[k]
    return Record(period * np.arange(float(count)), {"u": unit * u}, {"y": read / unit})


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("unit", [1.0, 1e6])
def test_input_of_a_controller_is_seen(seed, unit):
    """Whatever the units."""
    assert set(followed(controlled(seed, unit=unit))) == {"u"}


def test_advice_says_what_to_do():
    """The fit is made all the same, and the reader is warned."""
    found = identify([controlled(0)], allowed=Allowed(1, integrating=False))
    assert any("under control" in words and "set point" in words for words in found.advice)


def answer(u):
    """Return the output of a lag; an input acts from its sample on."""
    return np.r_[0.0, np.convolve(u, 0.1 * np.exp(-np.arange(100) / 10))[: u.size - 1]]


@pytest.mark.parametrize("seed", range(10))
def test_open_loop_records_raise_no_alarm(seed):
    """Staircases, and inputs that move at random at every sample."""
    generator = np.random.default_rng(seed)
    assert not followed(record([[Lag(2, 20, 0, 3), Lag(1, 10, 0, 0)]], generator))
    time = np.arange(600.0)
    u = generator.standard_normal(600)
    y = answer(u)
    assert not followed(Record(time, {"u": u}, {"y": y + 0.02 * generator.standard_normal(600)}))
    wandering = np.cumsum(u)
    y = answer(wandering)
    assert not followed(Record(time, {"u": wandering}, {"y": y}))
    sine = np.sin(time / 7)
    y = answer(sine)
    assert not followed(Record(time, {"u": sine}, {"y": y + 0.02 * generator.standard_normal(600)}))
