"""Two arms that face each other across a table: one carries the camera, the other the target.

The cell states what is known before a calibration: a lens, and bases and mounts measured with a tape measure.
"""

from __future__ import annotations

import numpy as np

from basecal.cell import Cell, CellCamera, CellTarget, Driver, Intrinsics, Robot, Target, Unknown
from basecal.cell.targets.registry import TARGETS, TargetKindName
from basecal.errors import InputError
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.rotation import rotation_exp
from basecal.kinematics import SerialChain
from basecal.simulation import draw
from basecal.simulation.arms import BASE_LINK, FLANGE_LINK, solve_joints
from basecal.simulation.running.faults import Faults
from basecal.simulation.running.ur5e import ur5e
from basecal.simulation.running.world import World, faulty_world
from basecal.simulation.scene import front

_BASE_DISTANCE_M = 1.7  # between the bases
_DISTANCE_M = 0.65  # between camera and target at the home poses
_REACHED_POSE = SE3(
    np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.array([0.45, 0.0, 0.5])
)  # a flange that points forward
_FLANGE_FROM_CAMERA = SE3(np.eye(3), np.array([0.0, -0.07, 0.05]))
_PLATE_OFFSET_M = 0.06  # from the flange to a target's plate
_LENS = Camera("pinhole", np.array([1012.0, 1009.0, 634.0, 366.0, -0.11, 0.07, 0.0004, -0.0003, 0.0]), (1280, 720))
_TRUTH_SIGMA = (0.03, 0.08)  # [m, rad] variation of cells of this kind
_GUESS_SIGMA = (0.02, 0.05)  # [m, rad] error of measurements by tape and eye
_START_COUNT = 64
_TARGET_NAMES = {True: "light", False: "board"}  # whether the target is one point


def two_arms(target: TargetKindName = "charuco", seed: int = 0, faults: Faults | None = None) -> World:
    """Create a cell of two UR5e, with its truth and its faults.

    Args:
        target: Kind of the target on the second arm.
        seed: Seed of the cell.
        faults: Faults of the cell; None for no faults.

    Raises:
        InputError: if the target is not found in images, or the arms do not reach their home poses.
    """
    rng = np.random.default_rng([seed, 5])
    shape = TARGETS[target].usual(np.random.default_rng(0))
    if shape.found_by is None:
        raise InputError(f"a running cell gives images, which show no {target!r}: choose another target")
    name = _TARGET_NAMES[shape.is_point]
    eye_base_from_hand_base = SE3.from_rotvec([0, 0, np.pi], [_BASE_DISTANCE_M, 0, 0]) @ _draw_pose(rng, _TRUTH_SIGMA)
    flange_from_camera = _FLANGE_FROM_CAMERA @ _draw_pose(rng, (0.01, 0.03))
    flange_from_target = _plate_mount(shape, rng)
    home_eye = _home_joints(ur5e(), _REACHED_POSE @ _draw_pose(rng, _TRUTH_SIGMA))
    hand_base_from_camera = eye_base_from_hand_base.inverse() @ ur5e().forward(home_eye) @ flange_from_camera
    home_hand = _home_joints(ur5e(), hand_base_from_camera @ _camera_from_target(shape) @ flange_from_target.inverse())
    truth = {
        "eye_base_from_hand_base": eye_base_from_hand_base,
        "eye_flange_from_wrist": flange_from_camera,
        f"hand_flange_from_{name}": flange_from_target,
    }
    stated = {each: _stated_unknown(each, true, rng, shape.is_point) for each, true in truth.items()}
    driver = Driver("simulated")
    cell = Cell(
        reference="eye",
        robots={
            each: Robot(each, None, ur5e(), {}, f"{each}.urdf", BASE_LINK, FLANGE_LINK, driver=driver)
            for each in ("eye", "hand")
        },
        bases={"hand": stated["eye_base_from_hand_base"]},
        cameras={
            "wrist": CellCamera(
                "wrist", "eye", stated["eye_flange_from_wrist"], _LENS.model, _LENS.size_px, Intrinsics("fixed", _LENS),
                driver=driver,
            )
        },
        targets={name: CellTarget(name, "hand", stated[f"hand_flange_from_{name}"], shape)},
    )  # fmt: skip
    return faulty_world(cell, truth, {"eye": home_eye, "hand": home_hand}, faults or Faults(), seed)


def _draw_pose(rng: draw.Generator, sigma: tuple[float, float]) -> SE3:
    return SE3.exp(draw.tangents(rng, 1, sigma)[0])


def _plate_mount(shape: Target, rng: draw.Generator) -> SE3:
    """Mount of a target: centred in front of the flange and facing away from it; a point has no rotation."""
    ahead = np.array([0.0, 0.0, _PLATE_OFFSET_M]) + draw.draw_in_ball(rng, 1, 0.02)[0]
    if shape.is_point:
        return SE3(np.eye(3), ahead - shape.points[0])
    rotation = _front_rotation(shape, np.diag([1.0, -1.0, -1.0])) @ rotation_exp(draw.draw_in_ball(rng, 1, 0.06)[0])
    return SE3(rotation, ahead - rotation @ shape.points.mean(0))


def _front_rotation(shape: Target, a_from_sheet: Array) -> Array:
    """Rotation of a target in a frame a, from the rotation of its front (x right, y down for a viewer), (3, 3)."""
    return a_from_sheet @ front(shape).T


def _camera_from_target(shape: Target) -> SE3:
    """Pose of the target in the camera at the home poses: on the optical axis, upright."""
    rotation = np.diag([-1.0, 1.0, -1.0]) if shape.is_point else _front_rotation(shape, np.eye(3))
    return SE3(rotation, np.array([0.0, 0.0, _DISTANCE_M]) - rotation @ shape.points.mean(0))


def _home_joints(chain: SerialChain, base_from_flange: SE3) -> Array:
    """Joints that reach a flange pose, (n,) [rad]; of several solutions, the farthest from singularities.

    Raises:
        InputError: if no solution is found.
    """
    starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (_START_COUNT, chain.n))
    joints, reached = solve_joints(chain, base_from_flange.repeat(_START_COUNT), starts)
    is_usable = reached & np.all(np.abs(joints) < np.pi, axis=-1)
    if not is_usable.any():
        raise InputError("an arm does not reach its home pose; choose another seed")
    dexterity = np.abs(np.linalg.det(chain.jacobian(joints[is_usable])))
    return np.asarray(joints[is_usable][int(dexterity.argmax())])


def _stated_unknown(name: str, true: SE3, rng: draw.Generator, is_led: bool) -> Unknown:
    """Stated transform of the cell: a guess; with an LED, as in the paper, mounts are known."""
    guess = true @ _draw_pose(rng, _GUESS_SIGMA)
    return Unknown("fixed", true) if is_led and "_flange_from_" in name else Unknown("free", guess)
