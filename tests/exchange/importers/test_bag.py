"""Tests of `basecal import bag`: a bag of each kind gives its cell's base, and unusable bags one line of error."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, KINDS, RATE_HZ, Kind, bag_by_tf, between, journey, middles, new_bag
from tests.stream_cells import streamed

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration
from basecal.cell.files import read_cell, read_recording, write_cell
from basecal.cli import main
from basecal.exchange.urdf import chain_urdf
from basecal.geometry import SE3
from basecal.kinematics import SerialChain
from basecal.simulation import Scenario, SimulatedCell, simulate
from quick import quick

STOPS = 10


@pytest.fixture(scope="module")
def simulated_cell() -> SimulatedCell:
    """Two arms, and poses of a board as another program would measure them."""
    return simulate(Scenario(samples=STOPS, target="pose", state_observation_noise=False), 1)


@pytest.fixture(scope="module")
def expected_calibration(simulated_cell: SimulatedCell) -> Calibration:
    return calibrate(simulated_cell.cell, simulated_cell.recording)


def views(simulated_cell: SimulatedCell) -> list[str]:
    seen = simulated_cell.recording.samples[0].observations
    return ["--view", *(f"{view.camera},{view.target}=/{view.camera}/{view.target}" for view in seen)]


@pytest.mark.journey
@pytest.mark.parametrize("kind", quick(KINDS, ["mcap"]))
def test_bag_gives_same_base_as_cell(
    kind: Kind,
    tmp_path: Path,
    simulated_cell: SimulatedCell,
    expected_calibration: Calibration,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The base agrees to 1e-9, with frames found by their names; --list writes no files."""
    bag, cell = bag_by_tf(tmp_path, kind, simulated_cell.recording).close(), tmp_path / "c"
    write_cell(simulated_cell.cell, cell)
    before = sorted(tmp_path.rglob("*"))
    assert main(["import", "bag", str(cell), str(bag), "--list", *views(simulated_cell)]) == 0
    message = capsys.readouterr().out
    assert "/tf  tf2_msgs/msg/TFMessage" in message
    assert "would take robot 'eye': tf, eye_base_link to eye_tool0" in message
    assert sorted(tmp_path.rglob("*")) == before
    assert main(["import", "bag", str(cell), str(bag), *views(simulated_cell)]) == 0
    assert f"{STOPS} stops" in capsys.readouterr().out
    found = calibrate(read_cell(cell), read_recording(cell))
    for name in expected_calibration.transforms:
        away = (expected_calibration[name].mean.inverse() @ found[name].mean).log()
        np.testing.assert_allclose(away, 0, atol=1e-9, err_msg=name)
    assert main(["import", "bag", str(cell), str(bag), *views(simulated_cell)]) == 3
    assert "is recorded already" in capsys.readouterr().err


@pytest.mark.journey
@pytest.mark.parametrize("kind", quick(KINDS, ["sqlite3"]))
def test_truncated_bag_is_read_up_to_cut(
    kind: Kind, tmp_path: Path, simulated_cell: SimulatedCell, capsys: pytest.CaptureFixture[str]
) -> None:
    """Data before the cut is read with one warning line that names the bag.

    If it has no robot or view no cell is made.
    """
    bag = bag_by_tf(tmp_path, kind, simulated_cell.recording).close()
    file = bag if bag.is_file() else next(each for each in bag.iterdir() if each.suffix in (".db3", ".mcap"))
    whole = file.read_bytes()
    recorded = [sample.robots["eye"].base_from_flange for sample in simulated_cell.recording.samples]
    counts = []
    for share in (0.0, 0.01, 0.3, 0.5, 0.9, 0.999):
        file.write_bytes(whole[: int(share * len(whole))])
        cell = tmp_path / f"c{share}"
        code = main(["import", "bag", str(cell), str(bag), *views(simulated_cell), "--on", "wrist=eye"])
        message = capsys.readouterr().err
        assert code == (0 if message.startswith("basecal: warning: ") else 3), (share, message)
        assert code == 3 or "is read up to where it is damaged" in message
        assert message.count("\n") == 1
        assert str(bag) in message
        assert cell.exists() == (code == 0)
        samples = read_recording(cell).samples if code == 0 else ()
        away = [[(of.robots["eye"].base_from_flange.inverse() @ pose).log() for pose in recorded] for of in samples]
        assert all(np.abs(each).max(-1).min() < 1e-9 for each in away), share
        counts.append(len(samples))
        assert not list(tmp_path.glob(".import-*"))
    assert counts[:2] == [0, 0]
    assert (max(counts) > 0) == (kind != "ros1")  # a ROS 1 bag has its index at the end


