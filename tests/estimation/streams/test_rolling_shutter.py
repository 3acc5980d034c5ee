"""Tests of rolling shutter correction."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import (
    CandidateObservation,
    Cell,
    CellCamera,
    CellTarget,
    PixelObservation,
    PoseObservation,
    Recording,
    Robot,
    RollingShutter,
    Sample,
    Unknown,
)
from basecal.cell.calibration import Calibration, LineTime
from basecal.cell.targets.points import points_target
from basecal.estimation.streams.rolling_shutter import (
    KnownGeometry,
    RobotMotion,
    correct_rolling_shutter,
    line_time_name,
    mean_row,
)
from basecal.estimation.streams.streams import recording_streams, synchronise, synchronous_recording
from basecal.geometry import SE3, Camera, PoseEstimate
from stream_cells import BOARD, MOUNT, Streamed, imaged, path_poses

LINE_S = 3e-5
TRUE = {"arm_flange_from_wrist": MOUNT, "arm_base_from_board": BOARD}


def true_geometry(made: Streamed) -> KnownGeometry:
    lens = made.cell.cameras["wrist"].intrinsics
    assert lens is not None
    assert lens.camera is not None
    return KnownGeometry(made.cell, TRUE, {"wrist": lens.camera})


def row_shifts(recording: Recording, made: Streamed) -> np.ndarray:
    """Pixels minus their position at the time of the sample, (n, p, 2)."""
    shape, lens = made.cell.targets["board"].target, true_geometry(made).lenses["wrist"]
    assert shape is not None
    poses = (path_poses(np.array([s.stamp_s for s in recording.samples])) @ MOUNT).inverse() @ BOARD
    return np.stack([s.observations[0].pixels for s in recording.samples]) - lens.project(poses[:, None] @ shape.points)


def test_views_are_at_their_mean_row_with_corrected_pixels() -> None:
    """Without noise, rows of 30 us shift pixels by more than 0.5 px. The correction leaves at most 0.03 px."""
    made = imaged(LINE_S, RollingShutter("fixed", LINE_S), noise_px=0.0)
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    at_mean = synchronise(streams, streams.stated_offsets)
    assert np.abs(row_shifts(at_mean.recording, made)).max() > 0.5
    mended = at_mean.correct_rows(true_geometry(made), streams.stated_offsets)
    assert np.abs(row_shifts(mended.recording, made)).max() < 0.03
    plain = synchronise(streams, {**streams.stated_offsets, line_time_name("wrist"): 0.0})
    assert plain.correct_rows(true_geometry(made), {"arm": 0.0, "wrist": 0.0}) is plain


def test_calibration_corrects_recordings_read_with_it() -> None:
    """Pixels are corrected by the line time of the calibration."""
    made = imaged(LINE_S, RollingShutter("free"), noise_px=0.0)
    transforms = {name: PoseEstimate(mean, np.zeros((6, 6))) for name, mean in TRUE.items()}
    found = Calibration("good", transforms=transforms, line_times={"wrist": LineTime(LINE_S, 1e-7)})
    assert np.abs(row_shifts(synchronous_recording(made.cell, made.recording, found), made)).max() < 0.03


def test_target_velocity_equals_differences() -> None:
    """The pose and velocity of the target in the camera equal finite differences of the path."""
    made = imaged(LINE_S, None)
    step = 1e-6
    here, later = path_poses(np.array([2.0, 2.0 + step]))
    moving = {"arm": RobotMotion(here, (here.inverse() @ later).log() / step)}
    pose, velocity = true_geometry(made).camera_from_target("wrist", "board", moving) or (None, None)
    assert pose is not None
    np.testing.assert_allclose(pose.matrix, ((here @ MOUNT).inverse() @ BOARD).matrix, atol=1e-12)
    after = (later @ MOUNT).inverse() @ BOARD
    np.testing.assert_allclose(velocity, (pose.inverse() @ after).log() / step, atol=1e-5)


def test_unknown_transforms_give_no_correction() -> None:
    """Without transforms, the pixels are unchanged."""
    made = imaged(LINE_S, RollingShutter("fixed", LINE_S))
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    at_mean = synchronise(streams, streams.stated_offsets)
    without = replace(true_geometry(made), transforms={})
    after = correct_rolling_shutter(at_mean.recording, without, {"wrist": LINE_S}, at_mean.robots)
    for a, b in zip(after.samples, at_mean.recording.samples, strict=True):
        np.testing.assert_array_equal(a.observations[0].pixels, b.observations[0].pixels)


def test_recordings_of_still_arms_have_no_streams() -> None:
    """Samples a second apart and samples without time stamps share one clock, whatever the shutter."""
    made = imaged(LINE_S, RollingShutter("fixed", LINE_S))
    together = synchronous_recording(replace(made.cell, cameras={}), Recording(made.recording.samples[:0]))
    assert together.samples == ()
    slow = tuple(replace(s, stamp_s=float(k)) for k, s in enumerate(_synchronous_samples(made)))
    assert recording_streams(_without_clock(made), Recording(slow)) is None
    assert recording_streams(_without_clock(made), Recording(tuple(replace(s, stamp_s=None) for s in slow))) is None
    assert recording_streams(_without_clock(made), Recording(_synchronous_samples(made))) is not None


def _without_clock(made: Streamed):
    return replace(made.cell, cameras={n: replace(c, clock=None) for n, c in made.cell.cameras.items()})


def _synchronous_samples(made: Streamed) -> tuple[Sample, ...]:
    """Views with the arm's pose, as recorded by one clock."""
    return synchronous_recording(made.cell, made.recording).samples


