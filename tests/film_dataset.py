"""A LeRobot dataset of two arms, each with films of wrist cameras, from images and poses: arms rest at each pose."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from basecal.exchange.urdf import chain_urdf
from basecal.geometry import SE3, Array
from basecal.kinematics import SerialChain
from basecal.simulation.arms import six_axis, solve_joints

RATE_HZ = 10
_MOVING = 4  # frames of each second in which the arm moves


def long_arm() -> SerialChain:
    """The simulated six-axis arm at twice its size, so that it reaches the far side of a table."""
    chain = six_axis()
    return replace(chain, origins=SE3(chain.origins.rotation, 2 * chain.origins.translation))


def write_dataset(folder: Path, urdf: Path, arms: Mapping[str, tuple[SE3, Sequence[Path]]]) -> None:
    """Write the dataset and the URDF of both arms.

    Args:
        folder: Folder of the dataset, v2.1.
        urdf: Path of the URDF, whose links are `base` and `tool`.
        arms: By name the flange poses (n,) of an arm, and the images of its wrist camera at each.
    """
    import pyarrow
    from pyarrow import parquet

    chain = long_arm()
    urdf.write_text(chain_urdf(chain, "base", "tool"))
    motors = [*chain.joint_names, "gripper"]
    states = np.concatenate([_states(_joints(chain, poses)) for poses, _ in arms.values()], axis=1)
    features = {"observation.state": {"names": [f"{arm}_{motor}.pos" for arm in arms for motor in motors]}}
    features |= {f"observation.images.{arm}_wrist": {"dtype": "video"} for arm in arms}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps({"codebase_version": "v2.1", "features": features}))
    table = folder / "data" / "chunk-000" / "episode_000000.parquet"
    table.parent.mkdir(parents=True)
    rows = [
        {"observation.state": s.tolist(), "timestamp": k / RATE_HZ, "episode_index": 0} for k, s in enumerate(states)
    ]
    parquet.write_table(pyarrow.Table.from_pylist(rows), table)
    for arm, (_, images) in arms.items():
        film = folder / "videos" / "chunk-000" / f"observation.images.{arm}_wrist" / "episode_000000.mp4"
        film.parent.mkdir(parents=True)
        _write_film(film, [cv2.imread(str(image)) for image in images])


def _joints(chain: SerialChain, poses: SE3) -> Array:
    """Joints (n, 6) [rad] that bring the flange to poses (n,)."""
    rng, solved = np.random.default_rng(0), np.full((len(poses.translation), chain.n), np.nan)
    for _ in range(60):
        missing = np.flatnonzero(np.isnan(solved[:, 0]))
        joints, reached = solve_joints(chain, poses[missing], rng.uniform(-2, 2, (len(missing), chain.n)))
        solved[missing[reached]] = joints[reached]
        if not np.isnan(solved).any():
            return solved
    raise ValueError("the arm does not reach")


def _states(joints: Array) -> Array:
    """Angles of motors [deg] and the gripper at each frame: the arm rests at each pose, then moves to the next."""
    next_joints = np.concatenate([joints[1:], joints[-1:]])
    share = np.maximum(np.arange(RATE_HZ) - (RATE_HZ - _MOVING), 0)[:, None] / _MOVING
    path = joints[:, None] + share * (next_joints - joints)[:, None]
    degrees = np.degrees(path.reshape(-1, joints.shape[1]))
    return np.concatenate([degrees, np.full((len(degrees), 1), 40.0)], axis=1)


def _write_film(path: Path, images: Sequence[Array]) -> None:
    """Write a film that shows each image while the arm rests, then shifted images while it moves."""
    height, width = images[0].shape[:2]
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), RATE_HZ, (width, height))
    for image in images:
        for k in range(RATE_HZ):
            film.write(image if k < RATE_HZ - _MOVING + 1 else np.roll(image, 15 * k, axis=1))
    film.release()
