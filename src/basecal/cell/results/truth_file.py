"""`truth.yaml`: what is so in a simulated cell."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from basecal.cell.format.plain import pose_dict
from basecal.cell.format.writing import write_whole
from basecal.cell.format.yaml_text import Document, parse_yaml, read_text, yaml_text
from basecal.cell.schema.errors import problems_of
from basecal.fields.problems import Problem, dataset_error, shorten
from basecal.fields.values import PoseEntry, full_pose, pose_se3
from basecal.geometry import SE3

FILE = "truth.yaml"
SCHEMA = "basecal/truth/1"


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
    write_whole(path, yaml_text({"schema": SCHEMA, "transforms": poses, **extra}))
    return path


def read_truth(folder: str | Path) -> dict[str, SE3]:
    """The true transforms of a simulated cell, by name.

    Raises:
        DatasetError: if there is no `truth.yaml`, or it cannot be read as written.
    """
    path = Path(folder) / FILE
    document = _document(path)
    data, transforms = document.data, {}
    for name, pose in data["transforms"].items():
        loc = ("transforms", name)
        try:
            transforms[name] = pose_se3(full_pose(PoseEntry.model_validate(pose)))
        except ValidationError as error:
            problems = [Problem((*loc, *p.loc), p.message) for p in problems_of(error, PoseEntry)]
            raise dataset_error(str(path), problems, document.lines) from None
        except ValueError as error:
            raise dataset_error(str(path), [Problem(loc, str(error))], document.lines) from None
    return transforms


def read_truth_extra(folder: str | Path) -> dict[str, Any]:
    """What else `truth.yaml` says, beside the transforms, as plain data.

    Raises:
        DatasetError: if there is no `truth.yaml`, or it cannot be read as written.
    """
    data = _document(Path(folder) / FILE).data
    return {key: value for key, value in data.items() if key not in ("schema", "transforms")}


def _document(path: Path) -> Document:
    document = parse_yaml(read_text(path, "only simulated cells have a truth"), str(path))
    data = document.data if isinstance(document.data, dict) else {}
    if data.get("schema") != SCHEMA or not isinstance(data.get("transforms"), dict):
        message = f"expected `schema: {SCHEMA}` and `transforms`, got {shorten(data.get('schema'))}"
        raise dataset_error(str(path), [Problem(("schema",), message)], document.lines)
    return document
