"""Tests of the finding about images that were not taken at the times of their stamps."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.late_images import _Late, _problem_sentence, late_images
from basecal.cell import Finding, PoseObservation, Recording, Sample
from basecal.estimation.outliers.left_out import LeftOut
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from stream_cells import Streamed, streamed


def delay_sample(sample: Sample, by_s: float) -> Sample:
    """The sample with an image taken so much later than its stamp."""
    assert sample.stamp_s is not None
    return replace(sample, stamp_s=sample.stamp_s - by_s)


def bump_view(sample: Sample) -> Sample:
    (seen,) = sample.observations
    assert isinstance(seen, PoseObservation)
    moved = seen.camera_from_target @ SE3.exp([0.01, -0.02, 0.02, 0.0, 0.03, 0.02])
    return replace(sample, observations=(replace(seen, camera_from_target=moved),))


def clock_findings(made: Streamed, changed: dict[int, Sample]) -> list[Finding]:
    samples = tuple(changed.get(s.sample, s) for s in made.recording.samples)
    found = calibrate(made.cell, Recording(samples))
    assert found.clocks["wrist"].offset_s == pytest.approx(0.03, abs=3.3 * found.clocks["wrist"].sigma_s)
    return [f for f in found.findings if f.code == "clock-offset"]


@pytest.mark.journey
def test_late_images_are_named_with_delay():
    """A 60 ms late and an 80 ms early image among seventy are named with their delays; the clock fits the others."""
    made = streamed()
    views = {s.sample: s for s in made.recording.samples if s.observations}
    (finding,) = clock_findings(made, {21: delay_sample(views[21], 0.06), 44: delay_sample(views[44], -0.08)})
    assert (finding.severity, finding.about) == ("info", ("wrist", "21", "44"))
    assert (
        "2 images of wrist were not taken at the times of their stamps, and are left out: samples 21, 44"
        in finding.message
    )
    delays = [
        float(word) for word in finding.message.split("(")[1].split(")")[0].replace("ms", "").split() if word.isdigit()
    ]
    np.testing.assert_allclose(delays, [60, 80], atol=6)
    assert "late," in finding.message
    assert "early)" in finding.message


@pytest.mark.journey
def test_moved_view_is_not_late():
    """A view that is off in another way is not reported as late."""
    made = streamed()
    views = {s.sample: s for s in made.recording.samples if s.observations}
    assert clock_findings(made, {21: bump_view(views[21])}) == []


@pytest.mark.journey
def test_many_late_images_are_warning():
    """Three late images are a warning."""
    made = streamed()
    views = {s.sample: s for s in made.recording.samples if s.observations}
    (finding,) = clock_findings(made, {k: delay_sample(views[k], 0.09) for k in (11, 27, 48)})
    assert finding.severity == "warning"


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (1, "An image of wrist was not taken at the time of its stamp, and is left out: sample 10 (30 ms late)."),
        (
            5,
            "their stamps, and are left out: samples 10 to 14 (30 ms late, 10 ms late, ",
        ),
        (6, ", 10 ms early, 30 ms early, 50 ms early, ...)."),
    ],
)
def test_five_delays_are_listed(count: int, words: str) -> None:
    """The first five delays are listed as late or early, with two digits; more images end in an ellipsis."""
    late = [_Late(10 + k, 0.03 - 0.02 * k) for k in range(count)]
    assert words in _problem_sentence("wrist", late)
    assert ("..." in _problem_sentence("wrist", late)) == (count > 5)


def test_short_delays_have_two_digits() -> None:
    """A fast motion shows delays below a millisecond, which are not zero."""
    assert "(0.42 ms late, 8.3 ms early)" in _problem_sentence("wrist", [_Late(1, 4.2e-4), _Late(2, -8.3e-3)])


MOTION = np.array([0.1, -0.2, 0.05, 0.3, 0.1, -0.2])  # motion of a camera relative to its target per second
ACROSS = np.array([0.2, 0.1, 0.0, 0.0, 0.0, 0.0])


def find_late_images(*late_s: float, aside: float = 0.0, samples: int = 100) -> list[Finding]:
    """Findings about left-out images so late, of which views are off the path by a share of the delay's motion.

    The next image is as late and was used; one of a second camera that stood still was left out, and another of it
    used.
    """
    way = np.array([*late_s, late_s[0]])[:, None] * MOTION
    across = ACROSS / np.linalg.norm(ACROSS) * np.linalg.norm(way, axis=-1, keepdims=True)
    problem, state = pose_problem(way + aside * across, np.ones(6))
    (group,) = problem.groups
    moving = replace(group, motion=np.tile(MOTION, (len(group), 1)))
    used = replace(moving, camera="other", sample=moving.sample + 50)
    still = replace(group, camera="other")
    out = [LeftOut(k, "camera", "target", (), 9.0) for k in range(len(late_s))]
    out += [LeftOut(len(late_s), "other", "target", (), 9.0), LeftOut(50, "other", "target", (3,), 9.0)]
    of = SimpleNamespace(
        robust=SimpleNamespace(outliers=out, samples=samples),
        recorded=problem.with_groups([moving, used, still]),
        solution=SimpleNamespace(state=state),
    )
    return late_images(of)


def test_delay_is_distance_along_motion() -> None:
    """The delay is the distance of a view along the camera's motion, to the millisecond, late and early.

    Only left-out images of one camera count.
    """
    (finding,) = find_late_images(0.06, -0.08, 0.04)
    assert (finding.code, finding.about) == ("clock-offset", ("camera", "0", "1", "2"))
    assert (
        "3 images of camera were not taken at the times of their stamps, and are left out: samples 0 to 2"
        in finding.message
    )
    assert "(60 ms late, 80 ms early, 40 ms late)" in finding.message
    assert finding.severity == "info"  # three of a hundred do not exceed 3 %
    assert find_late_images(0.06, samples=34)[0].severity == "info"
    assert find_late_images(0.06, samples=33)[0].severity == "warning"


def test_image_of_two_targets_is_named_once() -> None:
    """An image of two targets is named once, with the mean of both delays; it counts as one image."""
    way = np.array([[0.06], [0.06]]) * MOTION
    problem, state = pose_problem(way, np.ones(6))
    (group,) = problem.groups
    moving = replace(group.take(np.array([0])), motion=MOTION[None])
    evidence = SimpleNamespace(
        robust=SimpleNamespace(outliers=[LeftOut(0, "camera", "target", (), 9.0)], samples=33),
        recorded=problem.with_groups([moving, replace(moving, target="other", motion=1.5 * MOTION[None])]),
        solution=SimpleNamespace(state=state),
    )
    (finding,) = late_images(evidence)
    assert (finding.severity, finding.about) == ("warning", ("camera", "0"))
    assert (
        "An image of camera was not taken at the time of its stamp, and is left out: sample 0 (50 ms late)"
        in finding.what
    )


@pytest.mark.parametrize(("late_s", "aside", "is_reported"), [
    (0.49, 0.0, True), (0.51, 0.0, False), (-0.51, 0.0, False), (0.05, 0.3, True), (0.05, 0.36, False),
])  # fmt: skip
def test_delay_must_explain_nine_tenths_of_error(late_s: float, aside: float, is_reported: bool) -> None:
    """A delay must explain nine tenths of the squared error of a view, and be at most half a second."""
    assert bool(find_late_images(late_s, aside=aside)) == is_reported


@pytest.mark.parametrize("status", ["fixed", "free"])
def test_delays_of_images_equal_those_of_poses(status: str) -> None:
    """Delays of board images through a known or unknown lens are found as those of poses."""
    made = simulate(Scenario(samples=3, intrinsics=status), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    (group,) = problem.groups
    late_s = np.array([0.02, 0.0, -0.03])
    at = state.camera_from_target(group, problem.stops) @ SE3.exp(late_s[:, None] * MOTION)
    points = at.rotation @ group.measurement.points_in_target.T + at.translation[..., None]
    pixels = state.cameras[group.camera].project(np.swapaxes(points, -1, -2))
    group = replace(group, measurement=replace(group.measurement, pixels=pixels), motion=np.tile(MOTION, (3, 1)))
    of = SimpleNamespace(
        robust=SimpleNamespace(outliers=[LeftOut(k, "wrist", "board", (), 9.0) for k in (0, 2)], samples=100),
        recorded=problem.with_groups([group]),
        solution=SimpleNamespace(state=state),
    )
    (finding,) = late_images(of)
    assert finding.about == ("wrist", "0", "2")
    assert "(20 ms late, 30 ms early)" in finding.message
