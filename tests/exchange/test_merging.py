"""Tests of merging cells that were recorded separately."""

from __future__ import annotations

from pathlib import Path

import pytest

from basecal.cell import Cell, Recording, Robot, RobotState, Sample
from basecal.cell.files import append_samples, read_cell, read_recording
from basecal.errors import InputError
from basecal.exchange.importing.image_names import read_image_names, write_image_names
from basecal.exchange.merging import Part, _add_models, _check_times, merge_cells
from basecal.geometry import SE3
from cell_example import URDF

BASE = "schema: basecal/cell/1\nreference: left  # by the door\nrobots:\n  left: {}\n"
OTHER = "schema: basecal/cell/1\nreference: right\nrobots: {right: {}}\n"
CAMERA = "cameras:\n  cam: {on: left, size_px: [64, 48], intrinsics: {status: free}}\n"


def cell(folder: Path, text: str, numbers: range = range(3), stamps: float | None = None, robot: str = "left") -> Path:
    folder.mkdir()
    (folder / "cell.yaml").write_text(text)
    samples = [
        Sample(n, None if stamps is None else stamps + n, {robot: RobotState(SE3.from_rotvec([0, 0, n], [0.3, 0, 0]))})
        for n in numbers
    ]
    append_samples(folder, samples)
    return folder


def with_images(folder: Path, content: bytes, name: str = "0.png", number: int = 90) -> Path:
    images = folder / "recording" / "images" / "cam"
    images.mkdir(parents=True, exist_ok=True)
    (images / name).write_bytes(b"\x89PNG\r\n\x1a\n" + content)
    append_samples(folder, [Sample(number, None, {}, (), {"cam": f"recording/images/cam/{name}"})])
    return folder


def test_robots_are_merged_and_samples_renumbered(tmp_path: Path) -> None:
    """Entries of only one cell are added to the first one's text.

    Its samples follow, and the source cells are unchanged.
    """
    a = cell(tmp_path / "a", BASE + CAMERA)
    b = cell(
        tmp_path / "b", BASE + "  right: {noise: {sigma_t_m: 1e-4, sigma_r_rad: 2e-4}}\n", range(5, 7), robot="right"
    )
    merged = merge_cells([a, b], tmp_path / "c")
    assert merged.first_numbers == (0, 3)
    assert "# by the door" in (tmp_path / "c" / "cell.yaml").read_text()
    described = read_cell(tmp_path / "c")
    assert list(described.robots) == ["left", "right"]
    assert described.robots["right"].noise is not None
    samples = read_recording(tmp_path / "c").samples
    assert [(s.sample, *s.robots) for s in samples] == [
        (0, "left"),
        (1, "left"),
        (2, "left"),
        (3, "right"),
        (4, "right"),
    ]
    pose = samples[3].robots["right"].base_from_flange
    assert pose is not None
    assert pose.rotvec[2] == pytest.approx(5 - 2 * 3.141592653589793)
    assert len(read_recording(a).samples) == 3


def test_images_with_equal_names_are_kept(tmp_path: Path) -> None:
    """An image whose path is already used gets its sample's number before its name."""
    parts = [with_images(cell(tmp_path / n, BASE + CAMERA, range(2)), n.encode()) for n in "ab"]
    merge_cells(parts, tmp_path / "c")
    last = read_recording(tmp_path / "c").samples[-1]
    paths = [s.images["cam"] for s in read_recording(tmp_path / "c").samples if s.images]
    assert [(tmp_path / "c" / path).read_bytes() for path in paths] == [b"\x89PNG\r\n\x1a\na", b"\x89PNG\r\n\x1a\nb"]
    assert Path(paths[1]).name == f"{last.sample:06d}_0.png"


def test_numbered_image_paths_are_unique(tmp_path: Path) -> None:
    """A numbered path may also be in use, as in cells that were merged before."""
    first = with_images(cell(tmp_path / "a", BASE + CAMERA, range(0)), b"a", number=0)
    second = with_images(cell(tmp_path / "b", BASE + CAMERA, range(0)), b"b", "000002_0.png", 0)
    merge_cells([first, with_images(second, b"c", number=1)], tmp_path / "c")
    paths = [sample.images["cam"] for sample in read_recording(tmp_path / "c").samples]
    assert [(tmp_path / "c" / path).read_bytes()[8:] for path in paths] == [b"a", b"b", b"c"]


