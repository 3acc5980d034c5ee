"""Schema of `cell.yaml` and its entries as pydantic models."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, create_model
from pydantic import field_validator as checks
from pydantic import model_validator as checks_whole

from basecal.cell.cell import Clock, RollingShutter
from basecal.cell.schema.keep_out import KeepOutEntry
from basecal.cell.schema.lens import IntrinsicsEntry, check_lens, check_size
from basecal.cell.schema.touching import ClampEntry, MarkEntry, TipEntry, named_clamps
from basecal.cell.targets.registry import AnyTargetEntry
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.fields.parameters import Parameters
from basecal.fields.problems import shorten
from basecal.fields.values import (
    Entry,
    ImageSize,
    Length,
    Mount,
    Sigma,
    Sigma3,
    UnknownEntry,
    empty_if_missing,
    known_name_validator,
)
from basecal.geometry.lenses.registry import lens_models

SCHEMA = "basecal/cell/1"
_NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")


class RobotNoiseEntry(Entry):
    """Sigmas of a robot's recorded pose, per stop and per axis of the flange."""

    sigma_t_m: Sigma3
    sigma_r_rad: Sigma3
    kind: Literal["repeatability", "total"] = "repeatability"


def is_frame_name(name: str) -> bool:
    """Whether a name is a valid ROS frame name and a single word in a shell."""
    return bool(re.fullmatch(r"[A-Za-z_][A-Za-z0-9_./-]*", name)) and len(name) <= _LONGEST_FRAME


def _check_frame_name(name: str) -> str:
    if not is_frame_name(name):
        raise ValueError(
            f"expected a frame of ROS: a-z, A-Z, 0-9 and _ . / -, a letter or _ first, up to {_LONGEST_FRAME} of them; "
            f"got {shorten(name)}"
        )
    return name


_LONGEST_FRAME = 255
FrameName = Annotated[str, AfterValidator(_check_frame_name)]


class FramesEntry(Entry):
    """Names of a robot's frames in other programs; they are safe to paste into a shell command."""

    base: FrameName | None = None
    flange: FrameName | None = None


class ControllerEntry(Entry):
    """Source of a robot's poses: controller format, and its base and tool frames; the robot's own if not stated."""

    format: FrameName
    base: FrameName | None = None
    tool: FrameName | None = None


class RobotEntry(Entry):
    """A robot without its kinematic parameters; see `AnyRobotEntry`."""

    noise: RobotNoiseEntry | None = None
    urdf: str | None = None
    base_link: str | None = None
    flange_link: str | None = None
    reach_m: Length | None = None
    frames: FramesEntry = FramesEntry()
    controller: ControllerEntry | None = None
    clock: Clock | None = None
    driver: DriverEntry | None = None

    @property
    def parameters(self) -> dict[str, Parameters]:
        """Prior knowledge of the robot's parameters by kind, without kinds at their default."""
        stated = {kind: getattr(self, kind) for kind in ROBOT_PARAMETERS}
        return {kind: known for kind, known in stated.items() if known != type(known)()}

    @checks("clock")
    @classmethod
    def _check_no_jitter(cls, value: Clock | None) -> Clock | None:
        if value is not None and value.jitter_s is not None:
            raise ValueError("jitter_s belongs to the clock of a camera, not of a robot")
        return value

    @checks_whole(mode="after")
    def _check_urdf(self) -> RobotEntry:
        parts = (self.urdf, self.base_link, self.flange_link)
        if any(parts) and not all(parts):
            raise ValueError("urdf, base_link and flange_link go together; give all three")
        estimated = [kind for kind, known in self.parameters.items() if known.status != "fixed"]
        if estimated and not self.urdf:
            raise ValueError(f"to estimate {' and '.join(estimated)}, urdf, base_link and flange_link are needed")
        return self


# One field per registered kind of parameter, created at run time: type checkers cannot see these fields.
if TYPE_CHECKING:
    AnyRobotEntry = RobotEntry
