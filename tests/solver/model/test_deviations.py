"""Plants beside a given one."""

import numpy as np
import pytest

from solver.model.deviations import change_dead_time, change_gain, change_time_constant, varied
from solver.model.transfer_function import LARGEST, TransferFunction


@pytest.mark.parametrize("factor", [3.0, 10.0, 12.7, 99.0, 1234.5])
def test_coefficients_near_the_limit_may_be_multiplied(factor: float) -> None:
    """A coefficient that grows beyond the limit is divided with all others, to the last digit."""
    element = TransferFunction([LARGEST], [LARGEST / 7, 1.0])
    for changed in (change_gain(element, factor), change_time_constant(element, factor)):
        assert max(*changed.num, *changed.den) <= LARGEST
    assert change_gain(element, factor).static_gain == pytest.approx(LARGEST * factor)


@pytest.mark.parametrize("factor", [-2.0, 0.01, 0.7, 1.0, 3.0])
def test_values_of_a_changed_element_need_no_element(factor: float) -> None:
    """They are those of the element with its gain, its times or its dead time changed."""
    element = TransferFunction([3.0, 1.0], [40.0, 13.0, 1.0, 0.0], 2.5)
    s = 1j * np.geomspace(1e-4, 1e2, 25)
    changes = {"gain": change_gain}
    if factor > 0:
        changes |= {"time_constant": change_time_constant, "dead_time": change_dead_time}
    for name, change in changes.items():
        np.testing.assert_allclose(varied(name, element, factor, s), change(element, factor)(s))
