"""Tests of the findings about outliers: the samples and points left out, their causes, and their effect."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, views
from tests.shared.real_recordings import data_folder

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.outlier_samples import (
    _moved_sentence,
    agreeing_samples,
    agreement_findings,
    far_stops,
    outlier_causes,
    outlier_samples,
)
from basecal.accuracy.phrases.changed_frame import ChangedFrame
from basecal.cell import Cell, CellCamera, CellTarget, Intrinsics, Recording, Robot, RobotState, Sample, Unknown
from basecal.cell.targets.charuco import charuco_target
from basecal.estimation.outliers.left_out import LeftOut
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from basecal.vision.detect import detect

BUMP = SE3.exp([0.02, 0, 0, 0, 0.02, 0])


def bump_sample(sample):
    moved = RobotState(sample.robots["eye"].base_from_flange @ BUMP)
    return replace(sample, robots={**sample.robots, "eye": moved})


def with_stray(sample, row):
    (seen,) = sample.observations
    pixels = seen.pixels.copy()
    pixels[row] += 30
    return replace(sample, observations=(replace(seen, pixels=pixels),))


@pytest.mark.journey
def test_bumped_samples_make_answer_doubtful():
    """Three bumped samples of thirty give a warning that names them and the cause.

    Each still has its residual, which counts in no mean.
    """
    s = simulate(Scenario(robot_noise=(1e-4, 2e-4)), seed=0)
    samples = tuple(bump_sample(x) if x.sample in (4, 5, 6) else x for x in s.recording.samples)
    found = calibrate(s.cell, Recording(samples))
    assert found.verdict == "doubtful"
    (finding,) = found.findings
    assert (finding.code, finding.severity, finding.about) == ("outlier-samples", "warning", ("4", "5", "6"))
    assert "Samples 4 to 6 (3 of 30) were left out as outliers" in finding.message
    assert [o.sample for o in found.outliers] == [4, 5, 6]
    assert found.residuals.rms_px == pytest.approx(0.2, rel=0.1)
    assert len(found.residuals.per_sample) == 30
    assert found.residuals.per_sample[5].rms_px > 5


@pytest.mark.slow
def test_moved_base_is_reported():
    """A base moved during the recording is reported with the time, and 9 of 22 samples are left out.

    The answer is that of the other side of the move.
    """
    s = simulate(Scenario(samples=22, robot_noise=(3e-4, 5e-4)), seed=0)
    moved = SE3.exp([0.02, -0.01, 0.0, 0.0, 0.01, 0.02])
    samples = tuple(x if x.sample < 9 else _from(moved, x) for x in s.recording.samples)
    found = calibrate(s.cell, Recording(samples))
    assert found.verdict == "doubtful"
    (finding,) = [f for f in found.findings if f.code == "outlier-samples"]
    assert len(finding.about) == 9
    assert "before sample 9" in finding.message
    base = found["eye_base_from_hand_base"]
    off = (base.mean.inverse() @ s.truth["eye_base_from_hand_base"] @ moved.inverse()).log()
    assert (
        off @ np.linalg.solve(base.covariance, off) < 50
    )  # chi-square with 6 freedoms, exceeded with a chance of 5e-9


def _from(moved: SE3, sample: Sample) -> Sample:
    """The sample as the hand records it after its base was moved."""
    state = RobotState(moved @ sample.robots["hand"].base_from_flange)
    return replace(sample, robots={**sample.robots, "hand": state})


@pytest.mark.journey
def test_stray_points_leave_answer_good():
    """Two stray corners of 540 are an info that names their samples, and the answer stays good."""
    s = simulate(Scenario(samples=15), seed=0)
    samples = tuple(with_stray(x, 3) if x.sample in (7, 9) else x for x in s.recording.samples)
    found = calibrate(s.cell, Recording(samples))
    assert found.verdict == "good"
    (finding,) = found.findings
    assert (finding.code, finding.severity, finding.about) == ("outlier-points", "info", ("7", "9"))
    assert "2 of 540 points were left out as outliers, in samples 7, 9" in finding.message
    assert [(o.sample, len(o.ids)) for o in found.outliers] == [(7, 1), (9, 1)]


@pytest.mark.journey
def test_clean_data_have_empty_outlier_list():
    """Clean data have an empty outlier list, not null: outliers were searched."""
    s = simulate(Scenario(samples=12), seed=0)
    assert calibrate(s.cell, s.recording).outliers == ()


@pytest.mark.slow
def test_mostly_left_out_recording_is_doubtful():
    """If half of an LED's views are reflections, the answer is doubtful and the left-out samples are named."""
    s = simulate(Scenario(target="led", camera_mount="fixed", target_mount="fixed", samples=40), seed=2)
    rng = np.random.default_rng(2)
    samples = []
    for x in s.recording.samples:
        (seen,) = x.observations
        pixels = rng.uniform((0, 0), (1280, 720), (1, 2)) if x.sample % 5 < 2 else seen.pixels
        samples.append(replace(x, observations=(replace(seen, pixels=pixels),)))
    found = calibrate(s.cell, Recording(tuple(samples)))
    assert found.verdict == "doubtful"
    (finding,) = [f for f in found.findings if f.code == "outlier-samples"]
    assert len(finding.about) == 16


