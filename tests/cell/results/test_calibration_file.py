"""Tests of `calibration.json`: computed values, nulls for the rest, and a folder for each run."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from basecal.cell.calibration import (
    Calibration,
    Certificate,
    Finding,
    Loop,
    Outlier,
    Residuals,
    RobotParameters,
    SampleResidual,
    Validation,
)
from basecal.cell.files import (
    calibration_from_dict,
    calibration_to_dict,
    input_hashes,
    latest_run,
    read_calibration,
    read_cell,
    run_names,
    write_calibration,
)
from basecal.cell.results.calibration_file import indent_json, read_calibration_data, run_folder
from basecal.errors import DatasetError, FrameNotFound, InputError
from basecal.geometry import SE3, Camera, PoseEstimate

SEEN = np.ones((3, 6), dtype=bool)
SIX = [[0.0] * 6] * 6
BASE, LIGHT = "eye_base_from_hand_base", "hand_flange_from_light"
DATA = {"a": [[1.0, 2.5e-7], [None, True]], "b": {"c": {}, "d": '"x" \u00e9'}, "e": [], "f": {"g": 1, "h": "y"}}


def example() -> Calibration:
    spread = np.diag([1e-6, 2e-6, 3e-6, 1e-8, 2e-8, 3e-8])
    point = np.diag([1e-6, 2e-6, 3e-6, 0, 0, 0])
    spread_rad = np.array([[math.nan, math.nan], [math.nan, 4e-6]])
    known = np.array([math.nan, 0.01]), np.array([math.nan, 0.002]), np.array([False, True]), spread_rad
    camera = Camera("pinhole", np.array([700.0, 701, 320, 240, 0.1, 0.2, 0, 0, 0]), (640, 480))
    return Calibration(
        verdict="doubtful",
        transforms={
            BASE: PoseEstimate(SE3.exp([1, 2, 3, 0.1, 0.2, 0.3]), spread),
            LIGHT: PoseEstimate(SE3.exp([0, 0, 0.1, 0, 0, 0]), point),
        },
        status={BASE: "free", LIGHT: "prior"},
        points=frozenset({LIGHT}),
        cameras={"wrist": (camera, np.eye(9))},
        robot_parameters={
            "joint_offsets": {"hand": RobotParameters(("pan", "lift"), *known)},
            "link_parameters": {"hand": RobotParameters((), np.arange(18.0).reshape(3, 6), np.ones((3, 6)), SEEN)},
            "deflection": {"hand": RobotParameters(("pan",), np.array([1e-5]), np.array([math.nan]), SEEN[0, :1])},
        },
        noise={
            "pixel_px": np.float64(0.2),
            "robots": {"eye": {"sigma_t_m": [1e-4, 1e-4, math.nan], "sigma_r_rad": [1e-4] * 3}},
        },
        order=(BASE,),
        joint_covariance=spread,
        residuals=Residuals(
            0.2,
            0.1,
            4e-4,
            math.radians(0.05),
            (SampleResidual(3, "wrist", "board", 0.3, 1e-3, None),),
            (Loop(("eye_base", "wrist", "board", "hand_base"), 9, 4e-4, math.radians(0.05)),),
        ),
        outliers=(Outlier(4, "wrist", "board", (1, 2), "stray"),),
        validation=Validation("k-fold", 5, 0.3, 4e-4, math.radians(0.05), 1.1),
        certificate=Certificate(None, None, "signs are ambiguous"),
        condition=math.inf,
        unobservable=("none",),
        findings=(Finding("not-converged", "warning", ("3",), "why"),),
        settings={"seed": np.int64(3), "path": Path("x"), "pair": (1, 2)},
        inputs={"cell.yaml": "sha256:0"},
        versions={"numpy": "2.0"},
    )


def test_documented_fields_and_units() -> None:
    """The keys are the documented ones, in millimetres and degrees if their names state so; unknown values are null."""
    data = calibration_to_dict(example())
    assert (data["schema"], data["verdict"]) == ("basecal/calibration/1", "doubtful")
    assert data["transforms"][BASE].keys() == {"t_m", "q_xyzw", "covariance", "status", "verdict"}
    assert np.shape(data["transforms"][BASE]["covariance"]) == (6, 6)
    assert data["transforms"][LIGHT]["covariance"] == [[1e-6, 0, 0], [0, 2e-6, 0], [0, 0, 3e-6]]
    assert data["intrinsics"]["wrist"] == {
        **{"model": "pinhole", "fx": 700.0, "fy": 701.0, "cx": 320.0, "cy": 240.0, "size_px": [640, 480]},
        **{"distortion": [0.1, 0.2, 0.0, 0.0, 0.0], "covariance": np.eye(9).tolist()},
    }
    assert data["joint"]["order"] == [BASE]
    residuals = data["residuals"]
    assert (residuals["rms_px"], residuals["loop_rms_mm"]) == (0.2, 0.4)
    assert residuals["loop_rms_deg"] == pytest.approx(0.05)
    assert residuals["per_sample"] == [
        {"sample": 3, "camera": "wrist", "target": "board", "rms_px": 0.3, "loop_mm": 1.0, "loop_deg": None}
    ]
    (loop,) = residuals["loops"]
    assert loop["path"] == ["eye_base", "wrist", "board", "hand_base"]
    assert (loop["views"], loop["rms_mm"], loop["rms_deg"]) == (9, 0.4, pytest.approx(0.05))
    assert data["clock_offset_s"] is None
    assert data["joint_offsets_rad"] == {"hand": [None, 0.01]}
    assert data["joint_offsets_sigma_rad"] == {"hand": [None, 0.002]}
    assert data["joint_offsets_seen"] == {"hand": [False, True]}
    assert data["joint_names"] == {"hand": ["pan", "lift"]}
    compliances = {"rad_per_nm": [1e-5], "sigma_rad_per_nm": [None], "seen": [True], "joint_names": ["pan"]}
    assert data["deflection"] == {"hand": compliances}
    assert data["link_parameters"]["hand"]["r_rad"] == [[3, 4, 5], [9, 10, 11], [15, 16, 17]]
    place = {"sample": 4, "camera": "wrist", "target": "board", "image": None}
    assert data["outliers"] == [{**place, "ids": [1, 2], "reason": "stray"}]
    held_out = {"target_mm": 0.4, "target_deg": pytest.approx(0.05), "base_change": 1.1, "rivals": []}
    assert data["validation"] == {"kind": "k-fold", "folds": 5, "rms_px": 0.3, **held_out}
    assert data["certificate"] == {"gap": None, "global": None, "reason": "signs are ambiguous"}
    unasked = calibration_to_dict(Calibration("refused"))
    never = ("outliers", "validation", "certificate", "joint_offsets_rad", "joint_offsets_sigma_rad", "link_parameters")
    assert [unasked[name] for name in never] == [None] * len(never)
    assert data["observability"] == {"condition": None, "unobservable": ["none"]}
    assert data["noise"]["robots"]["eye"]["sigma_t_m"] == [1e-4, 1e-4, None]
    assert data["settings"] == {"seed": 3, "path": "x", "pair": [1, 2]}


def test_round_trip(tmp_path: Path) -> None:
    """A written calibration is strict JSON and reads back to the same values."""
    path = write_calibration(example(), tmp_path)

    def refuse(token: str) -> None:
        raise AssertionError(token)

    json.loads(path.read_text(), parse_constant=refuse)
    calibration, want = read_calibration(path), example()
    for name, estimate in want.transforms.items():
        assert_allclose(calibration[name].mean.matrix, estimate.mean.matrix, atol=1e-15)
        assert_array_equal(calibration[name].covariance, estimate.covariance)
    assert (calibration.points, calibration.status, calibration.order) == (want.points, want.status, want.order)
    assert_array_equal(calibration.joint_covariance, want.joint_covariance)
    assert_array_equal(calibration.cameras["wrist"][0].parameters, want.cameras["wrist"][0].parameters)
    assert (calibration.findings, calibration.unobservable, calibration.inputs, calibration.versions) == (
        want.findings,
        want.unobservable,
        want.inputs,
        want.versions,
    )
    (loop,), (wanted,) = calibration.residuals.loops, want.residuals.loops
    assert (loop.path, loop.views, loop.rms_m) == (wanted.path, wanted.views, pytest.approx(wanted.rms_m, rel=1e-14))
    assert (calibration.outliers, calibration.certificate) == (want.outliers, want.certificate)
    assert calibration.validation is not None
    assert calibration.validation.target_rad == pytest.approx(math.radians(0.05), rel=1e-14)
    assert calibration.residuals.per_sample == want.residuals.per_sample
    found, was = calibration.parameters_of_robot("hand"), want.parameters_of_robot("hand")
    assert found.keys() == was.keys()
    for kind, of in found.items():
        assert of.joints == was[kind].joints
        for name in ("values", "sigma", "seen"):
            assert_array_equal(getattr(of, name), getattr(was[kind], name))
    assert_array_equal(found["joint_offsets"].covariance, was["joint_offsets"].covariance)
    assert calibration.residuals.loop_rms_rad == pytest.approx(want.residuals.loop_rms_rad, rel=1e-14)
    assert calibration_to_dict(read_calibration(path.parent))["residuals"] == calibration_to_dict(want)["residuals"]


def test_unreadable_calibration_is_not_written(tmp_path: Path) -> None:
    """An invalid value such as negative noise is an error that names the field, and no run is created."""
    calibration = Calibration("refused", noise={"pixel_px": -1.0})
    with pytest.raises(InputError, match=r"^nothing was written.*noise\.pixel_px"):
        write_calibration(calibration, tmp_path)
    assert run_names(tmp_path) == ()


def test_huge_noise_is_read_back(tmp_path: Path) -> None:
    """The calibration of a recording that fits no model has noise beyond any image; its refusal is written with it."""
    calibration = Calibration("refused", noise={"pixel_px": 2e9})
    assert read_calibration(write_calibration(calibration, tmp_path)).noise == calibration.noise


def test_runs_of_one_second_have_own_folders(tmp_path: Path) -> None:
    """Runs within one second get separate folders, and the latest is the last one written."""
    assert latest_run(tmp_path) is None
    paths = [write_calibration(Calibration("good"), tmp_path) for _ in range(12)]
    assert len(set(paths)) == 12
    assert all(re.fullmatch(r"\d{8}T\d{6}Z(-\d+)?", path.parent.name) for path in paths)
    (tmp_path / "runs" / "99999999T999999Z").mkdir()
    assert latest_run(tmp_path) == paths[-1].parent


def test_latest_run_is_last_written(tmp_path: Path) -> None:
    """The last written run is the latest even if a wrong clock dated an earlier one in the future."""
    past = write_calibration(Calibration("good"), tmp_path)
    future = past.parent.rename(tmp_path / "runs" / "29990101T000000Z")
    os.utime(future / "calibration.json", ns=(1, 1))
    now = write_calibration(Calibration("good"), tmp_path)
    assert latest_run(tmp_path) == now.parent
    assert run_names(tmp_path) == (now.parent.name, "29990101T000000Z")
    assert run_names(tmp_path / "runs") == ()


def test_input_hashes_are_sha256(folder: Path) -> None:
    """Each existing input has the SHA-256 of its bytes; URDFs are included if the cell is given."""
    hashes = input_hashes(folder, read_cell(folder))
    assert list(hashes) == ["cell.yaml", "recording/samples.jsonl", "hand.urdf"]
    for name, value in hashes.items():
        assert value == f"sha256:{hashlib.sha256((folder / name).read_bytes()).hexdigest()}"
    (folder / "recording" / "samples.jsonl").unlink()
    assert list(input_hashes(folder)) == ["cell.yaml"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema": "basecal/calibration/9"}, "the one version"),
        ({"verdict": "fine"}, "expected 'good', 'doubtful' or 'refused'"),
        ({"transforms": []}, "transforms: expected a mapping"),
        (
            {
                "transforms": {
                    BASE: {
                        "t_m": [0, 0, 0],
                        "q_xyzw": [0, 0, 0, 2],
                        "covariance": SIX,
                        "status": None,
                        "verdict": "good",
                    }
                }
            },
            "norm 2",
        ),
        ({"residuals": {}}, "residuals.rms_px: missing"),
        ({"joint": {"order": [], "covariance": [[1, 2]]}}, "expected a square"),
    ],
)
def test_foreign_calibration_is_refused(tmp_path: Path, change: dict[str, object], words: str) -> None:
    """A calibration that this program did not write is an error with the path and the reason."""
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps(calibration_to_dict(example()) | change))
    with pytest.raises(DatasetError, match=words) as caught:
        read_calibration(path)
    assert caught.value.path == str(path)


def test_missing_calibration_is_explained(tmp_path: Path) -> None:
    """The error for a missing result states to calibrate first."""
    with pytest.raises(DatasetError, match="calibrate first"):
        read_calibration(tmp_path)


def test_null_covariance_reads_as_nan() -> None:
    """A covariance that was not finite is null on disk and NaN again when read."""
    data = calibration_to_dict(Calibration("good", joint_covariance=np.full((6, 6), np.inf), order=(BASE,)))
    assert data["joint"]["covariance"][0][0] is None
    assert np.isnan(calibration_from_dict(data).joint_covariance).all()


def test_run_is_found_by_name(tmp_path: Path) -> None:
    """A run is found by name if it has a result; otherwise the error lists the runs that have one."""
    one = write_calibration(Calibration("good"), tmp_path).parent
    (tmp_path / "runs" / "empty").mkdir()
    assert run_folder(tmp_path, one.name) == one
    with pytest.raises(FrameNotFound, match=one.name) as caught:
        run_folder(tmp_path, "empty")
    assert "empty" not in str(caught.value).split(one.name, 1)[1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"a": NaN}', "NaN is not JSON; calibrate again"),
        ('{"a": -Infinity}', "-Infinity is not JSON; calibrate again"),
        ("[" * 100_000, "nested too deeply"),
        ('{"a": "\\uD800"}', r"text has an unpaired surrogate (\ud800 to \udfff); calibrate again"),
        ('\n{"a": }', "not JSON (Expecting value); calibrate again"),
    ],
)
def test_invalid_json_is_explained(tmp_path: Path, text: str, words: str) -> None:
    """The error states the problem with the file, and the line if it is known."""
    path = tmp_path / "calibration.json"
    path.write_text(text)
    line = ":2" if "Expecting" in words else ""
    with pytest.raises(DatasetError, match=f"^{re.escape(f'{path}{line}: {words}')}"):
        read_calibration_data(path)


def test_surrogate_pair_is_one_character(tmp_path: Path) -> None:
    """An escaped surrogate pair is read as one character."""
    (tmp_path / "calibration.json").write_text('{"a": "\\ud83d\\ude00"}')
    assert read_calibration_data(tmp_path) == {"a": "\U0001f600"}


def test_only_timestamped_folders_are_runs(tmp_path: Path) -> None:
    """Other folders, and those without a calibration, are no runs.

    Runs written at once are sorted by time and number, highest first.
    """
    for name in ("20260101T000000Z", "20260101T000000Z-2", "20260101T000000Z-10", "notes", "20270101T000000Z"):
        folder = tmp_path / "runs" / name
        folder.mkdir(parents=True)
        if name != "20270101T000000Z":
            (folder / "calibration.json").write_text("{}")
            os.utime(folder / "calibration.json", ns=(1, 1))
    assert run_names(tmp_path) == ("20260101T000000Z-10", "20260101T000000Z-2", "20260101T000000Z")
    assert latest_run(tmp_path / "nowhere") is None


@pytest.mark.parametrize("link", ["runs", "runs/20260102T030405Z", "runs/20260102T030405Z/calibration.json"])
def test_runs_are_not_read_through_outside_links(tmp_path: Path, link: str) -> None:
    """A run behind any link that leads out of the cell is refused."""
    outside, cell = tmp_path / "outside", tmp_path / "cell"
    for folder in (outside, cell):
        (folder / "runs" / "20260102T030405Z").mkdir(parents=True)
        (folder / "runs" / "20260102T030405Z" / "calibration.json").write_text("{}")
    assert run_names(cell) == ("20260102T030405Z",)
    there = cell / link
    shutil.rmtree(there) if there.is_dir() else there.unlink()
    there.symlink_to(outside / link)
    for read in (latest_run, run_names, lambda folder: run_folder(folder, "20260102T030405Z")):
        with pytest.raises(DatasetError, match="is a link that leads out of the cell"):
            read(cell)


def test_indented_json_keeps_data():
    """Indented JSON holds the same data as given to `json.loads`, to the last digit."""
    assert json.loads(indent_json(DATA)) == DATA


def test_innermost_lists_stay_on_one_line():
    """Lists and mappings without nested ones are not broken over lines."""
    assert indent_json(DATA).split("\n") == [
        "{",
        ' "a": [',
        "  [1.0, 2.5e-07],",
        "  [null, true]",
        " ],",
        ' "b": {',
        '  "c": {},',
        '  "d": "\\"x\\" \\u00e9"',
        " },",
        ' "e": [],',
        ' "f": {"g": 1, "h": "y"}',
        "}",
    ]


def test_non_finite_json_is_refused():
    """NaN is refused, since no JSON reader would accept it."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        indent_json({"a": [float("nan")]})
