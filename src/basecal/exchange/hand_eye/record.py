"""The record of a hand-eye program: one robot and one camera, or a second robot that carries the target."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from basecal.geometry import SE3


@dataclass(frozen=True, eq=False)
class HandEyeRecord:
    """Poses of a robot, what its camera saw at each, and what is known of the rest.

    Attributes:
        path: The file.
        what: What it holds, in which frames and units.
        camera_on_robot: Whether the robot carries the camera, and not the target.
        base_from_flange: (n,) poses of the robot; none if the file has only a result.
        camera_from_target: (n,) poses of the target; None if there are images instead.
        images: One for each pose; none if there are poses.
        frames: What the file calls the robot's `base` and `flange`.
        camera_frame: What it calls the camera's frame; empty if it does not say.
        camera_mount: Where the camera was found to be, in the flange or the base; None if the file does not say.
        target_mount: Likewise the target.
        lens: What `cell.yaml` says of the camera's lens; nothing if the file does not.
        target: What it says of the target's kind and sizes; likewise.
        hand_base_from_flange: (n,) poses of a second robot, which carries the target; None if there is one robot.
    """

    path: str
    what: str
    camera_on_robot: bool
    base_from_flange: SE3 = field(default_factory=lambda: SE3.identity((0,)))
    camera_from_target: SE3 | None = None
    images: tuple[Path, ...] = ()
    frames: Mapping[str, str] = field(default_factory=dict)
    camera_frame: str = ""
    camera_mount: SE3 | None = None
    target_mount: SE3 | None = None
    lens: Mapping[str, Any] = field(default_factory=dict)
    target: Mapping[str, Any] = field(default_factory=dict)
    hand_base_from_flange: SE3 | None = None
