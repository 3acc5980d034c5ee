"""Tests of the entries that `cell.yaml` may combine."""

from __future__ import annotations

from contextlib import nullcontext

import pytest
from pydantic import ValidationError

from basecal.cell.schema.cell_dict import cell_to_dict
from basecal.cell.schema.cell_file import cell_from_dict
from basecal.cell.schema.cell_schema import AnyRobotEntry, CameraEntry, CellEntry, NoiseEntry
from basecal.errors import DatasetError

CHAIN = {"urdf": "a.urdf", "base_link": "base", "flange_link": "tool"}
PRIOR = {"status": "prior", "sigma_rad": 0.01}
DATA = {
    "schema": "basecal/cell/1",
    "reference": "eye",
    "robots": {"eye": {"driver": {"kind": "typed", "notation": "kuka"}}},
    "cameras": {"wrist": {"on": "eye", "mount": {"status": "free"}, "model": "pinhole", "driver": {"kind": "opencv"}}},
}


@pytest.mark.parametrize(
    "fields",
    [
        {},
        CHAIN,
        {**CHAIN, "joint_offsets": PRIOR, "link_parameters": {**PRIOR, "sigma_m": 0.001}},
        {**CHAIN, "joint_offsets": {"status": "free"}, "deflection": {"status": "prior", "sigma_rad_per_nm": 1e-5}},
        {"noise": {"sigma_t_m": 1e-4, "sigma_r_rad": 1e-4}},
        {"clock": {"status": "free"}},
    ],
)
def test_valid_robot_entries_are_accepted(fields):
    """Robots with or without a chain, and with fixed, prior or free offsets and links, are accepted."""
    AnyRobotEntry.model_validate(fields)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"urdf": "a.urdf", "base_link": "base"}, "urdf, base_link and flange_link go together; give all three"),
        ({"flange_link": "tool"}, "go together"),
        (
            {"joint_offsets": {"status": "free"}},
            "to estimate joint_offsets, urdf, base_link and flange_link are needed",
        ),
        ({"deflection": {"status": "free"}}, "to estimate deflection, urdf"),
        ({**CHAIN, "joint_offsets": {"status": "prior"}}, "status prior takes sigma_rad, got none"),
        ({**CHAIN, "joint_offsets": {**PRIOR, "sigma_m": 1.0}}, "Extra inputs are not permitted"),
        ({**CHAIN, "link_parameters": PRIOR}, "takes sigma_m and sigma_rad, got sigma_rad"),
        ({**CHAIN, "link_parameters": {"status": "free", "sigma_m": 1.0}}, "status free takes no sigma, got sigma_m"),
        ({"noise": {"sigma_t_m": 1e-4}}, "sigma_r_rad"),
        ({"clock": {"status": "free", "jitter_s": 1e-3}}, "jitter_s belongs to the clock of a camera"),
    ],
)
def test_invalid_robot_entries_are_refused(fields, message):
    """The error names incomplete fields and fields that do not match the status."""
    with pytest.raises(ValidationError, match=message):
        AnyRobotEntry.model_validate(fields)


def test_free_lens_needs_size_or_guess():
    """A free lens needs `size_px` or a guess, since the width of the image must be known."""
    guess = {"fx": 1.0, "fy": 1.0, "cx": 1.0, "cy": 1.0}
    for fields in ({"size_px": [4, 3], "intrinsics": {"status": "free"}}, {"intrinsics": {"status": "free", **guess}}):
        CameraEntry.model_validate({"on": "arm", **fields})
    with pytest.raises(ValidationError, match="a free lens needs size_px of the camera"):
        CameraEntry.model_validate({"on": "arm", "intrinsics": {"status": "free"}})
    with pytest.raises(ValidationError, match="did you mean 'fisheye'"):
        CameraEntry.model_validate({"on": "arm", "model": "fish-eye"})


