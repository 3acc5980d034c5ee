"""Tests of recordings as streams, and of their synchronised samples."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import (
    Calibration,
    CandidateObservation,
    Cell,
    CellCamera,
    CellTarget,
    Clock,
    ClockOffset,
    PoseObservation,
    Recording,
    Robot,
    RobotState,
    RollingShutter,
    Sample,
    Unknown,
)
from basecal.errors import InputError
from basecal.estimation.solve import solve
from basecal.estimation.streams import streams
from basecal.estimation.streams.rolling_shutter import line_time_name
from basecal.estimation.streams.streams import recording_streams, synchronise, synchronous_recording
from basecal.geometry import SE3
from planar_arm import planar
from stream_cells import MOUNT, imaged, path_poses, streamed


def test_samples_of_one_clock_are_no_streams() -> None:
    """A synchronous recording is returned unchanged."""
    made = streamed()
    together = synchronous_recording(
        made.cell, made.recording, Calibration("good", clocks={"wrist": ClockOffset(made.offset_s, 0.0)})
    )
    assert recording_streams(made.cell, together) is None
    assert synchronous_recording(made.cell, together) is together


def test_clock_of_a_camera_with_separate_views_is_free() -> None:
    """The clock offset of such a camera is estimated, with zero as the stated offset."""
    made = streamed()
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    assert streams.estimated_clocks == ("wrist",)
    assert streams.stated_offsets == {"arm": 0.0, "wrist": 0.0}


def test_streams_may_have_a_rolling_shutter() -> None:
    """The line time has a prior if nothing is stated and pixels were seen.

    A stated shutter is kept, and one clock for all has none.
    """
    made, name = imaged(0.0, None), line_time_name("wrist")
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    assert streams.clocks[name] == Clock("prior", 0.0, 3e-5)
    stated = imaged(0.0, RollingShutter("fixed", 0.0))
    streams = recording_streams(stated.cell, stated.recording)
    assert streams is not None
    assert streams.clocks[name] == Clock("fixed", 0.0)
    together = synchronous_recording(
        made.cell, made.recording, Calibration("good", clocks={"wrist": ClockOffset(0.0, 0.0)})
    )
    assert recording_streams(without_clock(made.cell), together) is None


def without_clock(cell: Cell) -> Cell:
    """The cell without a stated clock."""
    return replace(cell, cameras={"wrist": replace(cell.cameras["wrist"], clock=None)})


def test_stated_clocks_are_kept() -> None:
    """A stated prior is used, and a fixed clock is not estimated."""
    made = streamed(clock=Clock("prior", 0.02, 0.01))
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    assert streams.clocks["wrist"] == Clock("prior", 0.02, 0.01)
    fixed = recording_streams(*(lambda m: (m.cell, m.recording))(streamed(clock=Clock(offset_s=0.03))))
    assert fixed is not None
    assert fixed.estimated_clocks == ()


def test_reference_clock_is_held_if_all_are_free() -> None:
    """The clock of the reference robot is fixed at its stated offset."""
    made = streamed(clock=Clock("free"))
    robots = {"arm": replace(made.cell.robots["arm"], clock=Clock("free", 1.0))}
    streams = recording_streams(replace(made.cell, robots=robots), made.recording)
    assert streams is not None
    assert streams.estimated_clocks == ("wrist",)
    assert streams.clocks["arm"] == Clock("fixed", 1.0)


def test_robot_poses_are_interpolated_at_the_view_times() -> None:
    """Samples have the robot's pose at the time of each view."""
    made = streamed()
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    samples = synchronise(streams, {"arm": 0.0, "wrist": made.offset_s}).recording.samples
    assert len(samples) == 70
    times = np.array([s.stamp_s for s in samples])
    np.testing.assert_allclose(times, np.arange(0.5, 7.5, 0.1), atol=1e-9)
    found = SE3.stack([s.robots["arm"].base_from_flange for s in samples])
    assert np.abs((path_poses(times).inverse() @ found).log()).max() < 1e-5


