"""Recordings of streams, and their samples."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Calibration, CellCamera, Clock, ClockOffset, PoseObservation, Recording, RobotState, Sample
from basecal.errors import InputError
from basecal.estimation.solve import solve
from basecal.estimation.streams.streams import streams_of, synchronised, synchronous
from basecal.geometry import SE3
from stream_cells import MOUNT, along, streamed


def test_samples_by_one_clock_are_no_streams() -> None:
    made = streamed()
    together = synchronous(
        made.cell, made.recording, Calibration("good", clocks={"wrist": ClockOffset(made.offset_s, 0.0)})
    )
    assert streams_of(made.cell, together) is None
    assert synchronous(made.cell, together) is together


def test_the_clock_of_a_camera_whose_views_stand_alone_is_free() -> None:
    made = streamed()
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    assert streams.open == ("wrist",)
    assert streams.stated == {"arm": 0.0, "wrist": 0.0}


def test_what_is_stated_of_a_clock_holds() -> None:
    made = streamed(clock=Clock("prior", 0.02, 0.01))
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    assert streams.clocks["wrist"] == Clock("prior", 0.02, 0.01)
    fixed = streams_of(*(lambda m: (m.cell, m.recording))(streamed(clock=Clock(offset_s=0.03))))
    assert fixed is not None
    assert fixed.open == ()


def test_where_all_clocks_are_free_that_of_the_reference_is_held() -> None:
    made = streamed(clock=Clock("free"))
    robots = {"arm": replace(made.cell.robots["arm"], clock=Clock("free", 1.0))}
    streams = streams_of(replace(made.cell, robots=robots), made.recording)
    assert streams is not None
    assert streams.open == ("wrist",)
    assert streams.clocks["arm"] == Clock("fixed", 1.0)


def test_robots_stand_where_they_were_at_the_instant_of_the_view() -> None:
    made = streamed()
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    samples = synchronised(streams, {"arm": 0.0, "wrist": made.offset_s}).recording.samples
    assert len(samples) == 70
    times = np.array([s.stamp_s for s in samples])
    np.testing.assert_allclose(times, np.arange(0.5, 7.5, 0.1), atol=1e-9)
    found = SE3.stack([s.robots["arm"].base_from_flange for s in samples])
    assert np.abs((along(times).inverse() @ found).log()).max() < 1e-5


def test_the_offset_of_a_robot_counts_the_other_way() -> None:
    made = streamed()
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    by_camera = synchronised(streams, {"arm": 0.0, "wrist": 0.03}).recording.samples[5]
    by_robot = synchronised(streams, {"arm": -0.03, "wrist": 0.0}).recording.samples[5]
    first, second = (s.robots["arm"].base_from_flange for s in (by_camera, by_robot))
    np.testing.assert_allclose(first.matrix, second.matrix, atol=1e-12)


def test_views_that_no_record_surrounds_are_left_out_and_said() -> None:
    made = streamed()
    holed = tuple(s for s in made.recording.samples if not (s.robots and 3.0 < s.stamp_s < 4.0))
    found = synchronous(
        made.cell, Recording(holed), Calibration("good", clocks={"wrist": ClockOffset(made.offset_s, 0.0)})
    )
    assert len(found.samples) == 60
    (finding,) = found.findings
    assert finding.code == "dropped-sample"
    assert "10 view(s) not used" in finding.message


def test_two_cameras_of_one_line_become_two_samples() -> None:
    made = streamed()
    cameras = {**made.cell.cameras, "side": CellCamera("side", "arm")}
    both = [
        replace(s, observations=(*s.observations, replace(s.observations[0], camera="side"))) if s.observations else s
        for s in made.recording.samples
    ]
    streams = streams_of(replace(made.cell, cameras=cameras), Recording(tuple(both)))
    assert streams is not None
    samples = synchronised(streams, {"arm": 0.0, "wrist": 0.03, "side": 0.05}).recording.samples
    assert len({s.sample for s in samples}) == len(samples) == 140
    first, second = (next(s for s in samples if s.observations[0].camera == name) for name in ("wrist", "side"))
    assert second.stamp_s == pytest.approx(first.stamp_s + 0.02)


def test_a_line_without_a_stamp_is_an_error() -> None:
    made = streamed()
    first, *others = made.recording.samples
    with pytest.raises(InputError, match="sample 0 has no stamp_s"):
        streams_of(made.cell, Recording((replace(first, stamp_s=None), *others)))


def test_clocks_that_share_no_time_are_an_error() -> None:
    made = streamed(offset_s=1.6e9)
    with pytest.raises(InputError, match=r"stamps of wrist and of arm share no time.*clock: \{status: free, offset_s"):
        streams_of(made.cell, made.recording)
    guessed = streamed(offset_s=1.6e9, clock=Clock("free", 1.6e9 - 0.02))
    assert streams_of(guessed.cell, guessed.recording) is not None


def test_poses_and_joints_of_one_robot_do_not_mix() -> None:
    made = streamed()
    *others, last = made.recording.samples
    with pytest.raises(InputError, match="'arm' is recorded by poses in some lines and by joints in others"):
        streams_of(made.cell, Recording((*others, replace(last, robots={"arm": RobotState(joints_rad=np.zeros(6))}))))


def test_solve_reads_streams_by_the_clocks_as_stated() -> None:
    made = streamed(clock=Clock(offset_s=0.03))
    found = solve(made.cell, made.recording).transforms["arm_flange_from_wrist"]
    xi = (found.mean.inverse() @ MOUNT).log()
    assert xi @ np.linalg.solve(found.covariance, xi) < 22.5  # the 99.9 % of six freedoms


def test_thinned_views_are_spread_over_all() -> None:
    made = streamed()
    streams = streams_of(made.cell, made.recording)
    assert streams is not None
    assert [s.sample for s in streams.thinned(3).instants] == [0, 34, 69]


def test_a_few_samples_without_a_robot_do_not_make_streams() -> None:
    view = PoseObservation("wrist", "tag", SE3.identity())
    made = streamed()
    samples = [Sample(k, None, {"arm": RobotState(SE3.identity())} if k else {}, (view,)) for k in range(4)]
    assert streams_of(made.cell, Recording(tuple(samples))) is None
