"""Tests of a cell converted to the data of `cell.yaml`."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell import Cell, CellCamera, CellTarget, Intrinsics, Robot, Unknown
from basecal.cell.schema.cell_dict import cell_to_dict
from basecal.cell.schema.cell_objects import cell_from_entry
from basecal.cell.schema.cell_schema import CellEntry
from basecal.cell.targets.led import led_target
from basecal.effects import deflection, joint_offsets, link_parameters
from basecal.geometry import SE3, Camera

AT = SE3.from_rotvec([0, 0, np.pi], [1, 2, 3])
POSE = {"t_m": [1.0, 2.0, 3.0], "q_xyzw": [0.0, 0.0, 1.0, 0.0]}
SIGMA = np.array([0.1, 0.1, 0.1, 0.1, 0.2, 0.3])
LENS = Camera("pinhole", np.array([500.0, 510, 320, 240, 0.1, 0.2, 0, 0]), (640, 480))


def test_minimal_cell_writes_no_empty_sections():
    """A minimal cell writes the schema, the reference and the robots, and no empty sections."""
    assert cell_to_dict(Cell("eye", {"eye": Robot("eye")})) == {
        "schema": "basecal/cell/1",
        "reference": "eye",
        "robots": {"eye": {}},
    }


@pytest.mark.parametrize(
    ("unknown", "written"),
    [
        (Unknown(), {"status": "free"}),
        (Unknown("free", AT), {"status": "free", "guess": POSE}),
        (Unknown("fixed", AT), {"status": "fixed", **POSE}),
        (Unknown("prior", AT, SIGMA), {"status": "prior", **POSE, "sigma_t_m": 0.1, "sigma_r_rad": [0.1, 0.2, 0.3]}),
    ],
)
def test_transforms_are_written_by_status(unknown, written):
    """A transform is written as a pose with its sigmas, or as a guess; that of a point as its position alone."""
    robots = {"eye": Robot("eye"), "hand": Robot("hand")}
    light = CellTarget("light", "hand", unknown, led_target())
    data = cell_to_dict(Cell("eye", robots, bases={"hand": unknown}, targets={"light": light}))
    assert data["bases"]["hand"] == written
    point = {k: v for k, v in written.items() if k != "q_xyzw" and k != "sigma_r_rad"}
    if "guess" in point:
        point["guess"] = {"t_m": POSE["t_m"]}
    assert data["targets"]["light"] == {"on": "hand", "mount": point, "kind": "led", "points_m": [[0, 0, 0]]}


def test_robots_write_only_non_default_fields():
    """Fields of a robot that differ from their defaults are written, all others are omitted."""
    robot = Robot(
        "eye",
        noise=np.full(6, 0.5),
        urdf="a.urdf",
        base_link="b",
        flange_link="f",
        parameters={
            "joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.1),
            "link_parameters": link_parameters.Stated(status="free"),
            "deflection": deflection.Stated(status="prior", sigma_rad_per_nm=1e-5, down=[0.0, 1.0, 0.0]),
        },
        frames={"base": "link_0"},
        reach_m=0.85,
    )
    assert cell_to_dict(Cell("eye", {"eye": robot}))["robots"]["eye"] == {
        "noise": {"sigma_t_m": 0.5, "sigma_r_rad": 0.5},
        "urdf": "a.urdf",
        "base_link": "b",
        "flange_link": "f",
        "reach_m": 0.85,
        "joint_offsets": {"status": "prior", "sigma_rad": 0.1},
        "link_parameters": {"status": "free"},
        "deflection": {"status": "prior", "sigma_rad_per_nm": 1e-5, "down": [0.0, 1.0, 0.0]},
        "frames": {"base": "link_0"},
    }


@pytest.mark.parametrize(
    ("lens", "written"),
    [
        (Intrinsics("free"), {"status": "free", "distortion_terms": 5}),
        (Intrinsics("free", None, None, 8), {"status": "free", "distortion_terms": 8}),
        (
            Intrinsics("prior", LENS, np.array([1.0, 1, 2, 3, 4, 4, 4, 4])),
            {
                "status": "prior",
                **{"fx": 500.0, "fy": 510.0, "cx": 320.0, "cy": 240.0, "distortion": [0.1, 0.2, 0.0, 0.0]},
                **{"sigma_focal_px": 1.0, "sigma_center_px": [2.0, 3.0], "sigma_distortion": 4.0},
            },
        ),
        (
            Intrinsics("prior", Camera("pinhole", LENS.parameters[:4], None), np.array([1.0, 2, 3, 3])),
            {
                "status": "prior",
                **{"fx": 500.0, "fy": 510.0, "cx": 320.0, "cy": 240.0, "distortion": []},
                **{"sigma_focal_px": [1.0, 2.0], "sigma_center_px": 3.0},
            },
        ),
    ],
)
def test_lenses_are_written_by_status(lens, written):
    """A lens is written as values with their sigmas, or as the requested number of terms."""
    camera = CellCamera("wrist", "eye", Unknown(), "pinhole", (640, 480), lens)
    data = cell_to_dict(Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": camera}))["cameras"]["wrist"]
    assert data == {
        "on": "eye",
        "mount": {"status": "free"},
        "model": "pinhole",
        "size_px": [640, 480],
        "intrinsics": written,
    }


def test_noise_writes_stated_sigmas():
    """Each stated sigma is written."""
    robots = {"eye": Robot("eye")}
    assert cell_to_dict(Cell("eye", robots, pixel_px=1))["noise"] == {"pixel_px": 1.0}
    both = cell_to_dict(Cell("eye", robots, pixel_px=0.3, correlated_px=0.1))
    assert both["noise"] == {"pixel_px": 0.3, "correlated_px": 0.1}


@pytest.mark.parametrize(
    ("written", "size_sigma"),
    [({"exact": True}, 0.0), ({"size_sigma": 2e-4}, 2e-4), ({}, None), ({"exact": False}, None)],
)
def test_target_size_sigma_round_trip(written, size_sigma):
    """The stated sigma of a target's size is read and written unchanged."""
    data = cell_to_dict(Cell("eye", {"eye": Robot("eye")}, targets={"board": CellTarget("board", "eye")}))
    data["targets"]["board"] |= written
    cell = cell_from_entry(CellEntry.model_validate(data), {})
    assert cell.targets["board"].size_sigma == size_sigma
    stated = {k: v for k, v in cell_to_dict(cell)["targets"]["board"].items() if k in ("exact", "size_sigma")}
    assert stated == {k: v for k, v in written.items() if v}


def test_exact_target_takes_no_size_sigma():
    """`exact` and `size_sigma` contradict each other, so both together are refused."""
    data = cell_to_dict(Cell("eye", {"eye": Robot("eye")}, targets={"board": CellTarget("board", "eye")}))
    data["targets"]["board"] |= {"exact": True, "size_sigma": 1e-3}
    with pytest.raises(ValidationError, match="exact takes no size_sigma"):
        CellEntry.model_validate(data)
