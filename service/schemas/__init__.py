"""Requests and results as JSON; the service and the command line use the same."""

from service.schemas.parsing import (
    Fault,
    RequestError,
    canonical,
    computation,
    parse,
    parse_batch_tuning,
    parse_tuning_request,
)
from service.schemas.tunings import TuningRequest, TuningResult, tuning_to_json

__all__ = [
    "Fault",
    "RequestError",
    "TuningRequest",
    "TuningResult",
    "canonical",
    "computation",
    "parse",
    "parse_batch_tuning",
    "parse_tuning_request",
    "tuning_to_json",
]