def test_robot_clock_offset_has_the_opposite_sign() -> None:
    """A negative offset of the robot has the effect of a positive one of the camera."""
    made = streamed()
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    by_camera = synchronise(streams, {"arm": 0.0, "wrist": 0.03}).recording.samples[5]
    by_robot = synchronise(streams, {"arm": -0.03, "wrist": 0.0}).recording.samples[5]
    first, second = (s.robots["arm"].base_from_flange for s in (by_camera, by_robot))
    np.testing.assert_allclose(first.matrix, second.matrix, atol=1e-12)


def test_views_without_surrounding_records_are_reported() -> None:
    """Views without surrounding records are left out with a finding that counts them."""
    made = streamed()
    holed = tuple(s for s in made.recording.samples if not (s.robots and 3.0 < s.stamp_s < 4.0))
    found = synchronous_recording(
        made.cell, Recording(holed), Calibration("good", clocks={"wrist": ClockOffset(made.offset_s, 0.0)})
    )
    assert len(found.samples) == 60
    (finding,) = found.findings
    assert finding.code == "dropped-sample"
    assert "10 views are not used" in finding.message


def test_two_cameras_of_one_line_become_two_samples() -> None:
    """Each camera has its own sample number and time stamp."""
    made = streamed()
    cameras = {**made.cell.cameras, "side": CellCamera("side", "arm")}
    both = [
        replace(s, observations=(*s.observations, replace(s.observations[0], camera="side"))) if s.observations else s
        for s in made.recording.samples
    ]
    streams = recording_streams(replace(made.cell, cameras=cameras), Recording(tuple(both)))
    assert streams is not None
    samples = synchronise(streams, {"arm": 0.0, "wrist": 0.03, "side": 0.05}).recording.samples
    assert len({s.sample for s in samples}) == len(samples) == 140
    first, second = (next(s for s in samples if s.observations[0].camera == name) for name in ("wrist", "side"))
    assert second.stamp_s == pytest.approx(first.stamp_s + 0.02)


def test_line_without_a_time_stamp_is_an_error() -> None:
    """The error about a line without a time stamp names the sample."""
    made = streamed()
    first, *others = made.recording.samples
    with pytest.raises(InputError, match="sample 0 has no stamp_s"):
        recording_streams(made.cell, Recording((replace(first, stamp_s=None), *others)))


def test_missing_poses_of_a_still_arm_are_reported() -> None:
    """Views without the arm's poses and times are no streams, but may be sessions with another arm still."""
    made = streamed()
    samples = tuple(replace(sample, stamp_s=None) for sample in made.recording.samples)
    with pytest.raises(InputError, match=r"sample 0 has no pose of arm, and 69 more have none: .* --still"):
        recording_streams(made.cell, Recording(samples))
    single = (samples[0], *(sample for sample in samples if not sample.observations))
    with pytest.raises(InputError, match=r"sample 0 has no pose of arm: .* --still"):
        recording_streams(made.cell, Recording(single))


def test_clocks_without_a_shared_time_are_an_error() -> None:
    """The error suggests a free clock with an offset, and a guessed offset is accepted."""
    made = streamed(offset_s=1.6e9)
    with pytest.raises(InputError, match=r"stamps of wrist and of arm do not overlap.*clock: \{status: free, offset_s"):
        recording_streams(made.cell, made.recording)
    guessed = streamed(offset_s=1.6e9, clock=Clock("free", 1.6e9 - 0.02))
    assert recording_streams(guessed.cell, guessed.recording) is not None


def test_poses_and_joints_of_one_robot_do_not_mix() -> None:
    """The error says that one kind has to be given in all lines."""
    made = streamed()
    *others, last = made.recording.samples
    with pytest.raises(InputError, match="'arm' is recorded by poses in some lines and by joints in others"):
        recording_streams(
            made.cell, Recording((*others, replace(last, robots={"arm": RobotState(joints_rad=np.zeros(6))})))
        )


def test_solve_uses_stated_clocks() -> None:
    """The estimated mount agrees with the truth within its covariance."""
    made = streamed(clock=Clock(offset_s=0.03))
    found = solve(made.cell, made.recording).transforms["arm_flange_from_wrist"]
    xi = (found.mean.inverse() @ MOUNT).log()
    assert xi @ np.linalg.solve(found.covariance, xi) < 22.5  # the 99.9 % of six freedoms


