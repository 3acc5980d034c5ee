"""Tests of the stages that solve: the solution that is kept, and cases that end."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.stages import solving
from basecal.accuracy.stages.case import Case
from basecal.cell import Finding
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.settings import Settings
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=3), seed=0)
SOLVED = SimpleNamespace(problem="solved", state="state")
ERROR, WARNING, INFO = (Finding(s, s, (), s) for s in ("error", "warning", "info"))


def case(**parts):
    return Case(
        MADE.cell, MADE.recording, Settings(robot_noise=parts.pop("robot_noise", "estimated")), packed="all", **parts
    )


@pytest.mark.parametrize(("robot_noise", "noisy"), [("estimated", "noisy"), ("stated", None)])
def test_noise_is_estimated_unless_stated_requested(monkeypatch, robot_noise, noisy):
    """Noise is estimated unless the stated one is requested; the first solution uses the stated noise."""
    given = []
    monkeypatch.setattr(solving, "solve_problem", lambda *words: given.append(words) or "plain")
    monkeypatch.setattr(solving, "with_noise", lambda *words: "noisy")
    found = solving.solve_all(case(robot_noise=robot_noise))
    assert (found.plain, found.noisy) == ("plain", noisy)
    assert given[0][2].robot_noise == "stated"


@pytest.mark.parametrize(
    ("noisy", "of_arms", "explained"), [("noisy", True, True), ("noisy", False, False), (None, True, False)]
)
def test_convention_check_knows_whether_noise_explains_views(monkeypatch, noisy, of_arms, explained):
    """The convention check receives whether plausible robot noise explains the views."""
    given = []
    monkeypatch.setattr(solving, "has_plausible_noise", lambda solution: of_arms)
    monkeypatch.setattr(
        solving, "check_conventions", lambda *words, is_explained: given.append(is_explained) or (WARNING,)
    )
    found = solving.screen_conventions(case(plain=SOLVED, noisy=noisy, findings=(INFO,)))
    assert given == [explained]
    assert found.findings == (INFO, WARNING)
    assert not found.is_ended


def test_convention_error_ends_without_transforms(monkeypatch):
    """An error of conventions ends the case without transforms, with the residuals of the input as read."""
    monkeypatch.setattr(solving, "check_conventions", lambda *words, is_explained: (ERROR,))
    monkeypatch.setattr("basecal.accuracy.stages.case.residuals", lambda solution: f"fit of {solution}")
    found = solving.screen_conventions(case(plain="plain"))
    assert found.is_ended
    assert (found.calibration.verdict, found.calibration.residuals) == ("refused", "fit of plain")
    assert found.calibration.findings == (ERROR,)
    assert found.calibration.transforms == {}


@pytest.mark.parametrize(
    ("noisy", "of_arms", "explained", "solved"),
    [
        (None, True, True, "exact"),
        ("open", True, True, "noise"),
        ("open", False, True, "noise from exact"),
        ("open", False, False, "exact"),
        ("closed", False, True, "exact"),
    ],
)
def test_implausible_noise_keeps_robots_exact(monkeypatch, noisy, of_arms, explained, solved):
    """Robots are exact if no plausible noise explains the views.

    Noise is solved for with the agreeing samples, unless none is open or none agreed.
    """
    kinds = [{"estimated": ("pixel_px",)}, {"robots": ("eye",)}, {"jitter_s": {"wrist": 1.0}}]
    for kind in kinds if noisy == "open" else [{}]:
        noise = SimpleNamespace(**{"estimated": (), "robots": (), "jitter_s": {}} | kind)
        exact = SimpleNamespace(solution=SOLVED)
        monkeypatch.setattr(solving, "has_plausible_noise", lambda solution: of_arms)
        monkeypatch.setattr(solving, "is_hopeless", lambda problem, state: not explained)
        monkeypatch.setattr(solving, "solve_robustly", lambda *given, exact=exact: exact)
        monkeypatch.setattr(
            solving, "solve_with_noise", lambda *given: "noise from exact" if len(given) > 4 else "noise"
        )
        before = case(plain=SOLVED, noisy=None if noisy is None else SimpleNamespace(noise=noise))
        assert solving.leave_outliers_out(before).robust == (exact if solved == "exact" else solved)


@pytest.mark.parametrize(
    ("hidden", "expected"),
    [([], ["poor-fit", "agree", "warning"]), (["unobservable"], ["unobservable", "poor-fit", "warning"])],
)
def test_unexplained_views_are_refused(monkeypatch, hidden, expected):
    """Unexplained views are refused with unobservable directions first, else a poor fit.

    Earlier findings are listed once.
    """
    monkeypatch.setattr(solving, "is_hopeless", lambda problem, state: True)
    monkeypatch.setattr(solving, "unobservable_by_poses", lambda *given: [Finding(c, "error", (), "") for c in hidden])
    monkeypatch.setattr(solving, "joint_offset_findings", lambda *given: [])
    monkeypatch.setattr(solving, "hopeless_finding", lambda *given: Finding("poor-fit", "error", (), ""))
    monkeypatch.setattr(solving, "changed_frame", lambda *given: None)
    monkeypatch.setattr(solving, "agreement_findings", lambda *given: [Finding("agree", "info", (), "")])
    before = case(
        robust=SimpleNamespace(solution=SOLVED, agreeing=()), findings=(Finding("poor-fit", "info", (), ""), WARNING)
    )
    found = solving.refuse_unexplained_poses(before)
    assert found.is_ended
    assert [each.code for each in found.calibration.findings] == expected


def test_explained_views_continue(monkeypatch):
    """Explained views leave the case unchanged, and so does a case that has ended."""
    monkeypatch.setattr(solving, "is_hopeless", lambda problem, state: False)
    before = case(robust=SimpleNamespace(solution=SOLVED))
    assert solving.refuse_unexplained_poses(before) is before
    monkeypatch.setattr(solving, "is_hopeless", lambda problem, state: True)
    ended = before.refuse((ERROR,))
    assert solving.refuse_unexplained_poses(ended) is ended


@pytest.mark.parametrize("has_scene", [True, False])
def test_scene_replaces_finding_of_few_images(monkeypatch, has_scene):
    """With a scene, too few target images are no finding; the scene's findings follow the earlier ones."""
    given, few = [], Finding("few-images", "warning", (), "")
    scene = "scene" if has_scene else None
    monkeypatch.setattr(
        "basecal.accuracy.scene.join_scene.join_scene", lambda *words: given.append(words) or ("joined", (INFO,), scene)
    )
    solution = SimpleNamespace(converged=True)
    robust = RobustSolution(solution, (), SimpleNamespace(samples=np.array([3, 5])), 6, 6)
    before = case(robust=robust, findings=(few, WARNING))
    before = replace(before, settings=replace(before.settings, joins_scene=True))
    found = solving.join_static_scene(before)
    assert given[0][2:] == (solution, before.settings, {3, 5})
    assert (found.scene, found.solution) == (scene, "joined")
    assert found.findings == ((WARNING, INFO) if has_scene else (few, WARNING, INFO))


