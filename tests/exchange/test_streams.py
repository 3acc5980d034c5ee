"""Tests of files of all robots and of a target, as read by `import poses` and `import pixels`."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.cell import PixelObservation, PoseObservation
from basecal.cell.files import read_cell, read_recording
from basecal.cell.schema.cell_file import cell_from_dict
from basecal.cli import main
from basecal.errors import DatasetError, InputError
from basecal.exchange.controller_poses import PoseStream
from basecal.exchange.streams import (
    CellNames,
    Streams,
    _known_names,
    _new_names,
    read_pixels,
    recording_from_streams,
)
from basecal.geometry import SE3
from pose_files import drawn, options, pose_files, stack

CSV = "sample,id,u,v\n2,5,1.5,2.5\n0,3,10,20\n2,1,3,4\n"


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    """Write text files of four poses for each stream."""
    return pose_files(tmp_path)


def test_imported_poses_match_files(tmp_path: Path, files: dict[str, str]) -> None:
    """The recording holds the poses of the files in metres, and the new cell has everything free."""
    assert main(["import", "poses", str(tmp_path / "c"), *options(files), "--length-unit", "mm"]) == 0
    recording, cell = read_recording(tmp_path / "c"), read_cell(tmp_path / "c")
    assert list(cell.transforms) == ["eye_base_from_hand_base", "eye_flange_from_camera", "hand_flange_from_target"]
    sample = recording.samples[2]
    for seed, pose in enumerate(
        [
            sample.robots["eye"].base_from_flange,
            sample.robots["hand"].base_from_flange,
            sample.observations[0].camera_from_target,
        ]
    ):
        expected = drawn(4, seed)[2]
        np.testing.assert_allclose(pose.rotation, expected.rotation, atol=1e-12)
        np.testing.assert_allclose(pose.translation, expected.translation / 1000, atol=1e-12)


def test_invert_option_inverts_named_streams(tmp_path: Path, files: dict[str, str]) -> None:
    """`--invert` inverts the named streams, and only those."""
    words = ["--length-unit", "m", "--invert", "camera-from-target", "hand-base-from-flange"]
    assert main(["import", "poses", str(tmp_path / "c"), *options(files), *words]) == 0
    sample = read_recording(tmp_path / "c").samples[0]
    turned = [sample.robots["hand"].base_from_flange, sample.observations[0].camera_from_target]
    for seed, pose in zip((1, 2), turned, strict=True):
        np.testing.assert_allclose((pose @ drawn(4, seed)[0]).matrix, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(sample.robots["eye"].base_from_flange.matrix, drawn(4, 0)[0].matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("absent", "transforms"),
    [
        ("hand-base-from-flange", ["eye_flange_from_camera", "eye_base_from_target"]),
        ("eye-base-from-flange", ["hand_base_from_camera", "hand_flange_from_target"]),
    ],
)
def test_import_of_one_robot(tmp_path: Path, files: dict[str, str], absent: str, transforms: list[str]) -> None:
    """Without the hand's file the target is on the world; without the eye's file the camera is."""
    del files[absent]
    assert main(["import", "poses", str(tmp_path / "c"), *options(files), "--length-unit", "m"]) == 0
    assert list(read_cell(tmp_path / "c").transforms) == transforms
    assert len(read_recording(tmp_path / "c").samples) == 4


def test_import_into_existing_cell(tmp_path: Path, files: dict[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    """An existing cell keeps its file and provides the names; files that do not fit it are refused."""
    folder = str(tmp_path / "c")
    main(["new", folder, "--robots", "1", "--target", "pose"])
    text = Path(folder, "cell.yaml").read_text()
    base = ["import", "poses", folder, "--length-unit", "m"]
    assert main([*base, *options(files)]) == 3
    assert "--hand-base-from-flange has no robot" in capsys.readouterr().err
    seen = ["--camera-from-target", files["camera-from-target"]]
    assert main([*base, *seen]) == 3
    assert "give its poses with --eye-base-from-flange" in capsys.readouterr().err
    eye = ["--eye-base-from-flange", files["eye-base-from-flange"]]
    assert main([*base, *seen, *eye, "--camera", "cam"]) == 3
    assert "no 'cam' (did you mean 'camera'?)" in capsys.readouterr().err
    assert main([*base, *seen, *eye, "--invert", "hand-base-from-flange"]) == 3
    assert "no file is given" in capsys.readouterr().err
    assert main([*base, *seen, *eye]) == 0
    assert Path(folder, "cell.yaml").read_text() == text
    assert len(read_recording(folder).samples) == 4


def test_failed_import_creates_no_cell(
    tmp_path: Path, files: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Files of different lengths are refused by name, and no cell is created."""
    files["hand-base-from-flange"] = stack(tmp_path / "short.txt", drawn(3, 0))
    assert main(["import", "poses", str(tmp_path / "c"), *options(files), "--length-unit", "m"]) == 3
    assert "short.txt holds 3" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_points_are_assigned_to_samples(tmp_path: Path) -> None:
    """Rows in any order give each sample its points, in the order of the ids."""
    (tmp_path / "a.csv").write_text(CSV)
    views = read_pixels(tmp_path / "a.csv")
    assert list(views) == [0, 2]
    np.testing.assert_array_equal(views[2][0], [1, 5])
    np.testing.assert_array_equal(views[2][1], [[3, 4], [1.5, 2.5]])