def test_thinned_views_are_spread_over_all() -> None:
    """Three of 70 views are the first, the middle and the last."""
    made = streamed()
    streams = recording_streams(made.cell, made.recording)
    assert streams is not None
    assert [s.sample for s in streams.thin(3).instants] == [0, 34, 69]


def test_few_samples_without_a_robot_are_no_streams() -> None:
    """One of four samples without the robot does not make streams."""
    view = PoseObservation("wrist", "tag", SE3.identity())
    made = streamed()
    samples = [Sample(k, None, {"arm": RobotState(SE3.identity())} if k else {}, (view,)) for k in range(4)]
    assert recording_streams(made.cell, Recording(tuple(samples))) is None


def test_streams_need_a_majority_of_separate_views() -> None:
    """Two of four views without their robot are no majority. Three are, if other lines have that robot."""
    view = PoseObservation("wrist", "tag", SE3.identity())
    made = streamed()

    def of(alone: int, elsewhere: bool = True) -> Recording:
        """Four views, the first ones without the arm, and a line with the arm alone."""
        arm = {"arm": RobotState(SE3.identity())}
        views = [Sample(k, float(k), {} if k < alone else arm, (view,)) for k in range(4)]
        return Recording((*views, *([Sample(9, 0.5, arm), Sample(10, 2.5, arm)] if elsewhere else [])))

    assert recording_streams(made.cell, of(2)) is None
    assert recording_streams(made.cell, of(3)) is not None
    assert recording_streams(made.cell, of(4, elsewhere=False)) is None


@pytest.mark.parametrize(("gone", "shown"), [(10, "8, 9"), (11, "8, 9, ...")])
def test_ten_excluded_views_are_named(gone: int, shown: str) -> None:
    """The message names ten excluded views, and the finding lists all of them."""
    made = streamed(clock=Clock(offset_s=0.03))
    late = tuple(s for s in made.recording.samples if s.observations or s.stamp_s > 0.5 + 0.1 * (gone - 1) + 1e-3)
    assert min(s.stamp_s for s in late if s.robots) < 0.5 + 0.1 * gone + 1e-3
    (finding,) = synchronous_recording(made.cell, Recording(late)).findings
    numbers = ", ".join(map(str, range(8)))
    why = "no robot was recorded within 0.25 s before and after"
    expected = f"{gone} views are not used, of sample {numbers}, {shown}: {why}."
    assert finding.message == expected
    assert finding.about == tuple(map(str, range(gone)))


def test_first_of_two_records_at_one_time_counts() -> None:
    """The sample number decides, whatever the order in the recording."""
    made = streamed(clock=Clock(offset_s=0.03))
    record = next(s for s in made.recording.samples if s.robots and s.stamp_s == 2.0)
    elsewhere = replace(record, sample=5000, robots={"arm": RobotState(SE3.identity())})
    streams = recording_streams(made.cell, Recording((elsewhere, *made.recording.samples)))
    assert streams is not None
    path = streams.paths["arm"]
    assert len(path.times) == 400
    assert np.all(np.diff(path.times) > 0)
    np.testing.assert_allclose(path.base_from_flange.matrix, path_poses(path.times).matrix, atol=1e-12)


@pytest.mark.parametrize(("shift", "shares"), [(7.49, False), (7.47, True), (-7.39, True), (-7.41, False)])
def test_one_view_within_the_records_suffices(shift: float, shares: bool) -> None:
    """The only view is the first at the end of the records, or the last at their beginning, by the stated clocks."""
    made = streamed(offset_s=0.0, clock=Clock(offset_s=shift))
    assert max(s.stamp_s for s in made.recording.samples if s.robots) == pytest.approx(7.98)
    if shares:
        assert recording_streams(made.cell, made.recording) is not None
        return
    first, last = 0.5 + shift, 7.4 + shift
    with pytest.raises(InputError, match=f"do not overlap: {first:.3f} to {last:.3f} s and 0.000 to 7.980 s; write"):
        recording_streams(made.cell, made.recording)


