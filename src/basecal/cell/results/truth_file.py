"""`truth.yaml`: what is so in a simulated cell."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from basecal.cell.format.plain import pose_dict
from basecal.cell.format.writing import write_atomically
from basecal.cell.format.yaml_text import parse_yaml, read_text, yaml_text
from basecal.cell.schema.errors import check_entry, check_schema
from basecal.fields.values import PoseEntry, full_pose, pose_se3
from basecal.geometry import SE3

FILE = "truth.yaml"
SCHEMA = "basecal/truth/1"


class _Truth(BaseModel):
    """All of `truth.yaml`; what else is so in the cell stands beside."""

    model_config = ConfigDict(extra="allow", defer_build=True)
    version: Literal["basecal/truth/1"] = Field(alias="schema")
    transforms: dict[str, Annotated[PoseEntry, AfterValidator(full_pose)]]


def write_truth(folder: str | Path, transforms: Mapping[str, SE3], **extra: Any) -> Path:
    """Path of the `truth.yaml` written into a folder.

    Args:
        folder: The cell's folder.
        transforms: By name, `a_from_b`.
        extra: More that is so, as plain data (a seed, sigmas).

    Raises:
        InputError: if it cannot be written.
    """
    poses = {name: pose_dict(transform) for name, transform in transforms.items()}
    path = Path(folder) / FILE
    write_atomically(path, yaml_text({"schema": SCHEMA, "transforms": poses, **extra}))
    return path


def read_truth(folder: str | Path) -> dict[str, SE3]:
    """The true transforms of a simulated cell, by name.

    Raises:
        DatasetError: if there is no `truth.yaml`, or it cannot be read as written.
    """
    return {name: pose_se3(pose) for name, pose in _read(folder).transforms.items()}


def read_truth_extra(folder: str | Path) -> dict[str, Any]:
    """Other content of `truth.yaml`, beside the transforms, as plain data.

    Raises:
        DatasetError: if there is no `truth.yaml`, or it cannot be read as written.
    """
    extra: dict[str, Any] = _read(folder).model_extra or {}
    return extra


def _read(folder: str | Path) -> _Truth:
    path = Path(folder) / FILE
    document = parse_yaml(read_text(path, "only simulated cells have a truth"), str(path))
    data = check_schema(document.data, SCHEMA, str(path), document.lines)
    return check_entry(_Truth, data, str(path), document.lines)
