"""Settings by relay experiments in all loops, again and again."""

import johansson
import pytest

from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction
from solver.relay import sequential
from solver.relay.analysis import relay_experiment
from solver.relay.behaviour import Behaviour
from solver.relay.experiment import Relay
from solver.relay.sequential import Verdict, relay_tuning
from solver.relay.sequential_query import RelayTuning, Rule

LAG = TransferFunction([1], [1, 3, 3, 1])
WEAK = MatrixPlant(
    [[LAG, TransferFunction([0.2], [2, 1])], [TransferFunction([-0.3], [1, 2, 1]), LAG]]
)


def test_johanssons_algorithm_ends_where_he_found_it_to_end() -> None:
    """Section 3: open experiments give settings, unstable together; closed ones have no cycle."""
    found = relay_tuning(RelayTuning(johansson.PLANT, johansson.SAMPLED))
    assert found.verdict is Verdict.NO_CYCLE
    assert [(each.output, each.input) for each in found.open_loops] == [
        (0, 0), (0, 1), (1, 0), (1, 1),
    ]  # fmt: skip
    single = relay_experiment(johansson.experiment(1, 1, johansson.SAMPLED, duration=12.0)).cycle
    assert single is not None
    assert single.ultimate is not None
    first = found.open_loops[0].ultimate
    assert first is not None
    assert first.gain == pytest.approx(single.ultimate.gain, rel=1e-6)
    assert len(found.rounds) == 1
    assert any(each.ultimate is None for each in found.rounds[0])
    assert found.stable is False


def test_weak_interaction_converges_to_stable_settings() -> None:
    """Two rounds agree, and the settings of the last are stable together."""
    found = relay_tuning(RelayTuning(WEAK, Relay(1.0, 0.01), Rule.TYREUS_LUYBEN))
    assert found.verdict is Verdict.CONVERGED
    assert found.stable
    last = [each.controller for each in found.rounds[-1]]
    assert found.loops is not None
    assert list(found.loops) == last


def test_a_pairing_is_followed_and_signs_are_turned() -> None:
    """Outputs swapped, one process with a negative gain: the same settings at other places."""
    swapped = MatrixPlant(
        [[WEAK.element(0, 1), LAG], [TransferFunction([-1], [1, 3, 3, 1]), WEAK.element(1, 0)]]
    )
    found = relay_tuning(
        RelayTuning(swapped, Relay(1.0, 0.01), Rule.TYREUS_LUYBEN, pairing=(1, 0), rounds=1)
    )
    assert [(each.output, each.input) for each in found.rounds[0]] == [(0, 1), (1, 0)]
    assert found.loops is not None
    assert found.loops[0].gain > 0 > found.loops[1].gain


def test_a_process_that_never_oscillates_ends_it() -> None:
    """First-order processes have no ultimate point: nothing is tuned, and nothing claimed."""
    found = relay_tuning(RelayTuning(first_order(2, 1, 10, 0.2), Relay(1.0, 0.1)))
    assert found.verdict is Verdict.NO_CYCLE
    assert found.loops is None
    assert found.stable is None


@pytest.mark.parametrize(
    ("unit", "relay"),
    [(1.0, Relay(1.0, 0.01)), (1e-6, Relay(1.0, 0.01)), (1.0, Relay(1.0, 0.0, 0.02))],
)
def test_a_relay_that_switches_fast_is_told_as_what_it_is(unit: float, relay: Relay) -> None:
    """Thousands of switchings in the time of a slow lag: enough of them are looked at, no more."""
    plant = first_order(2, 1, 100 * unit, 0.5)
    found, *_ = relay_tuning(RelayTuning(plant, relay)).open_loops
    assert found.behaviour is Behaviour.LIMIT_CYCLE
    assert found.remark is not None
    assert found.remark.startswith("No ultimate gain: the phase of this process does not reach -pi")


@pytest.mark.parametrize(
    ("given", "field"),
    [({"pairing": (0, 0)}, "/pairing"), ({"rounds": 0}, "/rounds")],
)
def test_faults_are_named(given: dict[str, object], field: str) -> None:
    """By the field."""
    with pytest.raises(InvalidInputError) as error:
        RelayTuning(WEAK, Relay(1.0), **given)  # type: ignore[arg-type]
    assert error.value.field == field


def test_a_plant_that_cannot_be_judged_is_refused_before_the_experiments(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A pole on the axis: half a minute of experiments would end with the same words."""
    monkeypatch.setattr(sequential, "_experiment", None)
    ringing = TransferFunction([-0.3], [1, 1e-9, 1])
    plant = MatrixPlant([[LAG, WEAK.element(0, 1)], [ringing, LAG]])
    with pytest.raises(UnsupportedPlantError, match="open-loop unstable") as caught:
        relay_tuning(RelayTuning(plant, Relay(1.0, 0.01), Rule.TYREUS_LUYBEN))
    assert caught.value.field == "/plant/elements/1/0/den"
