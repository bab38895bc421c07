"""The certificate: what is claimed, the D-scales that prove it, and its JSON document.

The document has the forms of the service's requests. Every number is written as the shortest
decimal that reads back as the same double, so nothing is lost on the way. A digest tells an
altered document from a wrong claim; it is no signature.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from solver.certificate.enclosures import Interval
from solver.certificate.reduction import scale_count
from solver.model.errors import InvalidInputError
from solver.model.given import require_loops, require_weights
from solver.model.mixed_plant import MixedPlant
from solver.model.plants import ParallelPlant
from solver.model.validation import instance, instances, real, reals, settle

if TYPE_CHECKING:
    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Performance, Uncertainty

__all__ = ["FORMAT", "VERSION", "Certificate", "Claim", "ProvenInterval"]

FORMAT = "mutune-certificate"
VERSION = 1


@dataclass(frozen=True)
class ProvenInterval:
    """An interval of frequencies (rad per time unit) and the D-scales that serve all of it.

    Parameters
    ----------
    interval : Interval
        Both ends included.
    scales : tuple of float
        d > 0 of each of the different settings, in the order of their first loop; of each loop
        where the plant is a matrix; a single one for full-block uncertainty. Settings of outputs
        with unlike permitted errors, or of inputs or outputs with unlike uncertainty, are
        different; the scales go with the plant E^-1 G E. Where outputs err, their scales follow.
        Of loops that share inputs: of each input.

    """

    interval: Interval
    scales: tuple[float, ...]

    def __post_init__(self) -> None:
        settle(self, scales=reals(self.scales, "/scales"))
        for index, scale in enumerate(self.scales):
            if not 0 < scale < math.inf:
                message = "a D-scale is a positive number"
                raise InvalidInputError(message, f"/scales/{index}")


@dataclass(frozen=True)
class Claim:
    """The loops are nominally stable, and mu <= gamma at every frequency.

    Parameters
    ----------
    plant, uncertainty, performance, loops
        What the claim is about; one loop a unit.
    gamma : float
        Level of mu, > 0.

    """

    plant: Plant
    uncertainty: Uncertainty
    performance: Performance
    loops: tuple[Controller, ...]
    gamma: float

    def __post_init__(self) -> None:
        settle(self, loops=require_loops(self.plant, self.loops), gamma=real(self.gamma, "/gamma"))
        require_weights(self.plant, self.uncertainty, self.performance)
        if not 0 < self.gamma < math.inf:
            message = "the level is a positive number"
            raise InvalidInputError(message, "/gamma")


@dataclass(frozen=True)
class Certificate:
    """A claim and its evidence.

    Parameters
    ----------
    claim : Claim
        What is claimed.
    intervals : tuple of ProvenInterval
        They follow each other from 0 to infinity.

    """

    claim: Claim
    intervals: tuple[ProvenInterval, ...]

    def __post_init__(self) -> None:
        instance(self.claim, Claim, "/claim")
        settle(self, intervals=instances(self.intervals, ProvenInterval, "/intervals"))
        self._check_coverage()
        claim = self.claim
        count = scale_count(
            claim.plant, claim.loops, claim.uncertainty, claim.performance.output_scale
        )
        for index, proven in enumerate(self.intervals):
            if len(proven.scales) != count:
                message = f"{len(proven.scales)} scales where {count} are needed"
                raise InvalidInputError(message, f"/intervals/{index}/scales")

    def _check_coverage(self) -> None:
        reached = 0.0
        for index, proven in enumerate(self.intervals):
            interval, field = proven.interval, f"/intervals/{index}"
            if interval.low != reached:
                fault = "overlaps the one before" if interval.low < reached else "leaves a gap"
                message = f"the interval starts at {interval.low:g}, not at {reached:g}: it {fault}"
                raise InvalidInputError(message, field + "/low")
            if not interval.low < interval.high:
                message = "the interval ends before it starts"
                raise InvalidInputError(message, field + "/high")
            reached = interval.high
        if not math.isinf(reached):
            message = f"the intervals end at {reached:g}, not at infinity"
            raise InvalidInputError(message, "/intervals")

    def to_document(self) -> dict[str, Any]:
        """Return the document, ready for `json.dumps`. `read_certificate` is the inverse."""
        content = self._content()
        return {**content, "digest": _digest(content)}

    def _content(self) -> dict[str, Any]:
        claim = self.claim
        # Numbers as floats throughout, so that 101 and 101.0 have the same digest.
        return {
            "format": FORMAT,
            "version": VERSION,
            "gamma": float(claim.gamma),
            "plant": _plant(claim.plant),
            "uncertainty": _uncertainty(claim.uncertainty),
            "performance": _performance(claim.performance),
            "loops": [_loop(loop) for loop in claim.loops],
            "intervals": [
                {
                    "low": float(proven.interval.low),
                    "high": None if proven.interval.unbounded else float(proven.interval.high),
                    "scales": [float(scale) for scale in proven.scales],
                }
                for proven in self.intervals
            ],
        }


def _uncertainty(uncertainty: Uncertainty) -> dict[str, Any]:
    content: dict[str, Any] = {
        "weight": _weight(uncertainty.weight),
        "structure": str(uncertainty.structure),
    }
    # Written where they err only: other documents keep their form and digest.
    if uncertainty.outputs is not None:
        content["outputs"] = _weight(uncertainty.outputs.weight)
    return content


def _weight(weight: TransferFunction | tuple[TransferFunction, ...]) -> object:
    # A list where each input or output has its own: other documents keep their form and digest.
    if isinstance(weight, tuple):
        return [_transfer_function(own) for own in weight]
    return _transfer_function(weight)


def _performance(performance: Performance) -> dict[str, Any]:
    content: dict[str, Any] = {
        "max_peak": float(performance.max_peak),
        "offset": float(performance.offset),
        "tau_p": _optional(performance.tau_p),
    }
    # Written where they are given only: other documents keep their form and digest.
    if performance.output_scale is not None:
        content["output_scale"] = [float(scale) for scale in performance.output_scale]
    return content


def _loop(loop: Controller) -> dict[str, Any]:
    content = {
        "gain": float(loop.gain),
        "integral_time": _optional(loop.integral_time),
        "derivative_time": _optional(loop.derivative_time),
    }
    # Only a filter of its own is written: documents without one keep their form and digest.
    if loop.filter_time is not None:
        content["filter_time"] = float(loop.filter_time)
    return content


def _optional(value: float | None) -> float | None:
    return None if value is None else float(value)


def _digest(content: dict[str, Any]) -> str:
    """Return the SHA-256 of the content with sorted names and no white space, in hexadecimal."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _plant(plant: Plant) -> dict[str, Any]:
    if isinstance(plant, MixedPlant):
        return {
            "kind": "mixed",
            "plant": _plant(plant.plant),
            "outputs": [[float(entry) for entry in row] for row in plant.outputs],
            "inputs": [[float(entry) for entry in row] for row in plant.inputs],
            "shared": plant.shared,
        }
    if isinstance(plant, ParallelPlant):
        return {
            "kind": "parallel",
            "n": plant.n,
            "process": _transfer_function(plant.process),
            "interaction": _transfer_function(plant.interaction),
        }
    return {
        "kind": "matrix",
        "elements": [[_transfer_function(e) for e in row] for row in plant.rows],
    }


def _transfer_function(function: TransferFunction) -> dict[str, Any]:
    return {
        "num": list(function.num),
        "den": list(function.den),
        "dead_time": function.dead_time,
    }
