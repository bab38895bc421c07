"""The loop in exact numbers, and the matrices of the two statements over frequency intervals.

With E = I + G C, X = diag(d_i^2) and the diagonal M = |w_I|^2 C^H X C + |w_P|^2 I,

    sigma_max(D N D^-1) <= gamma   <=>   F = gamma^2 E M^-1 E^H - G X^-1 G^H - I >= 0,

because N = [w_I C; w_P I] E^-1 [G I]. F is a sum over the inputs, without the inverse of a matrix.
Congruence keeps its sign, so outputs may be combined by T and multiplied by powers of sigma.
Columns of E with the element of M may be multiplied by powers of sigma too: each takes as many as
its controller integrates, and M in its own right those of w_P. Where outputs err
(`solver.certificate.reduction`), the second half of the outputs is not demanded anything of: w_P,
and the 1 of the last term, are 0 there. What loops move that share inputs does not err: w_I and
G X^-1 G^H are 0 there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from flint import acb, fmpq, fmpq_poly

from solver.certificate.enclosures import ExactResponse, Frame, Ratio, exact, is_hurwitz
from solver.certificate.reduction import MAX_SETTINGS, ExactBlock, blocks, settings_of
from solver.certificate.taylor_models import TaylorModel
from solver.model.controllers import DERIVATIVE_FILTER
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.mixed_plant import shares_inputs
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Structure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.certificate.record import Claim
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.weights import Performance

__all__ = ["EnclosedLoop", "ExactLoop"]

SLIGHT = fmpq(1, 10**8)  # of w_P: M without an error, which would vanish at s = 0, is regular

Matrix = list[list[TaylorModel]]


@dataclass(frozen=True, eq=False)
class ExactLoop:
    """Plant, weights, controllers and level in exact numbers.

    Parameters
    ----------
    blocks : tuple of ExactBlock
        The plant's independent blocks.
    controllers : tuple of Ratio
        The different settings; where outputs err, as often 1.
    uncertainties : tuple of ExactResponse
        w_I of each of the settings, then w_O of each; or one for all.
    performance : Ratio
        w_P.
    level_squared : fmpq
        gamma^2.
    full : bool
        Whether the uncertainty is one full block: all inputs then share one D-scale.

    """

    blocks: tuple[ExactBlock, ...]
    controllers: tuple[Ratio, ...]
    uncertainties: tuple[ExactResponse, ...]
    performance: Ratio
    level_squared: fmpq
    full: bool

    @classmethod
    def of(cls, claim: Claim, most: int = MAX_SETTINGS, *, known: bool = False) -> ExactLoop:
        """Return the loop that a claim is about; `known`: without the errors of shared inputs.

        Raises
        ------
        UnsupportedPlantError
            A pole of the plant lies in the right half plane or, other than s = 0, on its edge.
        InvalidInputError
            The performance weight has no time constant, the uncertainty weight is not stable, or
            there are more than `most` different settings.

        """
        _require_stable(claim.plant)
        settings = settings_of(
            claim.plant, claim.loops, claim.uncertainty, claim.performance.output_scale
        )
        doubled = claim.uncertainty.outputs is not None
        if len(settings) * (2 if doubled else 1) > most:
            message = f"proofs cover at most {most} different settings"
            message += ", half as many where outputs err" if doubled else ""
            raise InvalidInputError(message, "/loops")
        for w_I in claim.uncertainty.all_weights:
            # At a pole of w_I no level of mu is finite, and at s = 0 the rows' powers of s, which
            # are counted from the plant alone, would hide it.
            if w_I.den[-1] == 0 or not is_hurwitz(w_I.den):
                message = "the uncertainty weight must be stable, without a pole at s = 0"
                raise InvalidInputError(message, "/uncertainty/weight/den")
        of_any = claim.uncertainty.weight_of(0)
        own = [group.weight or of_any for group in settings]
        controllers = [_controller(group.controller) for group in settings]
        others = [group.outputs for group in settings if group.outputs is not None]
        if shares_inputs(claim.plant) and not known:
            others = [claim.uncertainty.weight_of(unit) for unit in range(claim.plant.plant.n)]
        own += others
        controllers += [Ratio.reduced(fmpq_poly([1]), fmpq_poly([1])) for _ in others]
        return cls(
            blocks(claim.plant, settings, known=known),
            tuple(controllers),
            # Only |w_I| counts, so a dead time in it is left out.
            tuple(
                ExactResponse.combined([(1, TransferFunction(w_I.num, w_I.den))])
                for w_I in (own[:1] if len(set(own)) == 1 else own)
            ),
            _performance_weight(claim.performance),
            exact(claim.gamma) ** 2,
            claim.uncertainty.structure is Structure.FULL,
        )

    def X(self, scales: Sequence[float]) -> list[fmpq]:  # noqa: N802 - the matrix X
        """Return the squared D-scale that goes with each of the settings; 1 where none errs."""
        squares = [exact(scale) ** 2 for scale in scales]
        without = self.blocks[0].exact
        if self.full:
            squares *= len(self.controllers) - without
        return [fmpq(1)] * without + squares

    def powers(self, setting: int) -> int:
        """Powers of sigma of a column of E: one where its controller has a pole at s = 0."""
        return self.controllers[setting].integrators

    def turns(self, block: ExactBlock) -> int:
        """Powers of sigma of det E of a block, its rows and columns multiplied by theirs."""
        return sum(block.integrators) + sum(map(self.powers, block.settings))


def _require_stable(plant: Plant) -> None:
    for element in plant.elements:
        if not is_hurwitz(element.den):
            message = "a pole of the plant is unstable; integrators are the only ones permitted"
            raise UnsupportedPlantError(message, "/plant")


def _controller(controller: Controller) -> Ratio:
    """Return SLH eq. 26; its default filter is the product of two exact numbers."""
    num, den = fmpq_poly([exact(controller.gain)]), fmpq_poly([1])
    if controller.integral_time is not None:
        integral_time = exact(controller.integral_time)
        num *= fmpq_poly([1, integral_time])
        den *= fmpq_poly([0, integral_time])
    if controller.derivative_time is not None:
        derivative_time = exact(controller.derivative_time)
        num *= fmpq_poly([1, derivative_time])
        if controller.filter_time is None:
            den *= fmpq_poly([1, exact(DERIVATIVE_FILTER) * derivative_time])
    if controller.filter_time is not None:
        den *= fmpq_poly([1, exact(controller.filter_time)])
    return Ratio.reduced(num, den)


def _performance_weight(performance: Performance) -> Ratio:
    """Return SLH eq. 29; from the parameters, since the weight's coefficients are rounded."""
    if performance.tau_p is None:
        message = "the level of mu needs a time constant"
        raise InvalidInputError(message, "/performance/tau_p")
    tau_p, max_peak = exact(performance.tau_p), exact(performance.max_peak)
    return Ratio.reduced(
        fmpq_poly([1, tau_p]), fmpq_poly([exact(performance.offset), max_peak * tau_p])
    )


