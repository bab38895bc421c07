"""Conditions for decentralised integral control, as JSON."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field

__all__ = ["IntegralControllability"]


class IntegralControllability(BaseModel):
    """Whether loops may be detuned or switched off one by one (decentralised, integral)."""

    verdict: Literal["guaranteed", "impossible", "undecided"] = Field(
        description="What the conditions on the static gain say.", examples=["guaranteed"]
    )
    reasons: list[str] = Field(description="Conditions that fail.", examples=[[]])
    failing_subsets: list[list[int]] = Field(
        description="Smallest sets of loops that fail by themselves, from 0.", examples=[[]]
    )
    smallest_eigenvalue: float | None = Field(
        description="Least real part of the eigenvalues of the gain with a positive diagonal.",
        examples=[0.18],
    )
    scaling: list[float | None] | None = Field(
        description="Diagonal D with D G + G' D positive definite: the proof. Null: none found.",
        examples=[[0.5, 0.5]],
    )
    lower_limit: float | None = Field(
        description="Parallel units: the interaction must exceed this.", examples=[None, -1.0]
    )
    upper_limit: float | None = Field(
        description="Parallel units: the interaction must stay below this.", examples=[None, 1.0]
    )
