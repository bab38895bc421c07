"""Ms, Mt and the bandwidths of loops, alone and together, proven over all frequencies.

Counterexample-guided, as `solver.robustness.full_proof`: intervals on which a figure is not proven
within `BRACKET` are halved, and a figure that their middles contradict is put right. The loops
alone are those of the plant's diagonal.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import brentq

from solver.model.peaks import Peak, zoom
from solver.model.plants import MatrixPlant
from solver.model.transfer_function import TransferFunction
from solver.robustness.axis import BRACKET
from solver.robustness.bandwidth import HALF_POWER
from solver.robustness.full_models import UnprovenError
from solver.robustness.record import GuaranteeStatus, MarginsGuarantee
from solver.robustness.sensitivity_models import NONE, Sensitivities, SensitivityModels

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from solver.model.controllers import Controller
    from solver.model.plants import Plant
    from solver.robustness.bandwidth import Bandwidths
    from solver.robustness.margins import LoopMargins, Margins

__all__ = ["proven_margins"]

MOST = 12  # different loops: a second or so
PER_DECADE = 12  # intervals at first
AROUND = 10.0  # beyond the figures and the corners, where the first intervals end
TAIL_FACTOR = 8.0  # by which an end of the axis is drawn out
MOST_INTERVALS = 5_000  # in all: half a second for two loops
SHORTEST = 1e-11  # log(ratio): frequencies of 16 digits have few points left in it
FURTHEST = 1e25  # of the corners
MOST_CORRECTIONS = 20  # of figures
SECTIONS, ROUNDS = 32, 4  # of a refinement, as on the axis of mu


def proven_margins(
    plant: Plant,
    loops: Sequence[Controller],
    margins: tuple[LoopMargins, ...],
    bandwidths: Bandwidths,
) -> tuple[tuple[LoopMargins, ...], Bandwidths, MarginsGuarantee]:
    """Prove Ms, Mt and bandwidths of a stable loop within `BRACKET`, and put right what is not so.

    Parameters
    ----------
    plant : Plant
        Open-loop stable or integrating.
    loops : sequence of Controller
        One a unit.
    margins : tuple of LoopMargins
        As they were sampled and refined.
    bandwidths : Bandwidths
        As they were sampled and refined.

    Returns
    -------
    margins, bandwidths, guarantee
        The same figures, put right, and what is proven of them.

    """
    if len(margins) > MOST:
        reason = f"more than {MOST} loops differ"
        return margins, bandwidths, MarginsGuarantee(GuaranteeStatus.OPEN, BRACKET, reason)
    reasons: list[str] = []
    units = [row.units[0] for row in margins if row.alone is not None]
    alone = [row.alone for row in margins if row.alone is not None]
    if alone:
        entries = [plant.entry(unit, unit) for unit in units]
        functions = [each for each in entries if isinstance(each, TransferFunction)]
        if len(functions) < len(entries):
            reasons.append("what a loop moves acts on its output by unlike dead times")
        else:
            size = range(len(functions))
            rows = [[functions[a] if a == b else NONE for b in size] for a in size]
            search = _Search(alone)
            reasons += search.prove(MatrixPlant(rows), [loops[unit] for unit in units], None)
            alone = search.margins(alone)
    together = [row.together for row in margins if row.together is not None]
    if plant.n == 1:
        together = alone
    elif together:
        search = _Search(together, [bandwidths.worst_direction, bandwidths.best_direction])
        reasons += search.prove(plant, loops, [row.units[0] for row in margins])
        together = search.margins(together)
        worst, best = search.bandwidths[-2:]
        bandwidths = replace(bandwidths, worst_direction=worst, best_direction=best)
    if bandwidths.alone is not None:
        bandwidths = replace(bandwidths, alone=min(each.bandwidth for each in alone))
    own, closed = iter(alone), iter(together)
    found = tuple(
        replace(
            row,
            alone=row.alone and next(own),
            together=row.together and next(closed),
        )
        for row in margins
    )
    status = GuaranteeStatus.OPEN if reasons else GuaranteeStatus.PROVEN
    guarantee = MarginsGuarantee(status, BRACKET, reasons[0] if reasons else None)
    return found, bandwidths, guarantee


class _Cells(NamedTuple):
    """Intervals low..high (c,), rad per time unit."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def part(self, chosen: NDArray[np.bool_]) -> _Cells:
        return _Cells(self.low[chosen], self.high[chosen])

    def middles(self) -> NDArray[np.float64]:
        """One frequency in each."""
        with np.errstate(invalid="ignore"):
            between = np.sqrt(self.low) * np.sqrt(self.high)
        between = np.where(self.low == 0, self.high / TAIL_FACTOR, between)
        return np.asarray(np.where(np.isinf(self.high), self.low * TAIL_FACTOR, between))

    def halved(self) -> _Cells:
        """Both parts of each; those of an end of the axis are most unlike."""
        between = self.middles()
        return _Cells(np.concatenate([self.low, between]), np.concatenate([between, self.high]))

    def too_short(self, first: float, last: float) -> NDArray[np.bool_]:
        """Whether parts cannot be told from the whole, or the axis was drawn out far enough."""
        with np.errstate(divide="ignore", invalid="ignore"):
            short = np.log(self.high / self.low) < SHORTEST
        return np.asarray(short | (self.high < first / FURTHEST) | (self.low > last * FURTHEST))


