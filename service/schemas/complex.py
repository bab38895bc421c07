"""Complex numbers as JSON."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Complex"]


class Complex(BaseModel):
    """A complex number; null where it does not exist."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)

    re: float | None = Field(description="Real part.", examples=[1.0])
    im: float | None = Field(description="Imaginary part.", examples=[0.0])
