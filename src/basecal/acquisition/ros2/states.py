"""Robot states from joint states, poses, or tf frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from basecal.acquisition.driver import Reading
from basecal.acquisition.ros2.stream import Stream, stamp_s
from basecal.cell import RobotState
from basecal.errors import BasecalError, DriverError, list_names
from basecal.exchange.bags.bag import JOINTS, POSE, TF
from basecal.exchange.bags.frames import (
    FrameTransform,
    Tree,
    compose_path,
    pose_from_values,
    pose_values,
    transform_values,
)

_QUEUE_DEPTH = 50  # queued messages of states: a tenth of a second at the highest rate
_FRAMES_QUEUE_DEPTH = 200  # queued messages of tf, from all publishers
_STAMP_TOLERANCE_S = 5e-3  # between timestamps of the frames of a chain: one publisher sends equal timestamps


class StatesByTopic:
    """A robot whose joints or pose are published on a topic."""

    def __init__(self, name: str, domain: int, topic: str, joints: Sequence[str], wait_s: float) -> None:
        self._name, self._joints, self._last_s = name, list(joints), float("-inf")
        kinds = (JOINTS, POSE) if joints else (POSE,)
        self._stream = Stream(name, domain, topic, kinds, _QUEUE_DEPTH, wait_s)
        self._topic = topic
        self._published_joints: set[str] = set()

    def next(self) -> Reading:
        """The next state, with the timestamp of its header.

        Raises:
            DriverError: if no new state arrives before the timeout.
        """
        try:
            return self._stream.newest(self._reading, self._is_mine)
        except DriverError as error:
            missing = [joint for joint in self._joints if joint not in self._published_joints]
            if self._published_joints and missing and self._last_s == float("-inf"):
                raise DriverError(
                    f"{self._name}: {self._topic} lacks joints of the URDF: {list_names(missing)}; it has "
                    f"{list_names(sorted(self._published_joints))}"
                ) from None
            raise error

    def _is_mine(self, message: Any) -> bool:
        """Whether a message is about this robot; a gripper or a second arm may share the topic."""
        return self._stream.kind == POSE or set(self._joints) <= set(message.name)

    def _reading(self, message: Any) -> Reading | None:
        now_s = stamp_s(message.header)
        if self._stream.kind == JOINTS:
            self._published_joints.update(message.name)
        if not now_s > 0 or now_s <= self._last_s:
            return None
        if self._stream.kind == POSE:
            state = RobotState(pose_from_values(pose_values(message.pose), f"{self._name}, {self._topic}"))
        elif (found := self._joint_state(message)) is not None:
            state = found
        else:
            return None
        self._last_s = now_s
        return Reading(now_s, state)

    def _joint_state(self, message: Any) -> RobotState | None:
        """The robot's joints in a message; None if any joint is missing."""
        positions = dict(zip(message.name, message.position, strict=False))
        if not all(joint in positions for joint in self._joints):
            return None
        return RobotState(joints_rad=np.array([positions[joint] for joint in self._joints], dtype=float))


class StatesByFrames:
    """A robot whose flange is a tf frame."""

    def __init__(self, name: str, domain: int, base: str, flange: str, wait_s: float) -> None:
        self._name, self._base, self._flange = name, base, flange
        self._transforms: dict[str, FrameTransform] = {}
        self._stamps: dict[str, float] = {}
        self._last_s = float("-inf")
        self._dynamic_frames = Stream(name, domain, "/tf", (TF,), _FRAMES_QUEUE_DEPTH, wait_s)
        try:
            self._static_frames = [Stream(name, domain, "/tf_static", (TF,), _FRAMES_QUEUE_DEPTH, 0.5)]
        except DriverError:  # a robot without fixed frames has no such topic
            self._static_frames = []

    def next(self) -> Reading:
        """The next state, when all frames between base and flange have the same timestamp.

        Raises:
            DriverError: if the frames are not connected, or their timestamps do not advance.
        """
        try:
            return self._dynamic_frames.newest(self._reading)
        except DriverError as error:
            try:
                self._tree().path(self._base, self._flange)
            except BasecalError as why:
                raise DriverError(f"{self._name}: {why}") from None
            raise error

    def _tree(self) -> Tree:
        return Tree(self._transforms)

    def _reading(self, message: Any) -> Reading | None:
        for still in self._static_frames:
            for each in still.messages():
                self._add_transforms(each, is_fixed=True)
        self._add_transforms(message, is_fixed=False)
        try:
            way = self._tree().path(self._base, self._flange)
        except BasecalError:  # not all frames have arrived yet
            return None
        stamps = [self._stamps[step.child] for step in way if not self._transforms[step.child].is_fixed]
        if not stamps or max(stamps) - min(stamps) > _STAMP_TOLERANCE_S or min(stamps) <= self._last_s:
            return None
        self._last_s = min(stamps)
        return Reading(self._last_s, RobotState(compose_path(self._tree(), way, {}, self._name)))

    def _add_transforms(self, message: Any, is_fixed: bool) -> None:
        for each in message.transforms:
            frame_stamp_s, child = stamp_s(each.header), each.child_frame_id.lstrip("/")
            if is_fixed or frame_stamp_s > self._stamps.get(child, float("-inf")):
                values = transform_values(each.transform)
                self._transforms[child] = FrameTransform(
                    each.header.frame_id.lstrip("/"), values, is_fixed, not is_fixed
                )
                self._stamps[child] = frame_stamp_s
