"""Plant records: what the inputs did and what the outputs did then, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.model.errors import InvalidInputError
from solver.model.transfer_function import LARGEST
from solver.model.validation import instance, real_array

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "LEAST_SAMPLES",
    "MAX_SAMPLES",
    "MAX_SIGNALS",
    "MISSING",
    "Record",
    "checked_times",
    "same_signals",
]

MAX_SAMPLES = 1_000_000
MAX_SIGNALS = 300  # inputs or outputs of one record
LEAST_SAMPLES = 20  # below, two elements have as many unknowns as there are readings
# Samples in a row that are missing where they come regularly: held over fewer, an input that moved
# meanwhile is late by less than a few samples.
MISSING = 5
ROUNDED = 0.3  # share of samples at the time of the one before that no chance repetition reaches
HOUR = 3600.0  # seconds, which time stamps become


@dataclass(frozen=True, eq=False)
class Record:
    """One stretch of plant data.

    An input is held at its value from its sample to the next one. The samples need not be
    equidistant.

    Parameters
    ----------
    time : (k,) array_like
        Increasing, in any one unit.
    inputs, outputs : mapping of str to (k,) array_like
        Signals by name, in the order of the plant's columns and rows.
    name : str
        What messages call the record.

    Attributes
    ----------
    observed : (outputs, k) ndarray of bool
        Where each output was read; everywhere but in a record `with_gaps`.

    Raises
    ------
    InvalidInputError
        A value that is no finite number, a length that differs, time standing still or going
        backwards, a name used twice, too few samples or too many of anything.

    """

    time: NDArray[np.float64]
    inputs: Mapping[str, NDArray[np.float64]]
    outputs: Mapping[str, NDArray[np.float64]]
    name: str
    observed: NDArray[np.bool_]

    def __init__(
        self,
        time: ArrayLike,
        inputs: Mapping[str, ArrayLike],
        outputs: Mapping[str, ArrayLike],
        name: str = "record",
    ) -> None:
        self._fill(time, inputs, outputs, name, gaps=False)

    @classmethod
    def with_gaps(
        cls,
        time: ArrayLike,
        inputs: Mapping[str, ArrayLike],
        outputs: Mapping[str, ArrayLike],
        name: str = "record",
    ) -> Record:
        """Return a record in which NaN stands for "no reading".

        An input without a reading is held at the one before; an output without one is left out
        of the fit at that sample. So signals sampled at unlike times go into one record. Samples
        at which an input that is read every time has been lost for long are left out.

        Raises
        ------
        InvalidInputError
            As for the class; an input without its first reading.

        """
        record = object.__new__(cls)
        record._fill(time, inputs, outputs, name, gaps=True)
        return record

    @property
    def span(self) -> float:
        """Time from the first sample to the last."""
        return float(self.time[-1] - self.time[0])

    @property
    def sampling_period(self) -> float:
        """Median distance of the samples."""
        return float(np.median(np.diff(self.time)))

    def part(self, rows: slice, name: str) -> Record:
        """Return some samples of the record as one of its own, called `name`."""
        record = object.__new__(Record)
        object.__setattr__(record, "time", self.time[rows])
        for kind in ("inputs", "outputs"):
            signals = {key: values[rows] for key, values in getattr(self, kind).items()}
            object.__setattr__(record, kind, signals)
        object.__setattr__(record, "name", name)
        object.__setattr__(record, "observed", self.observed[:, rows])
        return record

    def _fill(
        self,
        time: ArrayLike,
        inputs: Mapping[str, ArrayLike],
        outputs: Mapping[str, ArrayLike],
        name: str,
        *,
        gaps: bool,
    ) -> None:
        times = checked_times(time)
        instance(name, str, "/name")
        for kind, signals in (("inputs", inputs), ("outputs", outputs)):
            instance(signals, Mapping, f"/{kind}")
            for key in signals:
                instance(key, str, f"/{kind}")
            if not 1 <= len(signals) <= MAX_SIGNALS:
                message = f"a record has 1..{MAX_SIGNALS} {kind}"
                raise InvalidInputError(message, f"/{kind}")
        for twice in inputs.keys() & outputs.keys():
            message = f"{twice!r} is an input and an output"
            raise InvalidInputError(message, f"/outputs/{twice}")
        moved = {
            key: _held(values, f"/inputs/{key}") if gaps else values
            for key, values in (
                (k, _column(v, times.size, "/inputs", k)) for k, v in inputs.items()
            )
        }
        read = {
            key: _column(values, times.size, "/outputs", key) for key, values in outputs.items()
        }
        observed = np.array([~np.isnan(values) if gaps else np.isfinite(values) | True
                             for values in read.values()])  # fmt: skip
        for kind, signals in (("inputs", moved), ("outputs", read)):
            for key, values in signals.items():
                bad = ~(np.abs(values) <= LARGEST)
                if gaps and kind == "outputs":
                    bad &= ~np.isnan(values)
                _refuse_bad(bad, f"/{kind}/{key}")
        for key, seen in zip(read, observed, strict=True):
            if np.count_nonzero(seen) < LEAST_SAMPLES:
                message = f"{key!r} has fewer than {LEAST_SAMPLES} readings"
                raise InvalidInputError(message, f"/outputs/{key}")
        kept = ~_lost(inputs.values()) if gaps else np.ones(times.size, dtype=bool)
        times, observed = times[kept], observed[:, kept]
        moved = {key: values[kept] for key, values in moved.items()}
        read = {key: values[kept] for key, values in read.items()}
        object.__setattr__(self, "time", times)
        object.__setattr__(self, "inputs", moved)
        object.__setattr__(self, "outputs", read)
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "observed", observed)


def same_signals(records: Sequence[Record]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of inputs and outputs that all records share.

    Raises
    ------
    InvalidInputError
        No record, or one whose signals differ from the first one's.

    """
    if not records:
        message = "at least one record is needed"
        raise InvalidInputError(message, "/records")
    first = records[0]
    for index, record in enumerate(records):
        for kind in ("inputs", "outputs"):
            names, wanted = tuple(getattr(record, kind)), tuple(getattr(first, kind))
            if names != wanted:
                message = (
                    f"{record.name} has the {kind} {', '.join(names)}, "
                    f"{first.name} has {', '.join(wanted)}: name them alike, in the same order"
                )
                raise InvalidInputError(message, f"/records/{index}/{kind}")
    return tuple(first.inputs), tuple(first.outputs)


