"""The shape of `cell.yaml`: what it and its entries may hold, as pydantic models."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic import field_validator as checks
from pydantic import model_validator as checks_whole

from basecal.cell.format.values import (
    Entry,
    ImageSize,
    Mount,
    Sigma,
    Sigma3,
    Status,
    UnknownEntry,
    Vector,
    empty,
    known_names,
)
from basecal.cell.schema.lens import IntrinsicsEntry, check_lens
from basecal.cell.targets.all_kinds import AnyTargetEntry
from basecal.geometry.lens import lens_models

SCHEMA = "basecal/cell/1"


class RobotNoiseEntry(Entry):
    """How well a robot's recorded pose is known, per axis of its flange and stop."""

    sigma_t_m: Sigma3
    sigma_r_rad: Sigma3


class ParametersEntry(Entry):
    """Joint offsets or link parameters."""

    status: Status = "fixed"
    sigma_rad: Sigma | None = None
    sigma_m: Sigma | None = None


class DeflectionEntry(Entry):
    """How the joints of a robot give way to gravity."""

    status: Status = "fixed"
    sigma_rad_per_nm: Sigma | None = None
    down: Vector = Field(default_factory=lambda: [0.0, 0.0, -1.0])

    @checks_whole(mode="after")
    def _sigma_of_prior(self) -> DeflectionEntry:
        if (self.status == "prior") != (self.sigma_rad_per_nm is not None):
            raise ValueError(f"status {self.status} takes {'a' if self.status == 'prior' else 'no'} sigma_rad_per_nm")
        if not any(self.down):
            raise ValueError("down is the direction of gravity in the robot's base, not zero")
        return self


class FramesEntry(Entry):
    """Names of a robot's frames in other programs."""

    base: str | None = None
    flange: str | None = None


class RobotEntry(Entry):
    """A robot."""

    noise: RobotNoiseEntry | None = None
    urdf: str | None = None
    base_link: str | None = None
    flange_link: str | None = None
    joint_offsets: ParametersEntry = ParametersEntry()
    link_parameters: ParametersEntry = ParametersEntry()
    deflection: DeflectionEntry = DeflectionEntry()
    frames: FramesEntry = FramesEntry()

    @checks("joint_offsets", "link_parameters")
    @classmethod
    def _sigmas_of_prior(cls, value: ParametersEntry, info: Any) -> ParametersEntry:
        wanted = {"sigma_rad"} if info.field_name == "joint_offsets" else {"sigma_rad", "sigma_m"}
        wanted = wanted if value.status == "prior" else set()
        given = {name for name in ("sigma_rad", "sigma_m") if getattr(value, name) is not None}
        if given != wanted:
            expected = " and ".join(sorted(wanted)) or "no sigma"
            raise ValueError(f"status {value.status} takes {expected}, got {' and '.join(sorted(given)) or 'none'}")
        return value

    @checks_whole(mode="after")
    def _urdf_whole(self) -> RobotEntry:
        parts = (self.urdf, self.base_link, self.flange_link)
        if any(parts) and not all(parts):
            raise ValueError("urdf, base_link and flange_link go together; give all three")
        asked = {self.joint_offsets.status, self.link_parameters.status, self.deflection.status}
        if not self.urdf and asked != {"fixed"}:
            raise ValueError("joint_offsets, link_parameters and deflection need urdf, base_link and flange_link")
        return self


class CameraEntry(Entry):
    """A camera."""

    on: str
    mount: Mount = UnknownEntry()
    model: Annotated[str, known_names("lens model", lens_models())] = "pinhole"
    size_px: ImageSize | None = None
    intrinsics: IntrinsicsEntry | None = None

    @checks("intrinsics")
    @classmethod
    def _lens(cls, value: IntrinsicsEntry | None, info: Any) -> IntrinsicsEntry | None:
        if value is not None and "model" in info.data:
            check_lens(value, info.data["model"])
            if value.fx is None and info.data.get("size_px", ()) is None:
                raise ValueError("a free lens needs size_px of the camera, or fx, fy, cx, cy as a guess")
        return value


class NoiseEntry(Entry):
    """What is known of the cameras' noise."""

    pixel_px: Sigma | None = None
    correlated_px: Sigma | None = None

    @checks_whole(mode="after")
    def _correlated_beside_pixel(self) -> NoiseEntry:
        if self.correlated_px is not None and self.pixel_px is None:
            raise ValueError("correlated_px needs pixel_px: state the noise of single points too")
        return self


class CellEntry(Entry):
    """All of `cell.yaml`."""

    version: Literal["basecal/cell/1"] = Field(alias="schema")
    reference: str
    robots: dict[str, Annotated[RobotEntry, BeforeValidator(empty)]]
    bases: Annotated[dict[str, Mount], BeforeValidator(empty)] = Field(default_factory=dict)
    cameras: Annotated[dict[str, CameraEntry], BeforeValidator(empty)] = Field(default_factory=dict)
    targets: Annotated[dict[str, AnyTargetEntry], BeforeValidator(empty)] = Field(default_factory=dict)
    noise: Annotated[NoiseEntry, BeforeValidator(empty)] = NoiseEntry()
