"""The process and the loops of Johansson, TFRT-7506 (1993)."""

import numpy as np

from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.relay.experiment import PlacedLoop, Relay, RelayExperiment
from solver.simulation.experiment import Step
from solver.simulation.loops import Loop

_OWN = TransferFunction([100], np.poly([-1, -10, -10]))
_CROSS = TransferFunction([200], np.poly([-3, -10, -10]))
PLANT = MatrixPlant([[_OWN, _CROSS], [_OWN, _OWN]])  # eq. (1)

RELAY = Relay(1.0, 0.01)
SAMPLED = Relay(1.0, 0.01, 0.01)  # the relay of his simulations

# Section 3, Ziegler-Nichols settings of the table there.
U2_Y2 = PlacedLoop(1, 1, Loop(6.5, 0.56))
U2_Y1 = PlacedLoop(0, 1, Loop(4.9, 0.46))


def experiment(  # noqa: PLR0917 - as short as the names in the paper
    input_: int,
    output: int,
    relay: Relay = RELAY,
    loops: tuple[PlacedLoop, ...] = (),
    duration: float = 20.0,
    steps: tuple[Step, ...] = (),
) -> RelayExperiment:
    """Return the experiment in the loop u_input - y_output, counted from 1 as in the paper."""
    return RelayExperiment(
        PLANT, output - 1, input_ - 1, relay, loops, duration, samples=401, steps=steps
    )