def robust(left_out=(), kept=(), agreeing=(), errors=(), points=(), samples=100):
    """A robust solution without these samples, with stop errors, each of its own kept sample."""
    numbers = np.array(kept, dtype=np.int64)
    stops = np.arange(len(numbers))
    group = replace(views(end(mount="lens"), end("hand", stop=stops), camera="wrist", target="board"), sample=numbers)
    of_stops = np.zeros((len(numbers), 6))
    of_stops[: len(errors), 2] = errors
    solution = SimpleNamespace(problem=SimpleNamespace(groups=(group,)), state=SimpleNamespace(stop_errors=of_stops))
    outliers = tuple(LeftOut(k, "wrist", "board", (), 40.0, 0.02, 0.01) for k in left_out)
    of_points = tuple(LeftOut(k, "wrist", "board", (3,), 9.0, off_px=2.0) for k in points)
    found = RobustSolution(solution, (*outliers, *of_points), None, samples, 0, tuple(agreeing))
    images = {(number, "wrist"): f"images/wrist/IMG_{number + 1}.png" for number in left_out}
    return SimpleNamespace(robust=found, solution=solution, recorded=SimpleNamespace(groups=()), images=images)


@pytest.mark.parametrize(
    ("left_out", "kept", "words"),
    [
        ((7, 8, 9), range(7), "as if a base, a mount or the target was moved after sample 6"),
        ((0, 1, 2), range(3, 9), "as if a base, a mount or the target was elsewhere before sample 3"),
        ((7, 8), range(7), "Look at them (samples count from 0), and record with arms at rest"),
        ((2, 8, 9), range(3, 8), "Look at them (samples count from 0), and record with arms at rest"),
        ((0, 1, 9), range(3, 9), "Look at them (samples count from 0), and record with arms at rest"),
        ((4,), range(3), "Look at it (samples count from 0), and record with arms at rest"),
        ((0, 1, 2), (), "Look at them (samples count from 0), and record with arms at rest"),
    ],
)
def test_outliers_at_one_end_mean_movement(left_out, kept, words):
    """Three or more outliers at one end of the recording mean that a device was moved; others do not."""
    (finding,) = outlier_samples(robust(left_out, kept))
    assert words in finding.message
    assert ("As if" in finding.message) == words.startswith("As if")
    assert ("was left out as an outlier." in finding.message) == (len(left_out) == 1)
    assert (
        f"At sample {left_out[0]} (IMG_{left_out[0] + 1}.png), the robots' poses and the view disagree"
        in finding.message
    )
    assert finding.about == tuple(map(str, left_out))


def test_moved_device_is_named():
    """The moved device is the one on which all outliers and no kept samples of that end depend.

    Points give the distance.
    """
    case = robust((7, 8, 9), range(7))
    (group,) = case.solution.problem.groups
    other = replace(group, target="light", ends=(group.eye, replace(group.hand, mount="flange_from_light")))
    own = replace(group, ends=(group.eye, replace(group.hand, mount="flange_from_board")))
    case.solution.problem.groups = (own, replace(other, sample=np.arange(7) + 3))
    (finding,) = outlier_samples(case)
    assert "as if board was moved after sample 6; the answer" in finding.why
    points = tuple(LeftOut(7 + k, "wrist", "board", (), 40.0, off_m=off) for k, off in enumerate((4e-3, 5e-3, 9e-3)))
    (finding,) = outlier_samples(SimpleNamespace(**vars(case) | {"robust": replace(case.robust, outliers=points)}))
    assert "as if board was moved by 5.0 mm after sample 6; the answer" in finding.why


