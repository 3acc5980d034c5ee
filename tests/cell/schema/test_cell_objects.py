"""Tests of objects created from the entries of `cell.yaml`."""

from __future__ import annotations

import math

import numpy as np
import pytest

from basecal.cell.schema.cell_objects import _intrinsics, cell_from_entry
from basecal.cell.schema.cell_schema import CameraEntry, CellEntry
from basecal.cell.schema.lens import IntrinsicsEntry

POSE = {"t_m": [1.0, 2.0, 3.0], "q_xyzw": [0.0, 0.0, 0.0, 1.0]}
LENS = {"fx": 500.0, "fy": 510.0, "cx": 320.0, "cy": 240.0}
SIGMAS = {"sigma_focal_px": [1.0, 2.0], "sigma_center_px": [3.0, 4.0]}


def make_cell(**sections):
    data = {"schema": "basecal/cell/1", "reference": "eye", "robots": {"eye": {}, "hand": {}}}
    return cell_from_entry(CellEntry.model_validate(data | sections), {})


def lens(status, **fields):
    camera = {"on": "eye", "size_px": [640, 480], "intrinsics": {"status": status, **fields}}
    return make_cell(cameras={"wrist": camera}).cameras["wrist"].intrinsics


def test_bases_and_mounts_are_created_by_status():
    """A guess is the mean of a free transform, sigmas start with translation, and unstated transforms are free."""
    sigmas = {"sigma_t_m": 0.1, "sigma_r_rad": [0.2, 0.3, 0.4]}
    cell = make_cell(
        bases={"hand": {"status": "prior", **POSE, **sigmas}},
        cameras={"wrist": {"on": "eye"}, "hall": {"on": "world", "mount": {"guess": POSE}}},
        targets={"board": {"on": "hand", "mount": {"status": "fixed", **POSE}}},
    )
    assert cell.bases["hand"].sigma.tolist() == [0.1, 0.1, 0.1, 0.2, 0.3, 0.4]
    assert cell.cameras["wrist"].mount.mean is None
    hall, board = cell.cameras["hall"].mount, cell.targets["board"].mount
    assert (hall.status, hall.mean.translation.tolist(), hall.sigma) == ("free", [1, 2, 3], None)
    assert (board.status, board.mean.translation.tolist(), board.sigma) == ("fixed", [1, 2, 3], None)
    assert make_cell().bases["hand"].status == "free"


def test_point_mount_has_no_rotation_sigma():
    """The mount of an LED with a prior has three sigmas of translation and none of rotation."""
    mount = {"status": "prior", "t_m": [0, 0, 1], "sigma_t_m": [0.1, 0.2, 0.3]}
    light = make_cell(targets={"light": {"on": "hand", "kind": "led", "mount": mount}}).targets["light"]
    assert light.mount.sigma.tolist() == [0.1, 0.2, 0.3, 0.0, 0.0, 0.0]


def test_robots_are_created_from_entries():
    """Noise starts with translation; named frames, the chain and parameters are those stated."""
    robot = {"noise": {"sigma_t_m": [1, 2, 3], "sigma_r_rad": 4.0}, "frames": {"base": "link_0"}}
    found = make_cell(robots={"eye": robot}).robots["eye"]
    assert found.noise.tolist() == [1, 2, 3, 4, 4, 4]
    assert found.frames == {"base": "link_0"}
    assert found.parameters == {}
    chain = {"urdf": "a.urdf", "base_link": "b", "flange_link": "f"}
    links = {"status": "prior", "sigma_rad": 0.1, "sigma_m": 0.2}
    found = make_cell(robots={"eye": {**chain, "link_parameters": links}}).robots["eye"]
    assert (found.parameters["link_parameters"].sigma_rad, found.parameters["link_parameters"].sigma_m) == (0.1, 0.2)
    assert (found.urdf, found.base_link, found.flange_link, found.noise) == ("a.urdf", "b", "f", None)


@pytest.mark.parametrize(
    ("found", "parameters", "sigma"),
    [
        (lens("fixed", **LENS), [500, 510, 320, 240], None),
        (lens("free", **LENS), [500, 510, 320, 240, 0, 0, 0, 0, 0], None),
        (lens("prior", **LENS, **SIGMAS), [500, 510, 320, 240], [1, 2, 3, 4]),
        (
            lens("prior", **LENS, **SIGMAS, distortion=[0.1, 0.2, 0.0, 0.0], sigma_distortion=0.5),
            [500, 510, 320, 240, 0.1, 0.2, 0, 0],
            [1, 2, 3, 4, 0.5, 0.5, 0.5, 0.5],
        ),
    ],
)
def test_lenses_are_created_from_entries(found, parameters, sigma):
    """Parameters are focal lengths, centre and distortion.

    A guess without distortion starts at zeros, and a single sigma applies to all terms.
    """
    assert found.camera.parameters.tolist() == parameters
    assert found.camera.size_px == (640, 480)
    assert sigma is None if found.sigma is None else found.sigma.tolist() == sigma


def test_free_lens_has_no_camera():
    """A free lens without a guess has no value, and the requested number of terms."""
    assert lens("free").camera is None
    assert lens("free", distortion_terms=8).distortion_terms == 8


def test_noise_of_pixels_is_read():
    """Single-point and correlated pixel noise are read; both are None if unstated."""
    cell = make_cell(noise={"pixel_px": 0.3, "correlated_px": 0.1})
    assert (cell.pixel_px, cell.correlated_px) == (0.3, 0.1)
    assert (make_cell().pixel_px, make_cell().correlated_px) == (None, None)


def test_noise_sigmas_are_read_only():
    """A robot is immutable, so its array of sigmas is read-only."""
    with pytest.raises(ValueError, match="read-only"):
        make_cell(robots={"eye": {"noise": {"sigma_t_m": 1.0, "sigma_r_rad": 1.0}}}).robots["eye"].noise[0] = np.inf


def test_lens_sigmas_need_all_groups():
    """One group of sigmas alone gives none; the order is focal lengths, centre, distortion."""
    for name in SIGMAS:
        entry = IntrinsicsEntry.model_validate({"status": "prior", **LENS, name: SIGMAS[name]})
        camera = CameraEntry.model_validate({"on": "eye", "size_px": [640, 480]})
        assert _intrinsics(entry, camera, (640, 480)).sigma is None
    assert lens("fixed", **LENS, exact=True).exact
    assert not lens("fixed", **LENS).exact


@pytest.mark.parametrize(
    ("fields", "size_sigma"),
    [({}, None), ({"exact": True}, 0.0), ({"scale": "free"}, math.inf), ({"size_sigma": 1e-3}, 1e-3)],
)
def test_target_size_sigma_by_entry(fields, size_sigma):
    """A target's size is exact, known up to scale, known with a sigma, or unstated."""
    assert make_cell(targets={"tag": {"on": "hand", **fields}}).targets["tag"].size_sigma == size_sigma


def test_driver_separates_kind_from_options():
    """A driver's kind and options are stored separately; a robot without a driver has None."""
    robots = {"eye": {"driver": {"kind": "ur", "host": "10.0.0.9", "port": 30004}}, "hand": {}}
    found = make_cell(robots=robots).robots
    assert (found["eye"].driver.kind, dict(found["eye"].driver.options)) == ("ur", {"host": "10.0.0.9", "port": 30004})
    assert found["hand"].driver is None
