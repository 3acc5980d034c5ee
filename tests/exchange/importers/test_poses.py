"""Tests of `basecal import poses --robot`: tables of two controllers become one recording."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main
from basecal.errors import UsageError
from basecal.exchange.controller_poses import PoseFormat
from basecal.exchange.controllers.registry import CONTROLLERS
from basecal.exchange.importers.poses import _robot_poses, table_format
from basecal.geometry import SE3

DRAWN = SE3.exp(np.random.default_rng(3).normal(0, 0.5, (4, 6)))


def table(path: Path, name: str, separator: str = ";", images: bool = False) -> str:
    how = CONTROLLERS[name]
    rows = [separator.join(f"{value:.12g}" for value in row) for row in how.to_numbers(DRAWN)]
    head = separator.join(how.names)
    if images:
        head, rows = f"image{separator}{head}", [f"IMG_{i}.png{separator}{row}" for i, row in enumerate(rows)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return str(path)


def test_tables_of_two_controllers_are_paired(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """UR's metres and KUKA's millimetres are paired in the same samples, and the units read are reported."""
    cell = str(tmp_path / "c")
    left, right = table(tmp_path / "left.csv", "ur"), table(tmp_path / "right.txt", "kuka", "\t")
    assert main(["import", "poses", cell, "--robot", "left", left, "--format", "ur", "--length-unit", "m"]) == 0
    assert (
        "4 poses left_base_from_left_flange as of ur (x, y, z, rx, ry, rz: m, rotation vec" in capsys.readouterr().out
    )
    assert main(["import", "poses", cell, "--robot", "right", right, "--format", "kuka"]) == 0
    message = capsys.readouterr().out
    assert "mm, angles about z, the new y, the new x in deg" in message
    assert "paired with 4 samples in order" in message
    assert (read_cell(cell).reference, list(read_cell(cell).robots)) == ("left", ["left", "right"])
    for i, sample in enumerate(read_recording(cell).samples):
        for state in sample.robots.values():
            assert state.base_from_flange is not None
            np.testing.assert_allclose(state.base_from_flange.matrix, DRAWN[i].matrix, atol=1e-9)


def test_self_describing_formats_need_no_name(tmp_path: Path) -> None:
    """A header of quaternions, and matrices, need no --format."""
    ros = table(tmp_path / "a.csv", "ros", ",")
    np.savetxt(tmp_path / "b.txt", DRAWN.matrix.reshape(-1, 4))
    assert main(["import", "poses", str(tmp_path / "c"), "--robot", "a", ros]) == 0
    assert main(["import", "poses", str(tmp_path / "c"), "--robot", "b", str(tmp_path / "b.txt")]) == 0
    sample = read_recording(tmp_path / "c").samples[3]
    for state in sample.robots.values():
        assert state.base_from_flange is not None
        np.testing.assert_allclose(state.base_from_flange.matrix, DRAWN[3].matrix, atol=1e-9)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--format", "ur"], 2, "--robot is missing"),
        (["--robot", "left", "--format", "urr"], 2, "did you mean 'ur'"),
        (["--robot", "left", "--format", "ur", "--deg", "--rad"], 2, "--deg and --rad exclude each other"),
        (["--robot", "left"], 3, "give --format"),
        (["--robot", "left", "--format", "ur", "--length-unit", "mm"], 3, "nothing is imported; check --length-unit"),
        (["--robot", "left", "--format", "kuka"], 3, "these columns suit --format ur"),
        (["--robot", "Left", "--format", "ur"], 3, "expected a name of a-z"),
    ],
)
def test_invalid_pose_imports_create_no_cell(
    tmp_path: Path, words: list[str], code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The error is one line with a remedy, and no cell is created."""
    path = table(tmp_path / "left.csv", "ur")
    assert main(["import", "poses", str(tmp_path / "c"), path, *words]) == code
    stderr = capsys.readouterr().err
    assert message in stderr
    assert stderr.count("\n") == 1
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (["FILE", "--robot", "arm", "--camera-from-target", "b.txt"], "--camera-from-target"),
        (["FILE", "--robot", "arm", "--camera", "wrist"], "--camera"),
        (["FILE", "--camera", "wrist", "--target", "tag", "--base-frame", "BASE_3"], "--base-frame"),
        (["FILE", "--camera", "wrist", "--target", "tag", "--still"], "--still"),
        (["--camera-from-target", "b.txt", "--length-unit", "mm", "--format", "ur"], "--format"),
    ],
)
def test_options_without_effect_are_refused(
    tmp_path: Path, words: list[str], option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """An option, or a file, that the kind of import would ignore is a usage error."""
    file = table(tmp_path / "a.csv", "ros")
    given = [file if word == "FILE" else word for word in words]
    assert main(["import", "poses", str(tmp_path / "c"), *given]) == 2
    assert f"{option} has no effect on " in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_pose_program_needs_stated_format(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Six numbers are not a matrix, so the error names the formats."""
    (tmp_path / "left.script").write_text("p[0.1, 0.2, 0.3, 0, 0, 1.5]\n")
    words = ["import", "poses", str(tmp_path / "c"), str(tmp_path / "left.script"), "--robot", "left"]
    assert main(words) == 3
    assert "does not state its format: give --format ur, kuka" in capsys.readouterr().err


def test_repeated_robot_import_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A second import of the same robot, and one with another count, change no files."""
    cell, path = str(tmp_path / "c"), table(tmp_path / "left.csv", "ur")
    assert main(["import", "poses", cell, "--robot", "left", path, "--format", "ur"]) == 0
    before = (tmp_path / "c" / "recording" / "samples.jsonl").read_bytes()
    assert main(["import", "poses", cell, "--robot", "left", path, "--format", "ur"]) == 3
    assert "robot 'left' is recorded already: add --session" in capsys.readouterr().err
    short = tmp_path / "short.csv"
    short.write_text("\n".join(Path(path).read_text().splitlines()[:3]) + "\n")
    assert main(["import", "poses", cell, "--robot", "right", str(short), "--format", "ur"]) == 3
    assert "short.csv holds 2, the recording has 4 samples" in capsys.readouterr().err
    assert (tmp_path / "c" / "recording" / "samples.jsonl").read_bytes() == before
    assert list(read_cell(cell).robots) == ["left"]


def test_inverted_base_poses_are_imported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--invert inverts the poses and this is reported; the option of another file is a usage error."""
    cell, file = str(tmp_path / "c"), table(tmp_path / "a.csv", "ros")
    words = ["import", "poses", cell, "--robot", "arm", file, "--invert"]
    assert main([*words, "camera-from-target"]) == 2
    assert "here it is base-from-flange" in capsys.readouterr().err
    assert main([*words, "base-from-flange"]) == 0
    assert "4 poses arm_flange_from_arm_base, inverted, as of ros" in capsys.readouterr().out
    state = read_recording(cell).samples[2].robots["arm"]
    assert state.base_from_flange is not None
    np.testing.assert_allclose(state.base_from_flange.matrix, np.linalg.inv(DRAWN[2].matrix), atol=1e-9)


@pytest.mark.parametrize(
    ("deg", "rad", "angle_rad"), [(False, False, None), (True, False, math.radians(1)), (False, True, 1.0)]
)
def test_stated_units_define_reading(deg: bool, rad: bool, angle_rad: float | None) -> None:
    """At most one of the two angle units is accepted. Lengths are converted to metres, and format names ignore case."""
    pose_format = table_format("a.csv", "KUKA", "inch" if deg else None, deg, rad)
    assert (pose_format.name, pose_format.length_m, pose_format.angle_rad) == (
        "kuka",
        0.0254 if deg else None,
        angle_rad,
    )
    with pytest.raises(UsageError, match="--deg and --rad exclude each other"):
        table_format("a.csv", "kuka", None, True, True)
    with pytest.raises(UsageError, match=r"--format no 'kuca' \(did you mean 'kuka'\?\)"):
        table_format("a.csv", "kuca", None, deg, rad)


@pytest.mark.parametrize("frames", [{}, {"base": "BASE_3", "flange": None}, {"base": None, "flange": "TOOL_1"}])
def test_stated_frames_replace_those_of_cell(tmp_path: Path, frames: dict[str, str | None]) -> None:
    """Only the stated frames are written; without any, the cell's are kept."""
    (tmp_path / "a.csv").write_text("0.1,0.2,0.3,0,0,0\n")
    found = _robot_poses("arm", str(tmp_path / "a.csv"), PoseFormat("ur"), False, (), frames)
    stated = {name: frame for name, frame in frames.items() if frame}
    assert found.cell == {"robots": {"arm": {"controller": {"format": "ur", **stated}}}}
    place = frozenset({("robots", "arm", "controller")})
    assert (found.replaced, found.defaults) == ((place, frozenset()) if stated else (frozenset(), place))
    assert not found.is_stream
    assert found.what.startswith("1 pose arm_base_from_arm_flange as of ur")
    turned = _robot_poses("arm", str(tmp_path / "a.csv"), PoseFormat("ur"), False, ("base-from-flange",), frames)
    assert turned.what.startswith("1 pose arm_flange_from_arm_base, inverted, as of ur")
    assert turned.rows[0].robots["arm"].base_from_flange.translation.tolist() == [-0.1, -0.2, -0.3]
