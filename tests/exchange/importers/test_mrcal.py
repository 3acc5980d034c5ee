"""Tests of `basecal import mrcal`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.importers.mrcal import read_cameramodel
from lens_texts import CAMERAMODEL, reads_lens

TEXT = """\
# generated on 2026-01-02 with ./calibrate
# --lensmodel LENSMODEL_OPENCV8
{
    'lensmodel':  'LENSMODEL_OPENCV8',

    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....
    'intrinsics': [ 1512.1, 1112.2, 500.3, 333.4, -0.012, 0.035, -0.001, 0.002, 0.019, 0.014, -0.056, 0.05,],

    'valid_intrinsics_region': [
    [ 10, 20 ],
    [ 900, 20 ],
],

    # extrinsics are rt_fromref
    'extrinsics': [ 0.02, -0.3, -0.01, 1, 2, -3,],

    'imagersize': [ 1000, 700,],

    'icam_intrinsics': 0,

    'optimization_inputs': b'P)h>@6aWAK2mt$eR#QJQ-Vy)',

}
"""
# For LENSMODEL_OPENCV4, 5 and 8, with the pixels of mrcal's own test-projections.py.
POINTS = np.array([[1.0, 2.0, 10.0], [-1.1, 0.3, 1.0], [-0.9, -1.5, 1.0]])


def test_lens_is_imported_into_new_cell(tmp_path: Path) -> None:
    """A camera of a new cell has the lens."""
    assert reads_lens(tmp_path, "mrcal", "a.cameramodel", CAMERAMODEL)


def test_free_status_and_unsupported_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--status free` leaves the lens to be estimated; a splined model is refused, and no cell is made."""
    assert reads_lens(tmp_path, "mrcal", "a.cameramodel", CAMERAMODEL, "--status", "free")
    intrinsics = read_cell(tmp_path / "c").cameras["wrist"].intrinsics
    assert intrinsics is not None
    assert intrinsics.status == "free"
    path = tmp_path / "s.cameramodel"
    path.write_text(CAMERAMODEL.replace("LENSMODEL_OPENCV4", "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=20"))
    assert main(["import", "mrcal", str(tmp_path / "d"), str(path), "--on", "left"]) == 3
    assert "LENSMODEL_SPLINED" in capsys.readouterr().err
    assert not (tmp_path / "d").exists()


def write(folder: Path, text: str) -> Path:
    path = folder / "camera-0.cameramodel"
    path.write_text(text, encoding="utf-8")
    return path


def test_cameramodel_is_read(tmp_path: Path) -> None:
    """Parameters are in OpenCV's order, with the size; the rig's pose is not read."""
    camera = read_cameramodel(write(tmp_path, TEXT)).camera
    assert (camera.model, camera.size_px) == ("pinhole", (1000, 700))
    np.testing.assert_array_equal(camera.parameters[:6], [1512.1, 1112.2, 500.3, 333.4, -0.012, 0.035])
    assert len(camera.distortion) == 8


@pytest.mark.parametrize(
    ("model", "terms", "expected"),
    [
        (4, "-0.012, 0.035, -0.001, 0.002", [651.27371, 555.23042]),
        (5, "-0.012, 0.035, -0.001, 0.002, 0.019", [651.2740691, 555.2309482]),
        (8, "-0.012, 0.035, -0.001, 0.002, 0.019, 0.014, -0.056, 0.050", [651.1885442, 555.10514968]),
    ],
)
def test_projections_match_mrcal(tmp_path: Path, model: int, terms: str, expected: list[float]) -> None:
    """The pixel of a point equals that of mrcal's own projection test, to its stated digits."""
    text = f"{{'lensmodel': 'LENSMODEL_OPENCV{model}', 'intrinsics': [1512., 1112, 500., 333., {terms}], "
    text += "'extrinsics': [0, 0, 0, 0, 0, 0], 'imagersize': [1000, 700]}"
    camera = read_cameramodel(write(tmp_path, text)).camera
    np.testing.assert_allclose(camera.project(POINTS[0]), expected, atol=1e-5)


def test_older_mrcal_names_are_read(tmp_path: Path) -> None:
    """Keys and models are read as mrcal wrote them before 2.0, which it still reads."""
    old = TEXT.replace("'lensmodel'", "'distortion_model'").replace("LENSMODEL_OPENCV8'", "DISTORTION_OPENCV8'")
    np.testing.assert_array_equal(
        read_cameramodel(write(tmp_path, old)).camera.parameters,
        read_cameramodel(write(tmp_path, TEXT)).camera.parameters,
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "'LENSMODEL_OPENCV8'",
            "'LENSMODEL_SPLINED_STEREOGRAPHIC_order=3'",
            ":4: lensmodel: .*is not supported.*convert-l",
        ),
        ("'LENSMODEL_OPENCV8'", "'LENSMODEL_OPENCV5'", ":7: intrinsics: has 12 numbers, expected 9"),
        ("[ 1000, 700,]", "[ 1000 ]", "imagersize: has 1 number, expected width and height"),
        ("'imagersize'", "'size'", "has no imagersize"),
        ("[ 1000, 700,]", "open('/etc/passwd')", "not a Python dictionary of plain values"),
        ("-0.012", "float('nan')", "not a Python dictionary of plain values"),
        ("-0.012", "1e999", "is inf, expected a number"),
        ("'imagersize'", "'lensmodel': 'LENSMODEL_OPENCV4', 'imagersize'", "lensmodel: is given twice: keep one"),
        ("'intrinsics': [", "'intrinsics': (", "not a Python dictionary of plain values"),
    ],
)
def test_invalid_cameramodels_are_reported(tmp_path: Path, old: str, new: str, message: str) -> None:
    """Unsupported models, truncated data, and expressions that compute values are errors."""
    assert old in TEXT
    with pytest.raises(DatasetError, match=message):
        read_cameramodel(write(tmp_path, TEXT.replace(old, new)))


@pytest.mark.parametrize("text", ["", "[1]", "(" * 5000, "-" * 100_000 + "1", "{**{}}", "{1: 2}", "\x00", "{'a': 1"])
def test_non_cameramodel_text_is_refused(tmp_path: Path, text: str) -> None:
    """Empty, too deeply nested, unpacked or truncated text is reported on one line."""
    with pytest.raises(DatasetError, match=r"camera-0.cameramodel"):
        read_cameramodel(write(tmp_path, text))
