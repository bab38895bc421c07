"""Whatever a public record or function is given, it is understood or refused by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import mutune
from mutune import InvalidInputError

LAG = mutune.TransferFunction([1], [10, 1], 1)
LOAD = mutune.TransferFunction([1], [10, 1])
PLANT = mutune.ParallelPlant(2, LAG, LAG)
MATRIX = mutune.plant([[([2], [10, 1]), ([1], [5, 1])], [([1], [5, 1]), ([2], [10, 1])]])
WEIGHT = mutune.Uncertainty.from_error(0.2, 1)
DEMAND = mutune.Performance(tau_p=100.0)
PI = mutune.Controller(0.1, 10.0)
LOOP = mutune.Loop(0.1, 10.0)
STEP = mutune.Step("load", 0, 0.0, 1.0)
DRIVE = mutune.Drive(1.0, 1.0)
DRIVES = mutune.ParallelDrives(LOAD, [DRIVE, DRIVE])
SCENARIO = mutune.DriveScenario()
RELAY = mutune.Relay()
GAIN = [[2.0, 1.0], [1.0, 2.0]]
INTEGRAL = mutune.StateSpace([[0.0]], [[1.0]], [[0.1]], [[0.5]])
MODES = mutune.ModeController(INTEGRAL, INTEGRAL)
TIMES = np.arange(40.0)
RECORD = mutune.Record(TIMES, {"u": TIMES % 7}, {"y": np.sin(TIMES)})

# Each with arguments that it accepts; every one of them is then replaced.
CASES: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    name: (getattr(mutune, name), arguments)
    for name, arguments in {
        "TransferFunction": {"num": (1.0,), "den": (10.0, 1.0), "dead_time": 2.0},
        "first_order": {
            "n": 2, "gain": 1.0, "time_constant": 10.0, "interaction": 0.5, "dead_time": 1.0,
        },
        "ParallelPlant": {"n": 2, "process": LAG, "interaction": LAG},
        "MatrixPlant": {"elements_by_row": ((LAG, LAG), (LAG, LAG))},
        "StreamSplit": {
            "n": 2, "flow": 1.0, "opening": 0.5, "pressure_drop": 2.0, "supply_resistance": 1.0,
            "header_time": 1.0, "valve_time": 1.0, "dead_time": 1.0,
        },
        "Blender": {
            "first_flow": 70.0, "second_flow": 30.0, "first_fraction": 0.9,
            "second_fraction": 0.2, "flow_time": 1.0,
        },
        "ParallelExchangers": {
            "n": 3, "holdup_heat": 800.0, "stream_heat": 20.0, "medium_flow": 2.0,
            "medium_heat_capacity": 4.0, "exchange": 10.0, "temperature_difference": -60.0,
            "opening": 0.5, "pressure_drop": 2.0, "supply_resistance": 0.5, "header_time": 1.0,
            "valve_time": 1.0, "dead_time": 1.0,
        },
        "ParallelCompressors": {
            "n": 4, "head_per_speed": 3.0, "head_per_flow": 2.0, "inertia": 1.0,
            "consumer_resistance": 2.0, "header_time": 1.0, "drive_time": 1.0, "dead_time": 1.0,
        },
        "BurnerPasses": {
            "n": 2, "holdup_heat": 800.0, "stream_heat": 20.0, "fuel_heat": 1000.0, "shared": 0.5,
            "firebox_time": 1.0, "fuel_time": 1.0, "dead_time": 1.0,
        },
        "NeighbourPlant": {
            "n": 5, "process": LOAD, "ahead": (LOAD,), "behind": (LOAD,), "ring": True,
        },
        "Mixing": {"outputs": ((1.0, 1.0), (-1.0, 1.0)), "inputs": ((1.0, -1.0), (1.0, 1.0))},
        "MeasuredPlant": {
            "omega": np.array([0.1, 1.0, 10.0]), "values": np.ones((3, 1, 1)), "unstable_poles": 0,
        },
        "Allowed": {"order": 1, "integrating": True},
        "ModeController": {"total": INTEGRAL, "difference": INTEGRAL},
        "Uncertainty": {"weight": LOAD, "structure": mutune.Structure.FULL},
        "Performance": {"max_peak": 2.0, "offset": 0.1, "tau_p": 5.0},
        "Controller": {
            "gain": 2.0, "integral_time": 3.0, "derivative_time": 1.0, "filter_time": 0.5,
        },
        "IdealForm": {
            "gain": 2.0, "integral_time": 3.0, "derivative_time": 0.5, "filter_time": 0.1,
        },
        "ParallelForm": {"proportional_gain": 2.0, "integral_gain": 3.0},
        "Bounds": {"gain": (1.0, 2.0), "integral_time": (3.0, 4.0), "derivative_time": (1.0, 2.0)},
        "Specification": {
            "plant": PLANT, "uncertainty": WEIGHT, "performance": DEMAND,
            "kind": mutune.ControllerKind.PID, "arrangement": mutune.Arrangement.GROUPED,
            "group_sizes": (1, 1), "objective": mutune.Objective.MU, "bounds": mutune.Bounds(),
            "starts": 3, "seed": 1, "time_limit": 5.0, "certificate": True,
        },
        "Loop": {
            "gain": 1.0, "integral_time": 2.0, "derivative_time": 1.0, "setpoint_weight": 0.5,
            "derivative_weight": 0.5, "filter_time": 0.5,
        },
        "Limits": {"low": -1.0, "high": 1.0, "tracking_time": 2.0},
        "Step": {"kind": mutune.StepKind.LOAD, "unit": 1, "time": 1.0, "size": 2.0},
        "Experiment": {
            "plant": PLANT, "loops": (LOOP, LOOP), "steps": (STEP,), "duration": 10.0,
            "samples": 11, "actuators": mutune.OwnActuators((LOAD, LOAD)),
            "limits": (mutune.Limits(-1, 1), None), "distribution": np.eye(2), "bound": 10.0,
        },
        "OwnActuators": {"functions": (LOAD, LOAD)},
        "CoupledActuators": {"weight": LOAD, "left": (LOAD,), "right": (LOAD,)},
        "Relay": {"amplitude": 1.0, "hysteresis": 0.1, "sampling_period": 0.01},
        "PlacedLoop": {"output": 1, "input": 1, "loop": LOOP},
        "RelayExperiment": {
            "plant": PLANT, "output": 0, "input": 0, "relay": RELAY,
            "loops": (mutune.PlacedLoop(1, 1, LOOP),), "duration": 10.0, "samples": 11,
            "steps": (STEP,),
        },
        "Drive": {"proportional_gain": 1.0, "integral_gain": 1.0},
        "ParallelDrives": {"load": LOAD, "drives": (DRIVE, DRIVE), "shares": (0.5, 0.5)},
        "DriveScenario": {
            "set_point": 1.0, "load": 1.0, "load_time": 10.0, "pulse": 1.0, "pulse_unit": 1,
            "pulse_time": 20.0, "pulse_duration": 1.0, "end": 40.0, "points": 401,
        },
        "DriveExperiment": {"system": DRIVES, "scenario": SCENARIO},
        "RobustnessLimits": {"max_sensitivity": 1.5, "max_complementary": 1.5},
        "DecouplingSpecification": {
            "plant": MATRIX, "limits": mutune.RobustnessLimits(), "max_index": 0.5,
            "set_point_weights": (0.5, 0.5), "omega": np.array([0.1, 0.01]),
        },
        "LoopEffectQuery": {
            "plant": MATRIX, "loop": 0, "other": 1, "gains": (1.0, 2.0), "controller": PI,
        },
        "Claim": {
            "plant": PLANT, "uncertainty": WEIGHT, "performance": DEMAND, "loops": (PI, PI),
            "gamma": 1.0,
        },
    }.items()
}  # fmt: skip

FUNCTIONS: dict[str, dict[str, Any]] = {
    "relative_gain_array": {"gain": GAIN},
    "niederlinski_index": {"gain": GAIN},
    "rank_pairings": {"gain": GAIN},
    "transmission_zeros": {"plant": MATRIX},
    "easy_direction": {"plant": PLANT},
    "difficult_direction": {"plant": PLANT},
    "analyse_interaction": {"plant": MATRIX, "omega": [1.0, 0.1]},
    "analyse": {
        "plant": PLANT, "uncertainty": WEIGHT, "performance": DEMAND, "loops": [PI, PI],
        "omega": [1.0, 0.1], "certificate": False,
    },
    "integrity": {
        "plant": PLANT, "uncertainty": WEIGHT, "performance": DEMAND, "loops": [PI, PI],
    },
    "loop_margins": {"plant": PLANT, "loops": [PI, PI]},
    "worst_actuators": {
        "plant": PLANT, "loops": [PI, PI], "uncertainty": WEIGHT, "performance": DEMAND,
    },
    "analyse_centralised": {
        "plant": PLANT, "uncertainty": WEIGHT, "performance": DEMAND, "controller": MODES,
    },
    "multivariable_limit": {"plant": PLANT, "uncertainty": WEIGHT, "performance": DEMAND},
    "identify": {
        "records": [RECORD], "structure": "matrix", "allowed": mutune.Allowed(), "validation": [],
        "drift": False, "seed": 0,
    },
    "relay_record": {"experiment": None, "outcome": None},
    "cover": {
        "omega": [0.1, 1.0, 10.0], "error": [0.1, 0.5, 1.0], "order": 1, "tight_below": 2.0,
        "hold_first": False,
    },
    "cover_by_error": {"omega": [0.1, 1.0, 10.0], "error": [0.1, 0.5, 1.0]},
    "Record": {"time": TIMES, "inputs": {"u": TIMES % 7}, "outputs": {"y": np.sin(TIMES)}},
    "StateSpace": {"A": [[0.0]], "B": [[1.0]], "C": [[0.1]], "D": [[0.5]]},
    "tune": {"plant": PLANT, "uncertainty": WEIGHT},
    "step_response": {"experiment": None},
    "relay_experiment": {"experiment": None},
    "decouple": {"specification": None},
    "loop_effect": {"query": None},
    "analyse_drives": {"system": None},
    "simulate_drives": {"experiment": None},
}  # fmt: skip

ODD = st.sampled_from(
    ["PIX", "", "1", b"1", 1j, 2.5, -1, 0, math.nan, math.inf, -math.inf, True, np.True_, 10**400,
     (), [], [1], ["1"], [None], [1j], [True], [[1.0]], [[1, 2], [3]], {}, {"a": 1}, {1, 2},
     object(), np.array(["a"]), np.array([math.nan]), np.zeros((2, 2, 2)), np.complex128(1),
     np.datetime64("2020-01-01"), np.ma.masked, mutune.Step, LAG, PI, PLANT, WEIGHT, STEP,
     mutune.Arrangement.IDENTICAL, mutune.Objective.MU, mutune.StepKind.LOAD, Fraction(1, 3),
     lambda: None]
)  # fmt: skip
QUIET = settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))


def same(stored: object, given_: object) -> bool:
    """Whether a record holds what it was given, in the form that it keeps."""
    if isinstance(stored, tuple | np.ndarray) and isinstance(given_, tuple | list | np.ndarray):
        return len(stored) == len(given_) and all(map(same, stored, given_))
    if isinstance(stored, mutune.Loop) and isinstance(given_, mutune.Controller):
        return stored == mutune.Loop.of(given_)
    if isinstance(stored, float) and not isinstance(stored, bool | np.bool_):
        return not isinstance(given_, bool | np.bool_ | str) and stored == float(given_)  # type: ignore[arg-type]
    return (type(stored) is type(given_) and bool(stored == given_)) or (
        isinstance(stored, bool) and isinstance(given_, np.bool_) and stored == given_
    )


@QUIET
@given(st.data(), st.sampled_from(sorted(CASES)), ODD)
def test_a_record_keeps_what_it_is_given_or_refuses_it_by_name(data, name, odd):
    """Nothing is cut, guessed or passed on to fail far away."""
    make, arguments = CASES[name]
    changed = data.draw(st.sampled_from(sorted(arguments)))
    try:
        record = make(**(arguments | {changed: odd}))
    except InvalidInputError as error:
        # The actuators are a list in JSON, whose own pointer is the empty one.
        assert error.field.startswith("/") or name == "OwnActuators"  # noqa: PT017 - or no error
        return
    if name == "first_order":
        return  # its arguments are those of no record; out of range would be refused
    if name == "TransferFunction" and changed in {"num", "den"}:
        stored = tuple(getattr(record, changed))
        assert same(stored, tuple(odd)[-len(stored) :])
        return
    stored = getattr(record, changed)
    if changed == "omega" and isinstance(stored, np.ndarray):
        odd = np.atleast_1d(odd)  # one frequency is an axis of one
    assert same(stored, odd) or (stored is None and odd is None)


@QUIET
@given(st.data(), st.sampled_from(sorted(FUNCTIONS)), ODD)
def test_a_function_refuses_by_name_what_it_does_not_take(data, name, odd):
    """Wrong types never end in an error of another kind, or in a plausible number."""
    arguments = FUNCTIONS[name]
    changed = data.draw(st.sampled_from(sorted(arguments)))
    fits = (odd is PLANT and changed == "plant") or (odd is WEIGHT and changed == "uncertainty")
    number = isinstance(odd, Fraction | float) and not isinstance(odd, bool) and changed == "omega"
    listed = isinstance(odd, list) and odd == [1] and changed == "omega"
    flags = {"certificate", "drift", "hold_first"}
    flagged = isinstance(odd, bool | np.bool_) and changed in flags
    square = isinstance(odd, list) and odd == [[1.0]] and changed in {"gain", "A", "B", "C", "D"}
    zero = type(odd) is int and odd == 0 and changed in {"seed", "order"}
    ratio = isinstance(odd, Fraction | float) and odd > 0 and changed == "tight_below"
    none = isinstance(odd, tuple | list) and not odd and changed == "validation"
    if fits or listed or flagged or square or zero or ratio or none:
        return
    if number and math.isfinite(odd) and odd > 0:
        return
    with pytest.raises(InvalidInputError) as error:
        getattr(mutune, name)(**(arguments | {changed: odd}))
    assert error.value.message


def equivalents(value: object) -> list[object]:  # noqa: PLR0911 - one for each kind
    """Return the same value in other forms that a caller may have it in."""
    if isinstance(value, bool):
        return [np.bool_(value)]
    if isinstance(value, Enum):
        return [value.value]
    if isinstance(value, int):
        return [np.int64(value), *([np.uint8(value), np.int8(value)] if 0 <= value < 128 else [])]
    if isinstance(value, float):
        exact = [np.float32(value), np.float16(value)]
        same_value = [each for each in exact if float(each) == value]
        whole = [int(value), np.int8(value)] if value.is_integer() and abs(value) < 128 else []
        return [np.float64(value), Fraction(value), np.array(value), *same_value, *whole]
    if isinstance(value, tuple) and value and all(isinstance(each, float) for each in value):
        return [list(value), np.array(value), [np.float64(each) for each in value]]
    if isinstance(value, tuple):
        return [list(value), iter(value)]
    if isinstance(value, np.ndarray):
        return [value.tolist(), value.copy()]
    return []


@pytest.mark.parametrize("name", sorted(CASES))
def test_a_value_means_the_same_in_every_form(name):
    """Lists and tuples, numbers of any width, members and their values."""
    make, arguments = CASES[name]
    usual = make(**arguments)
    for changed, value in arguments.items():
        for other in equivalents(value):
            record = make(**(arguments | {changed: other}))
            assert record == usual
            assert hash(record) == hash(usual)


def test_what_a_record_was_made_from_may_change_afterwards():
    """Sequences are copied, arrays are read-only."""
    sizes, gains, loops, matrix = [1, 1], [1.0, 2.0], [LOOP, LOOP], np.eye(2)
    task = mutune.Specification(
        PLANT, WEIGHT, mutune.Performance(), arrangement="grouped", group_sizes=sizes,
        bounds=mutune.Bounds(gain=gains),
    )  # fmt: skip
    experiment = mutune.Experiment(PLANT, loops, [STEP], 10.0, distribution=matrix)
    sizes[0], gains[0], loops[0], matrix[0, 0] = 2, 9.0, None, 9.0
    assert task.group_sizes == (1, 1)
    assert task.bounds.gain == (1.0, 2.0)
    assert experiment.loops == (LOOP, LOOP)
    assert experiment.distribution is not None
    assert experiment.distribution[0, 0] == 1
    for array in (LAG.poles, LAG.zeros, experiment.distribution):
        with pytest.raises(ValueError, match="read-only"):
            array *= -1  # noqa: PLW2901 - in place is what is tried


def test_full_uncertainty_by_its_value_is_full():
    """What is proven is what is claimed."""
    by_value = mutune.Uncertainty.from_error(0.2, 1, "full")
    assert by_value == mutune.Uncertainty.from_error(0.2, 1, mutune.Structure.FULL)
    plant = mutune.first_order(2, gain=1, time_constant=100, interaction=0.949)
    loops = [mutune.Controller(47.655, 101.23), mutune.Controller(18.901, 2.361)]
    demand = mutune.Performance(tau_p=18.446)
    full = mutune.analyse(plant, by_value, demand, loops)
    diagonal = mutune.analyse(plant, WEIGHT, demand, loops)
    assert full.peaks is not None
    assert diagonal.peaks is not None
    assert full.peaks.robust_performance.value > 1.05 > diagonal.peaks.robust_performance.value


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"performance": mutune.Performance(tau_p=5)}, "/performance/tau_p"),
        ({"bounds": mutune.Bounds(derivative_time=(1, 2))}, "/controller/bounds/derivative_time"),
        ({"kind": "identical"}, "/controller/kind"),
        ({"arrangement": "PID"}, "/controller/arrangement"),
        ({"certificate": "no"}, "/certificate"),
    ],
)
def test_what_would_be_ignored_is_refused(change, field):
    """A task says nothing that does not count."""
    arguments = {"plant": PLANT, "uncertainty": WEIGHT, "performance": mutune.Performance()}
    with pytest.raises(InvalidInputError) as error:
        mutune.Specification(**(arguments | change))
    assert error.value.field == field
