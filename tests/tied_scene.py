"""A problem of the tracks of two arms alone, and its scene."""

from __future__ import annotations

import numpy as np

from basecal.cell import Cell, Recording, RobotState, Sample
from basecal.cell.schema.cell_file import cell_from_dict
from basecal.estimation.problem.build import build_problem, scene_groups
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.scene.adjust import SceneFit, SceneProblem, adjust
from basecal.estimation.scene.tie import with_scene
from scene_points import ARM_M, ARM_RAD, LENS, PIXEL, Scene, made_scene

FIELDS = dict(zip(("fx", "fy", "cx", "cy"), LENS.parameters[:4].tolist(), strict=True))
FIELDS |= {"distortion": LENS.parameters[4:].tolist(), "status": "free"}


def tracks_alone(seed: int, count: int = 6) -> tuple[Scene, SceneFit, Problem, State]:
    """Return a scene, its optimum, and the same as a problem and its state."""
    scene = made_scene(seed, arms=2, count=count, points=80)
    views = scene.views
    noise = np.tile(np.repeat([ARM_M, ARM_RAD], 3), (len(views.stop_robot), 1))
    fit = adjust(SceneProblem(views, scene.tracks, PIXEL, noise, (LENS, LENS)), scene.truth)
    cell, recording = _recorded(scene)
    empty = build_problem(cell, recording)[0]
    samples = {camera.name: views.sample[views.camera == k].tolist() for k, camera in enumerate(views.cameras)}
    names = {"left_flange_from_left_eye": 0, "right_flange_from_right_eye": 1}
    transforms = {name: fit.state.mounts[k] for name, k in names.items()}
    transforms["left_base_from_right_base"] = fit.state.bases[1]
    cameras = {camera.name: lens for camera, lens in zip(views.cameras, fit.state.lenses, strict=True)}
    state = State(transforms, cameras, fit.state.errors / noise)
    return scene, fit, with_scene(empty, state, scene_groups(cell, recording, empty, samples), fit, PIXEL), state


def _recorded(scene: Scene) -> tuple[Cell, Recording]:
    views = scene.views
    noise = {"sigma_t_m": ARM_M, "sigma_r_rad": ARM_RAD}
    cameras = {
        camera.name: {"on": camera.robot, "intrinsics": FIELDS, "size_px": [1280, 720]} for camera in views.cameras
    }
    cell = {
        "schema": "basecal/cell/1",
        "reference": "left",
        "robots": {name: {"noise": noise} for name in views.robots},
    }
    samples = tuple(
        Sample(int(number), robots={views.robots[robot]: RobotState(pose)})
        for number, robot, pose in zip(views.sample, views.robot, views.base_from_flange, strict=True)
    )
    return cell_from_dict({**cell, "cameras": cameras}), Recording(samples)
