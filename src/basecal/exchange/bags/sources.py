"""Where in a bag robots, cameras and views of targets come from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from basecal.cell.target import Tags
from basecal.exchange.bags.tags import TagFrames
from basecal.kinematics import SerialChain


@dataclass(frozen=True)
class ByFrames:
    """A pose by tf: `parent_from_child`."""

    parent: str
    child: str

    def __str__(self) -> str:
        return f"tf, {self.parent} to {self.child}"


@dataclass(frozen=True)
class ByPoses:
    """A pose by a topic of PoseStamped."""

    topic: str

    def __str__(self) -> str:
        return self.topic


@dataclass(frozen=True, eq=False)
class ByTags:
    """Corners of a target's AprilTags, by a topic of what a detector found."""

    topic: str
    tags: Tags

    def __str__(self) -> str:
        return f"corners of {self.topic}"


@dataclass(frozen=True, eq=False)
class ByTagPoses:
    """A target by the poses of its tags, by a topic of what ROS 1's detector found."""

    topic: str
    frames: TagFrames

    def __str__(self) -> str:
        numbers = ", ".join(map(str, self.frames.tag_from_target)) or "the only one of each image"
        return f"poses of {self.topic}, tag {numbers}"


@dataclass(frozen=True, eq=False)
class ByJoints:
    """A robot by joint states.

    Attributes:
        topic: Of the joint states.
        chain: The robot's kinematics.
        base: Root of the chain in the URDF.
        flange: Its tip.
        urdf: Topic of the URDF, which is to be written into the cell; None if the cell has it.
    """

    topic: str
    chain: SerialChain
    base: str
    flange: str
    urdf: str | None = None

    def __str__(self) -> str:
        by = "the cell's URDF" if self.urdf is None else f"the URDF of {self.urdf}"
        return f"{self.topic}, {len(self.chain.joint_names)} joints from {self.base} to {self.flange} by {by}"


@dataclass(frozen=True)
class CameraSource:
    """A camera's images.

    Attributes:
        topic: Of the images.
        info: Topic of its camera_info; None if there is none.
        on: What carries it.
    """

    topic: str
    info: str | None
    on: str


@dataclass(frozen=True, eq=False)
class Taken:
    """The chosen parts of a bag: robots and cameras by name, views of targets by camera and target."""

    robots: Mapping[str, ByFrames | ByPoses | ByJoints] = field(default_factory=dict)
    cameras: Mapping[str, CameraSource] = field(default_factory=dict)
    views: Mapping[tuple[str, str], ByFrames | ByPoses | ByTags | ByTagPoses] = field(default_factory=dict)

    @property
    def words(self) -> list[str]:
        """A line for each."""
        cameras = [
            f"camera {name!r}, on {source.on!r}: {source.topic}{f' with {source.info}' if source.info else ''}"
            for name, source in self.cameras.items()
        ]
        views = [f"target {target!r} seen by {camera!r}: {source}" for (camera, target), source in self.views.items()]
        return [f"robot {name!r}: {source}" for name, source in self.robots.items()] + cameras + views


@dataclass(frozen=True)
class Asked:
    """The parts of a bag that a person requests; those left empty are found.

    Attributes:
        robots: `BASE,FLANGE` of tf, or a topic of poses, by name.
        cameras: Topic of images, by name.
        views: `CAMERA_FRAME,TARGET_FRAME` of tf, or a topic of poses or of tags, by the names of camera and
            target.
        on: What carries cameras and targets, by name.
        by_tf: Whether robots come from tf where joint states are there as well.
    """

    robots: Mapping[str, str] = field(default_factory=dict)
    cameras: Mapping[str, str] = field(default_factory=dict)
    views: Mapping[tuple[str, str], str] = field(default_factory=dict)
    on: Mapping[str, str] = field(default_factory=dict)
    by_tf: bool = False