def test_joints_are_passed_on_as_joints() -> None:
    """A robot recorded by joints keeps them. Without its kinematics, they are an error."""
    made, chain = streamed(clock=Clock(offset_s=0.03)), planar(0.4, 0.3, 0.2)
    joints = {s.sample: np.sin(s.stamp_s + np.arange(chain.n)) for s in made.recording.samples}
    samples = tuple(
        replace(s, robots={"arm": RobotState(joints_rad=joints[s.sample])}) if s.robots else s
        for s in made.recording.samples
    )
    with pytest.raises(InputError, match="robot 'arm' is recorded by joints and has no urdf"):
        recording_streams(made.cell, Recording(samples))
    cell = replace(made.cell, robots={"arm": Robot("arm", chain=chain)})
    streams = recording_streams(cell, Recording(samples))
    assert streams is not None
    found = synchronise(streams, {"arm": 0.01, "wrist": 0.03})
    assert len(found.recording.samples) == 70
    for sample in found.recording.samples:
        arm = sample.robots["arm"]
        assert arm.base_from_flange is None
        np.testing.assert_allclose(arm.joints_rad, np.sin(sample.stamp_s - 0.01 + np.arange(chain.n)), atol=1e-5)
        moving = found.robots["arm"][sample.sample]
        np.testing.assert_allclose(moving.base_from_flange.matrix, chain.forward(arm.joints_rad).matrix, atol=1e-12)


def make_line(number: int, stamp_s: float | None, cameras: Sequence[str] = (), robots: Sequence[str] = ()) -> Sample:
    """A line with views of the tag by some cameras, and poses of some robots."""
    views = tuple(PoseObservation(camera, "tag", SE3.identity()) for camera in cameras)
    return Sample(number, stamp_s=stamp_s, observations=views, robots={n: RobotState(SE3.identity()) for n in robots})


def two_arms(**clocks: Clock) -> Cell:
    """An arm with a camera, one with two rolling shutter cameras, and a tag on the world, with clocks by name."""
    robots = {name: Robot(name, clock=clocks.get(name)) for name in ("left", "right")}
    rolling = RollingShutter("fixed", 1e-5)
    cameras = {
        "first": CellCamera("first", "left", clock=clocks.get("first")),
        "second": CellCamera("second", "right", clock=clocks.get("second"), rolling_shutter=rolling),
        "third": CellCamera("third", "right", clock=clocks.get("third")),
    }
    return Cell("left", robots, {"right": Unknown()}, cameras, {"tag": CellTarget("tag", "world")})


def test_views_of_further_cameras_have_new_numbers() -> None:
    """Each camera has a sample, and the first keeps its number. Robots are removed, and the time stamp is unchanged."""
    lines = [
        make_line(4, 1.0, ["first", "second"], ["left"]),
        make_line(7, 2.0, ["third"]),
        make_line(2, 3.0),
        make_line(3, 4.0, ["third", "first", "third", "second"]),
    ]
    found = list(streams._instants(lines))
    assert [of.sample for of in found] == [4, 8, 7, 3, 9, 10]
    assert [of.stamp_s for of in found] == [1.0, 1.0, 2.0, 4.0, 4.0, 4.0]
    assert [[o.camera for o in of.observations] for of in found] == [
        ["first"], ["second"], ["third"], ["third", "third"], ["first"], ["second"],
    ]  # fmt: skip
    assert not any(of.robots for of in found)


def test_instant_includes_clock_offset_and_rows() -> None:
    """The delay is the clock offset plus the line time of the mean row."""
    spots = CandidateObservation("second", "tag", np.array([[0.0, 20.0], [0.0, 40.0]]))
    sample = Sample(1, stamp_s=5.0, observations=(spots,))
    offsets = {"second": 0.5, line_time_name("second"): 2e-3}
    assert streams._stamp_delay(sample, offsets) == pytest.approx(0.56)
    assert streams._stamp_delay(sample, {"second": 0.5}) == 0.5
    assert streams._stamp_delay(sample, {"second": -0.5, line_time_name("second"): 0.0}) == -0.5