def test_pixel_archives_equal_csv(tmp_path: Path) -> None:
    """Columns u and v or one array of pixels are read equally, under both spellings of the names."""
    columns = {"sample": np.array([0, 0]), "id": np.array([1, 0])}
    np.savez(tmp_path / "apart.npz", **columns, u=np.array([1.0, 2.0]), v=np.array([3.0, 4.0]))
    np.savez(
        tmp_path / "one.npz", samples=columns["sample"], ids=columns["id"], pixels=np.array([[1.0, 3.0], [2.0, 4.0]])
    )
    for name in ("apart.npz", "one.npz"):
        ids, pixels = read_pixels(tmp_path / name)[0]
        np.testing.assert_array_equal(ids, [0, 1])
        np.testing.assert_array_equal(pixels, [[2, 4], [1, 3]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sample,id,u\n0,0,1\n", "has no v"),
        ("sample,id,u,v\n0,0.5,1,1\n", "whole number"),
        ("sample,id,u,v\n-1,0,1,1\n", "whole number"),
        ("sample,id,u,v\n0,4,1,1\n0,4,2,2\n", "sample 0 has id 4 twice"),
        ("sample,id,u,v\n0,4,nan,1\n", "not finite"),
        ("sample,id,u,v\n0,4,5,1\n0,5,1,1e7\n", r"a.csv: u, v: row 1 is beyond 1e\+06 px"),
    ],
)
def test_invalid_pixel_csv_is_reported(tmp_path: Path, text: str, message: str) -> None:
    """A fault in a table of points is reported with its file."""
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(DatasetError, match=message):
        read_pixels(tmp_path / "a.csv")


def test_invalid_pixel_archives_are_refused(tmp_path: Path) -> None:
    """Arrays of different lengths, other shapes and NaN are refused by name."""
    two = np.array([0, 1])
    np.savez(tmp_path / "length.npz", sample=two, id=two, u=np.zeros(3), v=np.zeros(3))
    np.savez(tmp_path / "shape.npz", sample=two, id=two, pixels=np.zeros((2, 3)))
    np.savez(tmp_path / "nan.npz", sample=two, id=two, pixels=np.full((2, 2), np.nan))
    for name, message in [
        ("length.npz", "u: has shape"),
        ("shape.npz", r"expected \(n, 2\)"),
        ("nan.npz", "row 0 is not finite"),
    ]:
        with pytest.raises(DatasetError, match=message):
            read_pixels(tmp_path / name)


@pytest.mark.journey
def test_points_of_many_samples_are_sorted_once(tmp_path: Path) -> None:
    """Points of fifty thousand images in any order are sorted quickly, which took minutes before.

    An archive of no points has no samples.
    """
    rng = np.random.default_rng(3)
    columns = {key: each.ravel() for key, each in zip(("sample", "id"), np.mgrid[:50_000, :4], strict=True)}
    mixed = {key: each[order] for order in [rng.permutation(200_000)] for key, each in columns.items()}
    np.savez(tmp_path / "a.npz", **mixed, u=4.0 * mixed["sample"] + mixed["id"], v=np.zeros(200_000))
    views = read_pixels(tmp_path / "a.npz")
    assert list(views) == list(range(50_000))
    np.testing.assert_array_equal([ids for ids, _ in views.values()], np.tile(np.arange(4), (50_000, 1)))
    np.testing.assert_array_equal(np.concatenate([pixels[:, 0] for _, pixels in views.values()]), np.arange(200_000))
    np.savez(tmp_path / "none.npz", **{key: np.zeros(0) for key in ("sample", "id", "u", "v")})
    assert read_pixels(tmp_path / "none.npz") == {}


