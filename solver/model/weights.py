"""The weights of the robust performance problem: uncertainty w_I, w_O and performance w_P.

Skogestad, Lundstrom and Hovd (1989), eqs. 27 and 29. Eq. 27 is misprinted there; the weight
below is the one with which the published settings give mu = 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST, TransferFunction, refuse_vanishing
from solver.model.validation import choice, instance, instances, items, real, reals, settle

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = ["Performance", "Structure", "Uncertainty"]


# Skogestad and Postlethwaite (2005), eq. 7.28: x = theta s/2.363, (x^2 + 2 0.838 x + 1) over
# (x^2 + 2 0.685 x + 1).
CORRECTION, LEAD, LAG = 2.363, 1.676, 1.37
MOST_UNLIKE = 1e12  # ratio of permitted errors: more leaves too few digits of the smaller ones
SHORTEST = 1e-40  # dead time whose cube still is a coefficient


class Structure(StrEnum):
    """Structure of the input uncertainty.

    DIAGONAL: the inputs err independently. FULL: their errors may depend on each other.
    """

    DIAGONAL = "diagonal"
    FULL = "full"


@dataclass(frozen=True)
class Uncertainty:
    """Multiplicative uncertainty (I + w_O Delta_O) G (I + w_I Delta_I), |Delta| <= 1.

    Parameters
    ----------
    weight : TransferFunction or tuple of TransferFunction
        w_I(s), dimensionless; only its magnitude matters. Not zero, no pole on the imaginary
        axis or to its right. One for all inputs, or one an input.
    structure : Structure or str
        DIAGONAL: the actuators err independently. FULL: their errors may depend on each other.
    outputs : Uncertainty or None
        That of the outputs, the errors of the sensors: independent, w_O its `weight`. Besides
        independent inputs only. None: the outputs are known.

    """

    weight: TransferFunction | tuple[TransferFunction, ...]
    structure: Structure = Structure.DIAGONAL
    outputs: Uncertainty | None = None

    def __post_init__(self) -> None:
        if isinstance(self.weight, list | tuple):
            settle(self, weight=_some(instances(self.weight, TransferFunction, "/weight")))
        else:
            instance(self.weight, TransferFunction, "/weight")
        settle(self, structure=choice(Structure, self.structure, "/structure"))
        own = isinstance(self.weight, tuple)
        for index, weight in enumerate(self.weights):
            field = f"/weight/{index}" if own else "/weight"
            if weight.is_zero:
                message = "the uncertainty weight is zero"
                raise InvalidInputError(message, f"{field}/num")
            if np.any(weight.poles.real >= 0):
                message = "the uncertainty weight must be stable"
                raise InvalidInputError(message, f"{field}/den")
        if self.outputs is not None:
            self._check_outputs(self.outputs)

    def _check_outputs(self, outputs: Uncertainty) -> None:
        instance(outputs, Uncertainty, "/outputs")
        if outputs.outputs is not None:
            message = "the uncertainty of the outputs has no outputs of its own"
            raise InvalidInputError(message, "/outputs/outputs")
        if outputs.structure is Structure.FULL:
            message = "the outputs err independently: the structure full is for inputs alone"
            raise InvalidInputError(message, "/outputs/structure")
        if self.structure is Structure.FULL:
            message = "errors of the outputs go with independent inputs, not with a full block"
            raise InvalidInputError(message, "/outputs")

    @classmethod
    def from_error(
        cls,
        epsilon: float | Sequence[float],
        theta: float | Sequence[float],
        structure: Structure | Literal["diagonal", "full"] = Structure.DIAGONAL,
    ) -> Uncertainty:
        """Return w_I = epsilon ((theta/epsilon) s + 1)/((theta/2) s + 1).

        Parameters
        ----------
        epsilon : float or sequence of float
            Relative error of the inputs at steady state, > 0 (0.2 is 20 per cent); one for all, or
            one an input.
        theta : float or sequence of float
            The error reaches 100 per cent near the frequency 1/theta; theta >= 0. A neglected dead
            time theta is covered up to omega theta = 0.7 only, and not together with an error of
            the gain: `from_gain_and_dead_time` covers both.
        structure : Structure or str
            As for the class.

        """
        weight = _each(_of_error, epsilon=epsilon, theta=theta)
        return cls(weight, choice(Structure, structure, "/structure"))

    @classmethod
    def from_gain_and_dead_time(
        cls,
        gain_error: float | Sequence[float],
        dead_time_error: float | Sequence[float],
        structure: Structure | Literal["diagonal", "full"] = Structure.DIAGONAL,
    ) -> Uncertainty:
        """Return a weight that covers every gain error and every neglected dead time together.

        |w_I| is at least |(1 + r) exp(-j omega theta) - 1| for all gain errors up to r and dead
        times up to theta, at every frequency: Skogestad and Postlethwaite (2005), eqs. 7.27 and
        7.28, with the third-order correction of the latter.

        Parameters
        ----------
        gain_error : float or sequence of float
            r: greatest relative error of an actuator's gain, 0 < r <= 1 (0.2 is 20 per
            cent); one for all, or one an input.
        dead_time_error : float or sequence of float
            theta: greatest dead time that the model leaves out, >= 0.
        structure : Structure or str
            As for the class.

        """
        weight = _each(
            _of_gain_and_dead_time, gain_error=gain_error, dead_time_error=dead_time_error
        )
        return cls(weight, choice(Structure, structure, "/structure"))

    @property
    def weights(self) -> tuple[TransferFunction, ...]:
        """The weights of the inputs, one for all or one each."""
        return self.weight if isinstance(self.weight, tuple) else (self.weight,)

    @property
    def unlike_inputs(self) -> bool:
        """Whether the inputs have different weights."""
        return isinstance(self.weight, tuple) and len(set(self.weight)) > 1

    def weight_of(self, unit: int) -> TransferFunction:
        """Return w_I of an input."""
        return self.weight[unit] if isinstance(self.weight, tuple) else self.weight

    @property
    def unlike_units(self) -> bool:
        """Whether the units differ in the uncertainty of their inputs or outputs."""
        return self.unlike_inputs or (self.outputs is not None and self.outputs.unlike_inputs)

    @property
    def all_weights(self) -> tuple[TransferFunction, ...]:
        """The weights of the inputs, and those of the outputs."""
        return self.weights if self.outputs is None else self.weights + self.outputs.weights

    def of_units(self, units: Sequence[int]) -> Uncertainty:
        """Return the uncertainty of some of the units."""
        weight = self.weight
        if isinstance(weight, tuple):
            weight = tuple(weight[unit] for unit in units)
        outputs = None if self.outputs is None else self.outputs.of_units(units)
        return replace(self, weight=weight, outputs=outputs)

    def paired(self, pairing: Sequence[int] | None) -> Uncertainty:
        """Return the uncertainty as the loops see it: loop i moves input `pairing[i]`."""
        if pairing is None or not isinstance(self.weight, tuple):
            return self
        return replace(self, weight=tuple(self.weight[column] for column in pairing))

    def responses(self, omega: ArrayLike, units: Sequence[int]) -> NDArray[np.complex128]:
        """Return w_I of the inputs `units` (m,) at `omega` (k,) rad per time unit, (k, m)."""
        found = {w: w.response(omega) for w in {self.weight_of(unit) for unit in units}}
        return np.stack([found[self.weight_of(unit)] for unit in units], axis=-1)

    def magnitude(self, omega: ArrayLike) -> NDArray[np.float64]:
        """Return |w_I| of the most uncertain input at `omega` (rad per time unit), (k,)."""
        return np.asarray(np.max([np.abs(w.response(omega)) for w in self.weights], axis=0))


def _some(weights: tuple[TransferFunction, ...]) -> tuple[TransferFunction, ...]:
    if not weights:
        message = "give one weight for all inputs, or one an input"
        raise InvalidInputError(message, "/weight")
    return weights


def _each(
    weight: Callable[..., TransferFunction], **given: float | Sequence[float]
) -> TransferFunction | tuple[TransferFunction, ...]:
    """Return a weight of the given numbers, or one an input where a number has as many values."""
    values = {
        name: tuple(items(value, f"/{name}"))
        for name, value in given.items()
        if isinstance(value, list | tuple | np.ndarray)
    }
    if not values:
        fields = {name: f"/{name}" for name in given}
        return weight(fields, **{name: real(value, f"/{name}") for name, value in given.items()})
    longest = max(map(len, values.values()))
    for name, numbers in values.items():
        if len(numbers) != longest or not numbers:
            message = f"{len(numbers)} values, elsewhere {longest}: give one an input"
            raise InvalidInputError(message, f"/{name}")
    found = []
    for index in range(longest):
        fields = {name: f"/{name}/{index}" if name in values else f"/{name}" for name in given}
        own = {
            name: real(values[name][index] if name in values else value, fields[name])
            for name, value in given.items()
        }
        found.append(weight(fields, **own))
    return tuple(found)


def _of_error(fields: Mapping[str, str], *, epsilon: float, theta: float) -> TransferFunction:
    """Return the weight of SLH eq. 27."""
    if not 0 < epsilon <= LARGEST:
        message = "epsilon must be positive"
        raise InvalidInputError(message, fields["epsilon"])
    if not 0 <= theta <= LARGEST:
        message = "theta must not be negative"
        raise InvalidInputError(message, fields["theta"])
    refuse_vanishing(epsilon, fields["epsilon"])
    refuse_vanishing(theta / 2, fields["theta"])
    if theta == 0:
        return TransferFunction((epsilon,), (1.0,))
    return TransferFunction((theta, epsilon), (theta / 2, 1.0))


def _of_gain_and_dead_time(
    fields: Mapping[str, str], *, gain_error: float, dead_time_error: float
) -> TransferFunction:
    """Return the weight of Skogestad and Postlethwaite (2005), eqs. 7.27 and 7.28."""
    r, theta = gain_error, dead_time_error
    if not 0 < r <= 1:
        message = "the gain error must be positive and at most 1"
        raise InvalidInputError(message, fields["gain_error"])
    if not 0 <= theta <= LARGEST:
        message = "the dead time error must not be negative"
        raise InvalidInputError(message, fields["dead_time_error"])
    refuse_vanishing(r, fields["gain_error"])
    if theta == 0:
        return TransferFunction((r,), (1.0,))
    if theta < SHORTEST:
        message = f"the dead time error must be zero or at least {SHORTEST:g}"
        raise InvalidInputError(message, fields["dead_time_error"])
    num = np.polymul((1 + r / 2, r), (CORRECTION**-2, LEAD / CORRECTION, 1.0))
    den = np.polymul((0.5, 1.0), (CORRECTION**-2, LAG / CORRECTION, 1.0))
    # In powers of theta s; the larger of s and theta s goes with coefficients near one.
    powers = theta ** (np.arange(3, -1, -1.0) - (3 if theta > 1 else 0))
    return TransferFunction((num * powers).tolist(), (den * powers).tolist())


@dataclass(frozen=True)
class Performance:
    """Bound sigma_max(w_P S) < 1 with w_P = (1/M) (tau_P s + 1)/(tau_P s + A/M), SLH eq. 29.

    With permitted errors E = diag(e_i) of the outputs it is sigma_max(w_P E^-1 S E) < 1.

    Parameters
    ----------
    max_peak : float
        M > 1: greatest permitted peak of the sensitivity.
    offset : float
        A: permitted relative steady-state offset, 0 <= A < 1.
    tau_p : float or None
        Closed-loop time constant tau_P > 0 in the caller's time unit; None where it is sought.
    output_scale : tuple of float or None
        e_i > 0, the error that each output may have, in its own unit; only their ratios matter.
        None: the outputs are compared as they come.

    """

    max_peak: float = 2.0
    offset: float = 0.0
    tau_p: float | None = None
    output_scale: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        settle(
            self,
            max_peak=real(self.max_peak, "/max_peak"),
            offset=real(self.offset, "/offset"),
        )
        if self.tau_p is not None:
            settle(self, tau_p=real(self.tau_p, "/tau_p"))
        if not 1 < self.max_peak <= LARGEST:
            message = "the permitted peak of the sensitivity must exceed 1"
            raise InvalidInputError(message, "/max_peak")
        if not 0 <= self.offset < 1:
            message = "the permitted offset must lie in 0..1, 1 excluded"
            raise InvalidInputError(message, "/offset")
        if self.tau_p is not None and not 0 < self.tau_p <= LARGEST:
            message = f"tau_p must be positive and at most {LARGEST:g}"
            raise InvalidInputError(message, "/tau_p")
        if self.output_scale is not None:
            settle(self, output_scale=reals(self.output_scale, "/output_scale"))
            self._check_output_scale(self.output_scale)
        refuse_vanishing(self.offset / self.max_peak, "/offset")
        if self.tau_p is not None:
            refuse_vanishing(self.tau_p / self.max_peak, "/tau_p")

    @staticmethod
    def _check_output_scale(scales: tuple[float, ...]) -> None:
        for index, scale in enumerate(scales):
            if not 0 < scale <= LARGEST:
                message = f"a permitted error must be positive and at most {LARGEST:g}"
                raise InvalidInputError(message, f"/output_scale/{index}")
        if scales and max(scales) > MOST_UNLIKE * min(scales):
            message = f"the permitted errors may differ by a factor of {MOST_UNLIKE:g} at most"
            raise InvalidInputError(message, "/output_scale")

    @property
    def unlike_outputs(self) -> bool:
        """Whether the permitted errors of the outputs differ; only then do they matter."""
        return len(set(self.output_scale or ())) > 1

    def of_units(self, units: Sequence[int]) -> Performance:
        """Return the same demand on some of the outputs."""
        if self.output_scale is None:
            return self
        return replace(self, output_scale=tuple(self.output_scale[unit] for unit in units))

    def with_tau_p(self, tau_p: float) -> Performance:
        """Return the same demand at the time constant `tau_p`."""
        return replace(self, tau_p=tau_p)

    @cached_property
    def weight(self) -> TransferFunction:
        """w_P(s). Needs `tau_p`."""
        if self.tau_p is None:
            message = "tau_p is needed for the performance weight"
            raise InvalidInputError(message, "/tau_p")
        M = self.max_peak
        return TransferFunction((self.tau_p / M, 1 / M), (self.tau_p, self.offset / M))

    def magnitude(self, omega: ArrayLike) -> NDArray[np.float64]:
        """Return |w_P| at `omega` > 0 (rad per time unit), (k,). Needs `tau_p`."""
        return np.abs(self.weight.response(omega))
