"""Bounds of the structured singular value at one frequency.

Upper bounds come with the scales that prove them: `scaling.upper_bound` is the fast path, and
`sdp.upper_bound`, of the same signature, the reference that tests hold it to. `lower_bound` finds
perturbations that show how near they are.
"""

from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure, Bound, bound_of_scales

__all__ = ["BlockStructure", "Bound", "bound_of_scales", "upper_bound"]
