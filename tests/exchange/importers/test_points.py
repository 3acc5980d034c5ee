"""Tests of `basecal import points`, a tracker's measurements of reflectors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import latest_run, read_calibration, read_cell
from basecal.cell.format.yaml_text import yaml_text
from basecal.cli import main
from basecal.errors import DatasetError, UsageError
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importers.points import PointTable, read_points
from basecal.geometry import SE3

TRACKER = SE3.from_rpy((0.3, -0.2, 1.0), (3.0, 1.0, 0.5))
INCH_M = 0.0254


def write_measurements(folder: Path, unit_m: float, heading: str) -> tuple[str, str]:
    """Write files of poses, and of a tracker's measurements of two reflectors at each of them."""
    rng = np.random.default_rng(1)
    poses = SE3.from_rotvec(rng.normal(0, 0.7, (15, 3)), np.array([0.4, 0.0, 0.5]) + rng.uniform(-0.4, 0.4, (15, 3)))
    rows = CONTROLLERS["ur"].to_numbers(poses)
    (folder / "arm.csv").write_text("x,y,z,rx,ry,rz\n" + "".join(",".join(map(str, row)) + "\n" for row in rows))
    lines = [heading]
    for k in range(len(poses)):
        for name, place in (("top", [0.05, 0.0, 0.1]), ("side", [0.0, 0.1, 0.02])):
            point = TRACKER.inverse() @ (poses[k] @ np.array(place)) + 2e-5 * rng.standard_normal(3)
            lines.append(f"{name},{k}," + ",".join(f"{value / unit_m:.8f}" for value in point))
    (folder / "points.csv").write_text("\n".join(lines) + "\n")
    return str(folder / "arm.csv"), str(folder / "points.csv")


@pytest.mark.journey
@pytest.mark.parametrize(
    ("unit_m", "heading"),
    [(INCH_M, "reflector,sample,x_inch,y_inch,z_inch"), (1e-3, "target,sample,x [mm],y [mm],z [mm]")],
)
def test_tracker_pose_is_calibrated(tmp_path: Path, unit_m: float, heading: str) -> None:
    """Poses, then points in the unit of their header, give the tracker's true pose and a good verdict."""
    arm, points = write_measurements(tmp_path, unit_m, heading)
    cell = str(tmp_path / "c")
    assert main(["import", "poses", cell, "--robot", "arm", arm, "--format", "ur"]) == 0
    assert main(["import", "points", cell, points, "--camera", "tracker", "--robot", "arm"]) == 0
    assert main(["calibrate", cell]) == 0
    run = latest_run(cell)
    assert run is not None
    found = read_calibration(run)["arm_base_from_tracker"]
    off = (found.mean.inverse() @ TRACKER).log()
    assert np.all(np.abs(off) < 5 * np.sqrt(np.diag(found.covariance)))
    assert read_cell(cell).cameras["tracker"].kind == "tracker"


@pytest.mark.parametrize(
    ("heading", "more", "code", "words"),
    [
        ("reflector,sample,x,y,z", [], 3, "have no unit: give --length-unit"),
        ("reflector,sample,x_mm,y_mm,z_mm", ["--length-unit", "m"], 3, "several units"),
        ("a,sample,x_mm,y_mm,z_mm", [], 2, "name the measured reflector"),
        ("reflector,number,x_mm,q,z_mm", [], 3, "expected a header with x, y, z"),
    ],
)
def test_units_and_reflector_names_are_required(tmp_path, capsys, heading, more, code, words) -> None:
    """Neither is guessed, and no files are written."""
    _, points = write_measurements(tmp_path, 1e-3, heading)
    cell = str(tmp_path / "c")
    assert main(["import", "points", cell, points, "--camera", "tracker", "--robot", "arm", *more]) == code
    assert words in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("heading", "length_m", "size", "unit"),
    [
        ("x_mm y_mm z_mm", None, 1e-3, "mm"),
        ("x_in y_in z_in", None, 0.0254, "in"),
        ("X Y Z", 1.0, 1.0, "1000 mm"),
    ],
)
def test_length_unit_of_header_or_option(tmp_path, heading, length_m, size, unit):
    """Lengths are in the unit of the column names, or in the stated one."""
    (tmp_path / "a.txt").write_text(f"{heading}\n1 2 3\n4 5 6\n")
    table = PointTable.read(str(tmp_path / "a.txt"), length_m)
    assert table.unit == unit
    assert table.points_m.ravel().tolist() == pytest.approx([size * k for k in (1, 2, 3, 4, 5, 6)])


def test_mixed_length_units_are_refused(tmp_path):
    """The unit is not guessed from mixed ones."""
    (tmp_path / "a.txt").write_text("x_mm y_mm z_m\n1 2 3\n")
    with pytest.raises(DatasetError, match="several units"):
        PointTable.read(str(tmp_path / "a.txt"), None)


