"""Tests of `basecal detect`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from basecal.cli import main
from basecal.vision.image_file import write_png
from vision_scenes import TARGETS, WIDE, at, scene

CELL = """
schema: basecal/cell/1
reference: eye
robots: {eye: {}, hand: {}}
cameras:
  wrist:
    {on: eye, size_px: [1280, 720], intrinsics: {status: fixed, fx: 766.5, fy: 765.4, cx: 640.9, cy: 358.8,
     distortion: [-0.35, 0.179, 0, 0, 0]}}
targets:
  board: {on: hand, kind: charuco, squares: [5, 7], square_m: 0.04, marker_m: 0.03, dictionary: DICT_4X4_50}
"""


def line(number: int, with_image: bool, with_pixels: bool) -> str:
    """Sample with an image, or with recorded pixels."""
    pose = {"base_from_flange": {"t_m": [0, 0, number], "q_xyzw": [0, 0, 0, 1]}}
    sample: dict[str, object] = {"sample": number, "robots": {"eye": pose, "hand": pose}}
    if with_image:
        sample["images"] = {"wrist": "images/0.png"}
    if with_pixels:
        pixels = WIDE.project(at(TARGETS["charuco"]) @ TARGETS["charuco"].points)
        seen = {"camera": "wrist", "target": "board", "ids": list(range(24)), "pixels": pixels.tolist()}
        sample["observations"] = [seen]
    return json.dumps(sample) + "\n"


@pytest.mark.parametrize(
    ("samples", "said", "code"),
    [
        ([(False, True)] * 3, "board by wrist, 3 views recorded without an image, 24.0 points each", 0),
        ([(True, False)] * 2, "board in 2 of 2 images of wrist, 24.0 points each", 0),
        (
            [(True, False), (False, True)],
            "board in 1 of 1 images of wrist, 1 view recorded without an image, 24.0 points each",
            0,
        ),
        ([(False, False)] * 2, "there are no images to search", 0),
    ],
)
def test_summary_counts_images_and_recorded_views(
    samples: list[tuple[bool, bool]], said: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Images count if a target is found in them; views recorded without an image are counted separately."""
    (tmp_path / "cell.yaml").write_text(CELL)
    write_png(tmp_path / "recording" / "images" / "0.png", scene(TARGETS["charuco"]))
    text = "".join(line(number, *kind) for number, kind in enumerate(samples))
    (tmp_path / "recording" / "samples.jsonl").write_text(text)
    assert main(["detect", str(tmp_path)]) == code
    first, *_, last = capsys.readouterr().out.splitlines()
    assert first == said
    assert last.startswith("next")


def test_recorded_points_and_poses_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording by other programs has no images to search, but views."""
    seen = {"camera": "wrist", "target": "board"}
    as_points = {**seen, "ids": [0, 1], "points_in_camera_m": [[0, 0, 1], [0.04, 0, 1]]}
    as_pose = {**seen, "camera_from_target": {"t_m": [0, 0, 1], "q_xyzw": [0, 0, 0, 1]}}
    (tmp_path / "cell.yaml").write_text(CELL)
    (tmp_path / "recording").mkdir()
    for view, expected in ((as_points, "2.0 points each"), (as_pose, "as poses")):
        samples = [{**json.loads(line(number, False, False)), "observations": [view]} for number in range(2)]
        (tmp_path / "recording" / "samples.jsonl").write_text("".join(f"{json.dumps(each)}\n" for each in samples))
        assert main(["detect", str(tmp_path)]) == 0
        first, *_ = capsys.readouterr().out.splitlines()
        assert first == f"board by wrist, 2 views recorded without an image, {expected}"


def test_board_in_millimetres_is_searched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The images are searched although `calibrate` would refuse the size without a search."""
    (tmp_path / "cell.yaml").write_text(CELL.replace("0.04", "40").replace("0.03", "30"))
    write_png(tmp_path / "recording" / "images" / "0.png", scene(TARGETS["charuco"]))
    (tmp_path / "recording" / "samples.jsonl").write_text(line(0, True, False))
    main(["detect", str(tmp_path)])
    assert "board in 1 of 1 images of wrist" in capsys.readouterr().out


def test_camera_without_a_lens_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message names the missing entry; a search that did not take place is no success."""
    (tmp_path / "cell.yaml").write_text(re.sub(r", intrinsics: \{[^}]*\}", "", CELL))
    write_png(tmp_path / "recording" / "images" / "0.png", scene(TARGETS["charuco"]))
    (tmp_path / "recording" / "samples.jsonl").write_text(line(0, True, False))
    assert main(["detect", str(tmp_path)]) == 1
    printed = capsys.readouterr().out
    assert "the lens of wrist: add `intrinsics: {status: free}`" in printed
    assert "nothing found" not in printed