def test_path_is_in_the_order_of_time_stamps() -> None:
    """The first of two records at one time counts, and lines without a time stamp do not."""
    poses = SE3.exp(np.arange(30.0).reshape(5, 6) / 50)
    stamps = (3.0, 1.0, 3.0, None, 2.0)
    lines = [Sample(k, stamp_s=at, robots={"left": RobotState(poses[k])}) for k, at in enumerate(stamps)]
    path = streams._path(two_arms(), "left", [*lines, make_line(9, 0.5, robots=["right"])])
    assert path.times.tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_array_equal(path.base_from_flange.translation, poses.translation[[1, 4, 0]])
    nothing = streams._path(two_arms(), "right", lines)
    assert (nothing.times.shape, nothing.base_from_flange.shape) == ((0,), (0,))
    by_joints = [Sample(0, stamp_s=1.0, robots={"left": RobotState(joints_rad=np.zeros(2))})]
    with pytest.raises(InputError, match="no urdf"):
        streams._path(two_arms(), "left", by_joints)
    with pytest.raises(InputError, match="give one kind"):
        streams._path(two_arms(), "left", [*by_joints, make_line(2, 2.0, robots=["left"])])


@pytest.mark.parametrize(
    ("offset_s", "of_robot_s", "robot", "overlaps"),
    [
        (0.0, 0.0, "left", False),
        (98.5, 0.0, "left", False),
        (99.5, 0.0, "left", True),
        (102.5, 0.0, "left", True),
        (103.5, 0.0, "left", False),
        (0.0, -100.0, "left", True),
        (0.0, 100.0, "left", False),
        (0.0, 0.0, "right", True),
    ],
)
def test_time_stamps_must_overlap(offset_s: float, of_robot_s: float, robot: str, overlaps: bool) -> None:
    """Time stamps of a camera and the robot that carries it have to overlap, by the stated clocks.

    Other robots do not matter.
    """
    cell = two_arms(first=Clock("fixed", offset_s), left=Clock("fixed", of_robot_s))
    arm = [make_line(k, 100.0 + k, robots=[robot]) for k in range(3)]
    lines = [*arm, make_line(5, 1e4, ["third"]), make_line(8, -1.0, ["first"]), make_line(9, 1.0, ["first"])]
    lines = lines if robot == "left" else [*arm, *lines[4:]]
    if overlaps:
        assert recording_streams(cell, Recording(tuple(lines))) is not None
    else:
        with pytest.raises(InputError, match="do not overlap"):
            recording_streams(cell, Recording(tuple(lines)))


@pytest.mark.parametrize(("apart_s", "is_path"), [(0.24, True), (0.26, False)])
def test_rolling_shutter_matters_if_robots_are_recorded_often(apart_s: float, is_path: bool) -> None:
    """Records are at most a quarter of a second apart, and all lines have time stamps."""
    lines = tuple(make_line(k, k * apart_s, ["second"], ["right", "left"]) for k in range(4))
    assert streams._has_rolling_shutter(two_arms(), Recording(lines)) == is_path
    views = tuple(make_line(k, 0.1 * k, ["second"]) for k in range(10, 14))
    assert streams._has_rolling_shutter(two_arms(), Recording((*lines, *views))) == is_path
    unstamped = make_line(9, None, ["second"], ["right"])
    assert not streams._has_rolling_shutter(two_arms(), Recording((*lines, unstamped)))
    cell = two_arms()
    still = replace(cell, cameras={"third": cell.cameras["third"]})
    assert not streams._has_rolling_shutter(still, Recording(lines))


@pytest.mark.parametrize(("offset_s", "followed"), [(0.4, [8, 9]), (-0.4, [6, 7])])
def test_robots_are_interpolated_by_their_own_clock(offset_s: float, followed: list[int]) -> None:
    """An arm is recorded from 1 to 2 s by a clock with this offset."""
    cell = two_arms(left=Clock("fixed"))
    arm = [make_line(100 + k, 1.0 + 0.1 * k, robots=["left"]) for k in range(11)]
    at = {6: 0.7, 7: 1.3, 8: 1.7, 9: 2.3}
    found = recording_streams(cell, Recording((*arm, *(make_line(k, t, ["first"]) for k, t in at.items()))))
    assert found is not None
    samples = synchronise(found, {**found.stated_offsets, "left": offset_s}).recording.samples
    assert [of.sample for of in samples] == followed
