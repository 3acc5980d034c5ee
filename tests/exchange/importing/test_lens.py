"""Tests of lenses and targets of files, imported into a cell."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.cell import Cell, Sample
from basecal.cell.files import append_samples, read_cell
from basecal.cell.format.yaml_text import yaml_text
from basecal.errors import DatasetError, InputError
from basecal.exchange.fields import parse_fields
from basecal.exchange.importing.bring_in import add_to_cell
from basecal.exchange.importing.imported import NO_CELL, Imported
from basecal.exchange.importing.lens import (
    OPENCV_TERMS,
    StatedLens,
    camera_entry,
    imported_target,
    lens_of_file,
    make_camera,
    matrix_parameters,
    mount_by_chain,
    opencv_terms,
)
from basecal.geometry import SE3, Camera
from basecal.geometry.lenses.registry import model_lenses

LENS = StatedLens(Camera("pinhole", np.array([600.0, 601, 320, 240, 0.1, 0, 0, 0]), (640, 480)), "a lens", "cam1")
ON_ARM = {"on": "arm", "mount": {"status": "fixed", "t_m": [0.1, 0, 0], "q_xyzw": [0, 0, 0, 1]}}
WORDS = {"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": {}}}
HERE = parse_fields("k: 1", "a.yaml").find("k")


def cell_in(folder: Path, **more: object) -> Cell:
    (folder / "cell.yaml").write_text(yaml_text({**WORDS, **more}))
    return read_cell(folder)


def import_into(folder: Path, imported: Imported) -> Cell:
    return add_to_cell(folder, imported, lambda cell, recording: ()).cell


def test_new_cell_has_camera_on_robot(tmp_path: Path) -> None:
    """Without a cell one is made, whose robot carries the camera; a camera on the world needs a robot first."""
    cell = import_into(tmp_path, lens_of_file(tmp_path, LENS, "a.yaml", "wrist", "left", "fixed"))
    assert (cell.reference, cell.cameras["wrist"].on) == ("left", "left")
    lens = cell.cameras["wrist"].intrinsics
    assert lens is not None
    assert lens.camera is not None
    np.testing.assert_array_equal(lens.camera.parameters, LENS.camera.parameters)
    with pytest.raises(InputError, match=r"camera 'hall' on the world needs a robot, and there is no cell.yaml"):
        lens_of_file(tmp_path / "other", LENS, "a.yaml", "hall", "world", "fixed")


def test_lens_is_replaced_and_mount_kept(tmp_path: Path) -> None:
    """Model and intrinsics of the camera are the file's; its mount and carrier are unchanged."""
    cell_in(tmp_path, cameras={"wrist": {**ON_ARM, "size_px": [640, 480], "intrinsics": {"status": "free"}}})
    imported = lens_of_file(tmp_path, LENS, "a.yaml", None, None, "free", mount=SE3.identity())
    after = import_into(tmp_path, imported)
    lens = after.cameras["wrist"].intrinsics
    assert lens is not None
    assert (lens.status, lens.camera is not None) == ("free", True)
    assert after.cameras["wrist"].mount.status == "fixed"
    assert after.cameras["wrist"].mount.mean is not None
    np.testing.assert_array_equal(after.cameras["wrist"].mount.mean.translation, [0.1, 0, 0])


def test_other_image_size_is_reported(tmp_path: Path) -> None:
    """The error has both sizes and the camera."""
    cell_in(tmp_path, cameras={"wrist": {**ON_ARM, "size_px": [1280, 960], "intrinsics": {"status": "free"}}})
    with pytest.raises(InputError, match=r"a.yaml is of 640 x 480 px, camera 'wrist' in cell.yaml has 1280 x 960"):
        lens_of_file(tmp_path, LENS, "a.yaml", "wrist", None, "fixed")