@pytest.mark.parametrize("rows", [[10.0, 20.0, 60.0], []])
def test_mean_row_is_over_all_pixels(rows: list[float]) -> None:
    """The mean row is over all pixels, and zero without pixels."""
    spots = np.array([[0.0, v] for v in rows]).reshape(-1, 2)
    assert mean_row(Sample(0, observations=(CandidateObservation("a", "b", spots),))) == (30.0 if rows else 0.0)


@pytest.mark.parametrize(
    ("camera_on", "target_on"), [("eye", "hand"), ("hand", "eye"), ("world", "hand"), ("eye", "world")]
)
def test_poses_and_velocities_of_any_pair_equal_differences(camera_on: str, target_on: str) -> None:
    """Both arms move. The reference's base is the world, and the other's is at its pose in the cell."""
    cell = Cell(
        "eye",
        {"eye": Robot("eye"), "hand": Robot("hand")},
        {"hand": Unknown()},
        {"wrist": CellCamera("wrist", camera_on)},
        {"tag": CellTarget("tag", target_on)},
    )
    rng, step = np.random.default_rng(3), 1e-5
    names = {"base": cell.base_name("hand"), "camera": cell.mount_name("wrist"), "target": cell.mount_name("tag")}
    transforms = {name: SE3.exp(rng.uniform(-1, 1, 6)) for name in names.values()}
    flanges = {"eye": SE3.exp(rng.uniform(-1, 1, 6)), "hand": SE3.exp(rng.uniform(-1, 1, 6))}
    velocities = {name: rng.uniform(-1, 1, 6) for name in flanges}

    def seen(after_s: float) -> SE3:
        """The target in the camera by an explicit product."""
        at = {name: flange @ SE3.exp(after_s * velocities[name]) for name, flange in flanges.items()}
        in_world = {"eye": at["eye"], "hand": transforms[names["base"]] @ at["hand"], "world": SE3.identity()}
        camera = in_world[camera_on] @ transforms[names["camera"]]
        return camera.inverse() @ in_world[target_on] @ transforms[names["target"]]

    moving = {name: RobotMotion(flanges[name], velocities[name]) for name in flanges}
    pose, velocity = KnownGeometry(cell, transforms, {}).camera_from_target("wrist", "tag", moving) or (None, None)
    assert pose is not None
    np.testing.assert_allclose(pose.matrix, seen(0.0).matrix, atol=1e-12)
    np.testing.assert_allclose(velocity, (seen(-step).inverse() @ seen(step)).log() / (2 * step), atol=1e-8)
    for missing in names.values():
        fewer = KnownGeometry(cell, {n: t for n, t in transforms.items() if n != missing}, {})
        unneeded = missing == names["base"] and "hand" not in (camera_on, target_on)
        assert (fewer.camera_from_target("wrist", "tag", moving) is None) != unneeded


def test_pixels_are_corrected_by_rows_from_the_mean() -> None:
    """Corners and LED candidates equal an explicit computation. Other cameras, and zero line times, are unchanged."""
    made = imaged(LINE_S, RollingShutter("fixed", LINE_S))
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    at_mean = synchronise(streams, streams.stated_offsets)
    first = at_mean.recording.samples[3]
    (seen,) = first.observations
    shape, lens = made.cell.targets["board"].target, true_geometry(made).lenses["wrist"]
    assert shape is not None
    ids, spots = seen.ids[[4, 1]], np.array([[600.0, 100.0], [650.0, 700.0], [640.0, 400.0]])
    some = replace(seen, ids=ids, pixels=seen.pixels[[4, 1]], sigma_px=None)
    candidates = CandidateObservation("wrist", "board", spots)
    recording = replace(at_mean.recording, samples=(replace(first, observations=(some, candidates)),))
    mended = (
        correct_rolling_shutter(recording, true_geometry(made), {"wrist": LINE_S}, at_mean.robots)
        .samples[0]
        .observations
    )
    arm = at_mean.robots["arm"][first.sample]
    middle = np.concatenate([some.pixels, spots])[:, 1].mean()
    for before, after, points in (
        (some, mended[0], shape.points[shape.rows(ids)]),
        (candidates, mended[1], shape.points[[0, 0, 0]]),
    ):
        for k, point in enumerate(points):
            flange = arm.base_from_flange @ SE3.exp((before.pixels[k, 1] - middle) * LINE_S * arm.velocity)
            there, here = (
                lens.project((at @ MOUNT).inverse() @ BOARD @ point) for at in (flange, arm.base_from_flange)
            )
            np.testing.assert_allclose(after.pixels[k], before.pixels[k] - (there - here), atol=1e-9)
            assert np.abs(there - here).max() > 0.01
    for lines, lenses in (({"wrist": 0.0}, true_geometry(made).lenses), ({"wrist": LINE_S}, {})):
        same = correct_rolling_shutter(recording, replace(true_geometry(made), lenses=lenses), lines, at_mean.robots)
        assert same.samples[0].observations == (some, candidates)


