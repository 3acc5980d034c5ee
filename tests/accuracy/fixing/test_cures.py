"""Tests of `find_cures`."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.fixing import cures
from basecal.accuracy.fixing.change import Change
from basecal.accuracy.fixing.cures import find_cures
from basecal.cell import Calibration, Finding, Outlier, RobotState, Unknown
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BOARD = simulate(Scenario(samples=9), 2)


def cures_of(*findings: Finding, outliers: tuple[Outlier, ...] = (), recording=BOARD.recording, cell=BOARD.cell):
    calibration = Calibration("doubtful", findings=findings, outliers=outliers)
    return find_cures(cell, recording, recording, calibration)


@pytest.mark.journey
def test_convention_is_undone() -> None:
    """A finding by `calibrate`, or by the reach of a flange, is undone by the hypothesis with its words."""
    samples = tuple(
        replace(s, robots={**s.robots, "eye": RobotState(s.robots["eye"].base_from_flange.inverse())})
        for s in BOARD.recording.samples
    )
    recording = replace(BOARD.recording, samples=samples)
    what = "The poses of eye are inverted (flange_from_base)."
    (cure,) = cures_of(Finding("robot-pose-inverted", "error", ("eye",), what), recording=recording)
    assert cure.words == "Undo: the poses of eye are inverted (flange_from_base)."
    assert len(cure.change.samples) == 9
    what = "The poses of eye are in millimetres: a flange is 782 m from its base."
    (cure,) = cures_of(Finding("length-unit", "error", ("eye",), what), recording=recording)
    assert cure.words == "Undo: the poses of eye are in millimetres."


def test_inverted_poses_and_carriers_are_choices() -> None:
    """Inverted poses of the only robot fit as exactly as a camera on it and the target on the world.

    Both fixes are offered as choices.
    """
    made = simulate(Scenario(samples=9, layout="eye_to_hand"), 2)
    what = "The poses of arm are inverted (flange_from_base), or overhead is on arm and board on world."
    finding = Finding("robot-pose-inverted", "error", ("arm",), what)
    inverted, carried = cures_of(finding, cell=made.cell, recording=made.recording)
    assert inverted.is_choice
    assert carried.is_choice
    assert inverted.words == "Undo: the poses of arm are inverted (flange_from_base)."
    assert carried.words == "Write that overhead is on arm and board on world."
    assert carried.change.cell == {
        ("cameras", "overhead", "on"): "arm",
        ("cameras", "overhead", "mount"): {"status": "free"},
        ("targets", "board", "on"): "world",
        ("targets", "board", "mount"): {"status": "free"},
    }


@pytest.mark.journey
def test_fitting_angle_list_is_used() -> None:
    """The better of two angle lists is used.

    Roll, pitch and yaw beyond half a turn were read as a rotation vector: the longer vector is meant.
    """
    turn = SE3.from_rpy([2.9, 0.4, -2.8], np.zeros(3))
    samples, meant = [], []
    for sample in BOARD.recording.samples:
        pose = turn @ sample.robots["eye"].base_from_flange
        meant.append(pose.rotation)
        read = SE3.from_rotvec(pose.rpy, pose.translation)
        samples.append(replace(sample, robots={**sample.robots, "eye": RobotState(read)}))
    recording = replace(BOARD.recording, samples=tuple(samples))
    what = (
        "The rotations of eye are roll, pitch, yaw about fixed axes x, y, z (ROS, FANUC) that were read as a rotation "
        "vector (Universal Robots)."
    )
    (cure,) = cures_of(Finding("euler-order", "error", ("eye",), what), recording=recording)
    found = [sample.robots["eye"].base_from_flange.rotation for sample in cure.change.samples]
    np.testing.assert_allclose(found, meant, atol=1e-9)


def test_outliers_lens_and_lines_are_fixed() -> None:
    """Outlier samples are left out, a lens is freed, and a line offered by a finding is written for its target."""
    outliers = (Outlier(3, "wrist", "board", (), "far"), Outlier(5, "wrist", "board", (7,), "stray"))
    left, lens, line = cures_of(
        Finding("outlier-samples", "warning", ("3",), "Sample 3 was left out as an outlier."),
        Finding("intrinsics", "warning", ("wrist",), "The lens of wrist is not as stated: fx is 3 px off."),
        Finding(
            "few-images", "warning", ("wrist",), "None.", ("'board': no board: write `dictionary: DICT_5X5_100`.",)
        ),
        outliers=outliers,
    )
    assert left.words == "Leave out sample 3."
    assert [sample.sample for sample in left.change.samples] == [0, 1, 2, 4, 5, 6, 7, 8]
    assert lens.change.cell["cameras", "wrist", "intrinsics", "status"] == "free"
    assert line.change.cell == {("targets", "board", "dictionary"): "DICT_5X5_100"}


def test_all_lines_are_written_for_all_robots() -> None:
    """Offsets and links of both arms are written by one fix: without one of them the finding would remain."""
    offsets, links = (
        {"status": "prior", "sigma_rad": 0.03},
        {"status": "prior", "sigma_rad": 2e-3, "sigma_m": 1e-3},
    )
    do = (
        "Write `joint_offsets: {status: prior, sigma_rad: 0.03}` and "
        "`link_parameters: {status: prior, sigma_rad: 0.002, sigma_m: 0.001}` at eye and hand in cell.yaml."
    )
    (cure,) = cures_of(Finding("robot-model", "warning", ("eye", "hand"), "Joints are off.", (do,)))
    written = {"joint_offsets": offsets, "link_parameters": links}
    assert cure.change.cell == {("robots", r, key): value for r in ("eye", "hand") for key, value in written.items()}


@pytest.mark.journey
@pytest.mark.parametrize("code", ["fixed-contradicted", "prior-contradicted"])
def test_transform_is_freed(code: str) -> None:
    """A transform that effects or sigmas contradict is freed; no input hypothesis has these words."""
    name = "eye_flange_from_wrist"
    cell = BOARD.cell.with_transform(name, Unknown("fixed", SE3.identity()))
    finding = Finding(code, "warning", (name,), f"{name} is elsewhere than stated.")
    (cure,) = cures_of(finding, cell=cell)
    assert cure.change.cell == {("cameras", "wrist", "mount"): {"status": "free"}}


def test_lens_prior_is_freed() -> None:
    """A lens prior is freed by the finding's camera; an offered line of another finding is its only fix."""
    made = simulate(Scenario(samples=9, intrinsics="prior"), 2)
    what = "The answer is up to 14.1 sigmas away from the prior of the lens of wrist."
    lens, clock = cures_of(
        Finding("prior-contradicted", "warning", ("wrist",), what),
        Finding(
            "prior-contradicted", "warning", ("wrist",), "Late.", ("Write `clock: {status: free, offset_s: 0.02}`.",)
        ),
        cell=made.cell,
    )
    assert lens.words == "Free the lens of wrist."
    assert lens.change.cell["cameras", "wrist", "intrinsics"]["status"] == "free"
    assert clock.change.cell == {("cameras", "wrist", "clock"): {"status": "free", "offset_s": 0.02}}