def test_camera_for_lens_is_chosen(tmp_path: Path) -> None:
    """The only or the named camera gets the lens; a new one needs a carrier."""
    cell_in(tmp_path, cameras={"a": ON_ARM, "b": ON_ARM}, robots={"arm": {}, "other": {}})
    with pytest.raises(InputError, match=r"which camera\? --camera is one of: a, b"):
        lens_of_file(tmp_path, LENS, "a.yaml", None, None, "fixed")
    with pytest.raises(InputError, match=r"camera 'c' is new: give its carrier with --on, one of: arm, other"):
        lens_of_file(tmp_path, LENS, "a.yaml", "c", None, "fixed")
    assert (
        import_into(tmp_path, lens_of_file(tmp_path, LENS, "a.yaml", "c", "world", "fixed")).cameras["c"].on == "world"
    )
    cell_in(tmp_path)
    assert lens_of_file(tmp_path, LENS, "a.yaml", "only", None, "fixed").cell["cameras"]["only"]["on"] == "arm"


def test_camera_chain_gives_mount_guess(tmp_path: Path) -> None:
    """If the previous camera is known, carrier_from_camera = carrier_from_previous @ previous_from_camera."""
    cell = cell_in(tmp_path, cameras={"cam0": ON_ARM, "cam1": {"on": "arm"}})
    camera_from_previous = SE3.from_rotvec([0, 0, np.pi / 2], [-0.11, 0, 0])
    first = StatedLens(LENS.camera, "a lens", "cam0")
    second = StatedLens(LENS.camera, "a lens", "cam1", camera_from_previous)
    mount = mount_by_chain(cell, (first, second), "cam1")
    assert mount is not None
    # The previous camera's origin is 11 cm beside the new camera's, at the stated mount.
    np.testing.assert_allclose(mount @ np.array([-0.11, 0, 0]), [0.1, 0, 0], atol=1e-12)
    after = import_into(tmp_path, lens_of_file(tmp_path, second, "a.yaml", "cam1", None, "fixed", mount))
    assert after.cameras["cam1"].mount.mean is not None
    np.testing.assert_allclose(after.cameras["cam1"].mount.mean.matrix, mount.matrix, atol=1e-12)
    assert mount_by_chain(cell, (first, second), "cam0") is None
    assert mount_by_chain(NO_CELL, (first, second), "cam1") is None


@pytest.mark.parametrize(("stated", "on", "is_guessed"), [(None, "world", True), ("arm", "arm", False)])
def test_mount_guess_is_in_carrier_frame(tmp_path: Path, stated: str | None, on: str, is_guessed: bool) -> None:
    """A camera of a chain on the world is on the world, too.

    For a camera on the arm its pose in the world is no guess.
    """
    cell_in(tmp_path)
    imported = lens_of_file(tmp_path, LENS, "a.yaml", "cam1", stated, "fixed", SE3.identity(), "world")
    camera = import_into(tmp_path, imported).cameras["cam1"]
    assert (camera.on, camera.mount.mean is not None) == (on, is_guessed)
    again = lens_of_file(tmp_path, LENS, "a.yaml", "cam1", None, "fixed", SE3.identity(), "eye")
    assert "mount" not in again.cell["cameras"]["cam1"]


def test_target_description_is_imported(tmp_path: Path) -> None:
    """A description completes the only target, or makes one if its carrier is given."""
    board = {"kind": "chessboard", "corners": [6, 7], "square_m": 0.06}
    with pytest.raises(InputError, match=r"there is no cell.yaml to put the target of t.yaml into"):
        imported_target(NO_CELL, board, "t.yaml", None, None)
    cell = cell_in(tmp_path, robots={"arm": {}, "other": {}})
    with pytest.raises(InputError, match=r"target 'target' is new: give its carrier"):
        imported_target(cell, board, "t.yaml", None, None)
    after = import_into(tmp_path, imported_target(cell, board, "t.yaml", "board", "world"))
    shape = after.targets["board"].target
    assert shape is not None
    assert (shape.kind, dict(shape.options)["corners"]) == ("chessboard", [6, 7])
    assert import_into(tmp_path, imported_target(after, board, "t.yaml", None, None)).targets.keys() == {"board"}


def test_accepted_term_counts_match_lenses() -> None:
    """The accepted numbers of terms are those of the pinhole lenses."""
    assert tuple(sorted({count for lens in model_lenses("pinhole") for count in lens.TERMS})) == OPENCV_TERMS