def test_expected_image_names_follow_their_samples(tmp_path: Path) -> None:
    """A table may name images before their import; two cells that expect the same image are not merged."""
    parts = [cell(tmp_path / n, BASE, range(2)) for n in "ab"]
    for part, names in zip(parts, ({"y": 0, "x": 1}, {"w": 0, "v": 1}), strict=True):
        write_image_names(part, names)
    merge_cells(parts, tmp_path / "c")
    assert read_image_names(tmp_path / "c") == {"y": 0, "x": 1, "w": 2, "v": 3}
    write_image_names(parts[1], {"x": 0})
    with pytest.raises(
        InputError, match=r"b: its tables name image 'x', as those of another cell do. Import the images"
    ):
        merge_cells(parts, tmp_path / "d")
    write_image_names(with_images(cell(tmp_path / "e", BASE + CAMERA, range(1)), b"e", "x.png"), {"x": 90})
    merge_cells([parts[0], tmp_path / "e"], tmp_path / "f")
    assert read_image_names(tmp_path / "f") == {"y": 0, "x": 1}


def test_three_cells_are_merged(tmp_path: Path) -> None:
    """Any number of cells is merged in order."""
    parts = [cell(tmp_path / n, BASE, range(2)) for n in "abc"]
    assert [s.sample for s in merge_cells(parts, tmp_path / "d").recording.samples] == list(range(6))


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (BASE + CAMERA.replace("64, 48", "32, 24"), r"cameras.cam.size_px: .*a states \[64, 48\], .*b \[32, 24\]"),
        (BASE + CAMERA.replace("on: left", "on: world"), "cameras.cam.on: .*a states left, .*b world"),
        (BASE + CAMERA + "noise: {pixel_px: 0.2}\n", "noise: .*a states nothing, .*b {'pixel_px': 0.2}"),
        (
            OTHER + "targets: {board: {on: world, mount: {status: fixed, t_m: [1, 0, 0], q_xyzw: [0, 0, 0, 1]}}}\n",
            "targets.board is stated in the base of 'right'. .* of .*a is 'left': merge .*b first, or make it free",
        ),
    ],
)
def test_contradicting_fields_are_reported(tmp_path: Path, other: str, message: str) -> None:
    """The error has both values with their cells and the field; no file is written."""
    a = cell(tmp_path / "a", BASE + CAMERA)
    b = cell(tmp_path / "b", other, robot="right" if "reference: right" in other else "left")
    with pytest.raises(InputError, match=message):
        merge_cells([a, b], tmp_path / "c")
    assert not (tmp_path / "c").exists()


def test_cells_with_different_references_are_merged(tmp_path: Path) -> None:
    """A free object on the world is the same in both cells, whatever its guess; the first reference is kept."""
    guess = "mount: {status: free, guess: {t_m: [1, 0, 0], q_xyzw: [0, 0, 0, 1]}}"
    a = cell(tmp_path / "a", BASE + "targets: {board: {on: world}}\n")
    b = cell(
        tmp_path / "b",
        OTHER + f"targets: {{board: {{on: world, {guess}}}, tag: {{on: world, {guess}}}}}\n",
        robot="right",
    )
    merge_cells([a, b], tmp_path / "c")
    merged = read_cell(tmp_path / "c")
    assert (merged.reference, *merged.robots) == ("left", "left", "right")
    assert [(name, each.mount.mean) for name, each in merged.targets.items()] == [("board", None), ("tag", None)]


@pytest.mark.parametrize("is_whole", [(False, False), (False, True), (True, False)])
def test_overlapping_streams_are_refused(tmp_path: Path, is_whole: tuple[bool, bool]) -> None:
    """Lines with robots only are paired with image lines by time, so recordings must not overlap."""
    a, b = (cell(tmp_path / n, BASE + CAMERA, range(0)) for n in "ab")
    robot, images = {"left": RobotState(SE3.identity())}, {"cam": "recording/images/cam/0.png"}
    for folder, begun_s, whole in zip((a, b), (0.0, 1.5), is_whole, strict=True):
        append_samples(folder, [Sample(k, begun_s + k, robot, (), images if whole else {}) for k in range(3)])
    with pytest.raises(InputError, match=r"overlap in time \(1.5 to 2 s\)"):
        merge_cells([a, b], tmp_path / "c")


def test_existing_cell_is_not_overwritten(tmp_path: Path) -> None:
    """Merging into a folder with a cell is refused."""
    a = cell(tmp_path / "a", BASE)
    before = (a / "recording" / "samples.jsonl").read_bytes()
    with pytest.raises(InputError, match="not overwritten"):
        merge_cells([a, cell(tmp_path / "b", BASE)], a)
    assert (a / "recording" / "samples.jsonl").read_bytes() == before


def test_merge_does_not_write_through_links(tmp_path: Path) -> None:
    """A folder whose `recording` is a link elsewhere is refused, and the link's target stays empty."""
    a, b = cell(tmp_path / "a", BASE), cell(tmp_path / "b", BASE)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "recording").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="cannot be written"):
        merge_cells([a, b], tmp_path / "c")
    assert not list((tmp_path / "elsewhere").iterdir())
    assert not (tmp_path / "c" / "cell.yaml").exists()


