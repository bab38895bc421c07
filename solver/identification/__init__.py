"""Identification: from plant records to a plant, its uncertainty, and what is to be tested."""

from solver.identification.cover import cover, cover_by_error
from solver.identification.elements import Element, ElementKind
from solver.identification.equality import Equality
from solver.identification.errors import ErrorCurve
from solver.identification.findings import Estimate, FittedElement
from solver.identification.identify import Identification, Prediction, identify
from solver.identification.problem import Start, Structure
from solver.identification.reading import read_record
from solver.identification.record import Record
from solver.identification.relay_record import relay_record
from solver.identification.selection import Allowed
from solver.identification.uncertainty import Cover

__all__ = [
    "Allowed",
    "Cover",
    "Element",
    "ElementKind",
    "Equality",
    "ErrorCurve",
    "Estimate",
    "FittedElement",
    "Identification",
    "Prediction",
    "Record",
    "Start",
    "Structure",
    "cover",
    "cover_by_error",
    "identify",
    "read_record",
    "relay_record",
]
