"""Tests of `samples.jsonl`: the meaning of lines, dropped samples, refused files, and no loss of lines."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from basecal.cell.cell import Cell, CellCamera, Intrinsics, Robot
from basecal.cell.files import append_sample, read_cell, read_recording, write_recording
from basecal.cell.journal import recording_file
from basecal.cell.journal.observation_line import UnknownPoint
from basecal.cell.journal.recording_file import (
    BOM,
    LARGEST_BYTES,
    MOST_SAMPLES,
    check_image_bounds,
    read_samples,
    unknown_point_findings,
)
from basecal.cell.journal.sample_line import DroppedSample
from basecal.cell.recording import (
    CandidateObservation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    Sample,
)
from basecal.errors import DatasetError, InputError
from basecal.geometry import SE3, Camera
from cell_example import LINES, journal

DEEP = b'{"sample": ' + b"[" * 100_000
LENS = Camera("pinhole", np.array([900.0, 900, 640, 360]))
KNOWN = frozenset(range(24))


def file(folder: Path) -> Path:
    return folder / "recording" / "samples.jsonl"


def change_line(change: Callable[[dict[str, Any]], Any], line: int = 0) -> bytes:
    """Return the journal after `change` was applied to one of its lines."""
    lines = copy.deepcopy(list(LINES))
    change(lines[line])
    return journal(*lines)


def setter(path: str, value: Any) -> Callable[[dict[str, Any]], Any]:
    """Return a change that sets a field such as `observations.0.ids`."""

    def change(line: Any) -> None:
        *parents, last = [int(part) if part.isdigit() else part for part in path.split(".")]
        for part in parents:
            line = line[part]
        line[last] = value

    return change


def test_recorded_values_are_read_unchanged(folder: Path) -> None:
    """Robots, joints, images and each kind of observation are read as written."""
    first, second, third = read_recording(folder).samples
    eye = first.robots["eye"].base_from_flange
    assert_allclose(eye.matrix, SE3.from_quaternion([0.6, 0, 0.8, 0], [0.4, 0.1, 0.5]).matrix, atol=1e-15)
    assert_array_equal(first.robots["hand"].joints_rad, [0.1, -1.2])
    assert first.images == {"wrist": "recording/images/wrist/000000.png"}
    assert first.background == {"wrist": "recording/images/wrist/000000_off.png"}
    board, light, spots = first.observations
    assert isinstance(board, PixelObservation)
    assert_array_equal(board.ids, [0, 3])
    assert_array_equal(board.pixels, [[640.2, 360.1], [655, 360.4]])
    assert board.sigma_px is None
    assert isinstance(light, PixelObservation)
    assert (light.ids.tolist(), light.sigma_px.tolist()) == ([0], [0.2])
    assert isinstance(spots, CandidateObservation)
    assert_array_equal(spots.sigma_px, [0.1, 0.2])
    pose, points = second.observations
    assert isinstance(pose, PoseObservation)
    assert_array_equal(pose.sigma, [0.001, 0.001, 0.001, 0.1, 0.2, 0.3])
    assert_allclose(pose.camera_from_target.rotation, np.diag([1.0, -1, -1]), atol=1e-15)
    assert isinstance(points, PointObservation)
    assert_array_equal(points.sigma_m, [0.001])
    assert_allclose(third.robots["still"].base_from_flange.log()[3:], [0, 0, 0.5], atol=1e-15)
    assert (first.stamp_s, second.stamp_s) == (12.5, None)


def test_recorded_arrays_are_read_only(folder: Path) -> None:
    """Arrays of a recording cannot be changed in place."""
    seen = read_recording(folder).samples[0].observations[0]
    for array in (seen.pixels, seen.ids, read_recording(folder).samples[0].robots["hand"].joints_rad):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_round_trip(folder: Path, tmp_path: Path) -> None:
    """A recording written elsewhere and read again holds the same values, and a second writing gives the same bytes."""
    cell = read_cell(folder)
    once, twice = tmp_path / "once", tmp_path / "twice"
    write_recording(read_recording(folder, cell), once)
    recording = read_recording(once, cell)
    write_recording(recording, twice)
    assert [json.loads(line)["sample"] for line in file(once).read_bytes().splitlines()] == [0, 1, 2]
    original = read_recording(folder, cell)
    for one, other in zip(original.samples, recording.samples, strict=True):
        assert (one.sample, one.stamp_s, one.images) == (other.sample, other.stamp_s, other.images)
        for name, state in one.robots.items():
            if state.base_from_flange is not None:
                assert_allclose(state.base_from_flange.matrix, other.robots[name].base_from_flange.matrix, atol=4e-15)
        for left, right in zip(one.observations, other.observations, strict=True):
            assert type(left) is type(right)
            for name in ("ids", "pixels", "sigma_px", "sigma_m", "points_in_camera", "sigma"):
                assert_array_equal(getattr(left, name, None), getattr(right, name, None))
    assert read_recording(twice, cell).samples[0].images == original.samples[0].images


def test_written_line_has_documented_keys(folder: Path) -> None:
    """A sample is written with the keys from which it was read."""
    cell = read_cell(folder)
    sample = read_recording(folder, cell).samples[0]
    file(folder).unlink()
    append_sample(folder, sample)
    written = json.loads(file(folder).read_bytes())
    want = json.loads(json.dumps(LINES[0]))
    want["observations"][1]["ids"] = [0]
    assert written["robots"]["eye"]["base_from_flange"]["q_xyzw"] == pytest.approx([0.6, 0, 0.8, 0], abs=1e-14)
    written["robots"]["eye"] = want["robots"]["eye"]
    assert written == want


def test_existing_recording_is_not_rewritten(folder: Path) -> None:
    """Writing over a recording is refused, and leaves it unchanged."""
    before = file(folder).read_bytes()
    with pytest.raises(InputError, match="never rewritten"):
        write_recording(Recording(), folder)
    assert file(folder).read_bytes() == before


def test_nan_is_not_written(folder: Path) -> None:
    """A sample with NaN is refused, and the recording is unchanged."""
    before = file(folder).read_bytes()
    seen = PixelObservation("wrist", "light", np.array([0]), np.array([[np.nan, 1.0]]))
    with pytest.raises(InputError, match="NaN"):
        append_sample(folder, Sample(9, observations=(seen,)))
    assert file(folder).read_bytes() == before


def test_truncated_last_line_is_dropped(folder: Path) -> None:
    """However much of the last line is missing, the other samples are read, and a finding reports it."""
    cell, whole = read_cell(folder), file(folder).read_bytes()
    start = whole[:-1].rfind(b"\n") + 1
    for end in range(start + 1, len(whole) - 1):
        file(folder).write_bytes(whole[:end])
        recording = read_recording(folder, cell)
        assert [sample.sample for sample in recording.samples] == [0, 1]
        (finding,) = recording.findings
        assert (finding.code, finding.severity) == ("dropped-sample", "info")
        assert f"{file(folder)}:3: " in finding.message


def test_last_line_without_newline_is_read(folder: Path) -> None:
    """A last line that lacks only its newline is read, and appended to without loss."""
    cell, whole = read_cell(folder), file(folder).read_bytes()
    file(folder).write_bytes(whole[:-1])
    recording = read_recording(folder, cell)
    assert (len(recording.samples), recording.findings) == (3, ())
    assert append_sample(folder, Sample(3)) is None
    assert file(folder).read_bytes() == whole + b'{"sample": 3}\n'


@pytest.mark.parametrize("tail", [b'{"sample": 3, "rob', b"\0\0\0\0", b'{"sample": 3, "x": "\xc3', DEEP])
def test_appending_removes_truncated_line(folder: Path, tail: bytes) -> None:
    """A recording that ends in a partial line is cut back to its last newline before appending, with a finding."""
    whole = file(folder).read_bytes()
    file(folder).write_bytes(whole + tail)
    finding = append_sample(folder, Sample(3))
    assert finding.code == "dropped-sample"
    assert "samples.jsonl:4: " in finding.message
    assert file(folder).read_bytes() == whole + b'{"sample": 3}\n'


def test_recording_of_one_truncated_line_is_empty(folder: Path) -> None:
    """A recording that contains only a partial line is empty, with a finding."""
    file(folder).write_bytes(b'{"sam')
    recording = read_recording(folder)
    assert recording.samples == ()
    assert recording.findings[0].code == "dropped-sample"
    append_sample(folder, Sample(0))
    assert file(folder).read_bytes() == b'{"sample": 0}\n'


@pytest.mark.parametrize("content", [b"", b"\n", b"\n\n", b'{"sample": 0, "robots": {}}\n'])
def test_empty_recording_is_valid(folder: Path, content: bytes) -> None:
    """An empty recording, or one with only robots, is no error."""
    file(folder).write_bytes(content)
    recording = read_recording(folder)
    assert (sum(len(sample.observations) for sample in recording.samples), recording.findings) == (0, ())


def test_observation_without_points_is_dropped(folder: Path) -> None:
    """An observation without points has no effect and is left out."""
    line = {"sample": 0, "observations": [{"camera": "wrist", "target": "board", "ids": [], "pixels": []}]}
    file(folder).write_bytes(journal(line))
    assert read_recording(folder).samples[0].observations == ()


def test_repeated_sample_number_drops_later_sample(folder: Path) -> None:
    """The later of two samples with one number is dropped with a finding."""
    file(folder).write_bytes(journal(*LINES, {"sample": 0}))
    recording = read_recording(folder)
    assert len(recording.samples) == 3
    assert recording.samples[0].stamp_s == 12.5
    (finding,) = recording.findings
    assert (finding.code, finding.severity, finding.about) == ("dropped-sample", "info", ("0",))
    assert "samples.jsonl:4: " in finding.message
    assert "line 1" in finding.message


@pytest.mark.parametrize(("ids", "words"), [([0, 24], "id 24 is not on 'board'"), ([-1, 0], "id -1"), ([3, 3], "id 3")])
def test_invalid_point_ids_drop_sample(folder: Path, ids: list[int], words: str) -> None:
    """A sample with a point that is not on the target, or twice in one view, is dropped with a finding."""
    file(folder).write_bytes(change_line(setter("observations.0.ids", ids)))
    recording = read_recording(folder)
    assert [sample.sample for sample in recording.samples] == [1, 2]
    (finding,) = recording.findings
    assert (finding.code, finding.about) == ("dropped-sample", ("0",))
    assert words in finding.message
    assert "samples.jsonl:1: " in finding.message


@pytest.mark.parametrize(
    ("path", "value", "field", "words"),
    [
        ("sampel", 1, "sampel", "unknown field (did you mean 'sample'?)"),
        ("sample", -1, "sample", "0 or more"),
        ("sample", 1.5, "sample", "0 or more"),
        ("sample", True, "sample", "true or false"),
        ("sample", 10**30, "sample", "got a huge integer"),
        ("stamp_s", float("nan"), "stamp_s", "finite"),
        ("stamp_s", None, "stamp_s", "finite"),
        ("robots", [], "robots", "expected an object"),
        ("robots.eyes", {"joints_rad": []}, "robots.eyes", "no robot 'eyes' (did you mean 'eye'?)"),
        ("robots.eye", {}, "robots.eye", "got neither"),
        ("robots.hand.base_from_flange", {}, "robots.hand", "got both"),
        ("robots.hand.joints_rad", [1, 2, 3], "robots.hand.joints_rad", "expected 2 joints, got 3"),
        ("robots.hand.joints_rad", [1, "2"], "robots.hand.joints_rad", "list of numbers"),
        ("robots.hand.joints_rad", [1, None], "robots.hand.joints_rad", "list of numbers"),
        ("robots.hand.joints_rad", [1, False], "robots.hand.joints_rad.1", "true or false"),
        ("robots.eye", {"joints_rad": [1]}, "robots.eye.joints_rad", "joints need urdf"),
        ("robots.eye.base_from_flange.q_xyzw", [0, 0, 0, 1.01], "robots.eye.base_from_flange.q_xyzw", "norm 1.01"),
        ("robots.eye.base_from_flange.q_xyzw", [0, 0, 1], "robots.eye.base_from_flange.q_xyzw", "4 numbers"),
        ("robots.eye.base_from_flange.t_m", [0, 0, float("inf")], "robots.eye.base_from_flange.t_m", "finite"),
        ("robots.eye.base_from_flange.t_m", [0, 0, 10**400], "robots.eye.base_from_flange.t_m", "finite"),
        ("robots.eye.base_from_flange.tm", 1, "robots.eye.base_from_flange.tm", "did you mean 't_m'?"),
        ("robots.eye.base_from_flange", {"matrix": [[2, 0, 0, 0]] * 4}, "robots.eye.base_from_flange.matrix", "row"),
        ("robots.eye.base_from_flange", {"t_m": [0, 0, 0]}, "robots.eye.base_from_flange", "exactly one of"),
        ("images.wrist", "/etc/passwd", "images.wrist", "relative path"),
        ("images.wrist", "../../secret.png", "images.wrist", "leaves the cell"),
        ("images.wrist", "a\0b", "images.wrist", "relative path"),
        ("images.wrist", "C:\\x.png", "images.wrist", "relative path"),
        ("images.wrist", 3, "images.wrist", "expected a path"),
        ("images.rist", "a.png", "images.rist", "did you mean 'wrist'?"),
        ("observations", {}, "observations", "expected a list"),
        ("observations.0", 3, "observations[0]", "expected an object"),
        ("observations.0.camera", "wrst", "observations[0].camera", "did you mean 'wrist'?"),
        ("observations.0.camera", ["wrist"], "observations[0].camera", "no camera a list"),
        ("observations.0.target", "bord", "observations[0].target", "did you mean 'board'?"),
        ("observations.0.target", "unseen", "observations[0].target", "`kind`"),
        ("observations.0.camera", "depth", "observations[0].camera", "intrinsics"),
        ("observations.0.ids", [0], "observations[0].ids", "1 id for 2 points"),
        ("observations.0.ids", [0, 1.5], "observations[0].ids", "whole numbers"),
        ("observations.0.ids", [0, 10**30], "observations[0].ids", "whole numbers"),
        ("observations.0.ids", [[0], [1]], "observations[0].ids", "whole numbers"),
        ("observations.0.ids", None, "observations[0].ids", "whole numbers"),
        ("observations.0.pixels", [[1, 2], [3]], "observations[0].pixels", "rows of 2"),
        ("observations.0.pixels", [[1, 2], [3, "4"]], "observations[0].pixels", "rows of 2"),
        ("observations.0.pixels", [[1, 2], [3, float("nan")]], "observations[0].pixels", "NaN"),
        ("observations.0.pixels", [[1, 2], [3, 1e300]], "observations[0].pixels", "beyond"),
        ("observations.0.pixels", [[1, 2, 3], [3, 4, 5]], "observations[0].pixels", "rows of 2"),
        ("observations.0.pixels", 7, "observations[0].pixels", "rows of 2"),
        ("observations.0.sigma_px", -1, "observations[0].sigma_px", "positive"),
        ("observations.0.sigma_px", 0, "observations[0].sigma_px", "positive"),
        ("observations.0.sigma_px", [1, 2, 3], "observations[0].sigma_px", "or 2, got 3"),
        ("observations.0.sigma_m", 1, "observations[0].sigma_m", "unknown field"),
        ("observations.0.candidates", [[1, 2]], "observations[0]", "got pixels and candidates"),
        ("observations.2.target", "board", "observations[2].candidates", "single LED"),
        ("observations.1.camera", "wrist", "observations[2]", "twice in one sample"),
        ("observations.2", {"camera": "wrist", "target": "light"}, "observations[2]", "got none"),
    ],
)
def test_invalid_lines_are_refused(folder: Path, path: str, value: Any, field: str, words: str) -> None:
    """Unreadable content is an error with path, line, field and the expected value."""
    file(folder).write_bytes(change_line(setter(path, value)))
    with pytest.raises(DatasetError) as caught:
        read_recording(folder)
    assert (caught.value.line, caught.value.field) == (1, field)
    assert words in caught.value.reason
    assert str(caught.value).startswith(f"{file(folder)}:1: {field}: ")
    assert "\n" not in str(caught.value)


def test_pose_sigmas_are_given_together(folder: Path) -> None:
    """A measured pose has both sigmas or none."""
    pose = {"t_m": [0, 0, 1], "q_xyzw": [0, 0, 0, 1], "sigma_t_m": 0.1}
    file(folder).write_bytes(change_line(setter("observations.0.camera_from_target", pose), 1))
    with pytest.raises(DatasetError, match=r"samples.jsonl:2: .*go together"):
        read_recording(folder)


@pytest.mark.parametrize(
    "garbage",
    [
        b"garbage",
        b"{'sample': 1}",
        b'{"sample": 1',
        b"\xff\xfe\x00",
        b"[1]",
        b"7",
        b"null",
        b'{"sample": 1, "sample": 2}',
        b'{"sample": ' + b"9" * 5000 + b"}",
        b'{"sample": 1, "robots": ' + b"[" * 900 + b"]" * 900 + b"}",
        b'{"sample": 1, "observations": [{"camera": "wrist", "target": "board", "ids": [0], "pixels": '
        + b"[" * 900
        + b"true"
        + b"]" * 900
        + b"}]}",
        DEEP,
    ],
)
def test_malformed_line_in_middle_is_refused(folder: Path, garbage: bytes) -> None:
    """A malformed line followed by others is an error that names it."""
    first, *rest = file(folder).read_bytes().splitlines(keepends=True)
    file(folder).write_bytes(first + garbage + b"\n" + b"".join(rest))
    with pytest.raises(DatasetError, match=r"samples\.jsonl:2: "):
        read_recording(folder)


def test_image_links_out_of_cell_are_refused(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    """An image that is a link out of the cell, or lies in such a folder, is refused."""
    outside = tmp_path_factory.mktemp("outside")
    (outside / "000000.png").touch()
    images = folder / "recording" / "images"
    images.mkdir()
    (images / "wrist").symlink_to(outside)
    with pytest.raises(DatasetError, match="leaves the cell by a link"):
        read_recording(folder)
    (images / "wrist").unlink()
    (images / "wrist").mkdir()
    (images / "wrist" / "000000_off.png").symlink_to(outside / "000000.png")
    with pytest.raises(DatasetError, match=r"background\.wrist: .*leaves the cell by a link"):
        read_recording(folder)


def test_missing_recording_is_explained(folder: Path) -> None:
    """The error for a missing recording states how to make one."""
    file(folder).unlink()
    with pytest.raises(DatasetError, match="there is no recording: basecal capture or basecal import makes one"):
        read_recording(folder)


def test_appending_to_complete_recording_gives_no_finding(folder: Path) -> None:
    """Consecutive samples, the first one in an empty file, are all kept, and no line is cut."""
    file(folder).write_bytes(b"")
    for number in range(4):
        before = file(folder).read_bytes()
        assert append_sample(folder, Sample(number)) is None
        assert file(folder).read_bytes().startswith(before)
    assert [sample.sample for sample in read_recording(folder, read_cell(folder)).samples] == [0, 1, 2, 3]


def test_samples_are_read_from_any_file(folder: Path, tmp_path: Path) -> None:
    """A file elsewhere is read like the cell's own, with or without a byte-order mark.

    Its images are the cell's, and errors name the file.
    """
    own, cell = read_recording(folder), read_cell(folder)
    path = tmp_path / "new.jsonl"
    for mark in (b"", BOM):
        path.write_bytes(mark + file(folder).read_bytes())
        found = read_samples(path, folder, cell)
        assert [s.sample for s in found.samples] == [s.sample for s in own.samples]
        assert [s.images for s in found.samples] == [s.images for s in own.samples]
        assert found.folder == own.folder == str(folder)
    path.write_bytes(b"\n[]\n")
    with pytest.raises(DatasetError, match=rf"^{path}:2: "):
        read_samples(path, folder, cell)


def test_line_and_byte_limits(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording at the limits is read; one line more, or one byte more in a line, is an error with the number."""
    text = file(folder).read_bytes()
    longest = max(map(len, text.split(b"\n")))
    number = [len(line) for line in text.split(b"\n")].index(longest) + 1
    lines = text.count(b"\n")
    monkeypatch.setattr(recording_file, "MOST_SAMPLES", lines)
    monkeypatch.setattr(recording_file, "_LONGEST_LINE_BYTES", longest)
    assert read_recording(folder).samples
    monkeypatch.setattr(recording_file, "_LONGEST_LINE_BYTES", longest - 1)
    with pytest.raises(DatasetError, match=f":{number}: a line of {longest} bytes, no sample has that many"):
        read_recording(folder)
    monkeypatch.setattr(recording_file, "MOST_SAMPLES", lines - 1)
    with pytest.raises(DatasetError, match=f"more than {lines - 1} lines, expected one for each sample"):
        read_recording(folder)
    assert (MOST_SAMPLES, LARGEST_BYTES) == (200_000, 2**28)


