"""From records to a plant, what the records tell of it, and the weight that covers its errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from solver.identification.equality import Equality, test_equality
from solver.identification.feedback import followed
from solver.identification.findings import FittedElement, fitted_elements
from solver.identification.job import Job, fits_by_record
from solver.identification.prediction import Prediction, predictions
from solver.identification.problem import PlantStructure, Start, limits
from solver.identification.record import Record
from solver.identification.record_checks import check_records
from solver.identification.row_fit import RowFit, fit_row, refit_row
from solver.identification.selection import Allowed
from solver.identification.stretches import holes, stretches
from solver.identification.uncertainty import (
    Cover,
    Family,
    cover_family,
    matrix_responses,
    row_responses,
)
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant, ParallelPlant
from solver.model.validation import choice, flag, instance, instances, integer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.plants import Plant

__all__ = ["Alternative", "Identification", "identify"]

MOST_SEEDS = 2**63  # as over HTTP, so that every result can be had there
POOR = 50.0  # per cent of normalised fit


@dataclass(frozen=True, eq=False)
class Alternative:
    """A plant that units or records of their own tell, beside the nominal one.

    Attributes
    ----------
    name : str
        Whose it is.
    plant : Plant
        With the forms of the nominal plant.

    """

    name: str
    plant: Plant


@dataclass(frozen=True, eq=False)
class Identification:
    """A plant from records.

    Attributes
    ----------
    plant : Plant
        The nominal plant.
    structure : PlantStructure
        Which elements are shared.
    inputs, outputs : tuple of str
        Names in the order of columns and rows.
    elements : tuple of FittedElement
        Row by row; of a parallel plant g and i.
    predictions : tuple of Prediction
        Of each output in each record.
    equality : Equality or None
        Of a parallel plant with two units or more, whether the units are the same.
    alternatives : tuple of Alternative
        What the spread consists of: each unit with elements of its own where units that share
        theirs differ, and the plant of each record. Scenarios of a tuning with `cover.own`.
    cover : Cover
        The errors and the weight above them.
    begins : tuple of Start
        How each record begins.
    advice : tuple of str
        What to do next.
    fits : tuple of RowFit
        The fits themselves, row by row; one of a parallel plant.

    """

    plant: Plant
    structure: PlantStructure
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    elements: tuple[FittedElement, ...]
    predictions: tuple[Prediction, ...]
    equality: Equality | None
    alternatives: tuple[Alternative, ...]
    cover: Cover
    begins: tuple[Start, ...]
    advice: tuple[str, ...]
    fits: tuple[RowFit, ...]

    def draw(
        self, count: int, generator: np.random.Generator, omega: NDArray[np.float64]
    ) -> NDArray[np.complex128]:
        """Return responses of plants drawn from the fitted distribution, (count, k, n, n).

        Parameters
        ----------
        count : int
            Number of plants.
        generator : numpy.random.Generator
            Where the draws come from.
        omega : (k,) ndarray
            rad per time unit.

        """
        drawn = [fit.draws(count, generator) for fit in self.fits]
        parts = row_responses(self.fits, drawn, omega)
        return matrix_responses(parts, self.structure, len(self.inputs))


def identify(
    records: Sequence[Record],
    *,
    structure: PlantStructure | Literal["parallel", "units", "matrix"] = PlantStructure.MATRIX,
    allowed: Allowed = Allowed(),  # noqa: B008 - frozen
    validation: Sequence[Record] = (),
    drift: bool = False,
    seed: int = 0,
) -> Identification:
    """Fit a plant to records.

    Parameters
    ----------
    records : sequence of Record
        With as many inputs as outputs; all the same signals.
    structure : PlantStructure or str
        PARALLEL: g and i shared by all units. UNITS: each unit with a g and an i of its own, the
        other inputs having the same effect on it. MATRIX: every element of its own.
    allowed : Allowed
        Forms of the elements.
    validation : sequence of Record
        Predicted only.
    drift : bool
        Whether each output of each record may drift linearly.
    seed : int
        Of the draws from the fitted distribution.

    Raises
    ------
    InvalidInputError
        Records that cannot tell a plant; the message says what to add.
    UnsupportedPlantError
        Outputs that run away.

    """
    records = instances(records, Record, "/records")
    validation = instances(validation, Record, "/validation")
    structure = choice(PlantStructure, structure, "/structure")
    instance(allowed, Allowed, "/allowed")
    drift, seed = flag(drift, "/drift"), integer(seed, "/seed")
    if not 0 <= seed < MOST_SEEDS:
        message = "must lie in 0..2^63 - 1"
        raise InvalidInputError(message, "/seed")
    inputs, outputs = check_records(records, validation)
    whole, records, validation = records, stretches(records), stretches(validation)
    if structure is not PlantStructure.PARALLEL and len(inputs) > MAX_MATRIX_SIZE:
        message = (
            f"a matrix plant has at most {MAX_MATRIX_SIZE} inputs; identical units go as parallel"
        )
        raise InvalidInputError(message, "/structure")
    job = Job.of(records, structure, drift=drift)
    box = limits(records)
    fits = [fit_row(row, allowed, box) for row in job.rows()]
    _refuse_runaway(fits, records)
    n = len(inputs)
    by_record = fits_by_record(job, fits)
    members: dict[str, list[RowFit]] = {}
    equality, units = None, []
    if structure is PlantStructure.PARALLEL and n > 1:
        equality = test_equality(fits[0])
        kinds, shapes = fits[0].solved.kinds, fits[0].solved.shapes
        units = [refit_row(row, kinds, shapes, fits[0].limits) for row in job.units()]
        members |= {f"unit {name}": [unit] for name, unit in zip(outputs, units, strict=True)}
    cover = cover_family(Family(fits, members | by_record, structure, n), seed)
    if structure is PlantStructure.MATRIX:
        named = [(output, inputs) for output in outputs]
    else:
        rest = ("another input",)[: n - 1]
        named = (
            [(output, (own, *rest)) for output, own in zip(outputs, inputs, strict=True)]
            if structure is PlantStructure.UNITS
            else [("each output", ("own input", *rest))]
        )
    elements = tuple(
        element
        for fit, (output, ins) in zip(fits, named, strict=True)
        for element in fitted_elements(fit, output, ins, seed)
    )
    found = predictions(job, fits, kept_back=False)
    if validation:
        other = Job.of(validation, structure, drift=drift)
        found += predictions(other, fits, kept_back=True)
    alternatives = [Alternative(name, _plant(own, structure, n)) for name, own in by_record.items()]
    if equality is not None and not equality.plausible and n <= MAX_MATRIX_SIZE:
        own_units = Alternative("each unit its own", _plant(units, PlantStructure.UNITS, n))
        alternatives.insert(0, own_units)
    advice = [
        *(_parted(one) for one in whole if holes(one).size),
        *_advice(records, elements, found, cover),
    ]
    if equality is not None and not equality.plausible:
        advice.insert(0, _differ(equality, fits[0], units, outputs))
    return Identification(
        _plant(fits, structure, n), structure, inputs, outputs, elements, tuple(found), equality,
        tuple(alternatives), cover, job.begins, tuple(advice), tuple(fits),
    )  # fmt: skip


def _plant(fits: Sequence[RowFit], structure: PlantStructure, n: int) -> Plant:
    functions = [[e.transfer_function() for e in fit.elements] for fit in fits]
    if structure is PlantStructure.PARALLEL:
        return ParallelPlant(n, functions[0][0], functions[0][-1])
    if structure is PlantStructure.UNITS:
        return MatrixPlant(
            [[functions[r][0 if r == c else -1] for c in range(n)] for r in range(n)]
        )
    return MatrixPlant(functions)


def _differ(
    equality: Equality, shared: RowFit, units: Sequence[RowFit], outputs: tuple[str, ...]
) -> str:
    """Return by how much each unit's own element differs from the shared one, in words."""
    common = shared.elements[0]
    words = []
    for name, unit in zip(outputs, units, strict=True):
        own = unit.elements[0]
        parts = [f"gain {100 * (own.gains[0] / common.gains[0] - 1):+.0f} %"]
        if common.lag:
            parts.append(f"time constant {100 * (own.lag / common.lag - 1):+.0f} %")
        parts.append(f"dead time {own.dead_time - common.dead_time:+.2g}")
        words.append(f"{name}: {', '.join(parts)}")
    return (
        "the units differ by more than noise (probability "
        f"{equality.probability:.2g} if they were the same). Own input against the shared element: "
        f"{'; '.join(words)}. The weight holds the difference; as a scenario it costs less"
    )


