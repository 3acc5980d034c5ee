"""Tests of names and statuses of a cell's transforms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from tests.touch_cells import clamp_cell, touch_cell

from basecal.cell import WORLD, Cell, CellCamera, CellTarget, Clock, Intrinsics, Robot, RollingShutter, Unknown
from basecal.cell.cell import KeepOut, grip_name
from basecal.cell.schema.cell_dict import cell_to_dict
from basecal.cell.schema.cell_schema import CameraEntry, RobotEntry
from basecal.errors import FrameNotFound, InputError
from basecal.geometry import SE3, Camera
from basecal.simulation import Scenario, simulate

FIXED = Unknown("fixed", SE3.identity())


def cell(base=FIXED, mount=FIXED):
    return Cell(
        "eye",
        {"hand": Robot("hand"), "eye": Robot("eye"), "third": Robot("third")},
        bases={"hand": base, "third": FIXED},
        cameras={"wrist": CellCamera("wrist", "eye", FIXED), "hall": CellCamera("hall", WORLD, mount)},
        targets={"board": CellTarget("board", "hand", FIXED)},
    )


def test_transform_names_state_both_frames():
    """Bases start from the reference's base and mounts from their carrier, in the order bases, cameras, targets."""
    assert list(cell().transforms) == [
        "eye_base_from_hand_base",
        "eye_base_from_third_base",
        "eye_flange_from_wrist",
        "eye_base_from_hall",
        "hand_flange_from_board",
    ]
    assert cell().base_name("hand") == "eye_base_from_hand_base"
    assert cell().mount_name("board") == "hand_flange_from_board"
    with pytest.raises(FrameNotFound, match=r"no 'bord' \(did you mean 'board'\?\); there are: wrist, hall, board"):
        cell().mount_name("bord")


def test_unstated_base_is_free():
    """Robots without a base in the cell have a free one; the reference has none."""
    bare = Cell("eye", {"eye": Robot("eye"), "hand": Robot("hand")})
    assert {name: u.status for name, u in bare.transforms.items()} == {"eye_base_from_hand_base": "free"}


@pytest.mark.parametrize(
    ("base", "mount", "asked"),
    [
        (Unknown(), Unknown(), ["eye_base_from_hand_base"]),
        (Unknown("prior", SE3.identity(), np.ones(6)), Unknown(), ["eye_base_from_hand_base"]),
        (FIXED, Unknown(), ["eye_base_from_hall"]),
        (FIXED, FIXED, []),
    ],
)
def test_requested_transforms(base, mount, asked):
    """The bases that are not fixed are requested; if all are fixed, the mounts that are not."""
    assert cell(base, mount).requested_transforms == asked


def test_distortion_terms_of_camera():
    """A camera has the terms of its lens, the requested ones, the model's usual ones, or none without a lens."""
    lens = Camera("pinhole", np.array([500.0, 500, 320, 240, 0.1, 0, 0, 0]), (640, 480))
    for intrinsics, terms in (
        (None, 0),
        (Intrinsics("fixed", lens), 4),
        (Intrinsics("free", None, None, 8), 8),
        (Intrinsics("free", None, None, 0), 0),
        (Intrinsics("free"), 5),
    ):
        assert CellCamera("wrist", "eye", intrinsics=intrinsics).distortion_terms == terms
    assert CellCamera("wrist", "eye", model="fisheye", intrinsics=Intrinsics("free")).distortion_terms == 4


def test_with_transform_replaces_one_transform():
    """`with_transform` replaces one base or mount of a camera or target; everything else is unchanged."""
    cell = simulate(Scenario(samples=1), 0).cell
    for name in cell.transforms:
        changed = cell.with_transform(name, Unknown("fixed", SE3.identity()))
        assert {n: u.status for n, u in changed.transforms.items() if u.status != cell.transforms[n].status} == {
            name: "fixed"
        }