def cell(size_px: tuple[int, int] | None, lens: Camera | None = LENS) -> Cell:
    intrinsics = None if lens is None else Intrinsics("fixed", lens)
    camera = CellCamera("wrist", "eye", size_px=size_px, intrinsics=intrinsics)
    return Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": camera})


def samples(scale: np.ndarray, count: int = 5, points: int = 40, swapped: bool = False) -> list[Sample]:
    """Return views of points all over an image of 1280 x 720, scaled."""
    pixels = np.random.default_rng(0).uniform(0, 1, (count, points, 2)) * [1279, 719] * scale
    pixels = pixels[..., ::-1] if swapped else pixels
    ids = np.arange(points)
    return [Sample(n, observations=(PixelObservation("wrist", "board", ids, view),)) for n, view in enumerate(pixels)]


def check(size_px: tuple[int, int] | None, recorded: list[Sample], lens: Camera | None = LENS) -> None:
    check_image_bounds(recorded, {s.sample: s.sample + 1 for s in recorded}, "samples.jsonl", cell(size_px, lens))


def test_points_inside_image_are_accepted():
    """Points inside the image, or outside by noise only, are accepted; without a stated size, any point is."""
    check((1280, 720), samples(np.ones(2)))
    check((1280, 720), samples(np.array([1.04, 1.04])))
    check(None, samples(np.full(2, 9.0)))
    check((1280, 720), [])


