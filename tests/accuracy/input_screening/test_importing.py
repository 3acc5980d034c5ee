"""Tests of `import_into`: read data becomes part of a cell unless it is implausible."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pytest

import basecal
from basecal.errors import InputError

TABLE = "x,y,z,rx,ry,rz\n" + "".join(f"0.4,0.{i},0.3,0,0.{i},0.{i}\n" for i in range(1, 4))


def table(folder: Path) -> Path:
    path = folder / "left.csv"
    path.write_text(TABLE)
    return path


def test_poses_and_images_become_cell(tmp_path: Path) -> None:
    """Poses of a robot, then images and their target, become a cell and its recording through public names alone."""
    cell, photos = tmp_path / "mycell", tmp_path / "photos"
    photos.mkdir()
    for i in range(3):
        cv2.imwrite(str(photos / f"{i}.png"), np.full((48, 64), 9, np.uint8))
    made = basecal.import_into(cell, basecal.read_poses(cell, table(tmp_path), robot="left", format="ur"))
    assert (made.is_new_cell, made.made, made.doubts) == (True, 3, ())
    shape = basecal.Shape(squares="5x7", square="40mm")
    images = basecal.read_images(cell, photos, camera="wrist", on="left", target="charuco", shape=shape)
    done = basecal.import_into(cell, images)
    assert (done.is_new_cell, done.made) == (False, 0)
    samples = basecal.read_recording(cell).samples
    assert [Path(sample.images["wrist"]).name for sample in samples] == ["0.png", "1.png", "2.png"]
    assert [round(float(s.robots["left"].base_from_flange.translation[1]), 6) for s in samples] == [0.1, 0.2, 0.3]
    described = basecal.read_cell(cell)
    assert (described.reference, described.cameras["wrist"].size_px) == ("left", (64, 48))
    assert described.targets["board"].target.options["squares"] == [5, 7]


def test_implausible_input_is_refused(tmp_path: Path) -> None:
    """Millimetres read as metres leave no files, and the message names the options to check."""
    path = tmp_path / "far.csv"
    path.write_text("x,y,z,rx,ry,rz\n" + "".join(f"400,{i},300,0,0,0.{i}\n" for i in range(3)))
    read = basecal.read_poses(tmp_path / "c", path, robot="left", format="ur")
    with pytest.raises(InputError, match=r"far.csv: flange of left 500 m: .* nothing is imported; check --length-unit"):
        basecal.import_into(tmp_path / "c", read)
    assert not (tmp_path / "c").exists()
    done = basecal.import_into(tmp_path / "c", replace(read, is_strict=False))
    assert "flange of left 500 m" in done.doubts[0]


@pytest.mark.parametrize(
    ("factor", "cure"),
    [
        (1000, "lines 5, 7 look like millimetres, divide their lengths by 1000;"),
        (39.37, "lines 5, 7 look like inches, divide their lengths by 39.37;"),
        (70, "another length unit\\? Correct lines 5, 7;"),
        (0.001, "another length unit\\? Correct lines 5, 7;"),
    ],
)
def test_rows_in_other_unit_are_named_by_line(tmp_path: Path, factor: float, cure: str) -> None:
    """Rows in millimetres or inches among metres, and the reverse, are named by file, line and both distances."""
    path = tmp_path / "left.csv"
    odd = {5, 7}
    rows = [f"{0.3 * (factor if line in odd else 1)},{0.4 * (factor if line in odd else 1)},0" for line in range(3, 12)]
    path.write_text("\nx,y,z,rx,ry,rz\n" + "".join(f"{row},0,0,0.{k}\n" for k, row in enumerate(rows)))
    read = basecal.read_poses(tmp_path / "c", path, robot="left", format="ur")
    pattern = rf"left.csv:5: flange of left {0.5 * factor:.3g} m from its base, 0.5 m in most rows: {cure}"
    with pytest.raises(InputError, match=pattern):
        basecal.import_into(tmp_path / "c", read)
    unnumbered = replace(read, is_strict=False, rows=tuple(replace(row, line=None) for row in read.rows))
    (doubt,) = basecal.import_into(tmp_path / "c", unnumbered).doubts
    assert "rows 3, 5" in doubt
    assert "nothing is imported" not in doubt


def test_scratch_folder_is_always_removed(tmp_path: Path) -> None:
    """The scratch folder is removed after an import, and after a refused one."""
    read = basecal.read_poses(tmp_path / "c", table(tmp_path), robot="left", format="ur")
    for expected in (False, True):  # the second import fails: the robot is already recorded
        scratch = TemporaryDirectory(dir=tmp_path)
        if expected:
            with pytest.raises(InputError):
                basecal.import_into(tmp_path / "c", replace(read, scratch=scratch))
        else:
            basecal.import_into(tmp_path / "c", replace(read, scratch=scratch))
        assert not Path(scratch.name).exists()


def test_preview_is_not_imported(tmp_path: Path) -> None:
    """A preview has no data to import and is refused."""
    read = basecal.read_poses(tmp_path / "c", table(tmp_path), robot="left", format="ur")
    with pytest.raises(InputError, match="only listed"):
        basecal.import_into(tmp_path / "c", replace(read, is_preview=True))