def checked_times(time: ArrayLike) -> NDArray[np.float64]:
    """Return the times of a record's samples, (k,).

    Raises
    ------
    InvalidInputError
        Not finite, standing still, going backwards, too few or too many.

    """
    times = _numbers(time, "/time")
    if not LEAST_SAMPLES <= times.size <= MAX_SAMPLES:
        message = f"a record has {LEAST_SAMPLES}..{MAX_SAMPLES} samples"
        raise InvalidInputError(message, "/time")
    _refuse_bad(~(np.abs(times) <= LARGEST), "/time")
    steps = np.diff(times)
    if not np.all(steps > 0):
        index = int(np.argmax(~(steps > 0))) + 1
        how = "stands still" if steps[index - 1] == 0 else "goes backwards"
        message = (
            f"time {how} at sample {index} ({times[index]:g} after {times[index - 1]:g}): "
            f"{_remedy(steps, index)}"
        )
        raise InvalidInputError(message, f"/time/{index}")
    # Shifted before it is used: the distances must survive the subtraction.
    if steps.min() < 1e-12 * max(abs(times[0]), abs(times[-1])):
        message = "the samples are too close together for their times; count time from the start"
        raise InvalidInputError(message, "/time")
    return times


def _remedy(steps: NDArray[np.float64], index: int) -> str:
    """Return what to do about a step of time that is no step forward."""
    forward = steps[steps > 0]
    still = float(np.mean(steps == 0))
    if still > ROUNDED:
        return (
            f"{100 * still:.0f} % of the samples have the time of the one before, so the times are "
            "rounded: export them with more digits, as seconds beside minutes"
        )
    usual = float(np.median(forward)) if forward.size else 0.0
    if abs(steps[index - 1] + HOUR - usual) < usual / 2:
        return (
            "an hour back, as at the end of summer time: export the times in UTC or with their "
            "zone, or cut the record there into two files"
        )
    return "sort the samples, and cut the record where a clock was set or data were joined"


def _numbers(values: ArrayLike, field: str) -> NDArray[np.float64]:
    return real_array(values, field, ndim=1)


def _column(values: ArrayLike, size: int, kind: str, key: str) -> NDArray[np.float64]:
    column = _numbers(values, f"{kind}/{key}")
    if column.shape != (size,):
        message = f"{key!r} has {column.size} values, time has {size}"
        raise InvalidInputError(message, f"{kind}/{key}")
    return column


def _held(values: NDArray[np.float64], field: str) -> NDArray[np.float64]:
    """Fill each gap with the reading before it."""
    known = ~np.isnan(values)
    if not known[0]:
        message = "the first reading of an input is missing: start the record where it is known"
        raise InvalidInputError(message, f"{field}/0")
    last = np.maximum.accumulate(np.where(known, np.arange(values.size), 0))
    return np.asarray(values[last])


def _lost(inputs: Iterable[ArrayLike]) -> NDArray[np.bool_]:
    """Return where an input that is read every time is missing over more than `MISSING` samples."""
    lost: NDArray[np.bool_] | None = None
    for values in inputs:
        missing = np.isnan(np.asarray(values, dtype=float))
        lost = np.zeros(missing.size, dtype=bool) if lost is None else lost
        read = np.flatnonzero(~missing)
        if np.median(np.diff(read)) > 1:
            continue  # logged more rarely: held in between
        for first, last in zip(read, [*read[1:], missing.size], strict=True):
            if last - first > MISSING + 1:
                lost[first + 1 : last] = True
    assert lost is not None  # noqa: S101 - for the type checker: a record has inputs
    return lost


def _refuse_bad(bad: NDArray[np.bool_], field: str) -> None:
    if np.any(bad):
        index = int(np.argmax(bad))
        message = (
            f"no finite number up to {LARGEST:g}: leave the sample out of every signal, or give "
            "the record as one with gaps"
        )
        raise InvalidInputError(message, f"{field}/{index}")