def test_few_points_outside_image_are_accepted():
    """One point in twenty may be anywhere, since the outlier search handles it."""
    recorded = samples(np.ones(2))
    pixels = recorded[3].observations[0].pixels
    pixels[:9] = 9000.0
    check((1280, 720), recorded)
    pixels[:11] = 9000.0
    with pytest.raises(DatasetError, match=r"^samples\.jsonl:4: observations: 11 of 200 pixels of 'wrist' lie outside"):
        check((1280, 720), recorded)


@pytest.mark.parametrize(
    ("size_px", "lens", "scale", "swapped", "message"),
    [
        ((720, 1280), LENS, 1.0, False, r"width and height look swapped, expected size_px: \[1280, 720\]"),
        ((1280, 720), LENS, 1.0, True, "u and v of the points look swapped"),
        ((640, 360), LENS, 1.0, False, r"they reach to \(1\d\d\d, 7\d\d\): size_px is of another resolution"),
        ((1280, 720), LENS, 1.5, False, "size_px is of another resolution"),
        ((700, 700), LENS, 1.0, False, "size_px is of another resolution"),
    ],
)
def test_cause_of_points_outside_image_is_reported(size_px, lens, scale, swapped, message):
    """The error names swapped sides, swapped coordinates or another resolution."""
    with pytest.raises(DatasetError, match=message):
        check(size_px, samples(np.full(2, scale), swapped=swapped), lens)


