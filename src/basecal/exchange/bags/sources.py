"""Sources of robots, cameras and views of targets in a bag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from basecal.cell.target import Tags
from basecal.errors import count_text
from basecal.exchange.bags.tags import TagFrames
from basecal.kinematics import SerialChain


@dataclass(frozen=True)
class ByFrames:
    """A pose from tf: `parent_from_child`."""

    parent: str
    child: str

    def __str__(self) -> str:
        return f"tf, {self.parent} to {self.child}"


@dataclass(frozen=True)
class ByPoses:
    """A pose from a topic of PoseStamped."""

    topic: str

    def __str__(self) -> str:
        return self.topic


@dataclass(frozen=True, eq=False)
class ByTags:
    """Corners of a target's AprilTags from a topic of detections."""

    topic: str
    tags: Tags

    def __str__(self) -> str:
        return f"corners of {self.topic}"


@dataclass(frozen=True, eq=False)
class ByTagPoses:
    """A target's pose from the poses of its tags, in a topic of ROS 1's detector."""

    topic: str
    frames: TagFrames

    def __str__(self) -> str:
        numbers = ", ".join(map(str, self.frames.tag_from_target)) or "the only one of each image"
        return f"poses of {self.topic}, tag {numbers}"


@dataclass(frozen=True, eq=False)
class ByJoints:
    """A robot's state from joint states.

    Attributes:
        topic: Topic of the joint states.
        chain: The robot's kinematics.
        base: Root link of the chain in the URDF.
        flange: Tip link of the chain in the URDF.
        urdf: Topic of the URDF to be written into the cell; None if the cell has it.
    """

    topic: str
    chain: SerialChain
    base: str
    flange: str
    urdf: str | None = None

    def __str__(self) -> str:
        urdf = "the cell's URDF" if self.urdf is None else f"the URDF of {self.urdf}"
        joints = count_text(len(self.chain.joint_names), "joint")
        return f"{self.topic}, {joints} from {self.base} to {self.flange} by {urdf}"


@dataclass(frozen=True)
class CameraSource:
    """A camera's images.

    Attributes:
        topic: Topic of the images.
        info: Topic of the camera_info; None if there is none.
        on: Carrier of the camera.
    """

    topic: str
    info: str | None
    on: str


@dataclass(frozen=True, eq=False)
class BagSources:
    """Selected sources of a bag: robots and cameras by name, views of targets by camera and target."""

    robots: Mapping[str, ByFrames | ByPoses | ByJoints] = field(default_factory=dict)
    cameras: Mapping[str, CameraSource] = field(default_factory=dict)
    views: Mapping[tuple[str, str], ByFrames | ByPoses | ByTags | ByTagPoses] = field(default_factory=dict)

    @property
    def words(self) -> list[str]:
        """One line of text per source."""
        cameras = [
            f"camera {name!r}, on {source.on!r}: {source.topic}{f' with {source.info}' if source.info else ''}"
            for name, source in self.cameras.items()
        ]
        views = [f"target {target!r} seen by {camera!r}: {source}" for (camera, target), source in self.views.items()]
        return [f"robot {name!r}: {source}" for name, source in self.robots.items()] + cameras + views


@dataclass(frozen=True)
class BagRequest:
    """Sources of a bag requested by the user; empty fields are found automatically.

    Attributes:
        robots: `BASE,FLANGE` of tf, or a topic of poses, by name.
        cameras: Topics of images by name.
        views: `CAMERA_FRAME,TARGET_FRAME` of tf, or a topic of poses or of tags, by the names of camera and
            target.
        on: Carriers of cameras and targets, by name.
        by_tf: Whether robots are read from tf even if there are joint states.
    """

    robots: Mapping[str, str] = field(default_factory=dict)
    cameras: Mapping[str, str] = field(default_factory=dict)
    views: Mapping[tuple[str, str], str] = field(default_factory=dict)
    on: Mapping[str, str] = field(default_factory=dict)
    by_tf: bool = False
