"""`outlier-points`: points that were left out."""

from types import SimpleNamespace

import pytest

from basecal.accuracy.findings import outlier_points as module
from basecal.accuracy.findings.outlier_points import outlier_points


@pytest.fixture(autouse=True)
def reason(monkeypatch):
    """The words of a reason have tests of their own."""
    monkeypatch.setattr(module, "list_outliers", lambda outliers, _: f"At sample {outliers[0].sample}, the reason.")


@pytest.mark.parametrize(("kept", "severity"), [(27, "info"), (26, "warning")])
def test_a_tenth_is_many(evidence, kept, severity):
    """Up to a tenth of all points, those left out among them, is the detector's everyday business."""
    outliers = tuple(SimpleNamespace(sample=s, ids=ids) for s, ids in ((5, (1, 2)), (3, (0,)), (9, ())))
    (found,) = outlier_points(evidence(robust=SimpleNamespace(outliers=outliers, points=kept)))
    assert (found.severity, found.about) == (severity, ("3", "5"))
    assert found.message.startswith(f"3 of {kept + 3} points were left out as outliers")
    assert "At sample 5, the reason." in found.message


def test_without_points_left_out_nothing_is_said(evidence):
    """Whole views are told elsewhere."""
    assert outlier_points(evidence()) == []
    views = (SimpleNamespace(sample=5, ids=()),)
    assert outlier_points(evidence(robust=SimpleNamespace(outliers=views, points=10))) == []