def test_zero_tilt_terms_are_dropped() -> None:
    """Fourteen terms whose last two are zero become twelve; nonzero tilt and other counts are refused."""
    assert opencv_terms(HERE, [0.1] * 12 + [0.0, 0.0]) == [0.1] * 12
    with pytest.raises(DatasetError, match=r"a.yaml:1: k: the last two of 14 terms tilt the sensor"):
        opencv_terms(HERE, [0.1] * 14)
    with pytest.raises(DatasetError, match="has 6 distortion terms, expected 0 or 4 or 5 or 8 or 12 or 14"):
        opencv_terms(HERE, [0.1] * 6)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ([0, 0, 0, 0, 0, 0, 0, 0, 0], "the camera is not calibrated"),
        ([500, 0, 0, 0, 500, 0, 320, 240, 1], "is it transposed"),
        ([500, 1, 320, 0, 500, 240, 0, 0, 1], "a skew of 1 px"),
    ],
)
def test_invalid_camera_matrices_are_reported(matrix: list[float], message: str) -> None:
    """Zeros as in ROS for uncalibrated cameras, a transposed matrix, and a skew are errors."""
    with pytest.raises(DatasetError, match=message):
        matrix_parameters(HERE, [float(value) for value in matrix])


def test_camera_entry_of_lens() -> None:
    """The entry has model, size, status, focal lengths, centre and terms.

    An invalid lens is reported with its place.
    """
    camera = make_camera(HERE, "pinhole", [500, 501, 320, 240, 0.1, 0, 0, 0], (640, 480))
    assert camera_entry(camera, "fixed") == {
        "model": "pinhole",
        "size_px": [640, 480],
        "intrinsics": {"status": "fixed", "fx": 500, "fy": 501, "cx": 320, "cy": 240, "distortion": [0.1, 0, 0, 0]},
    }
    with pytest.raises(DatasetError, match=r"a.yaml:1: k: the focal lengths are -500"):
        make_camera(HERE, "pinhole", [-500, 500, 320, 240], None)


def test_existing_guess_is_kept(tmp_path: Path) -> None:
    """A free mount without a guess gets the file's."""
    guess = {"status": "free", "guess": {"t_m": [0.2, 0, 0], "q_xyzw": [0, 0, 0, 1]}}
    for mount, x in (({"status": "free"}, 0.5), (guess, 0.2)):
        cell_in(tmp_path, cameras={"wrist": {"on": "arm", "mount": mount}})
        moved = SE3(np.eye(3), np.array([0.5, 0, 0]))
        imported = lens_of_file(tmp_path, LENS, "a.yaml", None, None, "fixed", mount=moved)
        mean = import_into(tmp_path, imported).cameras["wrist"].mount.mean
        assert mean is not None
        assert mean.translation[0] == x


@pytest.mark.parametrize(("size", "is_other"), [((640, 480), False), ((640, 360), True), ((320, 480), True)])
def test_recorded_image_size_must_match_lens(tmp_path: Path, size: tuple[int, int], is_other: bool) -> None:
    """The first recorded image of the camera is compared."""
    cell_in(tmp_path, cameras={"wrist": {"on": "arm"}, "hall": {"on": "world"}})
    for name, pixels in (("wrist", size), ("hall", (8, 6))):
        (tmp_path / name).with_suffix(".png").write_bytes(cv2.imencode(".png", np.zeros(pixels[::-1], np.uint8))[1])
    samples = [Sample(0, images={"hall": "hall.png"}), Sample(1, images={"hall": "hall.png", "wrist": "wrist.png"})]
    append_samples(tmp_path, samples)
    if is_other:
        with pytest.raises(InputError, match=f"640 x 480 px, wrist.png has {size[0]} x {size[1]}: import the calib"):
            lens_of_file(tmp_path, LENS, "a.yaml", "wrist", None, "fixed")
    else:
        assert "wrist" in lens_of_file(tmp_path, LENS, "a.yaml", "wrist", None, "fixed").cell["cameras"]
