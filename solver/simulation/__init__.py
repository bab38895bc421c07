"""Time responses with exact dead time: closed loops and what their engineers read off them."""

from solver.simulation.actuators import CoupledActuators, OwnActuators
from solver.simulation.directions import difficult_direction, easy_direction
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.integrator import End
from solver.simulation.loops import Limits, Loop
from solver.simulation.metrics import SetPointMetrics
from solver.simulation.step_response import (
    EventMetrics,
    Metrics,
    StepResponse,
    UnitResponse,
    step_response,
)

__all__ = [
    "CoupledActuators",
    "End",
    "EventMetrics",
    "Experiment",
    "Limits",
    "Loop",
    "Metrics",
    "OwnActuators",
    "SetPointMetrics",
    "Step",
    "StepKind",
    "StepResponse",
    "UnitResponse",
    "difficult_direction",
    "easy_direction",
    "step_response",
]
