"""Documents are read strictly, and bad ones are refused with the place of their fault."""

from __future__ import annotations

import copy
import json
import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.certificate.reading import read_certificate
from solver.certificate.record import Certificate
from solver.certificate.verify import Verdict, verify


def fault_of(text: str | bytes) -> tuple[str, str]:
    """Pointer and message of the refusal."""
    verification = verify(text)
    assert verification.verdict is Verdict.MALFORMED
    assert not verification.ok
    assert verification.field is not None
    assert verification.reason
    return verification.field, verification.reason


def test_a_document_reads_back_as_the_same_certificate(certificate: Certificate) -> None:
    """Through JSON and back, to the last bit of each number."""
    assert read_certificate(json.dumps(certificate.to_document())) == certificate


def test_the_form_of_the_document_does_not_matter(certificate: Certificate) -> None:
    """Indented, with sorted members and integers for whole numbers it is the same certificate."""
    document = certificate.to_document()
    document["loops"][0]["integral_time"] = 101
    text = json.dumps(document, indent=2, sort_keys=True).encode()
    assert read_certificate(text) == certificate
    assert verify(text).ok


def test_no_infinity_is_written(certificate: Certificate) -> None:
    """The last interval's end is null."""
    text = json.dumps(certificate.to_document(), allow_nan=False)
    assert json.loads(text)["intervals"][-1]["high"] is None


CHANGES: dict[str, tuple[tuple[Any, ...], Any]] = {
    "/version": (("version",), 2),
    "/format": (("format",), "another"),
    "/gamma": (("gamma",), 0),
    "/plant/kind": (("plant", "kind"), "cubic"),
    "/plant/n": (("plant", "n"), 2.0),
    "/plant/process/den/0": (("plant", "process", "den", 0), "1"),
    "/plant/process/num/0": (("plant", "process", "num", 0), 10**400),
    "/plant/process": (("plant", "process"), []),
    "/plant/process/dead_time": (("plant", "process", "dead_time"), -1),
    "/uncertainty/structure": (("uncertainty", "structure"), "block"),
    "/performance/max_peak": (("performance", "max_peak"), 0.5),
    "/performance/tau_p": (("performance", "tau_p"), None),
    "/loops": (("loops",), []),
    "/loops/0/gain": (("loops", 0, "gain"), True),
    "/loops/1/derivative_time": (("loops", 1, "derivative_time"), 0),
    "/loops/1/extra": (("loops", 1, "extra"), 1),
    "/intervals": (("intervals",), {}),
    "/intervals/0/low": (("intervals", 0, "low"), 1e-9),
    "/intervals/1/high": (("intervals", 1, "high"), 0),
    "/intervals/2/scales/0": (("intervals", 2, "scales", 0), 0),
    "/intervals/3/scales/1": (("intervals", 3, "scales", 1), -1.0),
    "/intervals/4/scales": (("intervals", 4, "scales"), "none"),
    "/intervals/5": (("intervals", 5), None),
    "/digest": (("digest",), "0" * 64),
    "/a~1b": (("a/b",), 1),
}


@pytest.mark.parametrize("pointer", CHANGES)
def test_a_faulty_value_is_named_by_its_pointer(certificate: Certificate, pointer: str) -> None:
    """Wrong kind, out of range, unknown member: refused where it stands."""
    path, value = CHANGES[pointer]
    document = copy.deepcopy(certificate.to_document())
    place = document
    for step in path[:-1]:
        place = place[step]
    place[path[-1]] = value
    assert fault_of(json.dumps(document))[0] == pointer


def test_a_missing_member_is_named(certificate: Certificate) -> None:
    """Each of them is needed."""
    for name in certificate.to_document():
        document = certificate.to_document()
        del document[name]
        assert fault_of(json.dumps(document))[0] == f"/{name}"


def test_missing_and_overlapping_intervals_are_told_apart(certificate: Certificate) -> None:
    """A gap, an overlap, a missing end: each has its own reason."""
    document = certificate.to_document()
    missing, overlapping, short = (copy.deepcopy(document) for _ in range(3))
    del missing["intervals"][3]
    overlapping["intervals"].insert(3, overlapping["intervals"][2])
    del short["intervals"][-1]
    assert "gap" in fault_of(json.dumps(missing))[1]
    assert "overlaps" in fault_of(json.dumps(overlapping))[1]
    assert "infinity" in fault_of(json.dumps(short))[1]


def test_the_wrong_number_of_scales_is_refused(certificate: Certificate) -> None:
    """Two different loops need two scales."""
    document = certificate.to_document()
    document["intervals"][0]["scales"] = [1.0]
    field, _ = fault_of(json.dumps(document))
    assert field == "/intervals/0/scales"


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"\xff\xfe\x00",
        "{",
        "[" * 100_000,
        "null",
        "[]",
        "1" * 5000,
        '{"format": NaN}',
        '{"format": "mutune-certificate", "format": "mutune-certificate"}',
    ],
    ids=["empty", "bytes", "cut", "deep", "null", "array", "number", "nan", "twice"],
)
def test_what_is_no_document_is_refused(text: str | bytes) -> None:
    """No input makes a crash."""
    fault_of(text)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=5,
)


@settings(max_examples=200, deadline=None)
@given(data=st.data(), value=JSON)
def test_any_value_in_any_place_is_refused_or_changes_nothing(
    certificate: Certificate, data: st.DataObject, value: Any
) -> None:
    """Arbitrary JSON put anywhere into a certificate never raises anything unforeseen."""
    document: Any = certificate.to_document()
    place, step = document, data.draw(st.sampled_from(sorted(document)))
    while isinstance(place[step], (dict, list)) and place[step] and data.draw(st.booleans()):
        place = place[step]
        keys = sorted(place) if isinstance(place, dict) else range(len(place))
        step = data.draw(st.sampled_from(list(keys)))
    same = type(place[step]) is type(value) and place[step] == value
    place[step] = value
    try:
        text = json.dumps(document, allow_nan=False)
    except ValueError:
        text = json.dumps(document)
    if same:
        return
    verification = verify(text)
    if verification.verdict is Verdict.MALFORMED:
        assert verification.reason
    else:
        assert isinstance(value, int | float)
        assert math.isfinite(value)


def test_a_filter_of_its_own_is_read_back_and_changes_no_other_document(
    certificate: Certificate,
) -> None:
    """Settings with a filter time carry it; those without one are written as they always were."""
    claim = certificate.claim
    first, second = claim.loops
    loops = (replace(first, filter_time=0.25), second)
    changed = replace(certificate, claim=replace(claim, loops=loops))
    document = changed.to_document()
    assert [set(loop) for loop in document["loops"]] == [
        {"gain", "integral_time", "derivative_time", "filter_time"},
        {"gain", "integral_time", "derivative_time"},
    ]
    assert read_certificate(json.dumps(document)) == changed
    document["loops"][0]["filter_time"] = None
    assert fault_of(json.dumps(document))[0] == "/loops/0/filter_time"
