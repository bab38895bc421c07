"""A kind of plant that nothing knows by name goes through every solver, as its matrix does."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest

from solver.certificate.record import Certificate, Claim
from solver.certificate.search import certify
from solver.certificate.verify import Verdict, verify
from solver.interaction.analysis import analyse_interaction
from solver.model.controllers import Controller
from solver.model.errors import UnsupportedPlantError
from solver.model.plants import MatrixPlant, PlacedElement, Plant
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Uncertainty
from solver.robustness.analysis import analyse
from solver.robustness.integrity import integrity
from solver.robustness.margins import loop_margins
from solver.robustness.model_tolerance import model_tolerances
from solver.simulation.experiment import Experiment, Step, StepKind
from solver.simulation.step_response import step_response
from solver.tuning.specification import Arrangement, Specification
from solver.tuning.tuner import tune

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


@dataclass(frozen=True)
class Row(Plant):
    """Units in a row: each disturbs its neighbours alike, and no other unit."""

    n: int
    process: TransferFunction
    neighbour: TransferFunction

    @property
    def interchangeable(self) -> bool:
        """No: the first and the last have one neighbour."""
        return False

    @property
    def places(self) -> tuple[PlacedElement, ...]:
        """Both functions."""
        return (
            PlacedElement("process", "/process", self.process),
            PlacedElement("neighbour", "/neighbour", self.neighbour),
        )

    def element(self, row: int, column: int) -> TransferFunction:
        """Return what neighbours and the unit itself see; others see nothing."""
        nothing = TransferFunction((0.0,), (1.0,))
        return {0: self.process, 1: self.neighbour}.get(abs(row - column), nothing)

    def part(self, units: Sequence[int]) -> Plant:
        """Return a matrix: the units left need not be a row."""
        return MatrixPlant([[self.element(row, column) for column in units] for row in units])

    def mapped(self, change: Callable[[TransferFunction], TransferFunction]) -> Row:
        """Return the row with both functions changed."""
        return Row(self.n, change(self.process), change(self.neighbour))


ROW = Row(3, TransferFunction((1,), (10, 1), 1), TransferFunction((0.4,), (20, 1), 2))
MATRIX = MatrixPlant(ROW.rows)
LOOPS = (Controller(2, 8), Controller(1.5, 9), Controller(2, 8))
WEIGHTS = (Uncertainty.from_error(0.2, 1), Performance(tau_p=30))

SOLVERS: dict[str, Callable[[Plant], object]] = {
    "robustness": lambda plant: analyse(plant, *WEIGHTS, LOOPS).peaks,
    "margins": lambda plant: loop_margins(plant, LOOPS),
    "integrity": lambda plant: integrity(plant, *WEIGHTS, LOOPS),
    "interaction": lambda plant: analyse_interaction(plant, np.array([0.01, 0.1])),
    "steps": lambda plant: step_response(
        Experiment(plant, LOOPS, (Step(StepKind.SETPOINT, 0, 0, 1),), 60, samples=31)
    ),
    "tuning": lambda plant: (
        tune(
            Specification(
                plant, WEIGHTS[0], Performance(), arrangement=Arrangement.IDENTICAL, starts=1
            )
        ).loops
    ),
}


@pytest.mark.parametrize("name", SOLVERS)
def test_a_new_kind_is_solved_as_its_matrix(name: str) -> None:
    """What asks only for a plant gives the digits of the matrix plant of the same elements."""
    with np.printoptions(floatmode="unique", threshold=10**6):
        assert repr(SOLVERS[name](ROW)) == repr(SOLVERS[name](MATRIX))


def test_its_certificate_is_that_of_its_matrix() -> None:
    """A certificate writes the elements out, so that who checks it needs no new kind."""
    peak = analyse(ROW, *WEIGHTS, LOOPS).peaks
    assert peak is not None
    proven = certify(Claim(ROW, *WEIGHTS, LOOPS, 1.01 * peak.robust_performance.value))
    assert isinstance(proven, Certificate)
    assert verify(json.dumps(proven.to_document())).verdict is Verdict.PROVEN


def test_its_parameters_are_its_own() -> None:
    """Tolerances of the model change every element; a matrix has more parameters than they."""
    found = model_tolerances(ROW, WEIGHTS[1], LOOPS, np.geomspace(1e-3, 1, 40))
    assert {"gain", "time_constant", "dead_time"} <= {each.parameter for each in found}


def test_what_it_refuses_has_its_place() -> None:
    """The pointer leads to where the description of that kind has the element."""
    unstable = Row(2, TransferFunction((1,), (1, 1)), TransferFunction((1,), (1, -1)))
    with pytest.raises(UnsupportedPlantError) as refused:
        analyse(unstable, *WEIGHTS, LOOPS[:2])
    assert refused.value.field == "/plant/neighbour/den"
