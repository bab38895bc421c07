"""From records to a plant, what the records tell of it, and the weight that covers its errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from solver.identification.equality import Equality, test_equality
from solver.identification.findings import FittedElement, fitted_elements
from solver.identification.problem import (
    PlantStructure,
    Start,
    limits,
    matrix_rows,
    parallel_row,
    starts,
)
from solver.identification.record import Record
from solver.identification.record_checks import check_excitation, check_records
from solver.identification.row import Nuisance
from solver.identification.row_fit import RowFit, fit_row, refit_row
from solver.identification.selection import Allowed
from solver.identification.uncertainty import Cover, Family, cover_family, row_responses
from solver.model.errors import InvalidInputError, UnsupportedPlantError
from solver.model.plants import MAX_MATRIX_SIZE, MatrixPlant, ParallelPlant
from solver.model.validation import choice, flag, instance, instances, integer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.row import Row
    from solver.model.plants import Plant

__all__ = ["Identification", "Prediction", "identify"]

# A start that moves by so many standard deviations of its scatter before any input does is no rest.
MOVING = 6.0
QUIET_SAMPLES = 8
POOR = 50.0  # per cent of normalised fit


@dataclass(frozen=True, eq=False)
class Prediction:
    """One output of one record against the plant.

    Attributes
    ----------
    record, output : str
        Names.
    kept_back : bool
        Whether the fit has not seen this record.
    normalised_fit : float
        100 (1 - |y - y_hat| / |y - mean y|) per cent, each record with an offset of its own.
    time, measured, predicted : (k,) ndarray
        Readings with their times.
    spikes : int
        Readings left out as spikes.

    """

    record: str
    output: str
    kept_back: bool
    normalised_fit: float
    time: NDArray[np.float64]
    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    spikes: int


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
    unit_plant : MatrixPlant or None
        Of such a plant up to 10 units, each unit with elements of its own.
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
    unit_plant: MatrixPlant | None
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
        n = len(self.inputs)
        parts = row_responses(self.fits, [f.draws(count, generator) for f in self.fits], omega)
        if self.structure is PlantStructure.MATRIX:
            return np.moveaxis(parts, -1, 1)
        g, i = parts[:, 0, 0], parts[:, 0, -1]
        return np.where(np.eye(n, dtype=bool), g[..., None, None], i[..., None, None])


def identify(
    records: Sequence[Record],
    *,
    structure: PlantStructure | Literal["parallel", "matrix"] = PlantStructure.MATRIX,
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
        PARALLEL: g and i shared by all units. MATRIX: every element of its own.
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
    if seed < 0:
        message = "must not be negative"
        raise InvalidInputError(message, "/seed")
    inputs, outputs = check_records(records, validation)
    if structure is PlantStructure.MATRIX and len(inputs) > MAX_MATRIX_SIZE:
        message = (
            f"a matrix plant has at most {MAX_MATRIX_SIZE} inputs; identical units go as parallel"
        )
        raise InvalidInputError(message, "/structure")
    begins = starts(records)
    box = limits(records)
    job = _Job(tuple(records), tuple(begins), drift)
    if structure is PlantStructure.PARALLEL:
        fits = [fit_row(job.parallel(), allowed, box)]
    else:
        fits = [fit_row(row, allowed, box) for row in job.matrix()]
    _refuse_runaway(fits, records)
    if structure is PlantStructure.PARALLEL:
        return _parallel(job, fits[0], inputs, outputs, validation=validation, seed=seed)
    return _matrix(job, fits, inputs, outputs, validation=validation, seed=seed)


@dataclass(frozen=True, eq=False)
class _Job:
    records: tuple[Record, ...]
    begins: tuple[Start, ...]
    drift: bool

    def _with_nuisance(self, row: Row) -> Row:
        moving = any(not _rests(segment.time, segment.output, segment.changes)
                     for segment in row.segments)  # fmt: skip
        return replace(row, nuisance=Nuisance(drift=self.drift, unknown_start=moving))

    def parallel(self, units: Sequence[int] | None = None) -> Row:
        return self._with_nuisance(parallel_row(self.records, self.begins, units))

    def matrix(self) -> list[Row]:
        return [self._with_nuisance(row) for row in matrix_rows(self.records, self.begins)]

    def alone(self, index: int) -> _Job:
        return _Job((self.records[index],), (self.begins[index],), self.drift)


def _parallel(
    job: _Job,
    fit: RowFit,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    *,
    validation: Sequence[Record],
    seed: int,
) -> Identification:
    n = len(inputs)
    process = fit.elements[0].transfer_function()
    interaction = fit.elements[1].transfer_function() if n > 1 else process
    plant = ParallelPlant(n, process, interaction)
    units: list[RowFit] = []
    equality = None
    if n > 1:
        equality = test_equality(fit)
        kinds, shapes = fit.solved.kinds, fit.solved.shapes
        units = [refit_row(job.parallel([unit]), kinds, shapes, fit.limits) for unit in range(n)]
    unit_plant = None
    if 1 < n <= MAX_MATRIX_SIZE:
        functions = [[e.transfer_function() for e in unit.elements] for unit in units]
        unit_plant = MatrixPlant(
            [[functions[r][0 if r == c else 1] for c in range(n)] for r in range(n)]
        )
    members = {
        f"unit {name}": [unit] for name, unit in zip(outputs, units, strict=False)
    } | _by_record(job, [fit])
    cover = cover_family(Family([fit], members, parallel=n), seed)
    names = ("own input", "another input")[: min(n, 2)]
    elements = fitted_elements(fit, "each output", names, seed)
    predictions = _predictions(job, [fit], outputs, kept_back=False)
    predictions += _validated(job, [fit], validation, outputs)
    advice = _advice(elements, predictions, cover, equality)
    return Identification(
        plant, PlantStructure.PARALLEL, inputs, outputs, elements, tuple(predictions), equality,
        unit_plant, cover, job.begins, advice, (fit,),
    )  # fmt: skip


def _matrix(
    job: _Job,
    fits: list[RowFit],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    *,
    validation: Sequence[Record],
    seed: int,
) -> Identification:
    plant = MatrixPlant([[e.transfer_function() for e in fit.elements] for fit in fits])
    elements = tuple(
        element
        for fit, output in zip(fits, outputs, strict=True)
        for element in fitted_elements(fit, output, inputs, seed)
    )
    cover = cover_family(Family(fits, _by_record(job, fits), parallel=None), seed)
    predictions = _predictions(job, fits, outputs, kept_back=False)
    predictions += _validated(job, fits, validation, outputs)
    advice = _advice(elements, predictions, cover, None)
    return Identification(
        plant, PlantStructure.MATRIX, inputs, outputs, elements, tuple(predictions), None,
        None, cover, job.begins, advice, tuple(fits),
    )  # fmt: skip


def _by_record(job: _Job, fits: list[RowFit]) -> dict[str, list[RowFit]]:
    """Return fits of each record alone, those records that move every input."""
    if len(job.records) == 1:
        return {}
    found = {}
    for index, record in enumerate(job.records):
        try:
            check_excitation([record])
        except InvalidInputError:
            continue
        alone = job.alone(index)
        rows = [alone.parallel()] if len(fits) < len(record.outputs) else alone.matrix()
        found[f"record {record.name}"] = [
            refit_row(row, fit.solved.kinds, fit.solved.shapes, fit.limits)
            for row, fit in zip(rows, fits, strict=True)
        ]
    return found


def _predictions(
    job: _Job, fits: list[RowFit], outputs: tuple[str, ...], *, kept_back: bool
) -> list[Prediction]:
    parallel = len(fits) < len(outputs)
    rows = [job.parallel()] if parallel else job.matrix()
    found = []
    for row, fit in zip(rows, fits, strict=True):
        if not kept_back:
            row = fit.row.plain()  # noqa: PLW2901 - without the fit's spikes
        solved = replace(row.solve(fit.solved.kinds, fit.solved.shapes), gains=fit.solved.gains)
        own = row.own_parts(solved)
        for segment, block, part in zip(row.segments, solved.blocks, own, strict=True):
            predicted = block @ solved.gains + part
            seen = segment.weight > 0
            left = (segment.output - predicted)[seen]
            spread = segment.output[seen] - segment.output[seen].mean()
            found.append(
                Prediction(
                    job.records[segment.record].name,
                    outputs[segment.unit],
                    kept_back,
                    100 * (1 - float(np.linalg.norm(left) / np.linalg.norm(spread))),
                    segment.time + job.records[segment.record].time[0],
                    segment.output,
                    predicted,
                    int(np.count_nonzero(~seen)),
                )
            )
    return found


def _validated(
    job: _Job, fits: list[RowFit], validation: Sequence[Record], outputs: tuple[str, ...]
) -> list[Prediction]:
    if not validation:
        return []
    other = _Job(tuple(validation), tuple(starts(validation)), job.drift)
    return _predictions(other, fits, outputs, kept_back=True)


def _rests(
    time: NDArray[np.float64],
    output: NDArray[np.float64],
    changes: tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...],
) -> bool:
    """Whether an output rests while no input has moved yet, as far as the record shows it."""
    first = min((float(at[0]) for at, _ in changes if at.size), default=float(time[-1]))
    quiet = time < first
    if np.count_nonzero(quiet) < QUIET_SAMPLES:
        return True
    t, y = time[quiet], output[quiet]
    t = (t - t.mean()) / np.ptp(t)
    slope = float(t @ (y - y.mean()) / (t @ t))
    left = y - y.mean() - slope * t
    # Coloured noise wanders too: its steps, not its level, are the yardstick's floor.
    error = float(np.linalg.norm(left)) / max(float(np.linalg.norm(t)) * np.sqrt(t.size), 1e-300)
    return bool(abs(slope) <= max(MOVING * error, 0.05 * float(np.ptp(output))))


def _refuse_runaway(fits: list[RowFit], records: Sequence[Record]) -> None:
    """Refuse outputs that grow exponentially: no stable plant and no integrator explains them."""
    names = list(records[0].outputs)
    for fit in fits:
        for segment, left in zip(fit.row.segments, fit.residuals(), strict=True):
            spread = float(np.linalg.norm(segment.output - segment.output.mean()))
            if 100 * (1 - float(np.linalg.norm(left)) / spread) > POOR:
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


def _advice(
    elements: tuple[FittedElement, ...],
    predictions: list[Prediction],
    cover: Cover,
    equality: Equality | None,
) -> tuple[str, ...]:
    found = [f"{e.output}, {e.input}: {e.test}" for e in elements if e.test]
    found += [
        f"{one.output} of {one.record} is explained to {one.normalised_fit:.0f} % only: look for "
        "inputs that were not recorded, a wrong column or a nonlinear stretch"
        for one in predictions
        if one.normalised_fit < POOR
    ]
    if equality is not None and not equality.plausible:
        found.append(
            "the units differ by more than noise (probability "
            f"{equality.probability:.2g} if they were the same): the weight holds the difference; "
            "or tune with each unit as a scenario, or as a matrix plant"
        )
    found.extend(cover.advice)
    return tuple(found)
