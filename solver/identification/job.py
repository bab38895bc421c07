"""Records with what is assumed of them, as the rows that are fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.identification.problem import (
    PlantStructure,
    Start,
    matrix_rows,
    parallel_row,
    starts,
)
from solver.identification.record_checks import check_excitation
from solver.identification.row import Nuisance
from solver.identification.row_fit import RowFit, refit_row
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.identification.record import Record
    from solver.identification.row import Row

__all__ = ["Job", "fits_by_record"]

# A start that moves by so many standard deviations of its scatter before any input does is no rest.
MOVING = 6.0
QUIET_SAMPLES = 8


@dataclass(frozen=True, eq=False)
class Job:
    """Records, how each begins, and which elements are shared.

    Attributes
    ----------
    records : tuple of Record
        The data.
    begins : tuple of Start
        How each begins.
    structure : PlantStructure
        Which elements are shared.
    drift : bool
        Whether each output of each record may drift.

    """

    records: tuple[Record, ...]
    begins: tuple[Start, ...]
    structure: PlantStructure
    drift: bool

    @classmethod
    def of(cls, records: Sequence[Record], structure: PlantStructure, *, drift: bool) -> Job:
        """Return the job of fitting, or predicting, these records."""
        return cls(tuple(records), tuple(starts(records)), structure, drift)

    def rows(self) -> list[Row]:
        """Return the rows: one of a parallel plant, else one for each output."""
        match self.structure:
            case PlantStructure.PARALLEL:
                rows = [parallel_row(self.records, self.begins)]
            case PlantStructure.UNITS:
                rows = self.units()
            case PlantStructure.MATRIX:
                rows = matrix_rows(self.records, self.begins)
        return [self._with_nuisance(row) for row in rows]

    def units(self) -> list[Row]:
        """Return a row of own input and sum of the others for each unit."""
        rows = [
            parallel_row(self.records, self.begins, [unit])
            for unit in range(len(self.records[0].outputs))
        ]
        return [self._with_nuisance(row) for row in rows]

    def alone(self, index: int) -> Job:
        """Return the job with one record."""
        return replace(self, records=(self.records[index],), begins=(self.begins[index],))

    def _with_nuisance(self, row: Row) -> Row:
        moving = any(not _rests(segment.time, segment.output, segment.changes)
                     for segment in row.segments)  # fmt: skip
        return replace(row, nuisance=Nuisance(drift=self.drift, unknown_start=moving))


def fits_by_record(job: Job, fits: Sequence[RowFit]) -> dict[str, list[RowFit]]:
    """Return fits of each record alone, those records that move every input."""
    if len(job.records) == 1:
        return {}
    found = {}
    for index, record in enumerate(job.records):
        try:
            check_excitation([record])
        except InvalidInputError:
            continue
        found[f"record {record.name}"] = [
            refit_row(row, fit.solved.kinds, fit.solved.shapes, fit.limits)
            for row, fit in zip(job.alone(index).rows(), fits, strict=True)
        ]
    return found


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
