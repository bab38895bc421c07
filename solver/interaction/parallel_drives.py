"""Units in parallel on one load, each with its own integral action.

Astrom and Hagglund, section 11.4: two motors on one shaft, J dw/dt + D w = M_1 + M_2 - M_L,
each under M_i = K_i e_i + K_Ii z_i, z_i' = e_i = w_sp - w - n_i. Two integrators that see the
same error leave their difference free: a mode at s = 0 that the common signals neither move nor
show, while any measurement error drives it for good. Here for any number of units on any
rational load.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from solver.model.equality import ByValue
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.transfer_function import TransferFunction
from solver.model.validation import instance, instances, real, reals, settle
from solver.stability.singular import equilibrate, equilibration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = [
    "Drive",
    "DriveAnalysis",
    "DriveModel",
    "ParallelDrives",
    "Remedy",
    "SteadyState",
    "alternative",
    "analyse_drives",
    "mended_model",
    "original_model",
]

MAX_DRIVES = 100
# A singular value below this, relative to the largest, is zero but for rounding.
_RANK_TOLERANCE = 1e-10
_SAME_DIRECTION = 1e-6


@dataclass(frozen=True)
class Drive:
    """PI controller of a unit: `bias` + (`proportional_gain` + `integral_gain`/s) e.

    Gains are not negative. The bias is the unit's effort where output and set point agree, M_i0 of
    eq. 11.12.
    """

    proportional_gain: float
    integral_gain: float = 0.0
    bias: float = 0.0

    def __post_init__(self) -> None:
        settle(self, bias=real(self.bias, "/bias"))
        if not abs(self.bias) <= 1e12:
            message = "a bias must be at most 1e12 in magnitude"
            raise InvalidInputError(message, "/bias")
        for name in ("proportional_gain", "integral_gain"):
            settle(self, **{name: real(getattr(self, name), f"/{name}")})
            if not 0 <= getattr(self, name) <= 1e12:
                message = "a gain must not be negative and at most 1e12"
                raise InvalidInputError(message, f"/{name}")


@dataclass(frozen=True)
class ParallelDrives:
    """Units that act on one load.

    Parameters
    ----------
    load : TransferFunction
        From the sum of the units' efforts (torque, flow) to the common output (speed,
        pressure); rational, strictly proper, not zero.
    drives : sequence of Drive
        1 to `MAX_DRIVES` units.
    shares : sequence of float or None
        Wanted share of each unit in the steady load, each >= 0, sum 1; None: in proportion to
        the proportional gains, or to the integral gains where those are all zero.

    """

    load: TransferFunction
    drives: tuple[Drive, ...]
    shares: tuple[float, ...]

    def __init__(
        self,
        load: TransferFunction,
        drives: Sequence[Drive],
        shares: Sequence[float] | None = None,
    ) -> None:
        instance(load, TransferFunction, "/load")
        settle(self, load=load, drives=instances(drives, Drive, "/drives"))
        if load.is_zero or load.relative_degree < 1:
            message = "the load must be strictly proper and not zero"
            raise InvalidInputError(message, "/load/num")
        if load.dead_time:
            message = "parallel units are analysed on a load without dead time"
            raise UnsupportedPlantError(message, "/load/dead_time")
        if not 1 <= len(self.drives) <= MAX_DRIVES:
            message = f"the number of units must lie in 1..{MAX_DRIVES}"
            raise InvalidInputError(message, "/drives")
        if not any(drive.proportional_gain or drive.integral_gain for drive in self.drives):
            message = "no unit has any gain"
            raise InvalidInputError(message, "/drives")
        settle(self, shares=self._shares(shares))

    def _shares(self, shares: Sequence[float] | None) -> tuple[float, ...]:
        if shares is None:
            gains = [drive.proportional_gain for drive in self.drives]
            if not any(gains):
                gains = [drive.integral_gain for drive in self.drives]
            return tuple(gain / sum(gains) for gain in gains)
        shares = reals(shares, "/shares")
        if len(shares) != len(self.drives):
            message = f"{len(shares)} shares for {len(self.drives)} units"
            raise InvalidInputError(message, "/shares")
        for index, share in enumerate(shares):
            if not 0 <= share <= 1:
                message = "a share lies in 0..1"
                raise InvalidInputError(message, f"/shares/{index}")
        if not math.isclose(sum(shares), 1, abs_tol=1e-9):
            message = f"the shares sum to {sum(shares):.6g}, not to 1"
            raise InvalidInputError(message, "/shares")
        return shares

    @property
    def integrating(self) -> tuple[int, ...]:
        """Units with integral action, from 0."""
        return tuple(i for i, drive in enumerate(self.drives) if drive.integral_gain)


@dataclass(frozen=True)
class DriveModel:
    """Linear model of the closed loop.

    x' = A x + B v with v = (set point, load, measurement error of each unit), and outputs
    (common output, effort of each unit) = C x + D v.
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Closed-loop poles."""
        return np.asarray(np.linalg.eigvals(self.A), dtype=np.complex128)

    def hidden_modes(self) -> tuple[int, int]:
        """Return how many modes at s = 0 are uncontrollable and how many unobservable.

        Popov-Belevitch-Hautus test at s = 0: controllable from set point and load, observable
        in the common output.
        """
        size = len(self.A)
        controllable = np.hstack([self.A, self.B[:, :2]])
        observable = np.vstack([self.A, self.C[:1]])
        return size - _rank(controllable), size - _rank(observable)


@dataclass(frozen=True)
class Remedy:
    """One integrator whose output is shared out; the proportional parts stay with the units.

    Effort of unit i: K_i e_i + shares[i] `integral_gain` z with z' = sum_i weights[i] e_i. The
    common output answers set point and load as before. `poles` are those before less the free
    ones, `hidden_modes` those left (none).
    """

    shares: tuple[float, ...]
    weights: tuple[float, ...]
    proportional_gains: tuple[float, ...]
    integral_gain: float
    poles: NDArray[np.complex128]
    hidden_modes: int
    text: str


@dataclass(frozen=True, eq=False)
class DriveAnalysis(ByValue):
    """What is hidden in the closed loop of parallel units.

    Attributes
    ----------
    integrating : tuple of int
        Units with integral action, from 0.
    uncontrollable_modes, unobservable_modes : int
        Integrator modes that set point and load do not move, and that the common output does
        not show.
    effort_drifts : (m, n)
        Orthonormal patterns in which the units' efforts drift freely; each sums to zero.
    poles : (p,) complex
        Closed-loop poles, the free ones (at 0) included.
    stable : bool
        Whether all other poles lie in the left half plane.
    text : str
        Which controllers cause it, and what happens.
    remedy : Remedy or None
        None without integral action: there is a steady-state error instead.
    alternative : ParallelDrives or None
        The other remedy: the integral action of all units in one of them, the others proportional.
        That one takes up the steady load. None where it changes nothing.
    steady : SteadyState or None
        Of units without integral action; None with it, or where the load integrates.

    """

    integrating: tuple[int, ...]
    uncontrollable_modes: int
    unobservable_modes: int
    effort_drifts: NDArray[np.float64]
    poles: NDArray[np.complex128]
    stable: bool
    text: str
    remedy: Remedy | None
    alternative: ParallelDrives | None
    steady: SteadyState | None


@dataclass(frozen=True)
class SteadyState:
    """Where proportional units come to rest under unit set point and unit load.

    With a finite static gain of the load, G(0); w = (G K w_sp + G (sum of biases - M_L))/(1 + G K),
    K the sum of the gains (Astrom and Hagglund, section 11.4; G = 1/D).

    Attributes
    ----------
    set_point, load, bias : float
        Share of the set point that is reached; change of the output for a load of 1; what the
        biases alone make.
    effort_ratios : tuple of float
        (M_i - M_i0) of each unit over that of the first one with a gain: as the gains.

    """

    set_point: float
    load: float
    bias: float
    effort_ratios: tuple[float, ...]


def analyse_drives(system: ParallelDrives) -> DriveAnalysis:
    """Find the free integrator modes of parallel units, and the remedy.

    Parameters
    ----------
    system : ParallelDrives
        Units and load.

    Raises
    ------
    InvalidInputError
        No such system.

    """
    instance(system, ParallelDrives, "")
    model = original_model(system)
    uncontrollable, unobservable = model.hidden_modes()
    # The free modes are the poles nearest to the origin.
    visible = model.poles[np.argsort(np.abs(model.poles))][uncontrollable:]
    return DriveAnalysis(
        integrating=system.integrating,
        uncontrollable_modes=uncontrollable,
        unobservable_modes=unobservable,
        effort_drifts=_effort_drifts(model),
        poles=model.poles,
        stable=bool(np.all(visible.real < 0)),
        text=_explanation(system),
        remedy=_remedy(system) if system.integrating else None,
        alternative=alternative(system) if len(system.integrating) > 1 else None,
        steady=_steady(system),
    )


def alternative(system: ParallelDrives) -> ParallelDrives:
    """Return the units with all integral action in that which has most of it, others proportional.

    The common output answers set point and load as before: it sees the sum of the integral gains.
    """
    integral = [drive.integral_gain for drive in system.drives]
    chosen = int(np.argmax(integral))
    drives = [
        Drive(drive.proportional_gain, sum(integral) if unit == chosen else 0.0, drive.bias)
        for unit, drive in enumerate(system.drives)
    ]
    return ParallelDrives(system.load, drives, system.shares)


def _steady(system: ParallelDrives) -> SteadyState | None:
    gain = system.load.static_gain
    if system.integrating or not math.isfinite(gain):
        return None
    gains = [drive.proportional_gain for drive in system.drives]
    total = 1 + gain * sum(gains)
    first = next(each for each in gains if each)
    return SteadyState(
        set_point=gain * sum(gains) / total,
        load=-gain / total,
        bias=gain * sum(drive.bias for drive in system.drives) / total,
        effort_ratios=tuple(each / first for each in gains),
    )


def original_model(system: ParallelDrives) -> DriveModel:
    """Return the closed loop with one integrator in each unit that has integral action."""
    n, m = len(system.drives), len(system.integrating)
    distribution = np.zeros((n, m))
    selection = np.zeros((m, n))
    for column, unit in enumerate(system.integrating):
        distribution[unit, column] = system.drives[unit].integral_gain
        selection[column, unit] = 1.0
    return _model(system, distribution, selection)


def mended_model(system: ParallelDrives) -> DriveModel:
    """Return the closed loop with one integrator, shared out."""
    integral = np.array([drive.integral_gain for drive in system.drives])
    total = float(np.sum(integral))
    distribution = (np.array(system.shares) * total)[:, None]
    return _model(system, distribution, (integral / total)[None, :])


def _model(
    system: ParallelDrives, distribution: NDArray[np.float64], selection: NDArray[np.float64]
) -> DriveModel:
    """Close the loop: integrators z' = selection e, efforts K e + distribution z."""
    Al, Bl, Cl = _realise(system.load)
    n, m, order = len(system.drives), len(selection), len(Al)
    K = np.array([drive.proportional_gain for drive in system.drives])
    # Efforts M = -K y + distribution z + K r - K n; errors e = r - y - n.
    effort_x = np.hstack([-K[:, None] @ Cl, distribution])
    effort_v = np.hstack([K[:, None], np.zeros((n, 1)), -np.diag(K)])
    total = np.ones((1, n))
    A = np.vstack(
        [
            np.hstack([Al, np.zeros((order, m))]) + Bl @ total @ effort_x,
            np.hstack([-selection @ np.ones((n, 1)) @ Cl, np.zeros((m, m))]),
        ]
    )
    load_v = Bl @ (total @ effort_v - np.eye(1, n + 2, 1))
    error_v = selection @ np.hstack([np.ones((n, 1)), np.zeros((n, 1)), -np.eye(n)])
    B = np.vstack([load_v, error_v])
    C = np.vstack([np.hstack([Cl, np.zeros((1, m))]), effort_x])
    D = np.vstack([np.zeros((1, n + 2)), effort_v])
    return DriveModel(A, B, C, D)