@pytest.mark.parametrize("number", [1e300, 2.0**63, -1.0, 0.5])
def test_invalid_sample_numbers_give_no_warning(tmp_path: Path, number: float) -> None:
    """NumPy prints no warning beside the error."""
    np.savez(tmp_path / "a.npz", sample=np.array([0, number]), id=np.zeros(2), u=np.zeros(2), v=np.zeros(2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(DatasetError, match=r"sample: row 1 is .*, expected a whole number from 0"):
            read_pixels(tmp_path / "a.npz")


def stream(name: str, count: int, seed: int) -> PoseStream:
    return PoseStream(name, SE3.exp(np.random.default_rng(seed).normal(size=(count, 6))), np.arange(count) * 0.5)


def test_sample_i_has_row_i() -> None:
    """Sample i has the i-th pose of every stream, its stamp, and the pixels given for i."""
    eye, hand, seen = stream("a", 3, 0), stream("c", 3, 1), stream("b", 3, 2)
    pixels = {1: (np.array([4]), np.array([[7.0, 8.0]]))}
    recording = recording_from_streams({"eye": eye, "hand": hand}, "camera", "target", seen, pixels, sigma_px=0.4)
    assert [sample.sample for sample in recording.samples] == [0, 1, 2]
    sample = recording.samples[1]
    pose, points = sample.observations
    assert sample.stamp_s == 0.5
    assert isinstance(pose, PoseObservation)
    assert isinstance(points, PixelObservation)
    np.testing.assert_array_equal(sample.robots["hand"].base_from_flange.matrix, hand.poses[1].matrix)
    np.testing.assert_array_equal(pose.camera_from_target.matrix, seen.poses[1].matrix)
    np.testing.assert_array_equal(points.pixels, [[7, 8]])
    np.testing.assert_array_equal(points.sigma_px, [0.4])
    assert len(recording.samples[0].observations) == 1


def test_stream_lengths_must_agree() -> None:
    """Files of different lengths are refused, each with its length."""
    with pytest.raises(InputError, match=r"a\.txt holds 3, c\.txt holds 4"):
        recording_from_streams({"eye": stream("a.txt", 3, 0), "hand": stream("c.txt", 4, 1)}, "camera", "target")


def test_robot_with_one_pose_is_stationary() -> None:
    """A single pose applies to every sample, with the times of the moving streams."""
    moving, still = stream("a", 3, 0), stream("c", 1, 1)
    samples = recording_from_streams({"hand": still, "eye": moving}, "camera", "target").samples
    assert [sample.stamp_s for sample in samples] == [0, 0.5, 1]
    for sample in samples:
        np.testing.assert_array_equal(sample.robots["hand"].base_from_flange.matrix, still.poses[0].matrix)


def test_pixels_need_a_pose() -> None:
    """Pixels of a sample beyond the last pose are refused."""
    pixels = {3: (np.array([0]), np.array([[1.0, 2.0]]))}
    with pytest.raises(InputError, match="sample 3, but the poses end at sample 2"):
        recording_from_streams({"eye": stream("a", 3, 0)}, "camera", "target", pixels=pixels)


def test_at_least_one_robot_is_needed() -> None:
    """Without any stream no sample can be made."""
    with pytest.raises(InputError, match="no pose file"):
        recording_from_streams({}, "camera", "target")


def test_camera_and_target_on_one_robot_are_refused() -> None:
    """Camera and target on one robot see no motion; on two robots, or both on the world, they are accepted."""
    described = cell_from_dict({
        "schema": "basecal/cell/1",
        "reference": "a",
        "robots": {"a": {}, "b": {}},
        "cameras": {"own": {"on": "a"}, "still": {"on": "world"}},
        "targets": {"tag": {"on": "a"}, "other": {"on": "b"}, "wall": {"on": "world"}},
    })  # fmt: skip
    files = Streams("a.txt", "b.txt", "c.txt", "m")
    assert _known_names(described, files, "own", "other") == CellNames("own", "other", "a", "b")
    with pytest.raises(InputError, match="camera 'own' and target 'tag' are both on 'a': views are useless"):
        _known_names(described, files, "own", "tag")
    none = replace(files, eye=None, hand=None)
    assert _known_names(described, none, "still", "wall") == CellNames("still", "wall", None, None)


def test_names_of_new_cell_follow_files() -> None:
    """Pixels, and names other than the defaults, need an existing cell."""
    files = Streams("a.txt", None, "c.txt", "m")
    assert _new_names("c", files, "camera", "target") == CellNames("camera", "target", "eye", None)
    assert _new_names("c", replace(files, eye=None, hand="b.txt"), None, None).hand == "hand"
    with pytest.raises(InputError, match="must describe the target and the lens: basecal new c"):
        _new_names("c", replace(files, pixels="p.csv"), None, None)
    with pytest.raises(InputError, match="no robot: give"):
        _new_names("c", replace(files, eye=None), None, None)
    for names, message in ((("cam", "target"), "'cam'"), (("camera", "tag"), "'camera'"), ((None, "tag"), "'tag'")):
        with pytest.raises(InputError, match=f"has no cell.yaml to name {message}"):
            _new_names("c", files, *names)
