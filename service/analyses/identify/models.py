"""An identification: records and questions, and the plant that they tell, as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, JsonValue, model_validator

from service.schemas.drawn import Drawn
from service.schemas.fields import AnalysisRequest, RequestModel, ResultModel, below
from service.schemas.jobs import JobState
from solver.identification.record import MAX_SAMPLES, MAX_SIGNALS, Record
from solver.identification.record_checks import check_records
from solver.model.errors import InvalidInputError

__all__ = [
    "EXAMPLE",
    "DrawnIdentification",
    "IdentificationJob",
    "IdentificationRequest",
    "IdentificationResult",
    "IdentificationTask",
    "RecordOfSignals",
]

MAX_RECORDS = 100
_TIME = [float(k) for k in range(40)]
_INPUT = [0.0] * 5 + [1.0] * 20 + [0.0] * 15
_OUTPUT = [
    20.0, 20.01, 19.99, 20.0, 20.01, 19.99, 20.0, 20.36, 20.66, 20.9, 21.1, 21.27, 21.4, 21.5,
    21.6, 21.67, 21.73, 21.78, 21.82, 21.86, 21.88, 21.9, 21.92, 21.93, 21.95, 21.96, 21.96, 21.61,
    21.31, 21.08, 20.88, 20.72, 20.59, 20.48, 20.4, 20.32, 20.27, 20.21, 20.18, 20.15,
]  # fmt: skip
_RECORD: JsonValue = {
    "time": list[JsonValue](_TIME),
    "inputs": {"valve": list[JsonValue](_INPUT)},
    "outputs": {"temperature": list[JsonValue](_OUTPUT)},
}
EXAMPLE: dict[str, JsonValue] = {"records": [_RECORD], "structure": "matrix", "order": "first"}

MAX_POINTS = 20_001
Points = Annotated[list[float], Field(max_length=MAX_POINTS)]
Samples = Annotated[list[float], Field(max_length=MAX_SAMPLES)]
Readings = Annotated[list[float | None], Field(max_length=MAX_SAMPLES)]
Signals = Annotated[dict[str, Readings], Field(min_length=1, max_length=MAX_SIGNALS)]


@dataclass(frozen=True, eq=False)
class IdentificationTask:
    """Records of the solver, and the assumptions under which they are fitted."""

    used: tuple[Record, ...]
    kept_back: tuple[Record, ...]
    structure: str
    order: int | None
    integrating: bool | None
    drift: bool
    digests: tuple[str, ...] = ()  # of the files, those kept back last; else of the signals


class RecordOfSignals(RequestModel):
    """One stretch of plant data; inputs are held from their sample to the next."""

    name: str = Field(
        default="", max_length=200, description="What messages call it.", examples=["monday"]
    )
    time: Samples = Field(
        description="Increasing, in any one unit.",
        examples=[_TIME],
        json_schema_extra={"x-unit": "time"},
    )
    inputs: Signals = Field(
        description="Inputs by name, in the order of the loops; null: no reading, held.",
        examples=[{"valve": _INPUT}],
    )
    outputs: Signals = Field(
        description="Outputs by name, in the same order; null: no reading.",
        examples=[{"temperature": _OUTPUT}],
    )
    use: Literal["fit", "validate"] = Field(
        default="fit",
        description="validate: kept back from the fit, and predicted.",
        examples=["fit"],
    )

    def build(self, name: str) -> Record:
        """Return the solver's record."""
        nan = float("nan")
        inputs, outputs = (
            {key: [nan if v is None else v for v in values] for key, values in signals.items()}
            for signals in (self.inputs, self.outputs)
        )
        return Record.with_gaps(self.time, inputs, outputs, self.name or name)


