"""Table of mistakes, with the expected finding and advice of each."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from basecal.geometry import SE3
from mistakes import changes
from mistakes.cells import images, lines_of, samples_file, write_lines
from mistakes.changes import Change, each_image, each_line, each_pose, in_cell, in_line, in_text

UNREADABLE = "unreadable"
USAGE = "usage"


@dataclass(frozen=True)
class Mistake:
    """A mistake and what is to be said of it.

    Attributes:
        name: What was done.
        cell: To which of `cells.CELLS`.
        change: How.
        code: The finding that comes first; or that a file is unreadable, or the command line wrong.
        says: Words of the first sentence: what it is, and the fix.
        words: Of the command; `calibrate CELL` where none.
    """

    name: str
    cell: str
    change: Change
    code: str
    says: tuple[str, ...]
    words: Callable[[Path], list[str]] = lambda folder: ["calibrate", str(folder)]


def _with(*words: str) -> Callable[[Path], list[str]]:
    return lambda folder: ["calibrate", str(folder), *words]


def _nothing(folder: Path) -> None:
    pass


DEGREES = 180 / math.pi

_UNITS = [
    Mistake(
        "a robot's joints in degrees",
        "joints",
        changes.joints_times(DEGREES, "hand"),
        "angle-unit",
        ("joints of hand", "in degrees", "radians"),
    ),
    Mistake(
        "all joints in degrees",
        "joints",
        changes.joints_times(DEGREES, "eye", "hand"),
        "angle-unit",
        ("joints of eye and hand", "in degrees", "radians"),
    ),
    Mistake(
        "joints turned into radians twice",
        "joints",
        changes.joints_times(1 / DEGREES, "hand"),
        "angle-unit",
        ("hand", "radians"),
    ),
    Mistake(
        "all joints turned into radians twice",
        "joints",
        changes.joints_times(1 / DEGREES, "eye", "hand"),
        "angle-unit",
        ("eye and hand", "radians"),
    ),
    Mistake(
        "rotation vectors in degrees",
        "board",
        each_pose("hand", of=changes.as_rotvec(DEGREES)),
        UNREADABLE,
        ("rotvec_rad", "degrees", "radians"),
    ),
    Mistake(
        "rotation vectors of all in degrees",
        "board",
        each_pose("eye", "hand", of=changes.as_rotvec(DEGREES)),
        UNREADABLE,
        ("rotvec_rad", "degrees", "radians"),
    ),
    Mistake(
        "roll, pitch and yaw in radians",
        "board",
        each_pose("hand", of=changes.as_rpy(1 / DEGREES)),
        "angle-unit",
        ("hand", "rpy_deg", "radians", "degrees"),
    ),
    Mistake(
        "roll, pitch and yaw of all in radians",
        "board",
        each_pose("eye", "hand", of=changes.as_rpy(1 / DEGREES)),
        "angle-unit",
        ("eye and hand", "rpy_deg", "radians", "degrees"),
    ),
    Mistake(
        "one robot in mm",
        "board",
        each_pose("hand", of=changes.scale(1000)),
        "length-unit",
        ("hand", "millimetres", "divide"),
    ),
    Mistake(
        "all robots in mm",
        "board",
        each_pose("eye", "hand", of=changes.scale(1000)),
        "length-unit",
        ("eye and hand", "millimetres", "divide"),
    ),
    Mistake(
        "a robot 1000 times too small",
        "board",
        each_pose("eye", of=changes.scale(1e-3)),
        "length-unit",
        ("eye", "too small", "multiply"),
    ),
    Mistake(
        "observed poses in mm",
        "poses",
        each_pose(changes.SEEN, of=changes.scale(1000)),
        "length-unit",
        ("observed poses", "millimetres", "divide"),
    ),
    Mistake(
        "a board in mm",
        "board",
        in_cell(lambda c: c["targets"]["board"].update(square_m=30.0, marker_m=22.0)),
        "board-size",
        ("board", "millimetres", "divide"),
    ),
    Mistake(
        "another square",
        "board",
        in_cell(lambda c: c["targets"]["board"].update(square_m=0.033, marker_m=0.0242)),
        "board-size",
        ("board", "0.909", "square_m would be"),
    ),
]

_ROTATIONS = [
    Mistake("4x4 by columns", "board", each_pose("hand", of=changes.transpose), UNREADABLE, ("transposed", "by rows")),
    Mistake(
        "rotations by columns",
        "board",
        each_pose("hand", of=changes.transpose_rotation),
        "matrix-transposed",
        ("hand", "transposed", "by rows"),
    ),
    Mistake(
        "rotations of both by columns",
        "board",
        each_pose("eye", "hand", of=changes.transpose_rotation),
        "matrix-transposed",
        ("eye and hand", "transposed", "by rows"),
    ),
    Mistake(
        "KUKA's A, B, C read as roll, pitch, yaw",
        "board",
        each_pose("hand", of=changes.relist("ZYX", "xyz")),
        "euler-order",
        ("hand", "KUKA"),
    ),
    Mistake(
        "rotation vectors read as roll, pitch, yaw",
        "board",
        each_pose("hand", of=changes.relist("", "xyz")),
        "euler-order",
        ("hand", "rotation vector", "Universal Robots"),
    ),
    Mistake(
        "roll, pitch, yaw read as a rotation vector",
        "board",
        each_pose("hand", of=changes.relist("xyz", "")),
        "euler-order",
        ("hand", "roll, pitch, yaw"),
    ),
    Mistake(
        "moving axes read as fixed",
        "board",
        each_pose("eye", "hand", of=changes.relist("XYZ", "xyz")),
        "euler-order",
        ("eye and hand", "moving axes x, y, z"),
    ),
    Mistake(
        "quaternions w first",
        "board",
        each_pose("hand", of=changes.wxyz),
        "quaternion-order",
        ("hand", "w, x, y, z", "x, y, z, w"),
    ),
    Mistake(
        "quaternions of all w first",
        "board",
        each_pose("eye", "hand", of=changes.wxyz),
        "quaternion-order",
        ("eye and hand", "w, x, y, z", "x, y, z, w"),
    ),
    Mistake(
        "observed quaternions w first",
        "poses",
        each_pose(changes.SEEN, of=changes.wxyz),
        "quaternion-order",
        ("observed poses", "x, y, z, w"),
    ),
    Mistake(
        "a quaternion that is none",
        "board",
        each_pose("hand", of=lambda pose: pose.update(q_xyzw=[0.9, 0.1, 0.2, 0.9])),
        UNREADABLE,
        ("q_xyzw", "norm", "x, y, z, w"),
    ),
]

_DIRECTIONS = [
    Mistake(
        "a robot inverted",
        "board",
        each_pose("hand", of=changes.invert),
        "robot-pose-inverted",
        ("hand", "flange_from_base", "invert"),
    ),
    Mistake(
        "both robots inverted",
        "board",
        each_pose("eye", "hand", of=changes.invert),
        "robot-pose-inverted",
        ("eye and hand", "flange_from_base", "invert"),
    ),
    Mistake(
        "observed poses inverted",
        "one robot poses",
        each_pose(changes.SEEN, of=changes.invert),
        "target-pose-inverted",
        ("target_from_camera", "invert"),
    ),
    Mistake(
        "a stated mount inverted",
        "stated mount",
        in_cell(lambda c: _inverted(c["cameras"]["wrist"]["mount"])),
        "transform-inverted",
        ("eye_flange_from_wrist", "inverted", "invert"),
    ),
    Mistake(
        "flange and base link exchanged",
        "joints",
        in_text("base_link: base_link, flange_link: tool0", "base_link: tool0, flange_link: base_link"),
        UNREADABLE,
        ("base_link", "flange_link", "exchange"),
    ),
    Mistake("robots exchanged", "board", each_line(changes.exchanged), "robots-swapped", ("eye and hand", "exchange")),
    Mistake(
        "the target on the wrong robot",
        "board",
        in_cell(lambda c: c["targets"]["board"].update(on="eye")),
        UNREADABLE,
        ("'board'", "both on 'eye'", "on: hand?"),
    ),
    Mistake(
        "the camera on the wrong robot",
        "board",
        in_cell(lambda c: c["cameras"]["wrist"].update(on="hand")),
        UNREADABLE,
        ("'wrist'", "both on 'hand'", "on: eye?"),
    ),
    Mistake(
        "camera and target exchanged",
        "board",
        in_cell(lambda c: (c["cameras"]["wrist"].update(on="hand"), c["targets"]["board"].update(on="eye"))),
        "robots-swapped",
        ("eye and hand", "exchange", "`on`"),
    ),
]


def _inverted(mount: dict[str, object]) -> None:
    known = SE3.from_quaternion(mount["q_xyzw"], mount["t_m"]).inverse()
    mount.update(t_m=known.translation.tolist(), q_xyzw=known.quaternion.tolist())


def _rolled(folder: Path) -> None:
    lines = lines_of(folder)
    for line, other in zip(lines, [line["observations"] for line in lines][::-1], strict=True):
        line["observations"] = other
    write_lines(folder, lines)


def _same_view_elsewhere(lines: list[dict[str, object]]) -> list[dict[str, object]]:
    for one, other in ((2, 9), (4, 11)):
        lines[other]["observations"] = lines[one]["observations"]
    return lines


def _copied_rows(lines: list[dict[str, object]]) -> list[dict[str, object]]:
    return [*lines, *({**line, "sample": 100 + number} for number, line in enumerate(lines[:3]))]


def _same_images(folder: Path) -> None:
    shown = images(folder)
    for one, other in ((0, 4), (1, 6)):
        shown[other].write_bytes(shown[one].read_bytes())


_PAIRS = [
    Mistake(
        "views one sample late",
        "board",
        changes.paired_late(1),
        "pairing-shifted",
        ("cameras saw", "1 sample earlier", "pair"),
    ),
    Mistake(
        "a robot one sample late",
        "board",
        changes.paired_late(1, "hand"),
        "pairing-shifted",
        ("hand", "1 sample", "pair"),
    ),
    Mistake("views in reverse", "board", _rolled, "pairing-shifted", ("reverse order", "reverse its order")),
    Mistake(
        "a view twice under other poses",
        "board",
        changes.all_lines(_same_view_elsewhere),
        "repeated-view",
        ("samples 2 and 9", "samples 4 and 11", "different robot poses"),
    ),
    Mistake(
        "an image twice under other poses",
        "pictures",
        _same_images,
        "repeated-view",
        ("samples 0 and 4", "samples 1 and 6", "different robot poses"),
    ),
    Mistake(
        "rows copied",
        "board",
        changes.all_lines(_copied_rows),
        "duplicate-samples",
        ("sample 100, 101, 102", "counts once"),
    ),
    Mistake(
        "a number twice",
        "board",
        changes.all_lines(lambda lines: [*lines, lines[3]]),
        "dropped-sample",
        ("sample 3", "line 4", "number"),
    ),
    Mistake(
        "all poses equal",
        "board",
        changes.all_lines(lambda lines: [{**line, "robots": lines[0]["robots"]} for line in lines]),
        "too-few-samples",
        ("eye never moves", "hand never moves", "every arm in different orientations"),
    ),
]


def _all_endings(folder: Path) -> None:
    text = samples_file(folder).read_text()
    samples_file(folder).write_text(text.replace(".png", ".jpg"))


def _smaller(image: np.ndarray) -> np.ndarray:
    return cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)


def _blurred(image: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(image, (0, 0), 9)


def _board(**other: object) -> Change:
    return in_cell(lambda c: c["targets"]["board"].update(other))


_IMAGES = [
    Mistake(
        "another dictionary",
        "pictures",
        _board(dictionary="DICT_4X4_50"),
        "few-images",
        ("DICT_5X5_50", "DICT_4X4_50", "dictionary:"),
    ),
    Mistake(
        "columns and rows exchanged",
        "pictures",
        _board(squares=[8, 6]),
        "few-images",
        ("6x8", "8x6", "squares: [6, 8]"),
    ),
    Mistake(
        "another size of board",
        "pictures",
        _board(squares=[4, 5]),
        "few-images",
        ("6x8 squares", "not 4x5", "write `squares: [6, 8]`"),
    ),
    Mistake(
        "another kind of target",
        "pictures",
        in_cell(lambda c: _chessboard(c["targets"]["board"])),
        "few-images",
        ("charuco", "kind:"),
    ),
    Mistake(
        "images of another size",
        "pictures",
        each_image(_smaller),
        "few-images",
        ("320 x 240", "640 x 480", "size_px"),
    ),
    Mistake(
        "some images of another size",
        "pictures",
        each_image(_smaller, every=4),
        "dropped-sample",
        ("2 of 8", "320 x 240", "640 x 480"),
    ),
    Mistake("blurred images", "pictures", each_image(_blurred), "few-images", ("blurred", "focus")),
    Mistake("dark images", "pictures", each_image(lambda image: image // 250), "few-images", ("dark", "more light")),
    Mistake("another ending of all images", "pictures", _all_endings, "few-images", ("did you mean .png?",)),
    Mistake(
        "no folder of images",
        "pictures",
        lambda folder: (folder / "recording" / "images").rename(folder / "pictures"),
        "few-images",
        ("8 of 8", "missing", "images/wrist"),
    ),
    Mistake(
        "one image missing",
        "pictures",
        lambda folder: images(folder)[3].unlink(),
        "dropped-sample",
        ("000003.png", "missing"),
    ),
    Mistake(
        "an image that is none",
        "pictures",
        lambda folder: images(folder)[3].write_bytes(b"<html>"),
        "dropped-sample",
        ("000003.png", "not an image"),
    ),
    Mistake(
        "an image's path outside",
        "pictures",
        in_line(2, "images/wrist", "/home/me/wrist"),
        UNREADABLE,
        ("samples.jsonl:3", "relative path"),
    ),
    Mistake(
        "an image's path of Windows",
        "pictures",
        in_line(2, "images/wrist/", r"images\\wrist\\"),
        UNREADABLE,
        ("samples.jsonl:3", "forward slashes"),
    ),
    Mistake(
        "camera matrix of another resolution",
        "board",
        in_cell(lambda c: _halved(c["cameras"]["wrist"]["intrinsics"])),
        "intrinsics",
        ("wrist", "looks like that of images of about", "1280 x 720"),
    ),
    Mistake(
        "lens and size of another resolution",
        "board",
        in_cell(
            lambda c: (_halved(c["cameras"]["wrist"]["intrinsics"]), c["cameras"]["wrist"].update(size_px=[640, 360]))
        ),
        UNREADABLE,
        ("size_px", "resolution"),
    ),
    Mistake(
        "u and v exchanged",
        "board",
        changes.each_pixel(lambda p: p[:, ::-1]),
        "pixels-swapped",
        ("u and v", "exchange"),
    ),
    Mistake(
        "u and v exchanged, no size known",
        "board",
        lambda folder: (
            changes.each_pixel(lambda p: p[:, ::-1])(folder),
            in_cell(lambda c: c["cameras"]["wrist"].pop("size_px"))(folder),
        ),
        "pixels-swapped",
        ("u and v", "exchange"),
    ),
    Mistake(
        "ids from 1",
        "board",
        each_line(lambda line: [seen.update(ids=[i + 1 for i in seen["ids"]]) for seen in line["observations"]]),
        "dropped-sample",
        ("ids", "count from 0"),
    ),
    Mistake("a marker larger than its square", "board", _board(marker_m=0.04), UNREADABLE, ("marker_m", "square_m")),
]


def _chessboard(target: dict[str, object]) -> None:
    for name in ("squares", "marker_m", "dictionary", "legacy_pattern"):
        target.pop(name)
    target.update(kind="chessboard", corners=[5, 7])


def _halved(lens: dict[str, object]) -> None:
    for name in ("fx", "fy", "cx", "cy"):
        lens[name] = lens[name] / 2


def _same_key(folder: Path) -> None:
    in_text("cameras:\n", "robots:\n  third: {}\ncameras:\n")(folder)


_FILES = [
    Mistake(
        "tabs in YAML", "board", in_text("    on: eye", "\ton: eye"), UNREADABLE, ("cell.yaml:10", "tab", "spaces")
    ),
    Mistake(
        "a colon without a space",
        "board",
        in_text("on: eye", "on:eye"),
        UNREADABLE,
        ("cell.yaml:", "space after the colon"),
    ),
    Mistake(
        "a bracket left open", "board", in_text("[1280, 720]", "[1280, 720"), UNREADABLE, ("cell.yaml:", "bracket")
    ),
    Mistake(
        "indentation",
        "board",
        in_text("    mount: {status: free}", "   mount: {status: free}"),
        UNREADABLE,
        ("cell.yaml:11", "indent"),
    ),
    Mistake(
        "a quote left open", "board", in_text("model: pinhole", 'model: "pinhole'), UNREADABLE, ("cell.yaml:", "quote")
    ),
    Mistake(
        "a key misspelt", "board", in_text("square_m", "sqare_m"), UNREADABLE, ("sqare_m", "did you mean 'square_m'?")
    ),
    Mistake(
        "a kind misspelt", "board", in_text("kind: charuco", "kind: charucoo"), UNREADABLE, ("did you mean 'charuco'?",)
    ),
    Mistake(
        "a dictionary misspelt",
        "board",
        in_text("DICT_4X4_50", "DICT_4x4_50"),
        UNREADABLE,
        ("did you mean 'DICT_4X4_50'?",),
    ),
    Mistake(
        "a robot that is not there", "board", in_text("on: hand", "on: hnad"), UNREADABLE, ("did you mean 'hand'?",)
    ),
    Mistake("a section twice", "board", _same_key, UNREADABLE, ("robots", "given twice", "keep one")),
    Mistake("a name twice", "board", in_text("  board:\n", "  wrist:\n"), UNREADABLE, ("'wrist'", "taken", "unique")),
    Mistake(
        "NaN in the cell",
        "board",
        in_text("square_m: 0.03", "square_m: .nan"),
        UNREADABLE,
        ("square_m", "finite number"),
    ),
    Mistake(
        "a decimal comma in the cell",
        "board",
        in_text("square_m: 0.03", "square_m: 0,03"),
        UNREADABLE,
        ("square_m", "0,03", "decimal point"),
    ),
    Mistake(
        "no cell", "board", lambda folder: (folder / "cell.yaml").unlink(), UNREADABLE, ("cell.yaml", "no such file")
    ),
    Mistake(
        "cell.yml",
        "board",
        lambda folder: (folder / "cell.yaml").rename(folder / "cell.yml"),
        UNREADABLE,
        ("cell.yaml", "cell.yml", "rename"),
    ),
    Mistake(
        "no recording",
        "board",
        lambda folder: samples_file(folder).unlink(),
        UNREADABLE,
        ("samples.jsonl", "no recording"),
    ),
    Mistake(
        "no URDF",
        "joints",
        lambda folder: (folder / "hand.urdf").unlink(),
        UNREADABLE,
        ("robots.hand.urdf", "hand.urdf", "copy"),
    ),
    Mistake(
        "an empty recording",
        "board",
        lambda folder: samples_file(folder).write_text(""),
        "too-few-samples",
        ("no sample", "record at least 10"),
    ),
    Mistake(
        "one sample",
        "board",
        changes.all_lines(lambda lines: lines[:1]),
        "too-few-samples",
        ("only one sample", "record at least 10"),
    ),
    Mistake(
        "a null pixel",
        "board",
        each_line(lambda line: line["sample"] == 4 and line["observations"][0]["pixels"].__setitem__(7, None)),
        UNREADABLE,
        ("samples.jsonl:5", "row 7", "null"),
    ),
    Mistake(
        "a null coordinate",
        "board",
        each_line(lambda line: line["sample"] == 4 and line["observations"][0]["pixels"].__setitem__(7, [3.0, None])),
        UNREADABLE,
        ("samples.jsonl:5", "row 7", "null"),
    ),
    Mistake(
        "NaN in a pose",
        "board",
        each_line(
            lambda line: (
                line["sample"] == 4 and line["robots"]["eye"]["base_from_flange"]["t_m"].__setitem__(1, math.nan)
            )
        ),
        UNREADABLE,
        ("samples.jsonl:5", "t_m", "nan"),
    ),
    Mistake(
        "single quotes",
        "board",
        lambda folder: samples_file(folder).write_text("".join(f"{line}\n" for line in lines_of(folder))),
        UNREADABLE,
        ("samples.jsonl:1", "double quotes"),
    ),
    Mistake(
        "one array",
        "board",
        lambda folder: samples_file(folder).write_text(json.dumps(lines_of(folder), indent=1)),
        UNREADABLE,
        ("one object a line",),
    ),
    Mistake(
        "a comma after each line",
        "board",
        lambda folder: samples_file(folder).write_text(samples_file(folder).read_text().replace("}\n", "},\n")),
        UNREADABLE,
        ("samples.jsonl:1", "comma"),
    ),
    Mistake(
        "UTF-16",
        "board",
        lambda folder: samples_file(folder).write_text(samples_file(folder).read_text(), encoding="utf-16"),
        UNREADABLE,
        ("UTF-16", "UTF-8"),
    ),
    Mistake(
        "a joint too few",
        "joints",
        each_line(lambda line: line["robots"]["hand"]["joints_rad"].pop()),
        UNREADABLE,
        ("samples.jsonl:1", "6 joints", "5"),
    ),
    Mistake(
        "a camera that is not there", "board", in_line(0, '"wrist"', '"wirst"'), UNREADABLE, ("did you mean 'wrist'?",)
    ),
    Mistake(
        "a field misspelt",
        "board",
        in_line(0, '"observations"', '"observation"'),
        UNREADABLE,
        ("did you mean 'observations'?",),
    ),
    Mistake(
        "a choice of stations that nothing asks for",
        "board",
        _nothing,
        USAGE,
        ("--station-choice", "--method axis-shift"),
        _with("--station-choice", "weighted"),
    ),
]

MISTAKES = [*_UNITS, *_ROTATIONS, *_DIRECTIONS, *_PAIRS, *_IMAGES, *_FILES]
