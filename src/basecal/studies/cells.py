"""The simulated cells of a study; cells of one number differ between points only by the points' settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from basecal.cell.cell import WORLD
from basecal.geometry import SE3, Camera
from basecal.geometry.rotation import nearest_rotation
from basecal.simulation import Scenario, SimulatedCell, simulate
from basecal.simulation.draw import lens, rotations
from basecal.simulation.layout import make_layout
from basecal.simulation.shifts import simulate_shifts
from basecal.studies.paper_cell import paper_cell, paper_numbers

SHIFTS = "shifts"
"""The layout of the paper's method: one robot shifts an LED along its axes in front of a camera at rest."""

PAPER = "paper"
"""The paper's own cell with the layout `SHIFTS`."""

SHIFT_LAYOUTS = (SHIFTS, PAPER)

_NEAR_SHARE, _FAR_SHARE = 0.8, 1.2  # range of distances at home poses relative to the setting, which is their mean
_OFF_AXIS = 0.1  # largest offset of the unshifted LED from the optical axis, relative to its distance
_BASE_DISTANCE_M = 1.5  # between the bases in the layout `SHIFTS`, approximately as in the paper's cell

Settings = Mapping[str, Any]


def statuses(settings: Settings) -> dict[str, str]:
    """Status of each transform in the cells of a study's settings, by name."""
    if settings["layout"] in SHIFT_LAYOUTS:
        fixed = dict.fromkeys(("eye_flange_from_camera", "hand_flange_from_light"), "fixed")
        return {"eye_base_from_hand_base": "free", **fixed}
    plan = make_layout(settings["layout"], settings["robots"])
    reference, *others = plan.robots

    def mount_statuses(carriers: Mapping[str, str], status: str) -> dict[str, str]:
        """Statuses of mounts, by name."""
        ends = {name: f"{reference}_base" if on == WORLD else f"{on}_flange" for name, on in carriers.items()}
        return {f"{end}_from_{name}": status for name, end in ends.items()}

    bases = {f"{reference}_base_from_{other}_base": settings["base"] for other in others}
    return (
        bases
        | mount_statuses(plan.cameras, settings["camera_mount"])
        | mount_statuses(plan.targets, settings["target_mount"])
    )


def simulate_cell(settings: Settings, seed: int) -> SimulatedCell:
    """Simulate a cell with a study's settings, its recording, and the truth.

    Raises:
        InputError: if the settings are inconsistent, or too few poses show the target.
    """
    if settings["layout"] not in SHIFT_LAYOUTS:
        return simulate(_scenario(settings), seed)
    simulated = _paper_station(settings) if settings["layout"] == PAPER else _shift_station(settings, seed)
    sigmas = (settings["robot_sigma_t_m"], settings["robot_sigma_r_rad"])
    if not (settings["state_robot_noise"] and any(sigmas)):
        return simulated
    robots = {name: replace(robot, noise=np.repeat(sigmas, 3)) for name, robot in simulated.cell.robots.items()}
    return replace(simulated, cell=replace(simulated.cell, robots=robots))


def _scenario(settings: Settings) -> Scenario:
    shared = {f: settings[f] for f in ("samples", "arms", "layout", "stations", "robots", "base", "camera_mount")}
    shared |= {f: settings[f] for f in ("target_mount", "intrinsics", "lens", "pixel_px", "correlated_px")}
    shared |= {f: settings[f] for f in ("state_pixel_noise", "state_robot_noise", "spread_rad", "position_m")}
    board, distance_m = settings["board"], settings["distance_m"]
    return Scenario(
        target=settings["target"] if board is None else board.kind,
        board=None if board is None else board.shape(),
        robot_noise=(settings["robot_sigma_t_m"], settings["robot_sigma_r_rad"]),
        distance_m=(_NEAR_SHARE * distance_m, _FAR_SHARE * distance_m),
        **shared,
    )


def _shift_station(settings: Settings, seed: int) -> SimulatedCell:
    """Simulate one station of the paper's method with random camera, LED and base poses."""
    rng = np.random.default_rng(seed)
    drawn = lens(rng, Scenario(lens=settings["lens"]))
    camera = Camera("pinhole", drawn.parameters[:4], drawn.size_px)
    random_rotations = rotations(rng, 4)
    distance_m = rng.uniform(_NEAR_SHARE, _FAR_SHARE) * settings["distance_m"]
    position = distance_m * np.array([*rng.uniform(-_OFF_AXIS, _OFF_AXIS, 2), 1.0])
    camera_from_led = SE3(random_rotations[0], position)
    eye_base_from_camera = SE3(random_rotations[1], rng.uniform(-0.5, 0.5, 3))
    eye_base_from_hand_base = SE3(random_rotations[2], _BASE_DISTANCE_M * random_rotations[3][0])
    hand_base_from_led = eye_base_from_hand_base.inverse() @ eye_base_from_camera @ camera_from_led
    return _station(settings, eye_base_from_hand_base, eye_base_from_camera, hand_base_from_led, camera)


def _paper_station(settings: Settings) -> SimulatedCell:
    """Simulate the paper's station, with the rounded rotation of the printed base orthonormalised."""
    bed = paper_cell(paper_numbers())
    base = bed.eye_base_from_hand_base
    eye_base_from_hand_base = SE3(nearest_rotation(base.rotation), base.translation)
    camera = Camera("pinhole", np.array([*bed.focal_px, 0.0, 0.0]))
    return _station(settings, eye_base_from_hand_base, bed.eye_base_from_camera, bed.hand_base_from_led, camera)


def _station(
    settings: Settings,
    eye_base_from_hand_base: SE3,
    eye_base_from_camera: SE3,
    hand_base_from_led: SE3,
    camera: Camera,
) -> SimulatedCell:
    return simulate_shifts(
        eye_base_from_hand_base,
        SE3.stack([eye_base_from_camera]),
        SE3.stack([hand_base_from_led]),
        camera,
        settings["shift_m"],
        pixel_px=settings["pixel_px"] if settings["state_pixel_noise"] else 0.0,
    )