class IdentificationRequest(AnalysisRequest):
    """Ask for the plant that records tell."""

    records: Annotated[list[RecordOfSignals], Field(min_length=1, max_length=MAX_RECORDS)] = Field(
        description="Records of the same signals.", examples=[[_RECORD]]
    )
    structure: Literal["parallel", "units", "matrix"] = Field(
        default="matrix",
        description="parallel: all units share g and i. units: each has its own two. matrix: each "
        "element is its own.",
        examples=["matrix"],
    )
    order: Literal["auto", "first", "second"] = Field(
        default="auto",
        description="Of every element; auto: what predicts readings kept back, the lower if in "
        "doubt.",
        examples=["auto"],
    )
    integrating: Literal["auto", "yes", "no"] = Field(
        default="auto", description="Whether elements integrate.", examples=["auto"]
    )
    drift: bool = Field(
        default=False,
        description="Whether each output of each record drifts linearly. It hides slow elements.",
        examples=[False],
    )

    # Nobody types a record into a form: it comes from a file, by the command line or over HTTP.
    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE], "x-form": False})

    def build(self) -> IdentificationTask:
        """Return the records.

        Raises
        ------
        InvalidInputError
            A record that cannot be used, by pointer into this request.

        """
        used: list[Record] = []
        kept: list[Record] = []
        for index, record in enumerate(self.records):
            with below(f"/records/{index}"):
                built = record.build(f"record {index + 1}")
            (used if record.use == "fit" else kept).append(built)
        if not used:
            message = "no record is left for the fit: all are kept for validation"
            raise InvalidInputError(message, "/records/0/use")
        self._check(used, kept)
        return IdentificationTask(
            tuple(used),
            tuple(kept),
            self.structure,
            {"auto": None, "first": 1, "second": 2}[self.order],
            {"auto": None, "yes": True, "no": False}[self.integrating],
            self.drift,
        )

    def _check(self, used: list[Record], kept: list[Record]) -> None:
        """Refuse records that can tell no plant."""
        uses = [record.use for record in self.records]
        places = [
            index for use in ("fit", "validate") for index in range(len(uses)) if uses[index] == use
        ]
        try:
            check_records(used, kept)
        except InvalidInputError as error:
            # The solver counts the records that it fits, then the others.
            _, _, place, rest = error.field.split("/", 3)
            raise type(error)(error.message, f"/records/{places[int(place)]}/{rest}") from None


class EstimateResult(ResultModel):
    """A parameter of an element."""

    name: str = Field(description="Which.", examples=["time_constant"])
    value: float = Field(description="Estimate.", examples=[5.0])
    standard_error: float | None = Field(description="null: not told.", examples=[0.1])
    low: float | None = Field(
        description="Lower end of an interval that holds the true value in 95 of 100 records.",
        examples=[4.8],
    )
    high: float | None = Field(description="Upper end.", examples=[5.2])


class ElementResult(ResultModel):
    """An element of the plant as the records tell it."""

    output: str = Field(description="To which output.", examples=["temperature"])
    input: str = Field(description="From which input.", examples=["valve"])
    kind: str = Field(description="Its form.", examples=["first"])
    estimates: list[EstimateResult] = Field(description="Its parameters.", examples=[[]])
    untold: list[str] = Field(description="What the records cannot tell.", examples=[[]])
    test: str | None = Field(description="Which test would tell it.", examples=[None])


class PredictionResult(ResultModel):
    """One output of one record against the plant; curves have 2000 points at most."""

    record: str = Field(description="Which record.", examples=["record 1"])
    output: str = Field(description="Which output.", examples=["temperature"])
    kept_back: bool = Field(description="Whether the fit has not seen it.", examples=[False])
    normalised_fit: float = Field(
        description="100 (1 - |y - y_hat| / |y - mean of y|), per cent.", examples=[98.0]
    )
    spikes: int = Field(description="Readings left out as spikes.", examples=[0])
    time: list[float] = Field(description="Times.", examples=[[0.0]])
    measured: list[float] = Field(description="Readings.", examples=[[20.0]])
    predicted: list[float] = Field(description="The plant's.", examples=[[20.0]])


class EqualityResult(ResultModel):
    """Test whether all units are the same."""

    statistic: float = Field(description="Of the score test.", examples=[4.2])
    freedom: int = Field(description="Degrees of freedom.", examples=[6])
    probability: float = Field(
        description="Of so large a statistic if they are the same.", examples=[0.65]
    )
    plausible: bool = Field(description="Whether that is 5 per cent or more.", examples=[True])


class ErrorCurveResult(ResultModel):
    """One source of error over frequency."""

    source: str = Field(description="What errs.", examples=["statistical error"])
    size: list[float | None] = Field(
        description="Largest singular value of the relative input error.", examples=[[0.1]]
    )
    diagonal: list[float | None] = Field(
        description="What independent actuators would explain of it.", examples=[[0.1]]
    )


class WeightResult(ResultModel):
    """Uncertainty of a tuning request."""

    weight: dict[str, Any] = Field(
        description="w_I(s).", examples=[{"num": [1.0, 0.2], "den": [0.5, 1.0], "dead_time": 0.0}]
    )
    structure: str = Field(description="diagonal or full.", examples=["full"])


class AlternativeResult(ResultModel):
    """A plant that units or records of their own tell."""

    name: str = Field(description="Whose it is.", examples=["each unit its own"])
    plant: dict[str, Any] = Field(
        description="As a scenario of a tuning takes it.",
        examples=[{"kind": "matrix", "elements": []}],
    )


