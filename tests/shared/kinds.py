"""Kinds of cells that the solver must solve without a guess."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.simulation import Scenario

KINDS: dict[str, Scenario] = {
    "hand-eye, charuco": Scenario(layout="eye_in_hand"),
    "hand-eye, chessboard": Scenario(layout="eye_in_hand", target="chessboard"),
    "hand-eye, poses": Scenario(layout="eye_in_hand", target="pose"),
    "eye-to-hand, charuco": Scenario(layout="eye_to_hand"),
    "eye-to-hand, light": Scenario(layout="eye_to_hand", target="led"),
    "dual, charuco": Scenario(),
    "dual, chessboard": Scenario(target="chessboard"),
    "dual, rigid points": Scenario(target="points"),
    "dual, poses": Scenario(target="pose"),
    "dual, 3-D points": Scenario(target="points3d"),
    "dual in halves": Scenario(arms="halves"),
    "dual at stations": Scenario(arms="stations"),
    "eye still, its mount fixed": Scenario(arms="eye_still", camera_mount="fixed"),
    "hand still, target fixed": Scenario(arms="hand_still", target_mount="fixed"),
    "light, mounts known": Scenario(target="led", camera_mount="fixed", target_mount="fixed"),
    "light, its offset free": Scenario(target="led", camera_mount="fixed"),
    "light, all free": Scenario(target="led"),
    "mounts by priors": Scenario(camera_mount="prior", target_mount="prior"),
    "robot noise": Scenario(robot_noise=(3e-4, 5e-4)),
    "two cameras, a robot each": Scenario(layout="two_cameras"),
    "two cameras on the world": Scenario(layout="two_world_cameras"),
    "ring of three robots": Scenario(layout="chain"),
    "dual, lens free": Scenario(intrinsics="free"),
    "hand-eye, lens free": Scenario(layout="eye_in_hand", intrinsics="free"),
    "dual, fisheye": Scenario(lens="fisheye"),
}
FEWEST_SAMPLES, MOST_SAMPLES = 15, 30


def kind_scenario(kind: str, seed: int) -> Scenario:
    """The kind with 15 to 30 samples for each pair of camera and target that is recorded separately."""
    samples = int(np.random.default_rng([seed, 1]).integers(FEWEST_SAMPLES, MOST_SAMPLES + 1))
    scenario = KINDS[kind]
    return replace(scenario, samples=samples * (scenario.robots if scenario.layout == "chain" else 1))
