"""Plants beside a given one."""

import pytest

from solver.model.deviations import change_gain, change_time_constant
from solver.model.transfer_function import LARGEST, TransferFunction


@pytest.mark.parametrize("factor", [3.0, 10.0, 12.7, 99.0, 1234.5])
def test_coefficients_near_the_limit_may_be_multiplied(factor: float) -> None:
    """A coefficient that grows beyond the limit is divided with all others, to the last digit."""
    element = TransferFunction([LARGEST], [LARGEST / 7, 1.0])
    for changed in (change_gain(element, factor), change_time_constant(element, factor)):
        assert max(*changed.num, *changed.den) <= LARGEST
    assert change_gain(element, factor).static_gain == pytest.approx(LARGEST * factor)
