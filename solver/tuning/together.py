"""Several loops under the same settings as one objective: the greatest s that any of them has.

A frequency of one loop is a row beside those of the others, so the minimax problem stays what it
is. The rows of the fixed frequencies of all loops come first, those of the followed peaks last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from solver.tuning.objective import Evaluation, Levels, LoopObjective

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.tuning.goals import Goal
    from solver.tuning.specification import ControllerKind

__all__ = ["Together"]


@dataclass(frozen=True, eq=False)
class Together:
    """Levels of several loops under the same settings.

    Parameters
    ----------
    parts : tuple of LoopObjective
        One a loop, at least one, with the same goal, kind, signs and penalty.
    alike : (pairs, 2)
        Controllers that may change places: every level stays what it is.

    """

    parts: tuple[LoopObjective, ...]
    alike: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))

    @property
    def goal(self) -> Goal:
        """What is made small."""
        return self.parts[0].goal

    @property
    def kind(self) -> ControllerKind:
        """Of the controllers."""
        return self.parts[0].kind

    @property
    def signs(self) -> NDArray[np.float64]:
        """Sign of each gain, (controllers,)."""
        return self.parts[0].signs

    @property
    def penalty(self) -> float:
        """Price in s of a missing level."""
        return self.parts[0].penalty

    @property
    def per_controller(self) -> int:
        """Number of parameters of a controller."""
        return self.parts[0].per_controller

    def controllers(self, theta: NDArray[np.float64]) -> tuple[Controller, ...]:
        """Return the controllers that `theta` stands for."""
        return self.parts[0].controllers(theta)

    def having(self, **changes: Any) -> Self:  # noqa: ANN401 - fields of `LoopObjective`
        """Return the same with other fields in every part."""
        return replace(self, parts=tuple(replace(part, **changes) for part in self.parts))

    def at(
        self, omega: Sequence[NDArray[np.float64]], followed: Sequence[NDArray[np.float64]]
    ) -> Self:
        """Return the same with other fixed frequencies and peaks to follow, part by part."""
        return replace(
            self,
            parts=tuple(
                replace(part, omega=fixed, followed=peaks)
                for part, fixed, peaks in zip(self.parts, omega, followed, strict=True)
            ),
        )

    def evaluate(self, theta: NDArray[np.float64], *, near: Evaluation | None = None) -> Evaluation:
        """Evaluate at `theta`; see `LoopObjective.evaluate`."""
        neighbours = [None] * len(self.parts) if near is None else near.of_each
        found = [
            part.evaluate(theta, near=neighbour)
            for part, neighbour in zip(self.parts, neighbours, strict=True)
        ]
        if len(found) == 1:
            return found[0]
        s = max(each.s for each in found)
        raised = [
            part.with_s(each, s) if each.s < s else each
            for part, each in zip(self.parts, found, strict=True)
        ]
        missing = max(float((each.demand - each.level).max()) for each in raised)
        merit = s + self.penalty * max(missing, 0.0)
        if not all(math.isfinite(each.merit) for each in found):
            merit = math.inf
        tails = [each.level.size - each.peaks.size for each in raised]

        def rows(name: str) -> NDArray[np.float64]:
            arrays = [getattr(each, name) for each in raised]
            heads = [array[:tail] for array, tail in zip(arrays, tails, strict=True)]
            return np.concatenate(
                [*heads, *(array[tail:] for array, tail in zip(arrays, tails, strict=True))]
            )

        return Evaluation(
            theta, max(each.value for each in found), s, merit, rows("level"), rows("gradient"),
            rows("demand"), rows("demand_slope"), found[0].y,
            np.concatenate([each.peaks for each in raised]), tuple(raised),
        )  # fmt: skip

    def levels_at(self, thetas: NDArray[np.float64]) -> list[Levels]:
        """Return the levels for several settings; see `LoopObjective.levels_at`."""
        found = [part.levels_at(thetas) for part in self.parts]
        return [
            Levels(
                max(each.value for each in own),
                np.concatenate([each.level for each in own]),
                np.concatenate([each.gradient for each in own]),
            )
            for own in zip(*found, strict=True)
        ]