else:
    _STATED = {name: (each.stated, each.stated()) for name, each in ROBOT_PARAMETERS.items()}
    AnyRobotEntry = create_model("AnyRobotEntry", __base__=RobotEntry, **_STATED)


class CameraEntry(Entry):
    """A camera."""

    on: str
    mount: Mount = UnknownEntry()
    model: Annotated[str, known_name_validator("lens model", lens_models())] = "pinhole"
    size_px: ImageSize | None = None
    intrinsics: IntrinsicsEntry | None = None
    clock: Clock | None = None
    driver: DriverEntry | None = None
    rolling_shutter: RollingShutter | None = None
    kind: Literal["camera", "tracker"] = "camera"
    frame: FrameName | None = None

    @checks_whole(mode="after")
    def _check_tracker(self) -> CameraEntry:
        if self.kind == "tracker" and (self.intrinsics is not None or self.size_px is not None):
            raise ValueError("a tracker measures points in metres: remove intrinsics and size_px")
        return self

    @checks("intrinsics")
    @classmethod
    def _check_intrinsics(cls, value: IntrinsicsEntry | None, info: Any) -> IntrinsicsEntry | None:
        if value is not None and "model" in info.data:
            check_lens(value, info.data["model"])
            check_size(value, info.data.get("size_px"))
            if value.fx is None and info.data.get("size_px", ()) is None:
                raise ValueError("a free lens needs size_px of the camera, or fx, fy, cx, cy as a guess")
        return value


class NoiseEntry(Entry):
    """Prior knowledge of the cameras' noise."""

    pixel_px: Sigma | None = None
    correlated_px: Sigma | None = None

    @checks_whole(mode="after")
    def _check_correlated_noise(self) -> NoiseEntry:
        if self.correlated_px is not None and self.pixel_px is None:
            raise ValueError("correlated_px needs pixel_px: state the noise of single points too")
        return self


_Mark = Annotated[MarkEntry, BeforeValidator(empty_if_missing)]


class CellEntry(Entry):
    """Content of `cell.yaml`."""

    version: Literal["basecal/cell/1"] = Field(alias="schema")
    reference: str
    robots: dict[str, Annotated[AnyRobotEntry, BeforeValidator(empty_if_missing)]]
    bases: Annotated[dict[str, Mount], BeforeValidator(empty_if_missing)] = Field(default_factory=dict)
    cameras: Annotated[dict[str, CameraEntry], BeforeValidator(empty_if_missing)] = Field(default_factory=dict)
    targets: Annotated[dict[str, AnyTargetEntry], BeforeValidator(empty_if_missing)] = Field(default_factory=dict)
    noise: Annotated[NoiseEntry, BeforeValidator(empty_if_missing)] = NoiseEntry()
    keep_out: Annotated[dict[str, KeepOutEntry], BeforeValidator(empty_if_missing)] = Field(default_factory=dict)
    target: Literal["scene"] | None = None
    tips: Annotated[dict[str, TipEntry], BeforeValidator(empty_if_missing)] = Field(default_factory=dict)
    marks: Annotated[dict[str, _Mark], BeforeValidator(empty_if_missing)] = Field(default_factory=dict)
    clamp: Annotated[dict[str, ClampEntry], BeforeValidator(named_clamps)] = Field(default_factory=dict)


def _check_kind(value: dict[str, Any]) -> dict[str, Any]:
    kind = value.get("kind")
    if not (isinstance(kind, str) and _NAME.fullmatch(kind)):
        raise ValueError(
            f"expected `kind`, the name of a driver (a-z, 0-9 and _), with its options beside it; got {shorten(kind)}"
        )
    return value


DriverEntry = Annotated[dict[str, Any], AfterValidator(_check_kind)]
"""Name of a driver as `kind`, and its options; the driver validates the options when it is opened."""
