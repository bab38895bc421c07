"""A changed certificate is refused, and a claim that is false is refused whoever sealed it."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from certified_loops import PUBLISHED_PEAK, level_at, peak_of
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from solver.certificate.enclosures import Interval
from solver.certificate.record import Certificate, Claim, ProvenInterval
from solver.certificate.verify import Verdict, check, verify
from solver.model.controllers import Controller
from solver.model.errors import InvalidInputError
from solver.model.transfer_function import TransferFunction

RELAXED = settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
FACTORS = st.floats(1e-6, 1e6).filter(lambda factor: abs(factor - 1) > 1e-12)


def text_with(certificate: Certificate, change: Callable[[dict[str, Any]], None]) -> str:
    """The document after a change that leaves its digest as it was."""
    document = copy.deepcopy(certificate.to_document())
    change(document)
    return json.dumps(document)


def resealed(certificate: Certificate, index: int, scales: tuple[float, ...]) -> Certificate:
    """The certificate with other scales on one interval, as a forger would write it."""
    intervals = list(certificate.intervals)
    intervals[index] = ProvenInterval(intervals[index].interval, scales)
    return replace(certificate, intervals=tuple(intervals))


@RELAXED
@given(st.data(), FACTORS)
def test_any_changed_number_is_refused(
    certificate: Certificate, data: st.DataObject, factor: float
) -> None:
    """One D, one interval end, one loop gain or the level: the digest tells."""
    document = certificate.to_document()
    index = data.draw(st.integers(0, len(document["intervals"]) - 2))
    place, name = data.draw(
        st.sampled_from(
            [
                (document["intervals"][index]["scales"], 0),
                (document["intervals"][index]["scales"], 1),
                (document["intervals"][index], "high"),
                (document["loops"][0], "gain"),
                (document["loops"][1], "integral_time"),
                (document, "gamma"),
                (document["performance"], "tau_p"),
                (document["plant"]["process"]["den"], 0),
            ]
        )
    )
    place[name] *= factor
    assert verify(json.dumps(document)).verdict is Verdict.MALFORMED


@RELAXED
@given(st.data(), st.sampled_from([1e-4, 1e-2, 0.5, 0.9, 1.1, 2.0, 1e2, 1e4]))
def test_a_forged_scale_passes_only_where_it_proves_the_claim(
    certificate: Certificate, data: st.DataObject, factor: float
) -> None:
    """Whatever D is accepted keeps sigma_max(D N D^-1) below the level on its interval."""
    index = data.draw(st.integers(1, len(certificate.intervals) - 2))
    which = data.draw(st.integers(0, 1))
    scales = list(certificate.intervals[index].scales)
    scales[which] *= factor
    forged = resealed(certificate, index, tuple(scales))
    interval = forged.intervals[index].interval
    omega = np.geomspace(interval.low, interval.high, 100)[1:-1]
    holds = bool(level_at(omega, forged).max() <= forged.claim.gamma)
    verification = check(forged)
    assert holds or verification.verdict is Verdict.UNPROVEN
    if not verification.ok:
        assert verification.interval == interval
        assert verification.field == f"/intervals/{index}"


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_a_wrong_scale_at_the_peak_is_refused_with_its_interval(
    certificate: Certificate, factor: float
) -> None:
    """Near 0.0314 rad a scale wrong by a factor of 100 proves nothing."""
    index = next(
        k
        for k, proven in enumerate(certificate.intervals)
        if proven.interval.low <= 0.0314362 <= proven.interval.high
    )
    first, second = certificate.intervals[index].scales
    verification = check(resealed(certificate, index, (first * factor, second)))
    assert verification.verdict is Verdict.UNPROVEN
    assert verification.interval == certificate.intervals[index].interval


@RELAXED
@given(st.floats(0.9, 1 - 1e-9).map(lambda share: share * PUBLISHED_PEAK))
def test_a_level_below_the_peak_is_refused(certificate: Certificate, gamma: float) -> None:
    """However little below: 1.00034840 is what mu reaches."""
    lowered = replace(certificate, claim=replace(certificate.claim, gamma=gamma))
    assert check(lowered).verdict is Verdict.UNPROVEN


@settings(parent=RELAXED, max_examples=20)
@given(st.sampled_from([0, 1]), st.floats(0.2, 5))
def test_a_forged_gain_passes_only_where_the_claim_is_true(
    certificate: Certificate, which: int, factor: float
) -> None:
    """Another gain is accepted only if its own peak of mu is below the level."""
    claim = certificate.claim
    loops = list(claim.loops)
    loops[which] = Controller(loops[which].gain * factor, loops[which].integral_time)
    forged = replace(certificate, claim=replace(claim, loops=tuple(loops)))
    peak = peak_of(claim.plant, claim.uncertainty, claim.performance, tuple(loops))
    assume(abs(peak - claim.gamma) > 1e-6)
    assert check(forged).ok <= (peak < claim.gamma)


def test_unstable_loops_are_refused_although_mu_is_below_the_level(
    certificate: Certificate,
) -> None:
    """With both gains of the wrong sign mu can be bounded, but the loops are unstable."""
    claim = certificate.claim
    wrong = Claim(
        claim.plant,
        claim.uncertainty,
        claim.performance,
        tuple(Controller(-1e-3, 1e3) for _ in claim.loops),
        1e6,
    )
    ends = [0.0, *np.geomspace(1e-7, 10, 200).tolist(), float("inf")]
    intervals = tuple(ProvenInterval(Interval(low, high), (1.0,)) for low, high in pairwise(ends))
    verification = check(Certificate(wrong, intervals))
    assert verification.verdict is Verdict.UNSTABLE
    assert verification.reason == "2 of the closed-loop poles are unstable"


@pytest.mark.parametrize("den", [(1.0, 0.0), (1.0, -1.0), (1.0, 0.0, 1.0)])
def test_an_unstable_uncertainty_weight_is_refused_by_the_check_itself(
    certificate: Certificate, den: tuple[float, ...]
) -> None:
    """Also where the record, which refuses it too, was made without its own checks."""
    weight = TransferFunction((0.2,), den)
    uncertainty = copy.copy(certificate.claim.uncertainty)
    object.__setattr__(uncertainty, "weight", weight)
    forged = replace(certificate, claim=replace(certificate.claim, uncertainty=uncertainty))
    with pytest.raises(InvalidInputError, match="must be stable") as error:
        check(forged)
    assert error.value.field == "/uncertainty/weight/den"
