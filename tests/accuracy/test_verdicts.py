"""Tests of `transform_verdicts`: each transform has the verdict of the findings that concern it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from tests.ends import end
from tests.ends import views as group_of

from basecal.accuracy.verdicts import judge_findings, transform_verdicts
from basecal.cell import Finding


def views(camera, target, eye, hand, base):
    at_eye = end(eye, mount=f"{eye}_flange_from_{camera}")
    return group_of(at_eye, end(hand, mount=f"{hand}_flange_from_{target}", base=base), camera=camera, target=target)


APART = SimpleNamespace(
    all_groups=[views("wrist", "board", "eye", "hand", "base"), views("top", "tag", "one", "two", "far")]
)
TIED = SimpleNamespace(all_groups=[*APART.all_groups, views("wrist", "tag", "eye", "two", "far")])


@pytest.mark.parametrize(("problem", "code", "severity", "about", "base", "far"), [
    (APART, "drift", "warning", ("board",), "doubtful", "good"),
    (TIED, "drift", "warning", ("board",), "doubtful", "doubtful"),
    (APART, "drift", "info", ("board",), "good", "good"),
    (APART, "poor-fit", "warning", (), "doubtful", "doubtful"),
    (APART, "outlier-samples", "warning", ("3", "4"), "doubtful", "doubtful"),
    (APART, "not-converged", "error", (), "refused", "refused"),
    (TIED, "weak-direction", "warning", ("far",), "good", "doubtful"),
    (TIED, "unobservable-direction", "error", ("base", "eye_flange_from_wrist"), "refused", "good"),
])  # fmt: skip
def test_findings_concern_tied_transforms(problem, code, severity, about, base, far):
    """A finding concerns the transforms that views tie to its devices.

    Samples and empty subjects concern everything; the precision of a transform concerns it alone.
    """
    found = transform_verdicts(problem, ["base", "far"], [Finding(code, severity, about, "what")])
    assert found == {"base": base, "far": far}


def test_transforms_without_findings_are_good():
    """Transforms without findings are good; of several findings the worst decides."""
    assert transform_verdicts(APART, ["far"], []) == {"far": "good"}
    several = [Finding("a", "warning", (), ""), Finding("b", "error", ("tag",), ""), Finding("c", "info", (), "")]
    assert transform_verdicts(APART, ["base", "far"], several) == {"base": "doubtful", "far": "refused"}


@pytest.mark.parametrize(
    ("severities", "expected"),
    [((), "good"), (("info",), "good"), (("info", "warning"), "doubtful"), (("warning", "error", "info"), "refused")],
)
def test_worst_finding_is_verdict(severities, expected):
    """An error refuses, and a warning makes doubtful."""
    assert judge_findings([Finding("code", each, (), "") for each in severities]) == expected


def test_views_tie_parts_in_any_order():
    """A view that ties two groups makes them one in any order; a finding about its robot or camera concerns both."""
    tied = SimpleNamespace(all_groups=[TIED.all_groups[2], *APART.all_groups])
    for problem in (TIED, tied):
        for about in ("wrist", "top", "eye", "one", "eye_flange_from_wrist", "base"):
            found = transform_verdicts(problem, ["base", "far"], [Finding("drift", "warning", (about,), "")])
            assert set(found.values()) == {"doubtful"}
    assert transform_verdicts(APART, ["other"], [Finding("drift", "warning", ("top",), "")]) == {"other": "doubtful"}
    assert transform_verdicts(SimpleNamespace(all_groups=[]), ["base"], []) == {"base": "good"}
