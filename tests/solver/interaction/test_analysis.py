"""The whole interaction analysis: published examples, parallel plants of any n, edge cases."""

import math

import numpy as np
import pytest

from solver.interaction.analysis import DENSE_UP_TO, analyse_interaction
from solver.interaction.integral_controllability import ControllabilityVerdict
from solver.interaction.interpretation import (
    InteractionSign,
    LoopMeaning,
    interaction_sign,
    read_loop,
)
from solver.interaction.relative_gain import GainStatus
from solver.model.plants import MatrixPlant, ParallelPlant, first_order
from solver.model.transfer_function import TransferFunction

LAG = TransferFunction([1], [1, 1])


def _static(gain: list[list[float]]) -> MatrixPlant:
    return MatrixPlant([[TransferFunction([g], [1]) for g in row] for row in gain])


def _second_order(gain: float) -> TransferFunction:
    return TransferFunction([gain], [1, 2, 1])


def test_example_11_2() -> None:
    """Astrom and Hagglund, Examples 11.1 and 11.2: index -1, the other pairing is recommended."""
    result = analyse_interaction(
        MatrixPlant([[_second_order(1), _second_order(2)], [_second_order(1), _second_order(1)]])
    )
    assert result.bristol_index == pytest.approx(-1)
    assert result.sign is InteractionSign.NEGATIVE
    assert [loop.meaning for loop in result.loops] == [LoopMeaning.REVERSED] * 2
    assert result.recommended is not None
    assert result.recommended.inputs == (1, 0)
    assert result.integral_controllability is not None
    assert result.integral_controllability.verdict is ControllabilityVerdict.IMPOSSIBLE
    assert result.effects[0].reversal_gain == pytest.approx(1)
    assert any("wrong way" in warning for warning in result.warnings)


def test_example_11_3() -> None:
    """Astrom and Hagglund, Example 11.3: index 3, zero at s = 1, outside the band."""
    result = analyse_interaction(
        MatrixPlant(
            [
                [TransferFunction([1], [1, 1]), TransferFunction([2], [1, 3])],
                [TransferFunction([1], [1, 1]), TransferFunction([1], [1, 1])],
            ]
        )
    )
    assert result.bristol_index == pytest.approx(3)
    assert [loop.meaning for loop in result.loops] == [LoopMeaning.FOUGHT] * 2
    assert not result.loops[0].within_band
    assert result.zeros.zeros[0].value == pytest.approx(1)
    assert any("right half plane" in warning for warning in result.warnings)


def test_example_11_4() -> None:
    """Astrom and Hagglund, Example 11.4: no interaction at steady state, no zeros."""
    den = [1, 3, 2]
    result = analyse_interaction(
        MatrixPlant(
            [
                [TransferFunction([1, -1], den), TransferFunction([1, 0], den)],
                [TransferFunction([-6], den), TransferFunction([1, -2], den)],
            ]
        )
    )
    assert result.bristol_index == pytest.approx(1)
    assert result.sign is InteractionSign.NONE
    assert result.zeros.zeros == ()
    assert result.loops[0].meaning is LoopMeaning.UNAFFECTED


@pytest.mark.parametrize("share", [0.7, 0.5, 0.3])
def test_blending_is_positive_interaction(share: float) -> None:
    """Smith and Corripio, section 9-1: the relative gain is W1/W; the loops help each other."""
    result = analyse_interaction(_static([[1.0, 1.0], [1 - share, -share]]))
    assert result.bristol_index == pytest.approx(share)
    assert result.sign is InteractionSign.POSITIVE
    assert result.loops[0].meaning is LoopMeaning.HELPED


def test_odd_number_of_positive_gains_is_positive_interaction() -> None:
    """Smith and Corripio, below eq. 9-1.12: one or three positive gains of four."""
    rng = np.random.default_rng(1)
    for _ in range(12):
        signs = rng.choice([-1.0, 1.0], (2, 2))
        gain = signs * rng.uniform(0.2, 3, (2, 2))
        sign = analyse_interaction(_static(gain.tolist())).sign
        expected = bool(np.count_nonzero(signs > 0) % 2 == 1)
        assert (sign is InteractionSign.POSITIVE) is expected


@pytest.mark.parametrize("a", [0.949, -0.05, 0.0, -0.3])
def test_many_units_agree_with_the_dense_analysis(a: float) -> None:
    """What is said of 11 units continues what is said of 10."""
    small = analyse_interaction(first_order(10, 2, 100, a, 1))
    large = analyse_interaction(first_order(11, 2, 100, a, 1))
    assert small.parallel is not None
    assert large.parallel is not None
    assert small.parallel.deviation is not None
    assert small.parallel.deviation < 1e-9
    assert large.parallel.deviation is None
    assert large.static_gain is None
    for result in (small, large):
        n = result.n
        assert result.parallel is not None
        expected = (1 + (n - 2) * a) / ((1 + (n - 1) * a) * (1 - a))
        assert result.parallel.own_relative_gain == pytest.approx(expected)
        assert result.loops[0].relative_gain == pytest.approx(expected)
        np.testing.assert_allclose(result.parallel.own_relative_gains, expected, rtol=1e-9)
        dic = a > -1 / (n - 1)
        assert result.integral_controllability is not None
        assert (result.integral_controllability.verdict is ControllabilityVerdict.GUARANTEED) is dic
        assert (result.recommended is not None) is dic
        assert result.recommended is None or result.recommended.inputs == tuple(range(n))
    assert large.sign is small.sign
    assert small.niederlinski_index == pytest.approx((1 + 9 * a) * (1 - a) ** 9)
    assert large.niederlinski_index == pytest.approx((1 + 10 * a) * (1 - a) ** 10)


