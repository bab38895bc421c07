"""Relay feedback: experiments, periodic solutions, ultimate points, settings."""

from solver.relay.analysis import Cycle, RelayOutcome, Theory, relay_experiment
from solver.relay.behaviour import Behaviour, Regime
from solver.relay.describing_function import Harmonic, Ultimate
from solver.relay.experiment import PlacedLoop, Relay, RelayExperiment
from solver.relay.mcavoy import McAvoy
from solver.relay.periodic import PeriodicSolution
from solver.relay.settings import Settings

__all__ = [
    "Behaviour",
    "Cycle",
    "Harmonic",
    "McAvoy",
    "PeriodicSolution",
    "PlacedLoop",
    "Regime",
    "Relay",
    "RelayExperiment",
    "RelayOutcome",
    "Settings",
    "Theory",
    "Ultimate",
    "relay_experiment",
]
