"""Tests of `change_of_hypothesis`: a mistake put into a recording is undone to the last digit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.fixing.change import change_carriers, change_cell, change_of_hypothesis
from basecal.accuracy.input_check.hypotheses import convention_hypotheses, shift_hypothesis
from basecal.accuracy.input_check.rare_hypotheses import rare_hypotheses
from basecal.accuracy.input_check.target_sizes import size_hypothesis
from basecal.accuracy.readings.reading import Reading, declared_reading
from basecal.cell import Cell, PixelObservation, PoseObservation, Recording, RobotState, Sample, Unknown
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

POSES = simulate(Scenario(samples=9, target="pose"), 2)
BOARD = simulate(Scenario(samples=9), 2)


def pack_reading(cell: Cell, recording: Recording) -> Reading:
    return declared_reading(cell, recording, build_problem(cell, recording)[0])


def with_poses(recording: Recording, robot: str, change: Callable[[SE3], SE3]) -> Recording:
    def slipped(sample: Sample) -> Sample:
        state = RobotState(change(sample.robots[robot].base_from_flange))
        return replace(sample, robots={**sample.robots, robot: state})

    return replace(recording, samples=tuple(map(slipped, recording.samples)))


def poses(samples: tuple[Sample, ...], robot: str) -> np.ndarray:
    return np.stack([sample.robots[robot].base_from_flange.matrix for sample in samples])


@pytest.mark.parametrize(
    ("slip", "words"),
    [
        (SE3.inverse, "the poses of hand are inverted (flange_from_base)"),
        (lambda pose: SE3(pose.rotation, 1e3 * pose.translation), "the poses of hand are in millimetres"),
        (
            lambda p: SE3.from_quaternion(p.quaternion[[3, 0, 1, 2]], p.translation),
            "the quaternions of hand are w, x, y, z",
        ),
        (lambda pose: SE3(pose.rotation.T.copy(), pose.translation), "the rotation matrices of hand are transposed"),
    ],
)
def test_robot_poses_are_restored(slip: Callable[[SE3], SE3], words: str) -> None:
    """Inverted poses, millimetres, another quaternion order and transposed rotations are undone, and all else stays."""
    slipped = with_poses(BOARD.recording, "hand", slip)
    reading = pack_reading(BOARD.cell, slipped)
    every = [*convention_hypotheses(reading), *rare_hypotheses(reading)]
    (hypothesis,) = (each for each in every if each.words.startswith(words) and each.about == ("hand",))
    change = change_of_hypothesis(slipped, reading, hypothesis)
    np.testing.assert_allclose(poses(change.samples, "hand"), poses(BOARD.recording.samples, "hand"), atol=1e-12)
    np.testing.assert_array_equal(poses(change.samples, "eye"), poses(BOARD.recording.samples, "eye"))
    assert change.cell == {}


def test_target_poses_are_restored() -> None:
    """Inverted observed poses are restored."""

    def slipped(sample: Sample) -> Sample:
        (seen,) = sample.observations
        return replace(sample, observations=(replace(seen, camera_from_target=seen.camera_from_target.inverse()),))

    recording = replace(POSES.recording, samples=tuple(map(slipped, POSES.recording.samples)))
    reading = pack_reading(POSES.cell, recording)
    (hypothesis,) = (h for h in convention_hypotheses(reading) if h.code == "target-pose-inverted")
    change = change_of_hypothesis(recording, reading, hypothesis)
    for mine, true in zip(change.samples, POSES.recording.samples, strict=True):
        one, other = mine.observations[0], true.observations[0]
        assert isinstance(one, PoseObservation)
        np.testing.assert_allclose(one.camera_from_target.matrix, other.camera_from_target.matrix, atol=1e-12)


@pytest.mark.parametrize(("stream", "by", "start"), [(None, 1, 0), (None, -1, 0), ("hand", 1, 0), (None, 1, 5)])
def test_pairing_is_restored(stream: str | None, by: int, start: int) -> None:
    """Images and observations paired one sample off are moved to their robots; the rest is left out."""
    samples = [replace(s, images={"wrist": f"recording/images/wrist/{s.sample}.png"}) for s in BOARD.recording.samples]
    numbers = range(len(samples))
    source = [k + by if k >= start else k for k in numbers]  # the entry at k belongs to sample k + by
    kept = [k for k in numbers if 0 <= source[k] < len(samples)]

    def slipped(k: int) -> Sample:
        here, there = samples[k], samples[source[k]]
        if stream is None:
            return replace(here, observations=there.observations, images=there.images)
        return replace(here, robots={**here.robots, stream: there.robots[stream]})

    recording = replace(BOARD.recording, samples=tuple(slipped(k) for k in kept))
    reading = pack_reading(BOARD.cell, recording)
    place = kept.index(start) if start else 0
    change = change_of_hypothesis(recording, reading, shift_hypothesis(stream, by, place))
    assert len(change.samples) >= len(kept) - 2
    by_number = {sample.sample: sample for sample in samples}
    for sample in change.samples:
        true = (
            by_number[sample.sample]
            if stream is None
            else next(s for s in samples if s.robots[stream] is sample.robots[stream] or s.sample == sample.sample)
        )
        if stream is None:
            assert sample.images == true.images
            assert sample.observations is true.observations
        assert sample.robots["eye"] is by_number[sample.sample].robots["eye"]
        assert sample.robots["hand"] is by_number[sample.sample].robots["hand"]


def test_cell_statements_are_changed() -> None:
    """A wrong size, lens and transform become entries of `cell.yaml`."""
    cell = BOARD.cell.with_transform("eye_flange_from_wrist", Unknown("fixed", SE3.identity()))
    reading = pack_reading(cell, BOARD.recording)
    size = change_of_hypothesis(BOARD.recording, reading, size_hypothesis("board", 1.1, cell))
    square = cell.targets["board"].target.options["square_m"]
    assert size.cell["targets", "board", "square_m"] == pytest.approx(1.1 * square, rel=1e-4)
    assert size.samples is None
    known = {each.code: each for each in convention_hypotheses(reading)}
    lens = change_of_hypothesis(BOARD.recording, reading, known["intrinsics"])
    assert lens.cell["cameras", "wrist", "intrinsics", "status"] == "free"
    mount = change_of_hypothesis(BOARD.recording, reading, known["fixed-contradicted"])
    assert mount.cell["cameras", "wrist", "mount"]["status"] == "free"
    base = change_cell(cell, cell.with_transform("eye_base_from_hand_base", Unknown("fixed", SE3.identity())))
    assert list(base) == [("bases", "hand")]


def test_tags_in_list_are_resized() -> None:
    """The size of each tag is changed in the list `tags`."""
    made = simulate(Scenario(samples=9, target="apriltag"), 2)
    reading = pack_reading(made.cell, made.recording)
    change = change_of_hypothesis(made.recording, reading, size_hypothesis("board", 1.25, made.cell))
    assert change.samples is None
    assert [tag["size_m"] for tag in change.cell["targets", "board", "tags"]] == [0.15]


def test_swapped_pixels_have_no_change() -> None:
    """Pixels are part of images, not of the recording, so there is no change."""
    reading = pack_reading(BOARD.cell, BOARD.recording)
    (hypothesis,) = (each for each in rare_hypotheses(reading) if each.code == "pixels-swapped")
    assert change_of_hypothesis(BOARD.recording, reading, hypothesis) is None


def test_views_with_missing_points_are_changed() -> None:
    """Poses are changed even if a view lacks points of the board."""
    first = BOARD.recording.samples[0]
    (view,) = first.observations
    assert isinstance(view, PixelObservation)
    partial = replace(first, observations=(replace(view, ids=view.ids[:8], pixels=view.pixels[:8], sigma_px=None),))
    whole = replace(BOARD.recording, samples=(partial, *BOARD.recording.samples[1:]))
    slipped = with_poses(whole, "hand", SE3.inverse)
    reading = pack_reading(BOARD.cell, slipped)
    (hypothesis,) = (each for each in convention_hypotheses(reading) if "poses of hand are inverted" in each.words)
    change = change_of_hypothesis(slipped, reading, hypothesis)
    assert change is not None
    np.testing.assert_allclose(poses(change.samples, "hand"), poses(whole.samples, "hand"), atol=1e-12)


def test_target_is_moved_to_its_arm() -> None:
    """The target is moved to its arm in `cell.yaml` with a free mount, and the recording stays."""
    guess = Unknown("free", SE3.identity())
    targets = {name: replace(target, on="world", mount=guess) for name, target in BOARD.cell.targets.items()}
    on_world = replace(BOARD.cell, targets=targets)
    reading = pack_reading(on_world, BOARD.recording)
    (hypothesis,) = (each for each in rare_hypotheses(reading) if each.code == "wrong-carrier")
    change = change_of_hypothesis(BOARD.recording, reading, hypothesis)
    assert change.samples is None
    assert change.cell == {("targets", "board", "on"): "hand", ("targets", "board", "mount"): {"status": "free"}}


def test_carriers_are_written_with_free_mounts() -> None:
    """The carriers of a camera and a target are written with free mounts."""
    change = change_carriers({("cameras", "wrist", "on"): "hand", ("targets", "board", "on"): "world"})
    assert change.samples is None
    assert change.cell == {
        ("cameras", "wrist", "on"): "hand",
        ("targets", "board", "on"): "world",
        ("cameras", "wrist", "mount"): {"status": "free"},
        ("targets", "board", "mount"): {"status": "free"},
    }


def test_inverted_prior_keeps_sigmas() -> None:
    """An inverted prior of a mount is inverted in `cell.yaml` and keeps its sigmas."""
    known = Unknown("prior", SE3.from_rpy([0.1, 0.2, 0.3], [0.05, 0, 0.08]), np.repeat([1e-3, 1e-2], 3))
    cell = BOARD.cell.with_transform("eye_flange_from_wrist", known)
    reading = pack_reading(cell, BOARD.recording)
    inverted = [each for each in rare_hypotheses(reading) if each.code == "transform-inverted"]
    (hypothesis,) = (each for each in inverted if each.about == ("eye_flange_from_wrist",))
    entry = change_of_hypothesis(BOARD.recording, reading, hypothesis).cell["cameras", "wrist", "mount"]
    assert entry["status"] == "prior"
    assert entry["sigma_t_m"] == 1e-3
    np.testing.assert_allclose(entry["t_m"], known.mean.inverse().translation, atol=1e-12)