@pytest.mark.parametrize(("count", "severity"), [(3, "info"), (4, "warning")])
def test_over_three_percent_outliers_is_warning(count, severity):
    """Three outlier samples in a hundred are an info, more a warning. Outlier points have their own finding."""
    (finding,) = outlier_samples(robust(range(0, 2 * count, 2), range(1, 50, 2), points=[9]))
    assert finding.severity == severity
    assert f"({count} of 100)" in finding.message
    assert outlier_samples(robust((), range(9), points=[4])) == []


def test_agreeing_samples_are_named():
    """If the answer rests on a minority of samples, those that agree are named; else there is no finding."""
    assert agreeing_samples(robust()) == []
    (finding,) = agreement_findings(robust(agreeing=(5, 3, 4), samples=20).robust, None)
    assert (finding.severity, finding.about) == ("warning", ("3", "4", "5"))
    assert "Of 20 samples only 3 agree with one another: samples 3 to 5." in finding.message
    (finding,) = agreement_findings(
        robust(agreeing=(5, 3, 4), samples=20).robust, ChangedFrame((3, 4, 5), "From sample 6 on it differs.")
    )
    assert finding.why.startswith("From sample 6 on it differs. Nothing was left out")


@pytest.mark.parametrize(("error", "is_reported"), [(5.9, False), (6.1, True), (-6.1, True)])
def test_stops_beyond_six_sigmas_are_named(error, is_reported):
    """Stops beyond six sigmas are named by their samples, unless samples were left out as the outliers."""
    found = far_stops(robust(kept=range(10, 15), errors=(0.5, error)))
    assert [f.about for f in found] == ([("11",)] if is_reported else [])
    assert not is_reported or "by up to 6 of its sigmas at sample 11." in found[0].message
    assert far_stops(robust(left_out=(3,), kept=range(10, 15), errors=(0.5, error))) == []
    assert len(far_stops(robust(kept=range(10, 15), errors=(0.5, error), points=[3]))) == is_reported


def _abb(copy: Path) -> tuple[Cell, Recording]:
    """Two ABB IRB 120, of whose twenty samples only the last ten close the loop."""
    folder = data_folder() / "abb_irb120_dual_messy"
    if not folder.exists():
        pytest.skip(f"{folder} is not there: set BASECAL_DATA to the folder of the published recordings")
    images = Path("20230428_i")
    shutil.copytree(folder / images, copy / images)
    eye, hand = (np.loadtxt(folder / images / f"r{k}_tf.txt").reshape(-1, 4, 4) for k in (1, 2))
    samples = tuple(
        Sample(
            k,
            None,
            {"eye": RobotState(SE3.from_matrix(eye[k])), "hand": RobotState(SE3.from_matrix(hand[k]))},
            images={"camera": str(images / f"{k:03d}_image.jpg")},
        )
        for k in range(20)
    )
    board = charuco_target((10, 14), 0.0241, 0.0181, "DICT_4X4_250", legacy_pattern=True)
    cell = Cell(
        "eye",
        robots={name: Robot(name) for name in ("eye", "hand")},
        bases={"hand": Unknown()},
        cameras={"camera": CellCamera("camera", "eye", Unknown(), "pinhole", (1920, 1080), Intrinsics("free"))},
        targets={"board": CellTarget("board", "hand", Unknown(), board)},
    )
    return cell, Recording(samples, folder=str(copy))


@pytest.mark.slow
def test_abb_with_ten_inconsistent_samples_is_not_good(tmp_path):
    """The dual ABB recording is not good, and the samples that close the loop are named.

    They are 10 to 19, and one more at most. Lens and mounts are unknown.
    """
    cell, recording = _abb(tmp_path)
    found = calibrate(cell, detect(cell, recording))
    assert found.verdict != "good"
    (finding,) = [f for f in found.findings if f.code == "outlier-samples"]
    assert set(map(str, range(10, 20))) <= set(finding.about)
    assert len(finding.about) <= 11
    assert "10 to 19" in finding.message


def test_far_stops_are_omitted_beside_agreeing_samples():
    """Far stops are not reported beside agreeing samples.

    Of two far stops, both samples and the larger error are stated.
    """
    assert far_stops(robust(kept=range(10, 15), errors=(0.5, 9.0), agreeing=(10, 11))) == []
    (found,) = far_stops(robust(kept=range(10, 15), errors=(7.0, 0.5, -9.4)))
    assert found.what == "A robot's pose was off by up to 9 of its sigmas at samples 10, 12."
    assert found.do == ("Leave these samples out, or state a larger noise.",)
    assert (found.severity, found.about) == ("warning", ("10", "12"))


MADE = simulate(Scenario(samples=14, robot_noise=(1e-4, 2e-4)), 5)
SOLUTION = solve(MADE.cell, MADE.recording)


