"""Tests of reading and writing `cell.yaml`, and of the errors for an invalid one."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from basecal.cell.cell import Cell, Unknown
from basecal.cell.files import cell_from_dict, cell_to_dict, read_cell, write_cell
from basecal.cell.schema.cell_file import name_problems
from basecal.effects import deflection
from basecal.errors import DatasetError
from basecal.fields.problems import field_name
from basecal.geometry import SE3


def read_text(folder: Path, old: str, new: str) -> Cell:
    """Read the cell after replacing a piece of its text."""
    path = folder / "cell.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return read_cell(folder)


def error(folder: Path, old: str, new: str) -> str:
    with pytest.raises(DatasetError) as caught:
        read_text(folder, old, new)
    return str(caught.value)


def assert_same(one: Any, other: Any) -> None:
    """Equal data; numbers to the last digits, since a quaternion passes through its matrix."""
    if isinstance(one, dict):
        assert list(one) == list(other)
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, list):
        assert len(one) == len(other)
        for left, right in zip(one, other, strict=True):
            assert_same(left, right)
    else:
        assert one == (pytest.approx(other, rel=0, abs=4e-15) if isinstance(other, float) else other)


def test_cell_file_gives_documented_values(folder: Path) -> None:
    """Every notation of a pose, sigma, lens and target gives the transform, sigmas and points that it denotes."""
    cell = read_cell(folder)
    assert_allclose(cell.robots["eye"].noise, [1e-4, 1e-4, 1e-4, 1e-4, 2e-4, 3e-4])
    assert cell.robots["hand"].chain.n == 2
    assert cell.robots["hand"].parameters["joint_offsets"].sigma_rad == 1e-3
    assert_allclose(cell.bases["hand"].mean @ np.array([1.0, 0, 0]), [1, 1, 0], atol=1e-15)
    assert_allclose(cell.bases["still"].mean.translation, [0.1, 0.2, 0.3])
    hall = cell.cameras["hall"]
    assert_allclose(hall.mount.mean.rotation[1, 1], math.cos(3))
    assert_allclose(hall.mount.sigma, [0.01, 0.01, 0.01, 0.1, 0.1, 0.2])
    assert (hall.intrinsics.camera, hall.intrinsics.distortion_terms) == (None, 4)
    assert_allclose(cell.cameras["wrist"].intrinsics.camera.parameters[[0, 3, 4]], [766.5, 358.8, -0.35])
    assert_allclose(cell.targets["light"].mount.sigma, [0.002, 0.002, 0.002, 0, 0, 0])
    assert cell.targets["light"].target.is_point
    assert_array_equal(cell.targets["tags"].target.ids, [12, 13, 14, 15, 28, 29, 30, 31])
    assert cell.cameras["wrist"].mount.status == cell.bases["hand"].status == "free"
    assert cell.targets["unseen"].target is None
    assert cell.pixel_px == 0.3
    assert cell.correlated_px is None


def test_deflection_round_trip(folder: Path) -> None:
    """Deflection is read and written with its sigma and gravity's direction; by default there is none."""
    assert "deflection" not in read_cell(folder).robots["hand"].parameters
    here = "joint_offsets: {status: prior, sigma_rad: 1e-3}"
    stated = "deflection: {status: prior, sigma_rad_per_nm: 2e-5, down: [0, 1, 0]}"
    cell = read_text(folder, here, f"{here}, {stated}")
    wanted = deflection.Stated(status="prior", sigma_rad_per_nm=2e-5, down=[0.0, 1.0, 0.0])
    assert cell.robots["hand"].parameters["deflection"] == wanted
    write_cell(cell, folder)
    assert read_cell(folder).robots["hand"].parameters == cell.robots["hand"].parameters


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("{status: prior}", "takes sigma_rad_per_nm, got none"),
        ("{status: free, sigma_rad_per_nm: 1e-5}", "takes no sigma, got sigma_rad_per_nm"),
        ("{status: free, down: [0, 0, 0]}", "not zero"),
    ],
)
def test_invalid_deflection_is_refused(folder: Path, wrong: str, message: str) -> None:
    """A prior without its sigma, a free deflection with one, and a zero gravity direction are refused."""
    here = "joint_offsets: {status: prior, sigma_rad: 1e-3}"
    assert message in error(folder, here, f"{here}, deflection: {wrong}")


