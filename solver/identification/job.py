"""Records with what is assumed of them, as the rows that are fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from solver.identification.beginning import starts
from solver.identification.problem import PlantStructure, Start, rows
from solver.identification.record_checks import check_excitation
from solver.identification.row_fit import RowFit, refit_row
from solver.model.errors import InvalidInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from solver.identification.record import Record
    from solver.identification.row import Row

__all__ = ["Job", "fits_by_record"]


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
        return cls(tuple(records), tuple(starts(records, structure, drift=drift)), structure, drift)

    def rows(self) -> list[Row]:
        """Return the rows: one of a parallel plant, else one for each output."""
        return rows(self.records, self.begins, self.structure, drift=self.drift)

    def units(self) -> list[Row]:
        """Return a row of own input and sum of the others for each unit."""
        return rows(self.records, self.begins, PlantStructure.UNITS, drift=self.drift)

    def alone(self, index: int) -> Job:
        """Return the job with one record."""
        return replace(self, records=(self.records[index],), begins=(self.begins[index],))


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
