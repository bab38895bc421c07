"""Requests and results as JSON; the service and the command line use the same."""

from service.schemas.parsing import (
    Fault,
    RequestError,
    canonical,
    parse,
    parse_tuning_request,
)
from service.schemas.robustness import (
    RobustnessRequest,
    RobustnessResult,
    RobustnessTask,
    robustness_to_json,
)
from service.schemas.tunings import TuningRequest, TuningResult, tuning_to_json

__all__ = [
    "Fault",
    "RequestError",
    "RobustnessRequest",
    "RobustnessResult",
    "RobustnessTask",
    "TuningRequest",
    "TuningResult",
    "canonical",
    "parse",
    "parse_tuning_request",
    "robustness_to_json",
    "tuning_to_json",
]