def test_round_trip(folder: Path) -> None:
    """A cell written and read again has the same values."""
    cell = read_cell(folder)
    write_cell(cell, folder)
    again = read_cell(folder)
    assert_same(cell_to_dict(again), cell_to_dict(cell))
    for name, unknown in cell.transforms.items():
        other = again.transforms[name]
        assert unknown.status == other.status
        if unknown.mean is not None:
            assert_array_equal(unknown.mean.translation, other.mean.translation)
            assert_allclose(unknown.mean.rotation, other.mean.rotation, atol=4e-15)
    assert_array_equal(cell.targets["tags"].target.points.round(12), again.targets["tags"].target.points.round(12))


@pytest.mark.journey
@settings(deadline=None)
@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.lists(st.floats(1e-9, 10), min_size=6, max_size=6))
def test_any_prior_survives_round_trip(xi: list[float], sigma: list[float]) -> None:
    """Writing and reading keeps any transform and sigmas of a prior."""
    cell = cell_from_dict({"schema": "basecal/cell/1", "reference": "a", "robots": {"a": None, "b": None}})
    prior = Unknown("prior", SE3.exp(xi), np.array(sigma))
    changed = Cell("a", cell.robots, {"b": prior})
    read = cell_from_dict(cell_to_dict(changed)).bases["b"]
    assert_array_equal(read.mean.translation + 0.0, prior.mean.translation + 0.0)
    assert_allclose(read.mean.rotation, prior.mean.rotation, atol=1e-14)
    assert_array_equal(read.sigma, sigma)


@pytest.mark.parametrize(
    ("intrinsics", "terms", "sigma"),
    [
        ({"status": "fixed", "fx": 1, "fy": 1, "cx": 0, "cy": 0}, 0, None),
        ({"status": "free", "fx": 1, "fy": 1, "cx": 0, "cy": 0}, 5, None),
        ({"status": "free", "distortion_terms": 8}, 8, None),
        (
            {
                "status": "prior",
                **{"fx": 1, "fy": 1, "cx": 0, "cy": 0, "distortion": [0.1] * 4},
                **{"sigma_focal_px": 2, "sigma_center_px": [3, 4], "sigma_distortion": 0.5},
            },
            4,
            [2, 2, 3, 4, 0.5, 0.5, 0.5, 0.5],
        ),
    ],
)
def test_lens_terms_and_sigmas_survive_round_trip(
    intrinsics: dict[str, Any], terms: int, sigma: list[float] | None
) -> None:
    """The term count of a lens is that of its distortion, `distortion_terms` or the default, and survives writing."""
    camera = {"on": "world", "size_px": [9, 9], "intrinsics": intrinsics}
    data = {"schema": "basecal/cell/1", "reference": "a", "robots": {"a": {}}, "cameras": {"c": camera}}
    once = cell_from_dict(data)
    for cell in (once, cell_from_dict(cell_to_dict(once))):
        lens = cell.cameras["c"].intrinsics
        assert lens.distortion_terms == terms
        assert lens.camera is None or len(lens.camera.distortion) == terms
        assert (None if lens.sigma is None else lens.sigma.tolist()) == sigma


def test_all_errors_are_reported_in_file_order(folder: Path) -> None:
    """Different mistakes in one file are reported together, one line each, in the order of the file."""
    text = (folder / "cell.yaml").read_text()
    for old, new in (("fx: 766.5", "fx: -1"), ("noise: {pixel", "noice: {pixel"), ("on: still", "on: stil")):
        text = text.replace(old, new)
    (folder / "cell.yaml").write_text(text)
    with pytest.raises(DatasetError) as caught:
        read_cell(folder)
    lines = str(caught.value).splitlines()
    assert [line.split("cell.yaml:")[1].split(": ")[:2] for line in lines] == [
        ["15", "cameras.wrist.intrinsics.fx"],
        ["34", "targets.tags.on"],
        ["41", "noice"],
    ]
    assert "did you mean 'still'?" in lines[1]
    assert "did you mean 'noise'?" in lines[2]
    assert (caught.value.line, caught.value.field) == (15, "cameras.wrist.intrinsics.fx")


