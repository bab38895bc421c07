"""Plants that every solver is tried on, with stabilising loops for each."""

from dataclasses import dataclass

from hypothesis import strategies as st

from solver.model.controllers import Controller
from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
from solver.model.transfer_function import TransferFunction
from solver.model.weights import Performance, Structure, Uncertainty

__all__ = ["COLUMN", "SLH", "THREE", "ZOO", "Case", "interactions"]

USUAL = Uncertainty.from_error(0.2, 1)
USUAL_DEMAND = Performance(tau_p=20)

# Skogestad, Lundstrom and Hovd 1989, section 5: tau = 100, lambda_11 = 10.
SLH = first_order(2, 1, 100, 0.949)


def interactions(low: float, high: float) -> st.SearchStrategy[float]:
    """Interactions a, zero or of a size that no coefficient vanishes by."""
    return st.floats(low, high).map(lambda a: round(a, 6))


def _lag(gain: float) -> TransferFunction:
    return TransferFunction((gain,), (75, 1))


# Skogestad, Lundstrom and Hovd 1989, eq. 3.
COLUMN = MatrixPlant([[_lag(0.878), _lag(-0.864)], [_lag(-1.082), _lag(1.096)]])

# Three unlike units with unlike dead times.
THREE = MatrixPlant(
    [
        [TransferFunction((1,), (20, 1), 0.5), _lag(0.2), TransferFunction((-0.1,), (30, 1), 1)],
        [_lag(0.3), TransferFunction((1.2,), (40, 1), 0.2), TransferFunction((0.2,), (10, 1))],
        [TransferFunction((-0.2,), (15, 1)), _lag(0.1), TransferFunction((0.9,), (12, 1), 0.8)],
    ]
)


@dataclass(frozen=True)
class Case:
    """A plant with stabilising loops and weights."""

    name: str
    plant: Plant
    loops: tuple[Controller, ...]
    uncertainty: Uncertainty = USUAL
    performance: Performance = USUAL_DEMAND

    def __str__(self) -> str:
        return self.name


ZOO = (
    Case("published", SLH, (Controller(46.3, 101), Controller(22.8, 3.15))),
    Case("identical", SLH, (Controller(39.7, 65.1),) * 2),
    Case("single unit", first_order(1, 2, 30, 0.0), (Controller(5, 20),)),
    Case("no interaction", first_order(2, 1, 10, 0.0), (Controller(3, 8), Controller(4, 9))),
    Case("near singular", first_order(2, 1, 100, 0.9999), (Controller(40, 60), Controller(20, 9))),
    Case("three, a < 0", first_order(3, 1, 100, -0.45),
         (Controller(33, 2.7), *(Controller(53, 90),) * 2)),
    Case("five different", first_order(5, 1, 20, 0.3),
         tuple(Controller(2 + i, 10 + 3 * i) for i in range(5))),
    Case("six in two groups", first_order(6, 1, 50, 0.4),
         (*(Controller(10, 40),) * 2, *(Controller(14, 30),) * 4)),
    Case("dead time, other i",
         ParallelPlant(2, TransferFunction((1,), (20, 1), 0.5),
                       TransferFunction((0.6,), (30, 1), 1)),
         (Controller(4, 12), Controller(5, 12))),
    Case("integrating",
         ParallelPlant(2, TransferFunction((1,), (1, 0)), TransferFunction((0.5,), (1, 0))),
         (Controller(0.4, 20), Controller(0.3, 30))),
    Case("lightly damped",
         ParallelPlant(2, TransferFunction((1,), (1, 0.1, 1)), TransferFunction((0.2,), (5, 1))),
         (Controller(0.02, 1), Controller(0.02, 1.5))),
    Case("column, PID", COLUMN, (Controller(179, 28.9, 0.31), Controller(47, 1.38, 0.27)),
         performance=Performance(tau_p=10)),
    Case("full-block uncertainty", SLH, (Controller(46.3, 101), Controller(22.8, 3.15)),
         Uncertainty.from_error(0.2, 1, Structure.FULL)),
    Case("permitted offset", SLH, (Controller(39.7, 65.1),) * 2,
         performance=Performance(max_peak=2.5, offset=0.1, tau_p=30)),
)  # fmt: skip
