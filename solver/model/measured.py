"""Plants given by their frequency response at some frequencies, and nothing else.

What is between those frequencies is not known, and neither are poles and zeros. The number of poles
in the right half plane cannot be read from a response on the axis either: who gives the data
has to state that there are none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from solver.model.equality import ByValue
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MAX_MATRIX_SIZE, PlacedElement, Plant
from solver.model.transfer_function import LARGEST
from solver.model.validation import frequencies, integer, integers, read_only, settle

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from solver.model.transfer_function import TransferFunction

__all__ = ["ADVICE", "MAX_POINTS", "MIN_POINTS", "MeasuredPlant", "NoTransferFunctionsError"]

MIN_POINTS, MAX_POINTS = 3, 2000
ADVICE = (
    "a plant given as frequency response has no transfer functions, and this needs them: fit some, "
    "or identify the plant from a record (mutune identify); its data serve tuning and robustness"
)


class NoTransferFunctionsError(UnsupportedPlantError):
    """Something was asked of a `MeasuredPlant` that only transfer functions can answer."""

    def __init__(self, message: str = ADVICE, field: str = "/plant/kind") -> None:
        super().__init__(message, field)

    def within(self, prefix: str) -> NoTransferFunctionsError:
        """Return the same: the fault is the plant's, whatever part of a request met it."""
        del prefix
        return self


@dataclass(frozen=True, eq=False)
class MeasuredPlant(Plant, ByValue):
    """A square plant known at some frequencies only.

    Parameters
    ----------
    omega : (k,) array_like
        Frequencies, rad per time unit, ascending, `MIN_POINTS`..`MAX_POINTS` of them.
    values : (k, n, n) array_like, complex
        G(j omega); row r, column c is from input c to output r. n <= `MAX_MATRIX_SIZE`.
    unstable_poles : int or None
        Poles in the right half plane, as its owner knows them; None: not known. Poles elsewhere on
        the axis than the origin count, and so do those at the origin.

    Raises
    ------
    InvalidInputError
        Frequencies that do not ascend, values that are not finite or of another shape, a number of
        poles below zero.

    """

    omega: NDArray[np.float64]
    values: NDArray[np.complex128]
    unstable_poles: int | None = None

    def __post_init__(self) -> None:
        omega = frequencies(self.omega, most=MAX_POINTS)
        if omega.size < MIN_POINTS:
            message = f"at least {MIN_POINTS} frequencies are needed"
            raise InvalidInputError(message, "/omega")
        ascending = np.diff(omega) > 0
        if not ascending.all():
            index = int(np.argmin(ascending)) + 1
            message = "the frequencies must ascend"
            raise InvalidInputError(message, f"/omega/{index}")
        try:
            values = np.array(self.values, dtype=complex)
        except (TypeError, ValueError, OverflowError):
            message = "the values must be complex numbers, (frequencies, outputs, inputs)"
            raise InvalidInputError(message, "/elements") from None
        n = values.shape[-1] if values.ndim == 3 else 0
        if values.shape != (omega.size, n, n) or not 1 <= n <= MAX_MATRIX_SIZE:
            message = (
                f"the values must be a square matrix at each of the {omega.size} frequencies, of "
                f"at most {MAX_MATRIX_SIZE} rows"
            )
            raise InvalidInputError(message, "/elements")
        if not (np.isfinite(values).all() and (np.abs(values) <= LARGEST).all()):
            message = f"the values must be finite and at most {LARGEST:g} in magnitude"
            raise InvalidInputError(message, "/elements")
        settle(self, omega=read_only(omega), values=read_only(values))
        if self.unstable_poles is not None:
            settle(self, unstable_poles=integer(self.unstable_poles, "/unstable_poles"))
            if self.unstable_poles < 0:
                message = "a number of poles is not negative"
                raise InvalidInputError(message, "/unstable_poles")

    @property
    def n(self) -> int:
        """Number of loops."""
        return int(self.values.shape[-1])

    @property
    def interchangeable(self) -> bool:
        """Whether any two units may change places: nothing is said of it, so no."""
        return False

    @property
    def places(self) -> tuple[PlacedElement, ...]:
        """Raise `NoTransferFunctionsError`."""
        self._refuse()

    def element(self, row: int, column: int) -> TransferFunction:
        """Raise `NoTransferFunctionsError`."""
        del row, column
        self._refuse()

    def static_gain(self) -> NDArray[np.float64]:
        """Raise `NoTransferFunctionsError`."""
        self._refuse()

    def part(self, units: Sequence[int]) -> MeasuredPlant:
        """Return the plant between the inputs and outputs of `units`, at least one."""
        kept = np.array(integers(units, "/units"))
        return MeasuredPlant(
            self.omega, self.values[:, kept[:, None], kept], unstable_poles=self.unstable_poles
        )

    def mapped(self, change: Callable[[TransferFunction], TransferFunction]) -> Plant:
        """Raise `NoTransferFunctionsError`."""
        del change
        self._refuse()

    def paired(self, order: Sequence[int]) -> MeasuredPlant:
        """Return the plant whose input i is input `order[i]` of this one."""
        return MeasuredPlant(
            self.omega, self.values[:, :, list(order)], unstable_poles=self.unstable_poles
        )

    def delayed(self, dead_time: float) -> MeasuredPlant:
        """Return the plant with a dead time more in every element."""
        late = np.exp(-1j * self.omega * dead_time)[:, None, None]
        return MeasuredPlant(self.omega, self.values * late, unstable_poles=self.unstable_poles)

    def scaled(self, factors: NDArray[np.float64]) -> MeasuredPlant:
        """Return the plant with each element times its factor, (n, n)."""
        return MeasuredPlant(self.omega, self.values * factors, unstable_poles=self.unstable_poles)

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Frequency response at some of its own frequencies, as (k, n, n) complex.

        Raises
        ------
        UnsupportedPlantError
            A frequency that the data do not have.

        """
        wanted = frequencies(omega)
        places = np.minimum(np.searchsorted(self.omega, wanted), self.omega.size - 1)
        unknown = self.omega[places] != wanted
        if unknown.any():
            message = (
                f"the plant is known at its own {self.omega.size} frequencies only, not at "
                f"{wanted[unknown][0]:.6g}"
            )
            raise UnsupportedPlantError(message, "/plant/omega")
        return np.asarray(self.values[places])

    def _refuse(self) -> NoReturn:
        raise NoTransferFunctionsError
