"""How far tuned settings can be from the best ones: a proven lower bound of tau_P."""

from solver.optimality.bound import LowerBound
from solver.optimality.record import Optimality, Proof

__all__ = ["LowerBound", "Optimality", "Proof"]