@pytest.mark.parametrize("header", ["x_mm y_mm z_mm x_in", "X_mm Y_mm Z_mm x_mm", "x_mm y_mm z_mm x_mm"])
def test_duplicate_coordinate_columns_are_refused(tmp_path: Path, header: str) -> None:
    """Duplicate columns, such as a nominal and a measured one, are refused. Before, the last one was read."""
    (tmp_path / "a.txt").write_text(f"{header}\n1 2 3 4\n")
    with pytest.raises(DatasetError, match=r"has two columns of one coordinate, [xX]_mm, x_(in|mm): keep one"):
        PointTable.read(str(tmp_path / "a.txt"), None)


@pytest.mark.parametrize(("column", "numbers", "joined"), [
    ("sample", "0 0 3 1", [[0, 1], [2], [3]]), ("stamp_s", "2.5 2.5 3 1", [[0, 1], [2], [3]]),
    ("note", "0 0 3 1", [[0], [1], [2], [3]]),
])  # fmt: skip
def test_rows_of_one_sample_are_joined(tmp_path: Path, column: str, numbers: str, joined: list[list[int]]) -> None:
    """Rows with equal number or time are joined; without such a column each row is its own sample."""
    rows = "".join(f"mark_{k},{number},{k},0,0\n" for k, number in enumerate(numbers.split()))
    (tmp_path / "points.csv").write_text(f"target,{column},x_m,y_m,z_m\n{rows}")
    found = read_points(tmp_path / "c", tmp_path / "points.csv", camera="tracker", robot="arm").rows
    assert [[seen.points_in_camera[0, 0] for seen in row.observations] for row in found] == joined


def table_of(folder: Path, text: str) -> Path:
    (folder / "points.csv").write_text(text)
    return folder / "points.csv"


def test_existing_reflectors_and_trackers_are_kept(tmp_path: Path) -> None:
    """Unknown reflectors are added on the robot and an unknown instrument on the world; known ones need no robot."""
    words = {"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": {}}}
    there = {"cameras": {"laser": {"kind": "tracker", "on": "world"}}, "targets": {"top": {"on": "arm"}}}
    (tmp_path / "cell.yaml").write_text(yaml_text({**words, **there}))
    file = table_of(tmp_path, "target,x_m,y_m,z_m\ntop,1,2,3\nside,1,2,3\n")
    both = read_points(tmp_path, file, camera="laser", robot="arm").cell
    assert both == {"targets": {"side": {"on": "arm", "kind": "points", "points_m": [[0, 0, 0]]}}}
    with pytest.raises(UsageError, match=r"--robot is missing: give the carrier of side$"):
        read_points(tmp_path, file, camera="laser")
    known = table_of(tmp_path, "x_m,y_m,z_m\n1,2,3\n")
    found = read_points(tmp_path, known, camera="other", target="top")
    assert found.cell == {"targets": {}, "cameras": {"other": {"kind": "tracker", "on": "world"}}}
    assert found.what == "1 point of top in other, m"


@pytest.mark.parametrize("sigma_m", [None, 2e-5])
def test_point_sigma_applies_to_every_point(tmp_path: Path, sigma_m: float | None) -> None:
    """The sigma applies to every point if given, and is otherwise estimated."""
    file = table_of(tmp_path, "x_m,y_m,z_m\n1,2,3\n4,5,6\n")
    rows = read_points(tmp_path / "c", file, camera="laser", target="top", robot="arm", sigma_m=sigma_m).rows
    sigmas = [None if seen.sigma_m is None else seen.sigma_m.tolist() for row in rows for seen in row.observations]
    assert sigmas == [None if sigma_m is None else [sigma_m]] * 2


@pytest.mark.parametrize(("text", "target"), [("target,x_m,y_m,z_m\na,1,2,3\n", "b"), ("x_m,y_m,z_m\n1,2,3\n", None)])
def test_reflector_is_named_by_option_or_column(tmp_path: Path, text: str, target: str | None) -> None:
    """Exactly one of the option and the column must name the reflectors."""
    with pytest.raises(UsageError, match="name the measured reflector with either --target or a column"):
        read_points(tmp_path / "c", table_of(tmp_path, text), camera="laser", target=target, robot="arm")


def test_sample_with_repeated_reflector_is_refused(tmp_path: Path) -> None:
    """Two points of one reflector in a sample are an error; other reflectors and other samples are accepted."""
    file = table_of(tmp_path, "target,sample,x_m,y_m,z_m\na,0,1,2,3\nb,0,1,2,3\na,1,1,2,3\n")
    assert len(read_points(tmp_path / "c", file, camera="laser", robot="arm").rows) == 2
    file = table_of(tmp_path, "target,sample,x_m,y_m,z_m\na,0,1,2,3\nb,0,1,2,3\na,0,1,2,3\n")
    with pytest.raises(DatasetError, match="twice"):
        read_points(tmp_path / "c", file, camera="laser", robot="arm")