class IdentificationResult(ResultModel):
    """A plant, what the records tell of it, and the weight that covers its errors."""

    plant: dict[str, Any] = Field(
        description="As a tuning request takes it.", examples=[{"kind": "matrix", "elements": []}]
    )
    uncertainty: WeightResult = Field(
        description="As a tuning request takes it: the smallest first-order weight above all "
        "errors.",
        examples=[{"weight": {"num": [1.0, 0.2], "den": [0.5, 1.0]}, "structure": "full"}],
    )
    own_uncertainty: WeightResult | None = Field(
        description="The same without units and records of their own: for a tuning that has the "
        "alternatives as scenarios; null where there are none.",
        examples=[None],
    )
    alternatives: list[AlternativeResult] = Field(
        description="What the spread consists of: each unit its own where units differ, and the "
        "plant of each record.",
        examples=[[]],
    )
    epsilon: float | None = Field(
        description="Of the smallest weight of that form; null: errors reach 2, which it cannot.",
        examples=[0.2],
    )
    theta: float | None = Field(description="With it.", examples=[1.0])
    inputs: list[str] = Field(description="In the order of the loops.", examples=[["valve"]])
    outputs: list[str] = Field(description="In that order.", examples=[["temperature"]])
    elements: list[ElementResult] = Field(
        description="Row by row; of a parallel plant g and i.", examples=[[]]
    )
    predictions: list[PredictionResult] = Field(
        description="Of each output in each record.", examples=[[]]
    )
    starts: list[str] = Field(
        description="What the inputs did before each record: held, from zero, or moving.",
        examples=[["held"]],
    )
    equality: EqualityResult | None = Field(
        description="Of parallel units; null: of a matrix, or one unit.", examples=[None]
    )
    omega: list[float] = Field(description="rad per time unit.", examples=[[0.1]])
    errors: list[ErrorCurveResult] = Field(
        description="Every source of error at these frequencies.", examples=[[]]
    )
    weight_magnitude: list[float] = Field(description="|w_I| there.", examples=[[0.2]])
    advice: list[str] = Field(description="What to do next.", examples=[[]])
    origin: dict[str, Any] = Field(
        description="As a tuning request takes it: the records' digests, fit and errors.",
        examples=[{"records": [], "fits": [], "errors": []}],
    )


class DrawnPrediction(Drawn):
    """One output of one record."""

    record: str = Field(description="Which record.", examples=["record 1"])
    output: str = Field(description="Which output.", examples=["temperature"])
    kept_back: bool = Field(description="Whether the fit has not seen it.", examples=[False])
    normalised_fit: float = Field(description="Per cent.", examples=[98.0])
    time: Points = Field(description="Times.", examples=[[0.0]])
    measured: Points = Field(description="Readings.", examples=[[20.0]])
    predicted: Points = Field(description="The plant's.", examples=[[20.0]])

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        for name, values in (("measured", self.measured), ("predicted", self.predicted)):
            if len(values) != len(self.time):
                message = f"{name} has {len(values)} entries, time has {len(self.time)}"
                raise ValueError(message)
        return self


class DrawnErrorCurve(Drawn):
    """One source of error."""

    source: str = Field(description="What errs.", examples=["statistical error"])
    size: Annotated[list[float | None], Field(max_length=MAX_POINTS)] = Field(
        description="Largest singular value of the relative input error.", examples=[[0.1]]
    )


class IdentificationJob(JobState):
    """A job that identifies a plant."""

    request: IdentificationRequest = Field(
        description="The request, with all defaults.", examples=[EXAMPLE]
    )
    result: IdentificationResult | None = Field(
        description="The plant and its uncertainty, once the job has succeeded.", examples=[None]
    )


class DrawnIdentification(Drawn):
    """Data and fit, and the errors below their weight."""

    predictions: Annotated[list[DrawnPrediction], Field(min_length=1, max_length=600)] = Field(
        description="Of each output in each record.", examples=[[]]
    )
    omega: Points = Field(description="rad per time unit.", examples=[[0.1]])
    errors: Annotated[list[DrawnErrorCurve], Field(max_length=600)] = Field(
        description="Every source of error.", examples=[[]]
    )
    weight_magnitude: Points = Field(description="|w_I|.", examples=[[0.2]])

    @model_validator(mode="after")
    def _check_lengths(self) -> Self:
        curves: list[list[float | None]] = [
            [*self.weight_magnitude],
            *(error.size for error in self.errors),
        ]
        for curve in curves:
            if len(curve) != len(self.omega):
                message = f"a curve has {len(curve)} entries, omega has {len(self.omega)}"
                raise ValueError(message)
        return self
