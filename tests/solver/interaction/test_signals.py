"""Signal by signal: helping, fighting, acting the wrong way."""

import itertools

import numpy as np
import pytest

from solver.interaction.analysis import analyse_interaction
from solver.interaction.relative_gain import relative_gain_array
from solver.interaction.signals import controller_actions, signals
from solver.model.plants import MatrixPlant, first_order
from solver.model.transfer_function import TransferFunction


def test_blending_as_smith_and_corripio_tell_it() -> None:
    """Figs. 9-1.5 and 9-1.6: flow reverse acting, analyser direct acting; the loops help."""
    sentences = signals(np.array([[1.0, 1.0], [0.24, -0.56]]), 0.7)
    assert sentences[0] == "Controller 1 is reverse acting, controller 2 direct acting."
    assert "input 1 falls" in sentences[1]
    assert "it falls" in sentences[2]
    assert "input 2 falls" in sentences[3]
    assert sentences[4].endswith("loop 2 helps loop 1.")


@pytest.mark.parametrize("signs", list(itertools.product((-1, 1), repeat=4)))
def test_the_story_agrees_with_the_relative_gain(signs: tuple[int, ...]) -> None:
    """For all signs: helped between 0 and 1, fought above, acting the wrong way below."""
    rng = np.random.default_rng(0)
    for sizes in rng.uniform(0.2, 2.0, (20, 4)):
        gain = (np.array(signs) * sizes).reshape(2, 2)
        value = float(relative_gain_array(gain)[0, 0])
        end = "helps" if 0 < value < 1 else "fights" if value > 1 else "wrong way"
        assert end in signals(gain, value)[-1]


def test_one_way_interaction_leaves_stability_alone() -> None:
    """Section 9-2: to affect stability it must work both ways."""
    lag, none = TransferFunction([1], [1, 1]), TransferFunction([0], [1])
    found = analyse_interaction(MatrixPlant([[lag, none], [lag, lag]]))
    (sentence,) = found.signals
    assert sentence.startswith("Loop 1 disturbs loop 2, which does not answer")
    assert sentence.endswith("stable together where each is alone.")
    assert analyse_interaction(MatrixPlant([[lag, none], [none, lag]])).signals != ()


def test_actions_are_those_of_the_own_gains() -> None:
    """Reverse for a positive gain, direct for a negative one, none for no gain."""
    assert controller_actions(np.array([1.0, -2.0, 0.0, np.inf])) == (
        "reverse", "direct", None, "reverse",
    )  # fmt: skip
    assert analyse_interaction(first_order(50, -1, 10, 0.1)).actions == ("direct",)
    assert analyse_interaction(first_order(3, 1, 10, 0.1)).signals == ()
