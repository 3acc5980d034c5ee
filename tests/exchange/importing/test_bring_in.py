"""Tests of an import into a folder: the cell is made, completed, or left unchanged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.cell import Cell, PixelObservation, PoseObservation, Recording, RobotState
from basecal.cell.files import read_cell, read_recording
from basecal.errors import DatasetError, InputError
from basecal.exchange.importing.bring_in import _locations, _omit_defaults, add_to_cell
from basecal.exchange.importing.imported import Imported, Row
from basecal.geometry import SE3


def poses(robot: str, count: int, names: bool = False, **more: object) -> Imported:
    rows = tuple(
        Row(
            {robot: RobotState(SE3.from_rotvec([0, 0, 0.1 * i], [0.4, 0.1 * i, 0.3]))},
            image=f"IMG_{i}.png" if names else None,
        )
        for i in range(count)
    )
    return Imported(f"{robot}.csv", "poses", rows, {"robots": {robot: {}}, **more})


def accept_all(cell: Cell, recording: Recording) -> tuple[str, ...]:
    """Accept any cell and recording as plausible."""
    return ()


def images(folder: Path, names: list[str]) -> Imported:
    folder.mkdir()
    for name in names:
        (folder / name).write_bytes(b"\x89PNG\r\n\x1a\n" + name.encode())
    rows = tuple(Row(images={"cam": folder / name}, image=name) for name in names)
    return Imported(str(folder), "pictures", rows, {"cameras": {"cam": {"on": "left"}}})


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_cell_is_created_then_completed(tmp_path: Path) -> None:
    """The first robot makes cell and recording, the second completes both."""
    made = add_to_cell(tmp_path / "c", poses("left", 3), accept_all)
    assert (made.is_new_cell, made.made) == (True, 3)
    done = add_to_cell(tmp_path / "c", poses("right", 3), accept_all)
    assert (done.is_new_cell, done.made, done.changed) == (False, 0, ("robots.right",))
    assert list(read_cell(tmp_path / "c").robots) == ["left", "right"]
    assert [sorted(s.robots) for s in read_recording(tmp_path / "c").samples] == [["left", "right"]] * 3


def test_further_views_of_sample_become_samples(tmp_path: Path) -> None:
    """The first view completes the sample; each further one makes a sample with the same robot poses."""
    add_to_cell(tmp_path / "c", poses("left", 3), accept_all)
    views = [PoseObservation("cam", "board", SE3.from_rotvec([0, 0, 0], [0, 0, 1.0 + i])) for i in range(3)]
    rows = tuple(Row(observations=(view,), sample=sample) for view, sample in zip(views, (1, 1, 2), strict=True))
    cell = {"cameras": {"cam": {"on": "left"}}, "targets": {"board": {"on": "world"}}}
    done = add_to_cell(tmp_path / "c", Imported("views.csv", "poses", rows, cell), accept_all)
    assert done.made == 1
    samples = read_recording(tmp_path / "c").samples
    assert [(each.sample, len(each.observations)) for each in samples] == [(0, 0), (1, 1), (2, 1), (3, 1)]
    stands = [each.robots["left"].base_from_flange for each in samples]
    np.testing.assert_allclose(stands[3].translation, stands[1].translation)


def test_unusable_samples_are_reported(tmp_path: Path) -> None:
    """A sample with a point that its target lacks is reported; those of earlier imports are not repeated."""
    add_to_cell(tmp_path / "c", poses("left", 3), accept_all)
    target = {"on": "world", "kind": "points", "points_m": [[0, 0, 0], [1, 0, 0]]}
    camera = {"on": "left", "size_px": [64, 48], "intrinsics": {"status": "free"}}
    cell = {"cameras": {"cam": camera}, "targets": {"board": target}}
    views = [PixelObservation("cam", "board", np.array([k, 7 - k]), np.ones((2, 2))) for k in (6, 0)]
    rows = tuple(Row(observations=(view,), sample=k) for k, view in enumerate(views))
    done = add_to_cell(tmp_path / "c", Imported("points.csv", "points", rows, cell), accept_all)
    assert len(done.doubts) == 1
    assert "sample 0 and 1 more are dropped: id 6 is not on 'board'" in done.doubts[0]
    assert len(done.recording.samples) == 1
    assert add_to_cell(tmp_path / "c", poses("right", 1), accept_all).doubts == ()


@pytest.mark.parametrize("first", ["poses", "pictures"])
def test_image_names_pair_in_either_import_order(tmp_path: Path, first: str) -> None:
    """Images and a table that names them are paired in either import order and sorting."""
    table = poses("left", 3, True)
    folder = images(tmp_path / "photos", ["IMG_2.png", "IMG_0.png", "IMG_1.png"])
    begin = Imported("", "", (), {"robots": {"left": {}}})
    for each in [begin, table, folder] if first == "poses" else [begin, folder, table]:
        add_to_cell(tmp_path / "c", each, accept_all)
    for sample in read_recording(tmp_path / "c").samples:
        number = int(Path(sample.images["cam"]).stem[4:])
        pose = sample.robots["left"].base_from_flange
        assert pose is not None
        assert pose.translation[1] == pytest.approx(0.1 * number)


def test_failed_import_changes_no_file(tmp_path: Path) -> None:
    """A recorded robot, another count, and a refusal by the check leave the folder unchanged."""
    add_to_cell(tmp_path, poses("left", 3), accept_all)
    before = content(tmp_path)

    def refuse(cell: Cell, recording: Recording) -> None:
        raise InputError("cannot be")

    with pytest.raises(InputError, match="recorded already: add --session for other samples, or --replace"):
        add_to_cell(tmp_path, poses("left", 3), accept_all)
    with pytest.raises(InputError, match=r"right.csv holds 2, the recording has 3"):
        add_to_cell(tmp_path, poses("right", 2), accept_all)
    with pytest.raises(InputError, match="cannot be"):
        add_to_cell(tmp_path, poses("right", 3), refuse)
    photos = images(tmp_path.with_suffix(".photos"), ["a.png", "b.png"])
    with pytest.raises(InputError, match=r"holds 2, the recording has 3"):
        add_to_cell(tmp_path, photos, accept_all)
    assert content(tmp_path) == before


def test_sessions_and_stationary_arms_are_added(tmp_path: Path) -> None:
    """A second session has any length; the single row of a stationary arm is added to each sample without its pose."""
    add_to_cell(tmp_path, poses("left", 3), accept_all)
    add_to_cell(tmp_path, replace(poses("right", 1), is_still=True), accept_all)
    add_to_cell(tmp_path, replace(poses("right", 5), is_session=True), accept_all)
    assert add_to_cell(tmp_path, replace(poses("left", 1), is_still=True), accept_all).made == 0
    samples = read_recording(tmp_path).samples
    assert [sorted(sample.robots) for sample in samples] == [["left", "right"]] * 8
    lefts = [sample.robots["left"].base_from_flange for sample in samples]
    assert [round(float(pose.translation[1]), 1) for pose in lefts if pose is not None] == [0, 0.1, 0.2, *[0] * 5]
    with pytest.raises(InputError, match=r"robots\.left: is recorded already"):
        add_to_cell(tmp_path, replace(poses("left", 1), is_still=True), accept_all)


def test_equal_image_names_of_two_sessions(tmp_path: Path) -> None:
    """Images of the second session are stored under other names, and its table finds them by their original names."""
    place = tmp_path / "c"
    add_to_cell(place, poses("left", 2, names=True), accept_all)
    add_to_cell(place, images(tmp_path / "one", ["IMG_0.png", "IMG_1.png"]), accept_all)
    (tmp_path / "two").mkdir()
    again = images(tmp_path / "two" / "x", ["IMG_1.png", "IMG_0.png"])
    (tmp_path / "two" / "x" / "IMG_0.png").write_bytes(b"\x89PNG\r\n\x1a\nsecond")
    add_to_cell(place, replace(again, is_session=True), accept_all)
    add_to_cell(place, poses("left", 2, names=True), accept_all)
    last = read_recording(place).samples[-1]
    assert last.images["cam"] == "recording/images/cam/000003_IMG_0.png"
    assert (place / last.images["cam"]).read_bytes() == b"\x89PNG\r\n\x1a\nsecond"
    pose = last.robots["left"].base_from_flange
    assert pose is not None
    assert pose.translation[1] == 0


def test_equal_image_names_of_two_folders(tmp_path: Path) -> None:
    """Each sample has its own image, and the path of an earlier one is not reused."""
    (first,), (second,) = (images(tmp_path / name, ["IMG.png"]).rows for name in "ab")
    (tmp_path / "b" / "IMG.png").write_bytes(b"\x89PNG\r\n\x1a\nsecond")
    cell = {"robots": {"left": {}}, "cameras": {"cam": {"on": "left"}}}
    add_to_cell(tmp_path / "c", Imported("list", "pictures", (first, second), cell), accept_all)
    paths = [sample.images["cam"] for sample in read_recording(tmp_path / "c").samples]
    assert [(tmp_path / "c" / path).read_bytes()[8:] for path in paths] == [b"IMG.png", b"second"]
    assert Path(paths[1]).name == "000001_IMG.png"


def test_import_error_names_source_file(tmp_path: Path) -> None:
    """The error names the source, not the line of a recording that was not written."""
    rows = images(tmp_path / "photos", ["a\\b.png"])
    cell = {**rows.cell, "robots": {"left": {}}}
    with pytest.raises(DatasetError, match=rf"^{tmp_path}/photos: images.cam: .* is not a relative path"):
        add_to_cell(tmp_path / "c", replace(rows, cell=cell), accept_all)
    assert not (tmp_path / "c").exists()


def test_plausibility_check_sees_new_samples_only(tmp_path: Path) -> None:
    """Earlier recorded samples do not affect the check of new ones."""
    add_to_cell(tmp_path, poses("left", 2), accept_all)
    checked: list[Recording] = []
    add_to_cell(tmp_path, poses("right", 2), lambda cell, recording: checked.append(recording) or ())
    assert [sorted(sample.robots) for sample in checked[0].samples] == [["right"]] * 2


def test_controller_follows_recorded_poses(tmp_path: Path) -> None:
    """The controller in `cell.yaml` is kept with its frames until the poses are replaced."""
    folder, place = tmp_path / "c", frozenset({("robots", "left", "controller")})
    first = replace(poses("left", 3), cell={"robots": {"left": {"controller": {"format": "kuka", "base": "BASE_3"}}}})
    add_to_cell(folder, first, accept_all)
    other = replace(poses("left", 3), cell={"robots": {"left": {"controller": {"format": "abb"}}}}, defaults=place)
    add_to_cell(folder, replace(other, is_session=True), accept_all)
    assert read_cell(folder).robots["left"].controller == first.cell["robots"]["left"]["controller"]
    add_to_cell(folder, replace(other, rows=poses("left", 6).rows), accept_all, replace=True)
    assert read_cell(folder).robots["left"].controller == {"format": "abb"}


def test_replaced_files_are_kept_in_originals(tmp_path: Path) -> None:
    """Other robots and other fields of this one are kept; the previous files are copied to `originals`."""
    folder, noise = tmp_path / "c", {"sigma_t_m": 1e-4, "sigma_r_rad": 1e-4}
    add_to_cell(folder, replace(poses("left", 3), cell={"robots": {"left": {"noise": noise}}}), accept_all)
    add_to_cell(folder, poses("right", 3), accept_all)
    before = content(folder)
    other = replace(poses("left", 3), cell={"robots": {"left": {"controller": {"format": "abb"}}}})
    add_to_cell(folder, other, accept_all, replace=True)
    robots = read_cell(folder).robots
    assert list(robots) == ["left", "right"]
    np.testing.assert_array_equal(robots["left"].noise, np.full(6, 1e-4))
    assert robots["left"].controller == {"format": "abb"}
    (kept,) = (folder / "originals").iterdir()
    assert content(kept)["cell.yaml"] == before["cell.yaml"]
    assert content(kept)["samples.jsonl"] == before["recording/samples.jsonl"]


def test_locations_of_added_fields() -> None:
    """A pose or a lens is one location; a target has one for each of its fields."""
    lens = {"status": "free", "guess": {"fx": 1}}
    target = {"kind": "charuco", "squares": [5, 7]}
    data = {"cameras": {"a": {"on": "b", "intrinsics": lens}}, "targets": {"t": target}, "reference": "b"}
    assert set(_locations(data)) == {
        ("cameras", "a", "on"),
        ("cameras", "a", "intrinsics"),
        ("targets", "t", "kind"),
        ("targets", "t", "squares"),
        ("reference",),
    }


def test_defaults_yield_to_existing_values() -> None:
    """A default is omitted only if the cell has a value there, at any depth."""
    new = {"robots": {"a": {"noise": 1, "controller": {"format": "ur"}}}}
    place = frozenset({("robots", "a", "controller")})
    assert _omit_defaults(new, place, {"robots": {"a": {"noise": 2, "controller": 3}}}) == {
        "robots": {"a": {"noise": 1}}
    }
    for old in ({}, None, {"robots": {"a": {"noise": 2}}}, {"robots": {"b": {"controller": 3}}}):
        assert _omit_defaults(new, place, old) == new
    assert _omit_defaults(new, frozenset(), {"robots": {"a": {"controller": 3}}}) == new