def test_infos_and_incurable_findings_have_no_fix() -> None:
    """An info has no fix, nor has a finding that no file can undo."""
    info = Finding("outlier-samples", "info", ("3",), "Sample 3 was left out as an outlier.")
    weak = Finding("weak-direction", "warning", (), "The base is weak along x.")
    assert cures_of(info, weak, outliers=(Outlier(3, "wrist", "board", (), "far"),)) == ()


def test_best_of_several_hypotheses_is_undone(monkeypatch) -> None:
    """The best of several hypotheses with the finding's code and words is undone.

    A single one is used without a fit.
    """

    def hypothesis(code: str, words: str, misfit: float) -> SimpleNamespace:
        return SimpleNamespace(code=code, words=words, about=(), carriers=None, misfit=misfit)

    words = "the poses of eye are odd"
    known = [hypothesis("one", words, 3.0), hypothesis("one", words, 1.0), hypothesis("one", words, 2.0)]
    known += [hypothesis("two", words, 0.0), hypothesis("one", "another", 0.0)]
    asked = []
    monkeypatch.setattr(cures, "solve_problem", lambda *given: SimpleNamespace(state=None))
    monkeypatch.setattr(cures, "every_hypothesis", lambda *given: known)
    monkeypatch.setattr(cures, "_misfit", lambda declared, each: asked.append(each) or each.misfit)
    monkeypatch.setattr(cures, "change_of_hypothesis", lambda *given: Change(cell={("x",): given[-1].misfit}))
    finding = Finding("one", "error", (), "The poses of eye are odd.")
    (cure,) = cures_of(finding)
    assert cure.change.cell == {("x",): 1.0}
    assert asked == known[:3]
    (alone,) = cures_of(replace(finding, code="two"))
    assert alone.change.cell == {("x",): 0.0}
    assert asked == known[:3]