def test_inconsistent_names_are_refused():
    """A key that differs from the name, and a carrier or reference that is no robot, are refused at once."""
    eye, wrist = {"eye": Robot("eye")}, {"wrist": CellCamera("wrist", "eye")}
    for wrong, message in (
        (lambda: Cell("eye", {"eye": Robot("left")}), "'left' is listed under the name 'eye'"),
        (lambda: Cell("eye", {"eyes": Robot("eyes")}), "reference: no robot 'eye'.*did you mean 'eyes'"),
        (lambda: Cell("eye", eye, cameras={"wrist": CellCamera("wrist", "hand")}), "wrist: no robot 'hand'"),
        (lambda: Cell("eye", eye, bases={"hand": FIXED}, cameras=wrist), "hand: no robot 'hand'"),
    ):
        with pytest.raises(InputError, match=message):
            wrong()
    assert repr(Cell("eye", eye, cameras=wrist)) == "<cell of eye: wrist on eye>"


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"offset_s": 0.5},
        {"status": "free"},
        {"status": "prior", "offset_s": 0.01, "sigma_s": 0.002},
        {"offset_s": 0.01, "jitter_s": 0.002},
    ],
)
def test_clock_round_trip(data):
    """A stated clock is written and read back unchanged; a camera without one writes none."""
    entry = CameraEntry.model_validate({"on": "world", "clock": data})
    assert entry.clock == Clock(**data)
    camera = CellCamera("wrist", WORLD, clock=entry.clock)
    written = cell_to_dict(Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": camera}))["cameras"]["wrist"]["clock"]
    assert CameraEntry.model_validate({"on": "world", "clock": written}).clock == entry.clock
    bare = cell_to_dict(Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": CellCamera("wrist", WORLD)}))
    assert "clock" not in bare["cameras"]["wrist"]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"status": "prior"}, "status prior takes sigma_s"),
        ({"status": "free", "sigma_s": 0.1}, "status free takes no sigma_s"),
        ({"offset_s": 1e13}, "less than or equal"),
        ({"offset_s": "1"}, "valid number"),
        ({"status": "prior", "sigma_s": 0.0}, "sigma_s"),
        ({"lag_s": 1.0}, "lag_s"),
        ({"jitter_s": 2.0}, "jitter_s"),
    ],
)
def test_invalid_clocks_are_refused(data, message):
    """Numbers of a clock are checked like those of other entries."""
    with pytest.raises(ValidationError, match=message):
        CameraEntry.model_validate({"on": "world", "clock": data})


@pytest.mark.parametrize(
    "data", [{"line_time_s": 1.5e-5}, {"status": "free"}, {"status": "prior", "line_time_s": -2e-5, "sigma_s": 1e-6}]
)
def test_rolling_shutter_round_trip(data):
    """A stated rolling shutter is written and read back unchanged; a camera without one writes none."""
    entry = CameraEntry.model_validate({"on": "world", "rolling_shutter": data})
    assert entry.rolling_shutter == RollingShutter(**data)
    cameras = {"wrist": CellCamera("wrist", WORLD, rolling_shutter=entry.rolling_shutter)}
    written = cell_to_dict(Cell("eye", {"eye": Robot("eye")}, cameras=cameras))["cameras"]["wrist"]["rolling_shutter"]
    assert CameraEntry.model_validate({"on": "world", "rolling_shutter": written}) == entry
    bare = cell_to_dict(Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": CellCamera("wrist", WORLD)}))
    assert "rolling_shutter" not in bare["cameras"]["wrist"]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "status fixed takes line_time_s, the time from a row to the next"),
        ({"status": "prior", "line_time_s": 1e-5}, "status prior takes sigma_s"),
        ({"line_time_s": 1e-5, "sigma_s": 1e-6}, "status fixed takes no sigma_s"),
        ({"line_time_s": 0.015}, "less than or equal"),
        ({"line_time_s": "1e-5"}, "valid number"),
        ({"line_time_s": 1e-5, "line_time_ms": 0.015}, "line_time_ms"),
        (3, "dictionary"),
    ],
)
def test_invalid_rolling_shutters_are_refused(data, message):
    """Numbers of a rolling shutter are checked like those of other entries."""
    with pytest.raises(ValidationError, match=message):
        CameraEntry.model_validate({"on": "world", "rolling_shutter": data})


def test_robot_clock_takes_no_jitter():
    """Jitter is the timing of a camera's view against everything that moves, so a robot's clock has none."""
    with pytest.raises(ValidationError, match="jitter_s belongs to the clock of a camera"):
        RobotEntry.model_validate({"clock": {"jitter_s": 0.002}})