def moving_light(velocity: np.ndarray) -> tuple[KnownGeometry, dict[str, RobotMotion]]:
    """A camera on an arm, and a tag of two points, 1 m away, on another arm that moves."""
    lens = Camera("pinhole", np.array([800.0, 800.0, 640.0, 360.0]), (1280, 720))
    tag = points_target(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]))
    cell = Cell(
        "eye",
        {"eye": Robot("eye"), "hand": Robot("hand")},
        {"hand": Unknown()},
        {"wrist": CellCamera("wrist", "eye")},
        {"tag": CellTarget("tag", "hand", target=tag)},
    )
    transforms = {cell.mount_name("wrist"): SE3.identity(), cell.mount_name("tag"): SE3.identity()}
    transforms[cell.base_name("hand")] = SE3.from_rotvec([0, 0, 0], [0, 0, 1.0])
    arms = {"eye": RobotMotion(SE3.identity(), np.zeros(6)), "hand": RobotMotion(SE3.identity(), velocity)}
    return KnownGeometry(cell, transforms, {"wrist": lens}), arms


def test_motion_until_a_row_is_subtracted_from_its_pixels() -> None:
    """A tag moves by 1 m/s and is seen 100 rows of 10 us from the mean one: 800 px at 1 m times a millimetre."""
    known, arms = moving_light(np.array([1.0, 0, 0, 0, 0, 0]))
    ids = known.cell.targets["tag"].target.ids
    pixels = np.array([[640.0, 260.0], [720.0, 460.0]])
    sample = Sample(3, stamp_s=0.0, observations=(PixelObservation("wrist", "tag", ids, pixels),))
    robots = {name: {3: of} for name, of in arms.items()}

    def mended(line_s: float, known: KnownGeometry = known, sample: Sample = sample) -> np.ndarray:
        """Corrected pixels of the sample."""
        (found,) = correct_rolling_shutter(Recording((sample,)), known, {"wrist": line_s}, robots).samples
        assert found.stamp_s == sample.stamp_s
        return found.observations[0].pixels

    np.testing.assert_allclose(mended(1e-5), pixels + np.array([[0.8, 0.0], [-0.8, 0.0]]), atol=1e-9)
    np.testing.assert_array_equal(mended(0.0), pixels)
    np.testing.assert_array_equal(mended(1e-5, replace(known, lenses={})), pixels)
    np.testing.assert_array_equal(mended(1e-5, replace(known, transforms={})), pixels)
    spots = replace(sample, observations=(CandidateObservation("wrist", "tag", pixels),))
    np.testing.assert_allclose(mended(1e-5, sample=spots), pixels + np.array([[0.8, 0.0], [-0.8, 0.0]]), atol=1e-9)
    targets = {"tag": CellTarget("tag", "hand")}
    np.testing.assert_array_equal(mended(1e-5, replace(known, cell=replace(known.cell, targets=targets))), pixels)
    posed = replace(sample, observations=(PoseObservation("wrist", "tag", SE3.identity()),))
    (same,) = correct_rolling_shutter(Recording((posed,)), known, {"wrist": 1e-5}, robots).samples
    assert same.observations == posed.observations


def test_pixels_of_points_behind_the_camera_are_unchanged() -> None:
    """Points behind the camera have no pixel to correct by, and are unchanged."""
    known, arms = moving_light(np.array([1.0, 0, 0, 0, 0, 0]))
    base = {known.cell.base_name("hand"): SE3.from_rotvec([0, 0, 0], [0, 0, -1.0])}
    behind = replace(known, transforms={**known.transforms, **base})
    pixels = np.array([[640.0, 260.0], [720.0, 460.0]])
    ids = known.cell.targets["tag"].target.ids
    sample = Sample(3, stamp_s=0.0, observations=(PixelObservation("wrist", "tag", ids, pixels),))
    (found,) = correct_rolling_shutter(
        Recording((sample,)), behind, {"wrist": 1e-5}, {n: {3: of} for n, of in arms.items()}
    ).samples
    np.testing.assert_array_equal(found.observations[0].pixels, pixels)