def _refuse_runaway(fits: list[RowFit], records: Sequence[Record]) -> None:
    """Refuse outputs that grow exponentially: no stable plant and no integrator explains them."""
    names = list(records[0].outputs)
    for fit in fits:
        for segment, left in zip(fit.row.segments, fit.residuals(), strict=True):
            spread = float(np.linalg.norm(segment.output - segment.output.mean()))
            if not spread > 0 or 100 * (1 - float(np.linalg.norm(left)) / spread) > POOR:
                continue
            half = segment.time > segment.time[-1] / 2
            growing = [
                float(np.ptp(segment.output[part])) for part in (~half, half) if np.any(part)
            ]
            if growing[-1] > 10 * growing[0]:
                message = (
                    f"output {names[segment.unit]!r} runs away in {records[segment.record].name}: "
                    "the plant is unstable or the inputs that move it are missing; record it under "
                    "control, or leave that stretch out"
                )
                raise UnsupportedPlantError(
                    message, f"/records/{segment.record}/outputs/{names[segment.unit]}"
                )


def _parted(record: Record) -> str:
    """Say that a record goes on after holes as another one."""
    after = holes(record)
    first = f"from {record.time[after[0] - 1]:g} to {record.time[after[0]]:g}"
    more = f" and in {after.size - 1} more holes" if after.size > 1 else ""
    return (
        f"there are no samples of {record.name} {first}{more}: what the inputs did there is not "
        f"known, so the record is fitted in {after.size + 1} parts, each with a start of its own"
    )


def _advice(
    records: Sequence[Record],
    elements: tuple[FittedElement, ...],
    found: list[Prediction],
    cover: Cover,
) -> list[str]:
    advice = [
        f"{name} of {record.name} follows the readings ({100 * share:.0f} % of its moves): it was "
        "under control. Disturbances that the controller answered bias this fit; move the "
        "set point by much more than they move the output, or record the loop in manual"
        for record in records
        for name, share in followed(record).items()
    ]
    advice += [f"{e.output}, {e.input}: {e.test}" for e in elements if e.test]
    advice += [
        f"{one.output} of {one.record} is explained to {one.normalised_fit:.0f} % only: look for "
        "inputs that were not recorded, a wrong column or a nonlinear stretch"
        for one in found
        if one.normalised_fit < POOR
    ]
    return [*advice, *cover.advice]
