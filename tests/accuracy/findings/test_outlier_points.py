"""Tests of the finding `outlier-points`: points that were left out."""

from types import SimpleNamespace

import pytest

from basecal.accuracy.findings import outlier_points as module
from basecal.accuracy.findings.outlier_points import outlier_points


@pytest.fixture(autouse=True)
def reason(monkeypatch):
    """Replaces the wording of reasons, which has tests of its own."""
    monkeypatch.setattr(module, "list_outliers", lambda outliers, _: f"At sample {outliers[0].sample}, the reason.")


@pytest.mark.parametrize(("kept", "severity"), [(27, "info"), (26, "warning")])
def test_over_a_tenth_of_points_is_warning(evidence, kept, severity):
    """Up to a tenth of all points may be left out, as detectors do; more is a warning."""
    outliers = tuple(SimpleNamespace(sample=s, ids=ids) for s, ids in ((5, (1, 2)), (3, (0,)), (9, ())))
    (found,) = outlier_points(evidence(robust=SimpleNamespace(outliers=outliers, points=kept)))
    assert (found.severity, found.about) == (severity, ("3", "5"))
    assert found.message.startswith(f"3 of {kept + 3} points were left out as outliers")
    assert "At sample 5, the reason." in found.message


def test_without_outlier_points_no_finding(evidence):
    """Without left-out points there is no finding; whole views have their own."""
    assert outlier_points(evidence()) == []
    views = (SimpleNamespace(sample=5, ids=()),)
    assert outlier_points(evidence(robust=SimpleNamespace(outliers=views, points=10))) == []
