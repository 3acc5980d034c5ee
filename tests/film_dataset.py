"""A dataset of LeRobot with two arms and a film of each wrist, of images and poses: each arm rests at every place."""

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
_MOVING = 4  # of the frames of a second


def long_arm() -> SerialChain:
    """The made-up arm at twice its size, which reaches a table's far side."""
    chain = six_axis()
    return replace(chain, origins=SE3(chain.origins.rotation, 2 * chain.origins.translation))


def write_dataset(folder: Path, urdf: Path, arms: Mapping[str, tuple[SE3, Sequence[Path]]]) -> None:
    """Write the dataset and the URDF of both arms.

    Args:
        folder: Of the dataset, v2.1.
        urdf: With the links `base` and `tool`.
        arms: By name poses of its flange (n,), and the images that its wrist sees there.
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
    """Joints that bring the flange to poses (n,), (n, 6) [rad]."""
    rng, found = np.random.default_rng(0), np.full((len(poses.translation), chain.n), np.nan)
    for _ in range(60):
        missing = np.flatnonzero(np.isnan(found[:, 0]))
        joints, reached = solve_joints(chain, poses[missing], rng.uniform(-2, 2, (len(missing), chain.n)))
        found[missing[reached]] = joints[reached]
        if not np.isnan(found).any():
            return found
    raise ValueError("the arm does not reach")


def _states(joints: Array) -> Array:
    """Degrees of the motors and a gripper at each frame: they rest, then go on."""
    after = np.concatenate([joints[1:], joints[-1:]])
    share = np.maximum(np.arange(RATE_HZ) - (RATE_HZ - _MOVING), 0)[:, None] / _MOVING
    moved = joints[:, None] + share * (after - joints)[:, None]
    degrees = np.degrees(moved.reshape(-1, joints.shape[1]))
    return np.concatenate([degrees, np.full((len(degrees), 1), 40.0)], axis=1)


def _write_film(path: Path, images: Sequence[Array]) -> None:
    """Frames of each image as long as the arm rests, then shifted ones."""
    height, width = images[0].shape[:2]
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), RATE_HZ, (width, height))
    for image in images:
        for k in range(RATE_HZ):
            film.write(image if k < RATE_HZ - _MOVING + 1 else np.roll(image, 15 * k, axis=1))
    film.release()