def test_thousands_of_units() -> None:
    """Ten thousand units are analysed without writing out a matrix."""
    result = analyse_interaction(first_order(10_000, 1, 10, 0.5))
    assert result.n == 10_000
    assert result.curves.relative_gains is None
    assert result.parallel is not None
    assert result.parallel.own_relative_gain == pytest.approx(2, rel=1e-3)
    assert result.condition_number == pytest.approx((1 + 9999 * 0.5) / 0.5)
    assert result.n > DENSE_UP_TO


@pytest.mark.parametrize("n", [2, 12])
def test_singular_units(n: int) -> None:
    """A = 1 is a status with advice, not an error; closed forms that exist are still given."""
    result = analyse_interaction(first_order(n, 1, 10, 1))
    assert result.gain_status is GainStatus.SINGULAR
    assert result.loops == ()
    assert result.recommended is None
    assert result.sign is None
    assert result.parallel is not None
    assert math.isnan(result.parallel.own_relative_gain)
    assert result.parallel.difference_eigenvalue == 0
    assert result.zeros.degenerate
    assert result.integral_controllability is not None
    assert result.integral_controllability.verdict is ControllabilityVerdict.IMPOSSIBLE
    assert "singular" in result.warnings[0]


@pytest.mark.parametrize("n", [3, 12])
def test_units_without_gain_of_their_own(n: int) -> None:
    """g(0) = 0 beside a finite i(0): every loop depends on the others."""
    plant = ParallelPlant(n, TransferFunction([1, 0], [1, 2, 1]), LAG)
    result = analyse_interaction(plant)
    assert result.gain_status is GainStatus.REGULAR
    assert result.parallel is not None
    assert result.parallel.interaction == math.inf
    assert result.loops[0].meaning is LoopMeaning.DEPENDENT
    assert result.integral_controllability is not None
    assert result.integral_controllability.verdict is ControllabilityVerdict.IMPOSSIBLE


@pytest.mark.parametrize("n", [3, 12])
def test_integrating_units(n: int) -> None:
    """G = 1/s, i = 0.5/s: relative gains are those of the residues; no statement on DIC."""
    plant = ParallelPlant(n, TransferFunction([1], [1, 0]), TransferFunction([0.5], [1, 0]))
    result = analyse_interaction(plant)
    assert result.gain_status is GainStatus.INTEGRATING
    expected = (1 + (n - 2) * 0.5) / ((1 + (n - 1) * 0.5) * 0.5)
    assert result.loops[0].relative_gain == pytest.approx(expected)
    assert result.integral_controllability is None
    assert result.parallel is None
    assert result.condition_number is None
    assert result.effects == ()
    assert any("integrates" in warning for warning in result.warnings)


@pytest.mark.parametrize("n", [2, 12])
def test_integrating_in_the_sum_only(n: int) -> None:
    """Equal integrators in g and i: relative gains grow without bound, a status."""
    g = TransferFunction([2, 1], [1, 1, 0])  # 1/s + 1/(s+1)
    result = analyse_interaction(ParallelPlant(n, g, TransferFunction([1], [1, 0])))
    assert result.gain_status is GainStatus.SINGULAR


def test_unstable_plants_get_no_statement_on_integral_control() -> None:
    """The conditions are for stable plants."""
    plant = MatrixPlant([[TransferFunction([1], [1, -1]), LAG], [LAG, _second_order(3)]])
    result = analyse_interaction(plant)
    assert result.integral_controllability is None
    assert any("not stable" in warning for warning in result.warnings)


def test_one_loop() -> None:
    """A single loop has nobody to fight."""
    result = analyse_interaction(first_order(1, 3, 10, 0.4, 1))
    assert result.parallel is None
    assert result.loops[0].meaning is LoopMeaning.UNAFFECTED
    assert result.recommended is not None
    assert result.effects == ()


def test_given_frequencies() -> None:
    """The array over frequency is given where it was asked for; dead time is in it."""
    omega = np.array([1e-4, 0.1])
    plant = MatrixPlant(
        [
            [TransferFunction([12.8], [16.7, 1], 1), TransferFunction([-18.9], [21, 1], 3)],
            [TransferFunction([6.6], [10.9, 1], 7), TransferFunction([-19.4], [14.4, 1], 3)],
        ]
    )
    result = analyse_interaction(plant, omega)
    assert result.curves.relative_gains is not None
    assert result.relative_gains is not None
    np.testing.assert_allclose(result.curves.relative_gains[0], result.relative_gains, atol=2e-3)
    assert any("do not factor out" in warning for warning in result.warnings)