@pytest.mark.parametrize(
    ("place", "is_inside"),
    [
        ((-63.9, 10.0), True),
        ((-64.1, 10.0), False),
        ((10.0, -63.9), True),
        ((10.0, -64.1), False),
        ((1342.9, 10.0), True),
        ((1343.1, 10.0), False),
        ((10.0, 782.9), True),
        ((10.0, 783.1), False),
    ],
)
def test_image_border_tolerance_is_twentieth_of_width(place, is_inside):
    """The tolerance is 64 px of 1280, from the centres of the border pixels.

    The error names the line of the first sample outside.
    """
    inside = np.full((20, 2), 100.0)
    views = [inside, np.tile(place, (20, 1)), np.full((20, 2), 9000.0)]
    recorded = [
        Sample(n, observations=(PixelObservation("wrist", "board", np.arange(20), view),))
        for n, view in enumerate(views[:2] if is_inside else views)
    ]
    if is_inside:
        check((1280, 720), recorded)
        return
    message = (
        r":2: observations: 40 of 60 pixels of 'wrist' lie outside its 1280 x 720 px; they reach to \(9000, 9000\):"
    )
    with pytest.raises(DatasetError, match=message):
        check((1280, 720), recorded)


def test_swapped_sides_are_reported_without_lens():
    """Swapped width and height are recognised without the principal point of a lens, too."""
    with pytest.raises(DatasetError, match=r"width and height look swapped, expected size_px: \[1280, 720\]$"):
        check((720, 1280), samples(np.ones(2)), None)