@pytest.mark.journey
def test_urdf_and_joints_are_read_from_bag(
    tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]
) -> None:
    """The URDF is written into the cell; with --tf joints are ignored; images are unchanged to the bit."""
    rng = np.random.default_rng(0)
    places = rng.uniform(-0.5, 0.5, (4, arm.n))
    bag = new_bag(tmp_path, "mcap")
    bag.text("/robot_description", chain_urdf(arm, "base_link", "tool0"))
    names = list(arm.joint_names)
    for time, stop, share in journey(4):
        at = places[stop] if stop + 1 >= 4 else (1 - share) * places[stop] + share * places[stop + 1]
        bag.joints("/joint_states", time, ["gripper", *names[::-1]], np.array([0.0, *at[::-1]]))
        bag.transforms("/tf", time, {("base_link", "tool0"): arm.forward(at)})
    grey = rng.integers(0, 256, (24, 32), dtype=np.uint8)
    colour = rng.integers(0, 256, (24, 32, 3), dtype=np.uint8)
    jpeg = cv2.imencode(".jpg", grey)[1].tobytes()
    for time in middles(4):
        bag.image("/wrist/image_raw", float(time), grey)
        bag.image("/door/image_raw", float(time) + 0.01, colour, "bgr8")
        bag.compressed("/roof/image_raw/compressed", float(time) - 0.01, jpeg)
        bag.image("/wrist/depth/image_raw", float(time), grey.astype(np.uint16), "16UC1")
    bag.camera_info("/wrist/camera_info", BEGIN_S, (32, 24), np.array([50.0, 0, 16, 0, 50, 12, 0, 0, 1]), np.zeros(5))
    path, cell = bag.close(), tmp_path / "c"
    words = ["import", "bag", str(cell), str(path), "--on", "wrist=arm", "door=world", "roof=world"]
    assert main(words) == 0
    assert "robot 'arm': /joint_states, 6 joints from base_link to tool0" in capsys.readouterr().out
    found, recording = read_cell(cell), read_recording(cell)
    assert found.robots["arm"].chain is not None
    assert (found.cameras["wrist"].size_px, found.cameras["door"].size_px) == ((32, 24), (32, 24))
    lens = found.cameras["wrist"].intrinsics
    assert lens is not None
    assert lens.status == "fixed"
    for k, sample in enumerate(recording.samples):
        np.testing.assert_allclose(sample.robots["arm"].joints_rad, places[k], atol=1e-12)
        assert set(sample.images) == {"wrist", "door", "roof"}
        np.testing.assert_array_equal(cv2.imread(str(cell / sample.images["wrist"]), cv2.IMREAD_UNCHANGED), grey)
        np.testing.assert_array_equal(cv2.imread(str(cell / sample.images["door"]), cv2.IMREAD_UNCHANGED), colour)
        assert (cell / sample.images["roof"]).read_bytes() == jpeg
    assert len(recording.samples) == 4
    words[2] = str(tmp_path / "by_tf")
    assert main([*words, "--tf"]) == 0
    pose = read_recording(words[2]).samples[2].robots["arm"].base_from_flange
    assert pose is not None
    np.testing.assert_allclose(pose.matrix, arm.forward(places[2]).matrix, atol=1e-12)


