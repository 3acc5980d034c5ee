"""Tests of the finding `not-validated`: samples that could not be held out."""

from types import SimpleNamespace

import pytest

from basecal.accuracy.findings.not_validated import not_validated


def test_indispensable_samples_are_named(evidence):
    """Samples without which a requested transform is unobservable are named, the first ten in the message."""
    assert not_validated(evidence()) == []
    assert not_validated(evidence(cross_validation=SimpleNamespace(skipped=(), summary="any"))) == []
    (found,) = not_validated(evidence(cross_validation=SimpleNamespace(skipped=(11, 2), summary="any")))
    assert (found.severity, found.about) == ("info", ("2", "11"))
    assert found.message.startswith("Samples 2, 11 could not be held out")
    assert "Without them, base cannot be estimated." in found.message
    both = evidence(cross_validation=SimpleNamespace(skipped=(11, 2), summary="any"))
    both.cell.requested_transforms = ["base", "mount"]
    both.solution.problem.columns = dict.fromkeys(both.cell.requested_transforms)
    assert (
        "Without them, base and mount cannot be estimated. Record more of their kind." in not_validated(both)[0].message
    )


@pytest.mark.parametrize(("count", "ending"), [(10, "16, 18 could"), (11, "16, 18, ... could")])
def test_long_sample_lists_are_cut(evidence, count, ending):
    """Ten samples are listed in the message, more end in an ellipsis."""
    (found,) = not_validated(evidence(cross_validation=SimpleNamespace(skipped=range(0, 2 * count, 2), summary=None)))
    assert ending in found.message
    assert len(found.about) == count


def test_missing_folds_name_no_sample(evidence):
    """If no folds exist, the finding says so and names no sample."""
    (found,) = not_validated(evidence(cross_validation=SimpleNamespace(skipped=(), summary=None)))
    assert found.about == ()
    assert "cannot be split into folds" in found.message


def test_only_estimated_transforms_are_unobservable(evidence):
    """The finding names only requested transforms that are estimated."""
    made = evidence(cross_validation=SimpleNamespace(skipped=(4,), summary="any"))
    made.cell.requested_transforms = ["base", "fixed"]
    (found,) = not_validated(made)
    assert found.message == (
        "Sample 4 could not be held out in cross-validation. Without it, base cannot be estimated. "
        "Record more of its kind."
    )
    made.cell.requested_transforms = []
    assert "Without it, the solution cannot be estimated." in not_validated(made)[0].message