def _realise(
    load: TransferFunction,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return A, B, C of a strictly proper load in controllable canonical form."""
    order = len(load.den) - 1
    A = np.eye(order, k=-1)
    A[0] = -np.array(load.den[1:]) / load.den[0]
    C = np.zeros((1, order))
    C[0, order - len(load.num) :] = np.array(load.num) / load.den[0]
    return A, np.eye(order, 1), C


def _rank(matrix: NDArray[np.float64]) -> int:
    scaled = equilibrate(matrix)  # a rank must not depend on the units of time, output and effort
    return int(np.linalg.matrix_rank(scaled, tol=_RANK_TOLERANCE * np.linalg.norm(scaled, 2)))


def _effort_drifts(model: DriveModel) -> NDArray[np.float64]:
    """Return the efforts of the unobservable modes at s = 0, orthonormal rows.

    Those that Gram and Schmidt make of the projections of the units, one after the other.
    """
    units = len(model.C) - 1
    scaled, factors = equilibration(np.vstack([model.A, model.C[:1]]))
    hidden = factors.T * scipy.linalg.null_space(scaled, rcond=_RANK_TOLERANCE)
    if hidden.shape[1] == 0:
        return np.zeros((0, units))
    efforts = model.C[1:] @ hidden
    basis, _ = np.linalg.qr(efforts / np.linalg.norm(efforts, axis=0))
    found: list[NDArray[np.float64]] = []
    for projection in basis @ basis.T:
        rest = projection - sum((projection @ other) * other for other in found)
        if np.linalg.norm(rest) > _SAME_DIRECTION and len(found) < hidden.shape[1]:
            found.append(rest / np.linalg.norm(rest))
    return np.array(found)


def _remedy(system: ParallelDrives) -> Remedy:
    model = mended_model(system)
    integral = [drive.integral_gain for drive in system.drives]
    shares = ", ".join(f"{share:.3g}" for share in system.shares)
    return Remedy(
        shares=system.shares,
        weights=tuple(gain / sum(integral) for gain in integral),
        proportional_gains=tuple(drive.proportional_gain for drive in system.drives),
        integral_gain=sum(integral),
        poles=model.poles,
        hidden_modes=model.hidden_modes()[1],
        text=(
            f"Use one integrator with the gain {sum(integral):.6g} and share its output out "
            f"({shares}); leave each unit its proportional gain."
        ),
    )


def _explanation(system: ParallelDrives) -> str:
    count = len(system.integrating)
    if count == 0:
        return (
            "No unit has integral action: the steady load is shared as the gains, with an offset."
        )
    if count == 1:
        return (
            f"Unit {system.integrating[0] + 1} alone has integral action: nothing is free, and "
            "this unit takes up the steady load."
        )
    names = ", ".join(str(unit + 1) for unit in system.integrating[:-1])
    names += f" and {system.integrating[-1] + 1}"
    free = "the difference of their outputs is" if count == 2 else f"{count - 1} differences are"
    return (
        f"Units {names} integrate the same error, so {free} free: set point and load do not "
        "move it and the common output does not show it, but a measurement error in one unit "
        "shifts load between them for good."
    )