@pytest.mark.journey
@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("basecal/cell/1", "basecal/cell/2", 1, "schema: expected basecal/cell/1, the one version"),
        ("schema: basecal/cell/1", "", 2, "expected basecal/cell/1"),
        ("reference: eye", "reference: eys", 2, "reference: no robot 'eys' (did you mean 'eye'?)"),
        ("still:\n", "still:\n  still:\n", 7, "given twice, first on line 6"),
        ("still:\n", "world:\n", 6, "choose another name"),
        ("still:\n", "Still:\n", 6, "expected a name of a-z"),
        ("still:\n", "a_from_b:\n", 6, "without _from_"),
        ("wrist:\n", "hand:\n", 11, "the name 'hand' is taken by robots.hand"),
        ("wrist:\n", "eye_base:\n", 11, "taken by a frame of 'eye'"),
        ("light: {on: hand", "light: {on: depth", 32, "targets.light.on: no robot 'depth'"),
        ("  hand: {status: free, g", "  eye: {status: free, g", 8, "the base of the reference"),
        (
            "  hand: {status: free, g",
            "  hadn: {status: free, g",
            8,
            "bases.hadn: no robot 'hadn' (did you mean 'hand'?)",
        ),
        ("urdf: hand.urdf", "urdf: ../hand.urdf", 5, "leaves the cell"),
        ("urdf: hand.urdf", "urdf: /etc/passwd", 5, "relative path"),
        ("urdf: hand.urdf", "urdf: arm.urdf", 5, "there is no file 'arm.urdf'"),
        ("flange_link: tool0", "flange_link: tool", 5, "did you mean 'tool0'?"),
        ("flange_link: tool0, ", "", 5, "go together"),
        ("status: prior, sigma_rad: 1e-3", "status: free, sigma_rad: 1e-3", 5, "takes no sigma"),
        ("noise: {sigma_t_m: 1e-4", "noise: {sigma_t_m: 0", 4, "one positive number or 3"),
        ("sigma_t_m: 1e-4", "sigma_t_m: [1, 2]", 4, "one positive number or 3"),
        ("sigma_t_m: 1e-4", "sigma_t_m: .nan", 4, "one positive number or 3"),
        ("q_xyzw: [0, 0, 0, 1], sigma", "q_xyzw: [0, 0, 0, 1.01], sigma", 26, "has norm 1.01"),
        ("q_xyzw: [0, 0, 0, 1], sigma", "q_xyzw: [0, 0, 1], sigma", 26, "targets.board.mount.q_xyzw"),
        ("q_xyzw: [0, 0, 0, 1], sigma", "sigma", 26, "exactly one of q_xyzw, rotvec_rad, rpy_deg"),
        ("rpy_deg: [0, 0, 90]", "rpy_deg: [0, 0, 90], q_xyzw: [0, 0, 0, 1]", 8, "exactly one of"),
        ("[[1, 0, 0, 0.1]", "[[1, 0.1, 0, 0.1]", 9, "not a rotation"),
        ("[0, 0, 0, 1]]}", "[0, 0, 0, 1]], t_m: [0, 0, 0]}", 9, "`matrix` alone"),
        ("[0, 0, 0, 1]]}", "[0, 0, 0, 1]], sigma_t_m: 1}", 9, "status fixed has none"),
        ("status: free, guess: {t_m", "status: fixed, guess: {t_m", 8, "takes no guess"),
        ("guess: {t_m: [1, 0, 0], rpy_deg: [0, 0, 90]}", "t_m: [1, 0, 0]", 8, "`guess: {...}`"),
        ("sigma_t_m: 0.01, ", "", 18, "needs sigma_t_m"),
        ("t_m: [0, 0, 0.1]", "rpy_deg: [0, 0, 9], t_m: [0, 0, 0.1]", 32, "no rotation"),
        ("sigma_t_m: 0.002", "sigma_t_m: 0.002, sigma_r_rad: 0.1", 32, "single point has no rotation"),
        ("fy: 765.4, ", "", 15, "needs fy"),
        ("fx: 766.5", "fx: 1e400", 15, "fx: expected a finite number"),
        ("fx: 766.5", "fx: " + "9" * 5000, 15, "not a number that can be read"),
        ("fx: 766.5", "fx: 0x" + "f" * 5000, 15, "fx"),
        ("fx: 766.5", "fx: '766.5'", 15, "fx: expected a number"),
        ("fx: 766.5", "fx: true", 15, "fx: expected a number"),
        ("[-0.35, 0.179, 0, 0, 0]", "[-0.35, 0.179, 0]", 15, "0 or 4 or 5 or 8 or 12 terms"),
        ("intrinsics: {status: free}", "intrinsics: {status: free, distortion_terms: 5}", 21, "fisheye camera has 4"),
        ("size_px: [800, 600]", "size_px: [800, 0]", 20, "size_px[1]"),
        ("    size_px: [800, 600]\n", "", 20, "needs size_px"),
        ("kind: charuco", "kind: charucco", 27, "no kind 'charucco' (did you mean 'charuco'?)"),
        ("kind: charuco", "kind: [charuco]", 27, "no kind a list"),
        ("marker_m: 0.03", "marker_m: 0.04", 24, "not below square_m"),
        ("squares: [5, 7]", "squares: [5, 1e9]", 28, "squares[1]"),
        ("squares: [5, 7]", "squares: [5, 1000000000]", 28, "squares[1]"),
        ("DICT_4X4_50", "DICT_4X4_5", 31, "did you mean 'DICT_4X4_50'?"),
        ("id: 7", "id: 3", 37, "tag 3 is given twice"),
        ("t_m: [0.2, 0, 0], q_xyzw: [0, 0, 0, 1]", "", 37, "tag 7 has no pose"),
        ("tag36h11", "tag36h12", 36, "no family 'tag36h12'"),
        ("noise: {pixel_px: 0.3}", "noise: {pixel_px: -0.3}", 41, "noise.pixel_px"),
        ("noise: {pixel_px: 0.3}", "noise: {correlated_px: 0.3}", 41, "correlated_px needs pixel_px"),
        ("noise: {pixel_px: 0.3}", "noise: [1]", 41, "noise: expected a mapping"),
        ("reference: eye", "reference: &a eye", 2, "aliases and anchors"),
        ("reference: eye", "reference: *a", 2, "aliases and anchors"),
        ("reference: eye", "reference: !!str eye", 2, "tags"),
        ("reference: eye", "reference: !!python/object:os.system eye", 2, "tags"),
        ("reference: eye", "reference: [eye", 2, "not YAML: the bracket that opens here is not closed"),
        ("reference: eye", "? [a]\n: b", 2, "is not a name"),
        ("reference: eye", "<<: {reference: eye}", 2, "<<: unknown field"),
        ("reference: eye", "reference: " + "[" * 5000, 2, "nested deeper"),
    ],
)
def test_invalid_cell_files_are_refused(folder: Path, old: str, new: str, line: int, words: str) -> None:
    """Unreadable content is an error with path, line and the expected value."""
    message = error(folder, old, new)
    first = next(part for part in message.splitlines() if words in part)
    assert first.startswith(str(folder / "cell.yaml"))
    assert f"cell.yaml:{line}: " in first or (line == 2 and "cell.yaml:1: " in first)


