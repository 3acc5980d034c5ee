"""Tests of the finding `dropped-sample` as a warning."""

from types import SimpleNamespace

import pytest

from basecal.accuracy.findings.dropped_samples import many_dropped_samples
from basecal.cell import Finding


def make_input(kept, dropped):
    findings = tuple(Finding("dropped-sample", "info", (str(100 + k),), "") for k in range(dropped))
    others = (Finding("dropped-sample", "info", ("last line",), ""), Finding("other", "info", ("7",), ""))
    return SimpleNamespace(problem=SimpleNamespace(samples=range(kept)), findings=(*findings, *findings[:1], *others))


@pytest.mark.parametrize(("kept", "dropped", "found"), [(9, 1, False), (8, 1, True), (18, 2, False), (17, 2, True)])
def test_over_a_tenth_dropped_is_warning(kept, dropped, found):
    """More than a tenth of dropped samples is a warning.

    Each sample counts once, however often it is reported.
    """
    made = many_dropped_samples(make_input(kept, dropped))
    assert [f.severity for f in made] == (["warning"] if found else [])
    assert not found or made[0].message.startswith(f"{dropped} of {kept + dropped} samples could not be used")


def test_most_frequent_drop_reason_is_reported():
    """The warning states the reason of most dropped samples, not that of other findings.

    It is omitted beside "few-images".
    """
    reasons = (
        Finding("dropped-sample", "info", ("1",), "one reason"),
        Finding("dropped-sample", "info", ("2", "3"), "another reason"),
        Finding("other", "info", ("4", "5", "6"), "no reason"),
    )
    problem = SimpleNamespace(samples=range(10, 15))
    (found,) = many_dropped_samples(SimpleNamespace(problem=problem, findings=reasons))
    assert found.message == "3 of 8 samples could not be used. another reason"
    few = Finding("few-images", "warning", (), "")
    assert many_dropped_samples(SimpleNamespace(problem=problem, findings=(*reasons, few))) == []