@pytest.mark.parametrize(
    ("value", "meaning", "word"),
    [
        (0.0, LoopMeaning.DEPENDENT, "other loops only"),
        (0.5, LoopMeaning.HELPED, "2 times"),
        (1.0, LoopMeaning.UNAFFECTED, "keeps"),
        (4.0, LoopMeaning.FOUGHT, "0.25 times"),
        (-2.0, LoopMeaning.REVERSED, "-0.5 times"),
    ],
)
def test_readings(value: float, meaning: LoopMeaning, word: str) -> None:
    """Each range of the relative gain has its words and factor."""
    reading = read_loop(1, value)
    assert reading.meaning is meaning
    assert word in reading.text
    assert "Loop 2" in reading.text
    assert reading.within_band is (value == 1.0)


def test_sign_of_a_permutation_is_none() -> None:
    """Relative gains of exactly 0 and 1: no interaction, whatever the pairing."""
    assert interaction_sign(np.array([[0.0, 1.0], [1.0, 0.0]])) is InteractionSign.NONE


def test_no_sound_pairing_is_said() -> None:
    """Four units with a = -0.5: none of the 24 pairings, and a warning instead of one."""
    result = analyse_interaction(first_order(4, 1, 10, -0.5))
    assert result.recommended is None
    assert any(
        "None of the 24 pairings is decentralised integral controllable" in warning
        for warning in result.warnings
    )
    assert any("check the model" in warning for warning in result.warnings)
    assert not any("0.67..1.5" in warning for warning in result.warnings)


def test_sound_pairing_is_named_where_the_given_one_is_not() -> None:
    """Two units with a = 1.2: interchange them; the reason is not that of a = 1."""
    result = analyse_interaction(first_order(2, 1, 10, 1.2))
    assert result.recommended is not None
    assert result.recommended.inputs == (1, 0)
    text = " ".join(result.warnings)
    assert "Take the inputs 2, 1 for the outputs 1, 2" in text
    assert "above 1: each input moves the other outputs more than its own" in text
    assert "told apart" not in text


@pytest.mark.parametrize(
    ("a", "words"),
    [(0.9, None), (0.975, "ill-conditioned"), (0.999, "nearly singular")],
)
@pytest.mark.parametrize("n", [2, 12])
def test_large_relative_gains_are_said(n: int, a: float, words: str | None) -> None:
    """From 10 on, and again from 100 on: no controller changes it. Below there is no such word."""
    text = " ".join(analyse_interaction(first_order(n, 1, 10, a)).warnings)
    assert ("no controller changes that" in text) is (words is not None)
    assert words is None or words in text


@pytest.mark.parametrize(
    ("gain", "words"),
    [
        ([[1.0, -1.0], [1.0, 1.0]], "neither pairing is better"),
        ([[0.0, 1.0], [1.0, 1.0]], "interchanged then do not interact at all"),
        ([[1.0, 0.6], [0.6, 1.0]], "outside 0.67..1.5: a decoupler"),
    ],
)
def test_special_relative_gains_have_words(gain: list[list[float]], words: str) -> None:
    """Relative gains of 0.5, of 0 and outside the band 0.67..1.5 are told in words."""
    assert words in " ".join(analyse_interaction(_static(gain)).warnings)


def test_slight_interaction_is_no_fight() -> None:
    """A relative gain of 1.0076 is interaction that nobody notices."""
    reading = read_loop(0, 1.0076)
    assert reading.meaning is LoopMeaning.UNAFFECTED
    assert "hardly notices" in reading.text
    assert interaction_sign(np.array([[1.0076, -0.0076], [-0.0076, 1.0076]])) is (
        InteractionSign.NONE
    )
    assert interaction_sign(np.array([[1.03, -0.03], [-0.03, 1.03]])) is InteractionSign.NEGATIVE


def test_example_11_4_is_limited_loop_by_loop_only() -> None:
    """Astrom and Hagglund, Example 11.4: zeros at 1 in both elements, none in the plant."""
    dead = TransferFunction([-1, 1], [1, 2, 1])
    plant = MatrixPlant(
        [[dead, TransferFunction([2], [1, 1])], [TransferFunction([-2], [1, 1]), dead]]
    )
    result = analyse_interaction(plant)
    assert not any(zero.right_half_plane for zero in result.zeros.zeros)
    (limit,) = result.loop_limits
    assert limit.units == (0, 1)
    assert limit.zeros == (1,)
    assert limit.alone == pytest.approx(0.5)
    assert limit.together is None
    assert limit.text in result.warnings


@pytest.mark.parametrize("n", [1, 3, 12])
def test_zeros_of_the_process_limit_parallel_loops(n: int) -> None:
    """One entry for all units; one unit alone has no other loops to speak of."""
    process = TransferFunction([-2, 1], [1, 2, 1])
    plant = ParallelPlant(n, process, TransferFunction([0.1], [1, 2, 1]))
    limits = analyse_interaction(plant).loop_limits
    assert len(limits) == (0 if n == 1 else 1)
    for limit in limits:
        assert limit.units == tuple(range(n))
        assert limit.alone == pytest.approx(0.25)
        assert limit.together is not None