@pytest.mark.parametrize(
    ("joins", "tracks", "converged", "joined"),
    [(False, False, True, False), (False, True, True, True), (True, False, True, True), (True, True, False, False)],
)
def test_scene_is_joined_if_requested_or_tracked(monkeypatch, joins, tracks, converged, joined):
    """A scene is joined if it is requested or tracks exist, unless the answer did not converge."""
    monkeypatch.setattr("basecal.accuracy.scene.join_scene.join_scene", lambda *words: ("joined", (), None))
    samples = (replace(MADE.recording.samples[0], tracks=("track",) if tracks else ()), *MADE.recording.samples[1:])
    robust = RobustSolution(SimpleNamespace(converged=converged), (), SimpleNamespace(samples=np.array([])), 6, 6)
    before = replace(case(robust=robust), recording=replace(MADE.recording, samples=samples))
    before = replace(before, settings=replace(before.settings, joins_scene=joins))
    assert (solving.join_static_scene(before).solution == "joined") == joined


def test_changed_frame_is_error(monkeypatch):
    """A changed frame is an error, and no further finding about the poses follows."""
    monkeypatch.setattr(solving, "is_hopeless", lambda problem, state: True)
    monkeypatch.setattr(solving, "unobservable_by_poses", lambda *given: [])
    monkeypatch.setattr(solving, "joint_offset_findings", lambda *given: [])
    monkeypatch.setattr(solving, "changed_frame", lambda *given: "changed")
    monkeypatch.setattr(solving, "agreement_findings", lambda robust, changed: [Finding(changed, "warning", (), "")])
    found = solving.refuse_unexplained_poses(case(robust=SimpleNamespace(solution=SOLVED)))
    assert [(each.code, each.severity) for each in found.calibration.findings] == [("changed", "error")]