def dropped_sample(sample: int, ids: set[int], target: str = "board") -> DroppedSample:
    return DroppedSample(sample, sample + 1, UnknownPoint(f"id {max(ids)} is not on it", target, frozenset(ids), KNOWN))


def test_dropped_sample_finding_states_line() -> None:
    """The finding states the sample, its line and the reason."""
    (found,) = unknown_point_findings([dropped_sample(7, {3, 24})], "s.jsonl")
    assert (found.code, found.severity, found.about) == ("dropped-sample", "info", ("7",))
    assert found.message == "s.jsonl:8: sample 7 is dropped: id 24 is not on it."


def test_dropped_samples_are_grouped_by_target() -> None:
    """One finding per target is about all dropped samples, and its message describes the first."""
    found = unknown_point_findings(
        [dropped_sample(1, {30}), dropped_sample(2, {31}), dropped_sample(4, {40}, "tag")], "s.jsonl"
    )
    assert [each.about for each in found] == [("1", "2"), ("4",)]
    assert "sample 1 and 1 more are dropped" in found[0].message
    assert "subtract" not in found[0].message


def test_ids_counted_from_one_are_recognised() -> None:
    """If every id is one larger than the target's, the finding advises to subtract 1."""
    (found,) = unknown_point_findings([dropped_sample(1, {1, 5, 24}), dropped_sample(2, {2, 24})], "s.jsonl")
    assert found.message.endswith("Subtract 1 from each id: they count from 0.")
    (other,) = unknown_point_findings([dropped_sample(1, {2, 24})], "s.jsonl")
    assert "subtract" not in other.message