def test_near_rotations_are_projected(folder: Path) -> None:
    """A quaternion and a matrix off by less than 1e-3 give the nearest rotation."""
    cell = read_text(folder, "q_xyzw: [0, 0, 0, 1], sigma", "q_xyzw: [0, 0, 0, 1.0005], sigma")
    assert_allclose(cell.targets["board"].mount.mean.rotation, np.eye(3), atol=1e-15)
    cell = read_text(folder, "[[1, 0, 0, 0.1]", "[[1.0005, 0, 0, 0.1]")
    assert_allclose(cell.bases["still"].mean.rotation, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00binary", b"\x00\x01\x02", bytes(range(256)), b"\x80" * 1000])
def test_binary_file_is_refused(folder: Path, content: bytes) -> None:
    """Bytes that are not text are an error that names the file."""
    (folder / "cell.yaml").write_bytes(content)
    with pytest.raises(DatasetError, match=r"cell\.yaml"):
        read_cell(folder)


@pytest.mark.parametrize("content", ["", "[]", "3", "a cell"])
def test_file_without_mapping_is_refused(folder: Path, content: str) -> None:
    """The error for a file without a mapping shows the first line of a valid one."""
    (folder / "cell.yaml").write_text(content)
    with pytest.raises(DatasetError, match="schema: basecal/cell/1"):
        read_cell(folder)


def test_missing_cell_file_is_explained(tmp_path: Path) -> None:
    """The error for a folder without `cell.yaml` states what a cell is."""
    with pytest.raises(DatasetError, match=r"a cell is a folder with a cell\.yaml"):
        read_cell(tmp_path)


def test_links_out_of_cell_are_refused(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A symbolic link must not lead out of the cell; one that stays inside is followed."""
    outside = tmp_path_factory.mktemp("outside") / "arm.urdf"
    outside.write_text((folder / "hand.urdf").read_text())
    (folder / "arm.urdf").symlink_to(outside)
    assert "leaves the cell by a link" in error(folder, "urdf: hand.urdf", "urdf: arm.urdf")
    (folder / "inner.urdf").symlink_to(folder / "hand.urdf")
    assert read_text(folder, "urdf: arm.urdf", "urdf: inner.urdf").robots["hand"].chain.n == 2


def test_rewriting_leaves_no_temporary_file(folder: Path) -> None:
    """Writing a cell leaves one file, without a half-written one beside it."""
    write_cell(read_cell(folder), folder)
    assert sorted(path.name for path in folder.iterdir()) == ["cell.yaml", "hand.urdf", "recording"]


def test_yaml_1_2_rules_apply(folder: Path) -> None:
    """`on` is text and `1e-4` is a number, as in YAML 1.2."""
    assert read_cell(folder).cameras["wrist"].on == "eye"
    assert read_cell(folder).robots["eye"].noise[0] == 1e-4


def test_correlated_px_round_trip(folder: Path) -> None:
    """`correlated_px` is written and read back unchanged."""
    path = folder / "cell.yaml"
    path.write_text(path.read_text().replace("{pixel_px: 0.3}", "{pixel_px: 0.3, correlated_px: 0.4}"))
    cell = read_cell(folder)
    write_cell(cell, folder)
    assert (read_cell(folder).pixel_px, read_cell(folder).correlated_px) == (0.3, 0.4)


def problems(**changed):
    data = {"reference": "eye", "robots": {"eye": {}, "hand": {}}, "bases": {"hand": {}}}
    data |= {"cameras": {"wrist": {"on": "eye"}, "hall": {"on": "world"}}, "targets": {"board": {"on": "hand"}}}
    return {field_name(p.loc): p.message for p in name_problems(data | changed)}


def test_valid_names_give_no_problem():
    """A valid cell has no name problems, nor has one without sections or with sections of a wrong type."""
    assert problems() == {}
    assert problems(robots={"eye": {}, "a1_b": {}, "hand": {}}) == {}
    assert name_problems({}) == []
    assert problems(cameras=[1], targets="x", bases=None) == {}


@pytest.mark.parametrize("name", ["Arm", "1a", "_a", "a-b", "a b", "", "a_from_b", "a_in_b", 5, "ä"])
def test_invalid_names_are_refused(name):
    """Names consist of a-z, 0-9 and _, start with a letter, and must not read as a transform or a point."""
    (message,) = problems(targets={name: {"on": "eye"}}).values()
    assert message.startswith("expected a name of a-z, 0-9 and _, a letter first, without _from_ or _in_; rename ")


def test_world_is_reserved():
    """`world` is the base of the reference, so no target may have that name."""
    assert problems(targets={"world": {"on": "eye"}}) == {
        "targets.world": "'world' is the base of the reference robot; choose another name"
    }


@pytest.mark.parametrize(
    ("name", "owner"),
    [
        ("eye", "robots.eye"),
        ("wrist", "cameras.wrist"),
        ("hand_base", "a frame of 'hand'"),
        ("eye_flange", "a frame of 'eye'"),
    ],
)
def test_names_are_unique_across_sections(name, owner):
    """Names are unique over all sections and differ from the frames of robots."""
    (message,) = problems(targets={name: {"on": "eye"}}).values()
    assert message == f"the name {name!r} is taken by {owner}; names are unique"


def test_unknown_references_are_refused():
    """The reference, the carriers of cameras and targets, and the robots of bases must exist."""
    assert problems(reference="eyes", bases={})["reference"] == (
        "no robot 'eyes' (did you mean 'eye'?); there are: eye, hand"
    )
    assert problems(targets={"board": {"on": "hind"}})["targets.board.on"].endswith("there are: eye, hand, world")
    assert problems(cameras={"wrist": {"on": "moon"}})["cameras.wrist.on"].startswith("no robot 'moon'")
    assert problems(bases={"arm": {}})["bases.arm"].startswith("no robot 'arm'")
    assert problems(bases={"eye": {}})["bases.eye"] == "the base of the reference 'eye' is `world` itself; remove it"
    assert problems(robots={}, bases={}, cameras={}, targets={})["reference"].endswith("there are: none")
