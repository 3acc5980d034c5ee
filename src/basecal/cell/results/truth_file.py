"""`truth.yaml`: ground truth of a simulated cell."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from basecal.cell.format.plain import pose_dict
from basecal.cell.format.writing import write_atomically
from basecal.cell.format.yaml_text import parse_yaml, read_text, yaml_text
from basecal.cell.schema.errors import check_entry, check_schema
from basecal.fields.values import PoseEntry, check_full_pose, pose_se3
from basecal.geometry import SE3

FILE = "truth.yaml"
SCHEMA = "basecal/truth/1"


class _Truth(BaseModel):
    """Content of `truth.yaml`; other fields of the ground truth are allowed."""

    model_config = ConfigDict(extra="allow", defer_build=True)
    version: Literal["basecal/truth/1"] = Field(alias="schema")
    transforms: dict[str, Annotated[PoseEntry, AfterValidator(check_full_pose)]]


def write_truth(folder: str | Path, transforms: Mapping[str, SE3], **extra: Any) -> Path:
    """Write `truth.yaml` into a folder and return its path.

    Args:
        folder: The cell's folder.
        transforms: True transforms by name, `a_from_b`.
        extra: Other ground truth as plain data, such as a seed or sigmas.

    Raises:
        InputError: if the file cannot be written.
    """
    poses = {name: pose_dict(transform) for name, transform in transforms.items()}
    path = Path(folder) / FILE
    write_atomically(path, yaml_text({"schema": SCHEMA, "transforms": poses, **extra}))
    return path


def read_truth(folder: str | Path) -> dict[str, SE3]:
    """Read the true transforms of a simulated cell, by name.

    Raises:
        DatasetError: if `truth.yaml` is missing or invalid.
    """
    return {name: pose_se3(pose) for name, pose in _read(folder).transforms.items()}


def read_truth_extra(folder: str | Path) -> dict[str, Any]:
    """Read the content of `truth.yaml` other than the transforms, as plain data.

    Raises:
        DatasetError: if `truth.yaml` is missing or invalid.
    """
    extra: dict[str, Any] = _read(folder).model_extra or {}
    return extra


def _read(folder: str | Path) -> _Truth:
    path = Path(folder) / FILE
    document = parse_yaml(read_text(path, "only simulated cells have a truth"), str(path))
    data = check_schema(document.data, SCHEMA, str(path), document.lines)
    return check_entry(_Truth, data, str(path), document.lines)