def test_correlated_px_requires_pixel_px():
    """`correlated_px` is accepted only beside `pixel_px`, the noise of single points."""
    assert NoiseEntry.model_validate({"pixel_px": 0.1, "correlated_px": 0.2}).correlated_px == 0.2
    with pytest.raises(ValidationError, match="correlated_px needs pixel_px"):
        NoiseEntry.model_validate({"correlated_px": 0.2})


def test_empty_sections_are_accepted():
    """Sections may have no content after their colon; an unknown version of the schema is refused."""
    data = {"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": None}}
    entry = CellEntry.model_validate(data | dict.fromkeys(("bases", "cameras", "targets", "noise")))
    assert (entry.bases, entry.cameras, entry.targets, entry.noise.pixel_px) == ({}, {}, {}, None)
    with pytest.raises(ValidationError, match="basecal/cell/1"):
        CellEntry.model_validate(data | {"schema": "basecal/cell/2"})


@pytest.mark.parametrize("name", ["base_link", "ur5e/tool0", "left.arm-1", "_x", "f" * 255])
def test_ros_frame_names_are_accepted(name):
    """ROS frame names may contain letters, digits and the separators of ROS."""
    assert AnyRobotEntry.model_validate({"frames": {"base": name}}).frames.base == name


@pytest.mark.parametrize("name", ["b; touch PWNED $(...) #", "", "-x", "/abs", "a b", "a\n", "\ud800", "f" * 256, "ü"])
def test_unsafe_frame_names_are_refused(name):
    """Names that a shell or ROS would interpret otherwise are refused."""
    with pytest.raises(ValidationError, match="expected a frame of ROS"):
        AnyRobotEntry.model_validate({"frames": {"flange": name}})


def test_driver_round_trip():
    """The kind of a driver and arbitrary options are read and written back unchanged."""
    cell = cell_from_dict(DATA)
    assert (cell.robots["eye"].driver.kind, cell.robots["eye"].driver.options) == ("typed", {"notation": "kuka"})
    assert cell.cameras["wrist"].driver.options == {}
    assert cell_to_dict(cell) == DATA


@pytest.mark.parametrize("driver", [{}, {"kind": 3}, {"kind": "Typed robot"}, {"notation": "ur"}])
def test_driver_needs_valid_kind(driver):
    """A driver without a `kind`, or with an invalid one, is an error that states what was expected."""
    data = DATA | {"robots": {"eye": {"driver": driver}}}
    with pytest.raises(DatasetError, match=r"robots\.eye\.driver: expected `kind`"):
        cell_from_dict(data)


LENS = {"status": "fixed", "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0}


@pytest.mark.parametrize(
    "fields", [{"intrinsics": LENS}, {"size_px": [640, 480]}, {"size_px": [640, 480], "intrinsics": LENS}]
)
def test_tracker_takes_no_lens_or_image_size(fields):
    """A tracker has neither a lens nor an image size; a camera may have both, or the lens alone."""
    with pytest.raises(ValidationError, match="a tracker measures points in metres: remove intrinsics and size_px"):
        CameraEntry.model_validate({"on": "eye", "kind": "tracker", **fields})
    assert CameraEntry.model_validate({"on": "eye", **fields}).kind == "camera"
    assert CameraEntry.model_validate({"on": "eye", "kind": "tracker"}).intrinsics is None


@pytest.mark.parametrize(("fields", "is_valid"), [
    ({}, True), ({"pixel_px": 0.3}, True), ({"pixel_px": 0.3, "correlated_px": 0.1}, True),
    ({"correlated_px": 0.1}, False),
])  # fmt: skip
def test_pixel_noise_may_be_stated_alone(fields, is_valid):
    """`pixel_px` may be stated alone, `correlated_px` only beside it."""
    with nullcontext() if is_valid else pytest.raises(ValidationError, match="correlated_px needs pixel_px"):
        NoiseEntry.model_validate(fields)
