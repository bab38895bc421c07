"""The nonlinear bench of the examples: balances, and loops that work on it."""

import runpy

import pytest
from touring import ROOT

BENCH = runpy.run_path(str(ROOT / "examples" / "bench" / "two_heaters.py"))


def test_bench_rests_at_room_temperature() -> None:
    """Nothing moves without heat."""
    bench = BENCH["Bench"]()
    bench.step([0.0, 0.0], 100.0)
    assert bench.state == [21.0] * 4


def test_heat_goes_where_it_must() -> None:
    """At steady state the losses to the room are the power put in."""
    bench = BENCH["Bench"]()
    for _ in range(20_000):
        bench.step([60.0, 20.0], 1.0)
    lost = 0.0
    for warm in bench.state[:2]:
        radiated = 5.67e-8 * ((warm + 273.15) ** 4 - (21 + 273.15) ** 4)
        lost += bench.convection * (warm - 21) + bench.surface * radiated
    assert lost == pytest.approx(60 * 0.010 + 20 * 0.0075, rel=1e-9)
    assert bench.state[0] > bench.state[1] > 21


def test_settings_of_the_readme_hold_on_it() -> None:
    """Both outputs end at their set points, with the room cooler; neither heater at its limit."""
    trace = BENCH["run"]([BENCH["Pi"](7.4643, 241.1), BENCH["Pi"](13.282, 235.13)])
    _, readings, inputs = trace[-1]
    assert readings == pytest.approx([50, 45], abs=0.1)
    assert all(0 < value < 100 for value in inputs)


def test_controller_does_not_wind_up() -> None:
    """A long error at a limit leaves no integral behind."""
    pi = BENCH["Pi"](1.0, 10.0)
    for _ in range(1000):
        assert pi.output(200.0, 1.0) == 100.0
    assert pi.output(-1.0, 1.0) < 100.0
