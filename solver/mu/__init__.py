"""Upper and lower bounds of the structured singular value, and their certificates.

Two upper bounds with one signature: `scaling.upper_bound`, the fast path, and `sdp.upper_bound`,
the reference that tests hold it to.
"""

from solver.mu.scaling import upper_bound
from solver.mu.structure import BlockStructure, Bound, bound_of_scales

__all__ = ["BlockStructure", "Bound", "bound_of_scales", "upper_bound"]