def with_poses(robot: str, pose_of: Callable[[int, SE3], SE3]) -> Recording:
    samples = MADE.recording.samples
    states = [RobotState(pose_of(k, sample.robots[robot].base_from_flange)) for k, sample in enumerate(samples)]
    slipped = (replace(s, robots={**s.robots, robot: state}) for s, state in zip(samples, states, strict=True))
    return replace(MADE.recording, samples=tuple(slipped))


def causes(recording: Recording, numbers: list[int]) -> list[str]:
    problem, _ = build_problem(MADE.cell, recording)
    state = replace(SOLUTION.state, stop_errors=0 * SOLUTION.state.stop_errors)
    return outlier_causes(problem, state, numbers)


def test_exchanged_rows_are_named() -> None:
    """Two exchanged rows of one robot are named as the cause."""
    poses = [sample.robots["hand"].base_from_flange for sample in MADE.recording.samples]
    recording = with_poses("hand", lambda k, pose: poses[{7: 8, 8: 7}.get(k, k)])
    assert causes(recording, [7, 8]) == ["The poses of hand at samples 7 and 8 are exchanged."]


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "millimetres"), (1e-3, "metres among millimetres")])
def test_rows_in_other_unit_are_named(factor: float, unit: str) -> None:
    """Both outliers with rows in another unit are named."""
    recording = with_poses("eye", lambda k, p: SE3(p.rotation, p.translation * (factor if k in (4, 11) else 1)))
    assert causes(recording, [4, 11]) == [f"The poses of eye at samples 4, 11 look like {unit}."]


def test_cause_of_two_targets_is_named_once() -> None:
    """A cause shown by two targets is named once, for a single row in the singular."""
    recording = with_poses("eye", lambda k, p: SE3(p.rotation, p.translation * (1e3 if k == 4 else 1)))
    problem, _ = build_problem(MADE.cell, recording)
    state = replace(SOLUTION.state, stop_errors=0 * SOLUTION.state.stop_errors)
    twice = problem.with_groups([*problem.groups, *problem.groups])
    assert outlier_causes(twice, state, [4]) == ["The pose of eye at sample 4 looks like millimetres."]


def test_bump_has_no_row_cause() -> None:
    """A bumped pose has none of these causes."""
    bump = SE3.exp([0.02, 0, 0, 0, 0.02, 0])
    assert causes(with_poses("hand", lambda k, pose: pose @ bump if k in (4, 9) else pose), [4, 9]) == []


def make_group(camera, frames, samples):
    return SimpleNamespace(camera=camera, target="board", frames=frames, sample=np.array(samples))


def make_outliers(samples, camera="wrist", off_m=None):
    return [LeftOut(number, camera, "board", (), "outlier", off_m=off_m) for number in samples]


MOUNT, BASE = "eye_flange_from_wrist", "eye_base_from_hand_base"


@pytest.mark.parametrize(
    ("samples", "sentence"),
    [
        ([8, 9, 10], "wrist was moved after sample 7; the answer is for the samples before."),
        ([0, 1, 2], "wrist was elsewhere before sample 3; the answer is for the samples after."),
        ([7, 8, 9], ""),
        ([1, 2, 3], ""),
        ([2, 8, 9], ""),
        ([8], ""),
        ([], ""),
    ],
)
def test_outliers_at_one_end_name_frame(samples, sentence):
    """Outliers after or before all others name the frame with the fewest views.

    Other cameras that share the base go on.
    """
    inliers = SimpleNamespace(
        groups=[make_group("wrist", (MOUNT, BASE), [3, 5, 7]), make_group("other", (BASE,), [0, 9, 12])]
    )
    found = _moved_sentence(make_outliers(samples), inliers)
    assert found == (f" The outliers look as if {sentence}" if sentence else "")


def test_frames_with_equal_views_are_not_distinguished():
    """Frames with equal views are not distinguished.

    Points state their distance, and a frame without an inlier gives no sentence.
    """
    both = SimpleNamespace(groups=[make_group("wrist", (MOUNT, BASE), [3, 5, 7])])
    found = _moved_sentence(make_outliers([8, 9, 10], off_m=2e-3), both)
    assert found.startswith(" The outliers look as if a base, a mount or the target was moved by 2.0 mm after sample 7")
    assert _moved_sentence(make_outliers([8, 9, 10], "third"), both) == ""
    empty = SimpleNamespace(groups=[make_group("wrist", (MOUNT, BASE), [])])
    assert _moved_sentence(make_outliers([8, 9, 10]), empty) == ""