class _Search:
    """Figures of some loops, and of directions; each is put right where it is contradicted."""

    def __init__(self, margins: Sequence[Margins], directions: Sequence[float] = ()) -> None:
        self.peaks = [each.sensitivity for each in margins]
        self.peaks += [each.complementary_sensitivity for each in margins]
        self.bandwidths = [*(each.bandwidth for each in margins), *directions]
        self.directions = len(directions)
        self.corrections = 0

    def margins(self, before: Sequence[Margins]) -> list[Margins]:
        """Return margins with these figures in them."""
        count = len(before)
        return [
            replace(
                each,
                sensitivity=self.peaks[index],
                complementary_sensitivity=self.peaks[count + index],
                bandwidth=self.bandwidths[index],
            )
            for index, each in enumerate(before)
        ]

    def prove(
        self, plant: Plant, loops: Sequence[Controller], units: Sequence[int] | None
    ) -> list[str]:
        """Prove the figures of the loops of `units`, None: of all; return why not, if not."""
        try:
            models = SensitivityModels(plant, loops)
            units = range(plant.n) if units is None else units
            self.channels = [models.channel(unit) for unit in units]
            while self.corrections < MOST_CORRECTIONS:
                reason = self._march(models)
                if reason is None:
                    return []
                if reason:
                    return [reason]
        except UnprovenError as unproven:
            return [str(unproven)]
        return ["the curves vary too much"]

    def _peak_curves(self, seen: Sensitivities) -> NDArray[np.float64]:
        return np.concatenate(
            [seen.own[:, self.channels], seen.complement[:, self.channels]], axis=1
        )

    def _falling_curves(self, seen: Sensitivities) -> NDArray[np.float64]:
        ends = np.column_stack([seen.largest, seen.smallest])[:, : self.directions]
        return np.concatenate([seen.own[:, self.channels], ends], axis=1)

    @property
    def _levels(self) -> NDArray[np.float64]:
        return (1 + BRACKET) * np.array([peak.value for peak in self.peaks])

    @property
    def _limits(self) -> NDArray[np.float64]:
        """Up to where each falling curve has to be below 0.707."""
        return (1 - BRACKET) * np.array(self.bandwidths)

    def _march(self, models: SensitivityModels) -> str | None:
        """Return None where all is proven, "" after a bandwidth was put right, else the reason."""
        known = [*self.bandwidths, *(peak.omega for peak in self.peaks), *models.ends]
        known = [each for each in known if 0 < each < math.inf]
        first, last = min(known), max(known)
        low, high = first / AROUND, last * AROUND
        grid = np.geomspace(low, high, math.ceil(PER_DECADE * math.log10(high / low)))
        limits = self._limits
        ends = np.union1d(grid, limits[(limits > 0) & (limits < np.inf)])
        cells = _Cells(np.append(0.0, ends), np.append(ends, np.inf))
        work = 0
        while cells.low.size:
            work += cells.low.size
            lost = cells.too_short(first, last)
            if work > MOST_INTERVALS or lost.any():
                return _where(cells.part(lost) if lost.any() else cells)
            far = np.isinf(cells.high)
            done = np.zeros(cells.low.size, dtype=bool)
            for chosen in (np.flatnonzero(far), np.flatnonzero(~far)):
                if chosen.size:
                    done[chosen] = self._holds(models, _Cells(*(e[chosen] for e in cells)))
            cells = cells.part(~done)
            if cells.low.size and self._corrected(models, cells):
                return ""
            cells = cells.halved()
        return "" if self._begun(models, first, last) else None

    def _begun(self, models: SensitivityModels, first: float, last: float) -> bool:
        """Put right bandwidths of 0 whose curves are below 0.707 at the frequency zero."""
        none = [index for index, each in enumerate(self.bandwidths) if each == 0]
        if not none:
            return False
        low = first / FURTHEST
        seen = models.over(np.zeros(1), np.array([low]), singular=self.directions > 0)
        starts = self._falling_curves(seen)[0]
        wrong = [index for index in none if starts[index] < HALF_POWER]
        if wrong:
            grid = np.geomspace(low, last, math.ceil(PER_DECADE * math.log10(last / low)))
            curves = self._falling_curves(models.at(grid))
        for index in wrong:
            self.corrections += 1
            above = np.flatnonzero(~(curves[:, index] < HALF_POWER))
            self.bandwidths[index] = (
                _first_above(self._curve(models, index), float(grid[above[0]]))
                if above.size
                else math.inf
            )
        return bool(wrong)

    def _refined(
        self, models: SensitivityModels, index: int, ends: tuple[float, float], peak: Peak
    ) -> Peak:
        """Return the highest value of a curve between two frequencies, given one."""

        def curve(_: NDArray[np.intp], points: NDArray[np.float64]) -> NDArray[np.float64]:
            found = self._peak_curves(models.at(points.ravel()))[:, index]
            return np.nan_to_num(found).reshape(points.shape)

        omega, values = zoom(
            curve, np.log(ends[:1]), np.log(ends[1:]), np.array([peak.omega]),
            np.array([peak.value]), sections=SECTIONS, rounds=ROUNDS,
        )  # fmt: skip
        return Peak(float(values[0]), float(omega[0]))

    def _curve(self, models: SensitivityModels, index: int) -> Callable[[float], float]:
        return lambda at: float(self._falling_curves(models.at(np.array([at])))[0, index])

    def _holds(self, models: SensitivityModels, cells: _Cells) -> NDArray[np.bool_]:
        seen = models.over(*cells, singular=self.directions > 0)
        with np.errstate(invalid="ignore"):
            passed = cells.high[:, None] > self._limits
        falling = (self._falling_curves(seen) < HALF_POWER) | passed
        return np.asarray(
            (self._peak_curves(seen) <= self._levels).all(axis=1) & falling.all(axis=1)
        )

    def _corrected(self, models: SensitivityModels, cells: _Cells) -> bool:
        """Put right what the middles contradict; whether that was a bandwidth."""
        middle = cells.middles()
        seen = models.at(middle)
        for index, values in enumerate(self._peak_curves(seen).T):
            best = int(np.argmax(np.where(np.isfinite(values), values, 0.0)))
            if values[best] > self._levels[index]:
                self.corrections += 1
                low, high = cells.low[best], cells.high[best]
                self.peaks[index] = self._refined(
                    models,
                    index,
                    (low or middle[best] / TAIL_FACTOR, min(high, middle[best] * TAIL_FACTOR)),
                    Peak(float(values[best]), float(middle[best])),
                )
        found = False
        for index, values in enumerate(self._falling_curves(seen).T):
            above = (values >= HALF_POWER) & (middle <= self._limits[index])
            if above.any():
                self.corrections += 1
                found = True
                self.bandwidths[index] = _first_above(
                    self._curve(models, index), float(middle[above].min())
                )
        return found


def _first_above(curve: Callable[[float], float], high: float) -> float:
    """Where a curve that is above 0.707 at `high` reaches it, somewhere below; 0: nowhere."""
    low = high / 2
    while not curve(low) < HALF_POWER:
        low, high = low / 2, low
        if low == 0:
            return 0.0
    return float(
        np.exp(brentq(lambda x: curve(math.exp(x)) - HALF_POWER, math.log(low), math.log(high)))
    )


def _where(cells: _Cells) -> str:
    if cells.low[0] == 0:
        return "no proof towards the frequency zero"
    if math.isinf(cells.high[0]):
        return "no proof towards the frequency infinity"
    return f"no proof near omega = {cells.low[0]:.6g}: the curves vary too quickly there"