@dataclass(frozen=True, eq=False)
class EnclosedBlock:
    """A block over one frame, row r multiplied by sigma^k_r with its k_r integrators.

    Parameters
    ----------
    identity : list of TaylorModel
        sigma^k_r, (k,).
    plant : Matrix
        T G, (k, k).
    return_difference : Matrix
        T (I + G C), (k, k), its columns multiplied by their powers of sigma.

    """

    identity: list[TaylorModel]
    plant: Matrix
    return_difference: Matrix


class EnclosedLoop:
    """The loop over one frame.

    Parameters
    ----------
    loop : ExactLoop
        The loop.
    frame : Frame
        Where to enclose it.

    Raises
    ------
    UnenclosedError
        A pole may lie in the frame.

    """

    def __init__(self, loop: ExactLoop, frame: Frame) -> None:
        self.loop = loop
        self.frame = frame
        self._responses: dict[tuple[ExactResponse, int], TaylorModel] = {}
        self._controllers = [
            ratio.enclose(frame, loop.powers(x)) for x, ratio in enumerate(loop.controllers)
        ]
        self.blocks = [self._enclose(block) for block in loop.blocks]

    def performance_form(self, index: int, X: Sequence[fmpq]) -> list[TaylorModel]:
        """Return T F T^H of a block, rows multiplied as there: the lower triangle by rows.

        Raises
        ------
        UnenclosedError
            M may be singular in the frame.

        """
        block, parts = self.loop.blocks[index], self.blocks[index]
        T, w = block.combination, block.weights
        E, G, powers = parts.return_difference, parts.plant, parts.identity
        inputs, outputs = range(len(w)), range(len(T))
        over_M = [
            inverse.scaled(self.loop.level_squared * w[i])
            for i, inverse in enumerate(self._inverse_of_M(block, X))
        ]
        over_X = [
            w[i] / X[x] if i >= block.exact else fmpq(0) for i, x in enumerate(block.settings)
        ]
        E_right = [[E[c][i].conjugate * over_M[i] for i in inputs] for c in outputs]
        G_right = [[G[c][i].conjugate.scaled(over_X[i]) for i in inputs] for c in outputs]
        elements = []
        for r in outputs:
            for c in range(r + 1):
                constant = sum(
                    (w[i] * T[r][i] * T[c][i] for i in inputs if block.demanded[i]), fmpq(0)
                )
                element = (powers[r] * powers[c].conjugate).scaled(-constant)
                for i in inputs:
                    element = element + E[r][i] * E_right[c][i] - G[r][i] * G_right[c][i]
                elements.append(element)
        return elements

    @cached_property
    def _weights_squared(self) -> tuple[list[TaylorModel], TaylorModel]:
        """|w_I|^2 of each of the settings, and |w_P|^2 with its powers of sigma."""
        found = [response.enclose(self.frame, 0) for response in self.loop.uncertainties]
        own = [w_I * w_I.conjugate for w_I in found]
        w_P = self.loop.performance.enclose(self.frame, self.loop.performance.integrators)
        return own if len(own) > 1 else own * len(self._controllers), w_P * w_P.conjugate

    def _inverse_of_M(self, block: ExactBlock, X: Sequence[fmpq]) -> list[TaylorModel]:  # noqa: N802 - the matrix M
        """Return M^-1, its diagonal, divided by the powers of |sigma|^2 of the columns of E.

        Where w_P has a pole at s = 0 but the controller has none, powers of |sigma|^2 remain.
        """
        w_I, w_P = self._weights_squared
        square = self.frame.sigma * self.frame.sigma.conjugate
        found = []
        for i, (x, demanded) in enumerate(zip(block.settings, block.demanded, strict=True)):
            controller = self._controllers[x]
            errs = i >= block.exact
            own = (w_I[x] * (controller * controller.conjugate)).scaled(X[x] if errs else fmpq(0))
            powers = self.loop.powers(x)
            wanted = self.loop.performance.integrators if demanded else powers
            M = own * square if wanted > powers else own
            if demanded:
                M = M + (w_P * square if powers > wanted else w_P)
                if powers > wanted and not errs:  # a larger M is a stronger claim
                    M = M + w_P.scaled(SLIGHT)
            inverse = M.reciprocal()
            found.append(inverse * square if wanted > powers else inverse)
        return found

    def _enclose(self, block: ExactBlock) -> EnclosedBlock:
        identity, plant, return_difference = [], [], []
        for r, count in enumerate(block.integrators):
            powers = TaylorModel.constant(acb(1))
            for _ in range(count):
                powers = powers * self.frame.sigma
            row = [
                self._response(response, count).scaled(factor)
                for response, factor in zip(block.responses[r], block.factors[r], strict=True)
            ]
            identity.append(powers)
            plant.append(row)
            raised = powers * self.frame.sigma
            return_difference.append(
                [
                    (raised if self.loop.powers(x) else powers).scaled(t) + g * self._controllers[x]
                    for t, g, x in zip(block.combination[r], row, block.settings, strict=True)
                ]
            )
        return EnclosedBlock(identity, plant, return_difference)

    def _response(self, response: ExactResponse, factors: int) -> TaylorModel:
        if (response, factors) not in self._responses:
            self._responses[response, factors] = response.enclose(self.frame, factors)
        return self._responses[response, factors]
