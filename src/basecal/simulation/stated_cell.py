"""The stated part of a simulated cell: statuses, and priors drawn about the truth."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.cell.cell import (
    Cell,
    CellCamera,
    CellTarget,
    Intrinsics,
    Robot,
    Status,
    Unknown,
)
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.geometry import SE3, Array, Camera
from basecal.simulation import draw
from basecal.simulation.arms import BASE_LINK, FLANGE_LINK, Arm
from basecal.simulation.draw import Generator
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import Scene


def _unknown(status: Status, truth: SE3, sigma: tuple[float, float], rng: Generator, is_point: bool = False) -> Unknown:
    """Draw a stated transform; the truth is `mean @ SE3.exp(xi)`, and xi has the sigmas of `sigma`.

    The mount of a point has no rotation, neither in the prior nor in the truth.
    """
    if status == "free":
        return Unknown("free")
    if status == "fixed":
        return Unknown("fixed", truth)
    xi = draw.tangents(rng, 1, sigma)[0]
    if is_point:
        xi[3:] = 0.0
    return Unknown("prior", truth @ SE3.exp(xi).inverse(), np.repeat(sigma, 3))


def _intrinsics(lens: Camera, scenario: Scenario, rng: Generator) -> Intrinsics | None:
    if scenario.target in ("pose", "points3d"):
        return None
    terms = len(lens.distortion)
    if scenario.intrinsics == "fixed":
        return Intrinsics("fixed", lens, exact=True)
    if scenario.intrinsics == "free":
        return Intrinsics("free", distortion_terms=terms)
    focal, center, distortion = scenario.intrinsics_prior
    sigma: Array = np.array([focal, focal, center, center] + [distortion] * terms)
    mean = lens.with_parameters(lens.parameters - sigma * rng.standard_normal(len(sigma)))
    return Intrinsics("prior", mean, sigma)


def _camera(name: str, scene: Scene, scenario: Scenario, rng: Generator) -> CellCamera:
    lens = scene.lenses[name]
    mount = _unknown(scenario.camera_mount, scene.mounts[name], scenario.mount_prior, rng)
    intrinsics = _intrinsics(lens, scenario, rng)
    size = lens.size_px if intrinsics else None
    return CellCamera(name, scene.layout.cameras[name], mount, lens.model, size, intrinsics)


def _robot(name: str, noise: Array | None, scenario: Scenario, arm: Arm | None) -> Robot:
    if arm is None:
        return Robot(name, noise, is_total_noise=noise is not None)
    metres, radians = scenario.link_error
    sigmas = {
        "joint_offsets": {"sigma_rad": scenario.joint_offset_rad},
        "link_parameters": {"sigma_rad": radians, "sigma_m": metres},
        "deflection": {"sigma_rad_per_nm": scenario.compliance},
    }
    parameters = {}
    for kind, prior_sigmas in sigmas.items():
        status: Status = getattr(scenario, kind)
        if status != "fixed":
            stated_sigmas = prior_sigmas if status == "prior" else {}
            parameters[kind] = ROBOT_PARAMETERS[kind].stated(status=status, **stated_sigmas)
    return Robot(
        name, noise, arm.chain, parameters, f"{name}.urdf", BASE_LINK, FLANGE_LINK, is_total_noise=noise is not None
    )


def stated_cell(scene: Scene, scenario: Scenario, rng: Generator, arms: Mapping[str, Arm]) -> Cell:
    """The cell that a solver receives."""
    reference, *others = scene.layout.robots
    states_robots = scenario.state_robot_noise and any(scenario.robot_noise)
    noise = np.repeat(scenario.robot_noise, 3) if states_robots else None
    in_pixels = scenario.target not in ("pose", "points3d")
    states_pixels = in_pixels and scenario.state_pixel_noise and bool(scenario.pixel_px)
    bases = {name: _unknown(scenario.base, scene.bases[name], scenario.base_prior, rng) for name in others}
    cameras = {name: _camera(name, scene, scenario, rng) for name in scene.layout.cameras}
    targets = {}
    for name, carrier in scene.layout.targets.items():
        shape = scene.shapes[name]
        mount = _unknown(scenario.target_mount, scene.mounts[name], scenario.mount_prior, rng, shape.is_point)
        targets[name] = CellTarget(name, carrier, mount, None if scenario.target == "pose" else shape)
    return Cell(
        reference,
        robots={name: _robot(name, noise, scenario, arms.get(name)) for name in scene.layout.robots},
        bases=bases,
        cameras=cameras,
        targets=targets,
        pixel_px=scenario.pixel_px if states_pixels else None,
        correlated_px=scenario.correlated_px if states_pixels and scenario.correlated_px else None,
    )


def truth(scene: Scene, cell: Cell) -> dict[str, SE3]:
    """True transforms of the cell, by name."""
    named = {cell.base_name(robot): scene.bases[robot] for robot in scene.layout.robots[1:]}
    carried = (*scene.layout.cameras, *scene.layout.targets)
    return named | {cell.mount_name(name): scene.mounts[name] for name in carried}
