"""mutune identify: from files of records to a tuning request."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from service.analyses.identify import ANALYSIS, identified, tuning_request
from service.analyses.identify.models import IdentificationTask
from service.cli.outcomes import ExitCode, reported, say
from service.schemas.parsing import Fault, RequestError
from service.whole_file import replace_text
from solver.identification.columns import MOST_SHOWN
from solver.identification.reading import column_names, read_record
from solver.identification.record import Record

__all__ = ["Question", "identify_files"]


@dataclass(frozen=True)
class Question:
    """What to identify from the files; the names of the columns are separated by commas."""

    time: str | None
    inputs: str
    outputs: str
    structure: str
    order: str
    drift: bool


@reported
def identify_files(
    files: list[Path],
    question: Question,
    *,
    validate: list[Path],
    output: Path | None,
    as_scenarios: bool,
    as_json: bool,
) -> ExitCode:
    """Identify a plant from files, print what they tell, and write the tuning request.

    Returns
    -------
    ExitCode
        BAD_INPUT where the files are at fault; else DONE.

    """
    inputs = _names(question.inputs, "--inputs", files[0])
    outputs = _names(question.outputs, "--outputs", files[0])

    def records(paths: list[Path]) -> tuple[Record, ...]:
        return tuple(
            read_record(path, time=question.time, inputs=inputs, outputs=outputs) for path in paths
        )

    task = IdentificationTask(
        used=records(files),
        kept_back=records(validate),
        structure=question.structure,
        order={"auto": None, "first": 1, "second": 2}[question.order],
        integrating=None,
        drift=question.drift,
        digests=tuple(map(_digest, (*files, *validate))),
    )
    document = identified(task)
    if output is not None:
        request = tuning_request(document, as_scenarios=as_scenarios)
        replace_text(output, json.dumps(request, indent=2, allow_nan=False) + "\n")
        say(f"{output}: a tuning request")
    if as_json:
        print(json.dumps(document, allow_nan=False))  # noqa: T201 - the output asked for
    else:
        from service.cli.console import show  # noqa: PLC0415 - needed for people alone

        show(ANALYSIS.table(ANALYSIS.result.model_validate(document)))
    return ExitCode.DONE


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _names(text: str, option: str, file: Path) -> list[str]:
    if not text:
        has = ", ".join(column_names(file)[:MOST_SHOWN])
        raise RequestError((Fault("", f"{option} is missing; the columns of {file.name}: {has}"),))
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise RequestError((Fault("", f"{option} {text!r}: a name is empty"),))
    return names