@pytest.mark.journey
def test_clock_offset_is_recovered_from_streams(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """For a moving arm and its views the simulated clock offset is recovered."""
    turned = SE3.exp(np.array([0, 0, 0, np.pi, 0, 0]))  # so that the camera looks at the tag
    bag = new_bag(tmp_path, "sqlite3")
    for sample in streamed(stated=False).recording.samples:
        time = BEGIN_S + sample.stamp_s
        for state in sample.robots.values():
            bag.pose("/arm/pose", time, state.base_from_flange)
        for view in sample.observations:
            bag.pose("/tag/pose", time, turned @ view.camera_from_target)
    words = ["import", "bag", str(tmp_path / "c"), str(bag.close()), "--robot", "arm=/arm/pose"]
    words += ["--view", "wrist,tag=/tag/pose", "--on", "wrist=arm"]
    assert main(words) == 3
    assert "the robots are never all at rest for 0.3 s around an image: --streams" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()
    assert main([*words, "--streams"]) == 0
    found = calibrate(read_cell(tmp_path / "c"), read_recording(tmp_path / "c"))
    assert found.clocks["wrist"].offset_s == pytest.approx(0.03, abs=4 * found.clocks["wrist"].sigma_s)


@pytest.fixture(scope="module")
def by_tf(simulated_cell: SimulatedCell, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag that no test changes."""
    return bag_by_tf(tmp_path_factory.mktemp("bag"), "ros1", simulated_cell.recording).close()


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--robot", "eye=/eye/pose"], 3, "no '/eye/pose'; there are: /tf, /tf_static, /wrist/board"),
        (["--robot", "eye=eye_base,eye_tool0"], 3, "no 'eye_base' (did you mean 'eye_base_link'?)"),
        (["--robot", "eye=/tf"], 3, "/tf holds tf2_msgs/msg/TFMessage, expected one of geometry_msgs/msg/PoseStamped"),
        (["--robot", "eye=eye_base_link,hand_tool0"], 3, "no transform of tf joins 'eye_base_link' and 'hand_tool0'"),
        (["--robot", "eye=eye_wrist,eye_tool0"], 3, "only /tf_static connects these frames"),
        (["--camera", "wrist=/wrist/image_raw"], 3, "no '/wrist/image_raw'"),
        (["--robot", "eye"], 2, "--robot eye: expected NAME=BASE,FLANGE"),
        (["--robot", "eye=a,b", "eye=a,b"], 2, "given twice"),
        (["--view", "wrist=/wrist/board"], 2, "expected CAMERA,TARGET=/TOPIC"),
        ([], 3, "there is no image, and no --view names a topic of poses or tags"),
    ],
)
def test_missing_bag_sources_are_reported(
    words: list[str],
    code: int,
    message: str,
    tmp_path: Path,
    by_tf: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The error is one line, and no files are written."""
    assert main(["import", "bag", str(tmp_path / "c"), str(by_tf), *words]) == code
    stderr = capsys.readouterr().err
    assert message in stderr
    assert stderr.count("\n") == 1
    assert not (tmp_path / "c").exists()


def test_list_works_without_recognised_robots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Arms with topics of poses are not found by frame names, but topics are listed with what to give."""
    bag = new_bag(tmp_path, "mcap")
    bag.pose("/left/pose", BEGIN_S, SE3.identity())
    bag.image("/cam/image_raw", BEGIN_S, np.zeros((8, 8), np.uint8))
    assert main(["import", "bag", str(tmp_path / "c"), str(bag.close()), "--list"]) == 0
    message = capsys.readouterr().out
    assert "/cam/image_raw  sensor_msgs/msg/Image" in message
    assert "would take nothing: no robot was found from the names of frames: give --robot" in message
    assert not (tmp_path / "c").exists()


@pytest.mark.journey
def test_carrier_of_unknown_cameras_is_requested(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """If no information gives the carriers of two cameras, they are requested. With frames in tf they are found."""
    where = SE3.exp(np.random.default_rng(1).normal(0, 0.3, (6, 6)))
    for frames in (("", ""), ("left_eye", "post")):
        bag = new_bag(tmp_path, "mcap")
        bag.path = tmp_path / f"bag{frames[0]}"
        fixed = {
            ("left_tool0", "left_eye"): where[4],
            ("world", "post"): where[5],
            ("world", "left_base_link"): where[3],
        }
        bag.transforms("/tf_static", BEGIN_S, fixed)
        for time, stop, share in journey(3):
            moved = {(f"{name}_base_link", f"{name}_tool0"): between(where, stop, share) for name in ("left", "right")}
            bag.transforms("/tf", time, moved)
        for time in middles(3):
            for camera, frame in zip(("a", "b"), frames, strict=True):
                bag.image(f"/{camera}/image_raw", float(time), np.zeros((8, 8), np.uint8), frame=frame)
        code = main(["import", "bag", str(tmp_path / "c"), str(bag.close())])
        message = capsys.readouterr()
        if frames[0]:
            assert code == 0
            cameras = read_cell(tmp_path / "c").cameras
            assert {name: camera.on for name, camera in cameras.items()} == {"a": "left", "b": "world"}
        else:
            assert code == 3
            assert "the carrier of camera 'a' is unknown" in message.err
            assert "--on a=ROBOT" in message.err
            assert not (tmp_path / "c").exists()


def test_images_between_stops_are_left_out(tmp_path: Path) -> None:
    """Each stop gets one image from its middle if images are recorded continuously."""
    where = SE3.exp(np.random.default_rng(2).normal(0, 0.3, (3, 6)))
    bag = new_bag(tmp_path, "ros1")
    for k, (time, stop, share) in enumerate(journey(3)):
        bag.transforms("/tf", time, {("base_link", "tool0"): between(where, stop, share)})
        if k % 3 == 0:
            bag.image("/cam/image_raw", time, np.full((8, 8), stop if share == 0 else 255, np.uint8))
    assert main(["import", "bag", str(tmp_path / "c"), str(bag.close()), "--on", "cam=arm"]) == 0
    samples = read_recording(tmp_path / "c").samples
    assert len(samples) == 3
    for stop, (sample, middle) in enumerate(zip(samples, middles(3), strict=True)):
        assert cv2.imread(str(tmp_path / "c" / sample.images["cam"]), cv2.IMREAD_UNCHANGED).max() == stop
        assert sample.stamp_s == pytest.approx(middle, abs=6 / RATE_HZ)


def test_target_is_described_on_import(tmp_path: Path) -> None:
    """The target in the images is described by the options that `images` has."""
    where = SE3.exp(np.random.default_rng(1).normal(0, 0.3, (3, 6)))
    bag = new_bag(tmp_path, "mcap")
    for time, stop, share in journey(2):
        moved = {(f"{name}_base_link", f"{name}_tool0"): between(where, stop, share) for name in ("left", "right")}
        bag.transforms("/tf", time, moved)
    for time in middles(2):
        bag.image("/wrist/image_raw", float(time), np.zeros((24, 32), np.uint8))
    words = ["import", "bag", str(tmp_path / "c"), str(bag.close()), "--on", "wrist=left"]
    assert main([*words, "--target", "charuco", "--squares", "5x7", "--square", "40mm", "--target-on", "right"]) == 0
    cell = read_cell(tmp_path / "c")
    board = cell.targets["board"]
    assert (board.on, cell.cameras["wrist"].on) == ("right", "left")
    assert board.target is not None
    assert board.target.options["square_m"] == 0.04
    assert cell.robots["left"].frames == {"base": "left_base_link", "flange": "left_tool0"}