def test_with_transform_replaces_one_plate():
    """Replacing one plate of several leaves the other plates, bases and mounts unchanged."""
    cell = Cell("eye", {"eye": Robot("eye")}, plates={"near": Unknown(), "far": Unknown()})
    changed = cell.with_transform("eye_base_from_far", FIXED)
    assert changed.plates == {"near": cell.plates["near"], "far": FIXED}


def test_box_distance_is_measured_from_surface():
    """The distance from a rotated box is that from its surface, and zero inside it."""
    box = KeepOut("table", SE3.from_rotvec([0, 0, np.pi / 2], [1.0, 0.0, 0.0]), np.array([2.0, 0.4, 0.6]))
    points = np.array([[1.0, 0.9, 0.2], [1.0, 1.5, 0.0], [1.5, 0.0, 0.0], [1.5, 1.4, 0.0], [0.5, 0.0, 0.7]])
    np.testing.assert_allclose(box.distance(points), [0, 0.5, 0.3, 0.5, 0.5])


def test_touched_targets():
    """Marks, tips and clamped parts are touched; a board is not, and has a free scale only if stated."""
    assert all(target.is_touched for target in touch_cell().targets.values())
    held = clamp_cell("free").targets
    assert all(target.is_touched for target in held.values())
    assert grip_name("part") in held
    (board,) = simulate(Scenario(samples=1), 0).cell.targets.values()
    assert not board.is_touched
    assert not board.has_free_scale
    assert replace(board, size_sigma=np.inf).has_free_scale


def test_unstated_cell_fields_have_defaults():
    """Unstated fields of a cell have their defaults.

    Robots have repeatability noise, lenses have errors, cameras expose all rows at once, and mounts are free.
    """
    robot, camera = Robot("a"), CellCamera("b", "a")
    assert not robot.is_total_noise
    assert (camera.kind, camera.model, camera.mount.status) == ("camera", "pinhole", "free")
    assert not Intrinsics().exact
    assert not camera.touches
    assert [replace(camera, kind=kind).touches for kind in ("tracker", "tip", "clamp")] == [False, True, True]


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_non_finite_clock_numbers_are_refused(number):
    """Offsets, sigmas, jitter and line times must be finite."""
    for fields in ({"offset_s": number}, {"status": "prior", "sigma_s": number}, {"jitter_s": number}):
        with pytest.raises(ValidationError, match=r"finite number|a positive number"):
            CameraEntry.model_validate({"on": "world", "clock": fields})
    with pytest.raises(ValidationError, match=r"finite number|a positive number"):
        CameraEntry.model_validate({"on": "world", "rolling_shutter": {"line_time_s": number}})


def test_plate_names_transforms_of_its_targets():
    """A plate is a frame of its own, so transforms of what it carries start from the plate, not a flange."""
    plated = Cell(
        "eye",
        {"eye": Robot("eye"), "hand": Robot("hand")},
        cameras={"wrist": CellCamera("wrist", "eye")},
        targets={"board": CellTarget("board", "table")},
        plates={"table": FIXED},
    )
    assert list(plated.transforms) == [
        "eye_base_from_hand_base", "eye_base_from_table", "eye_flange_from_wrist", "table_from_board",
    ]  # fmt: skip
    assert plated.transforms["eye_base_from_table"] is FIXED
    fixed = plated.with_transform("eye_base_from_hand_base", FIXED)
    assert plated.requested_transforms == ["eye_base_from_hand_base"]
    assert fixed.requested_transforms == ["eye_flange_from_wrist", "table_from_board"]


def test_default_cell_values():
    """Unless stated otherwise, a cell sees targets only and noise is the repeatability.

    Lenses have errors, and all devices share one clock.
    """
    cell = Cell("eye", {"eye": Robot("eye")})
    assert not cell.sees_scene
    assert not cell.robots["eye"].is_total_noise
    assert not Intrinsics().exact
    assert (Clock().offset_s, Clock().jitter_s, RollingShutter("free").line_time_s) == (0.0, None, 0.0)
    assert not CellTarget("tag", "eye").has_free_scale


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
def test_clocks_and_line_times_are_finite(value):
    """Infinite and NaN clock offsets and line times of cameras are refused."""
    for data in ({"clock": {"offset_s": value}}, {"rolling_shutter": {"line_time_s": value}}):
        with pytest.raises(ValidationError):
            CameraEntry.model_validate({"on": "world", **data})
