"""Bounds of the structured singular value at one frequency.

Upper bounds come with the scales that prove them: `scaling.upper_bound` is the fast path, and
`sdp.upper_bound`, of the same signature, the reference that tests hold it to. `lower_bound` finds
perturbations that show how near they are.
"""