def test_controller_formats_of_different_robots_are_merged(tmp_path: Path) -> None:
    """Each cell states the format of another robot, as sessions with one moving arm do; both are kept.

    Two formats of one robot contradict.
    """
    robots = "schema: basecal/cell/1\nreference: left\nrobots:\n"
    a = cell(tmp_path / "a", robots + "  left: {}\n  right: {controller: {format: ros}}\n")
    b = cell(tmp_path / "b", robots + "  left: {controller: {format: ur}}\n  right: {}\n")
    c = cell(tmp_path / "c", robots + "  left: {controller: {format: abb}}\n  right: {}\n")
    merge_cells([a, b], tmp_path / "d")
    merged = read_cell(tmp_path / "d").robots
    formats = {name: robot.controller["format"] for name, robot in merged.items() if robot.controller is not None}
    assert formats == {"left": "ur", "right": "ros"}
    with pytest.raises(InputError, match=r"robots.left.controller.format: .* states ur, .* abb"):
        merge_cells([a, b, c], tmp_path / "e")


def test_equal_urdf_files_are_shared(tmp_path: Path) -> None:
    """Equal files of one name are one file; different ones are refused, and a robot without a URDF adds none."""
    robots = {"left": Robot("left", urdf="a.urdf"), "right": Robot("right")}
    parts = [Part(tmp_path / n, Cell("left", robots), Recording()) for n in "ab"]
    for part in parts:
        part.folder.mkdir()
        (part.folder / "a.urdf").write_text(URDF)
    files: dict[str, Path] = {}
    for part in parts:
        _add_models(files, part)
    assert files == {"a.urdf": tmp_path / "a" / "a.urdf"}
    (tmp_path / "b" / "a.urdf").write_text(URDF.replace("0.3", "0.4"))
    with pytest.raises(InputError, match=r"a.urdf and .*b.a.urdf differ, and would be one file"):
        _add_models(files, parts[1])


def test_first_guess_is_kept(tmp_path: Path) -> None:
    """A free mount keeps the guess of the first cell."""
    guesses = ("guess: {t_m: [1, 0, 0], q_xyzw: [0, 0, 0, 1]}", "guess: {t_m: [2, 0, 0], q_xyzw: [0, 0, 0, 1]}")
    parts = [
        cell(tmp_path / n, BASE + f"targets: {{board: {{on: left, mount: {{status: free, {guess}}}}}}}\n", range(1))
        for n, guess in zip("ab", guesses, strict=True)
    ]
    merge_cells(parts, tmp_path / "c")
    mean = read_cell(tmp_path / "c").targets["board"].mount.mean
    assert mean is not None
    assert mean.translation.tolist() == [1, 0, 0]


@pytest.mark.parametrize("begun_s", [1.0, 1.1])
def test_consecutive_streams_are_merged(begun_s: float) -> None:
    """Streams may be in any order; one shared instant is an overlap, and complete samples may overlap."""
    images = {"cam": "recording/images/cam/0.png"}
    for robots in ({}, {"left": RobotState(SE3.identity())}):
        lines = [[Sample(k, begin + k, robots, (), images) for k in range(2)] for begin in (begun_s, 0.0)]
        lines.append([Sample(0, None, robots)])
        described = Cell("left", {"left": Robot("left")})
        parts = [Part(Path(name), described, Recording(tuple(each))) for name, each in zip("abc", lines, strict=True)]
        if not robots and begun_s == 1.0:
            with pytest.raises(InputError, match=r"^b and a overlap in time \(1 to 1 s\)"):
                _check_times(parts)
        else:
            _check_times(parts)


def test_stream_inside_long_recording_overlaps() -> None:
    """Overlapping recordings need not be neighbours in time; the overlap ends with the earlier of both."""
    robots, images = {"left": RobotState(SE3.identity())}, {"cam": "recording/images/cam/0.png"}
    spans = {"a": (0.0, 9.0, robots), "b": (1.0, 2.0, robots), "c": (4.0, 5.0, {})}
    described = Cell("left", {"left": Robot("left")})
    parts = [
        Part(Path(name), described, Recording(tuple(Sample(k, s, states, (), images) for k, s in enumerate(times))))
        for name, (*times, states) in spans.items()
    ]
    with pytest.raises(InputError, match=r"^a and c overlap in time \(4 to 5 s\)"):
        _check_times(parts)


def test_cell_without_samples_adds_none(tmp_path: Path) -> None:
    """Numbering continues after the last sample, whatever the first number of a cell."""
    parts = [cell(tmp_path / n, BASE, numbers) for n, numbers in (("a", range(0)), ("b", range(4, 6)), ("c", range(0)))]
    parts.append(cell(tmp_path / "d", BASE, range(7, 8)))
    merged = merge_cells(parts, tmp_path / "e")
    assert [sample.sample for sample in merged.recording.samples] == [4, 5, 6]
    assert merged.first_numbers == (0, 4, 0, 6)
