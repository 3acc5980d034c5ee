"""`basecal new`."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import CycloptsError, Parameter

from basecal.cli.new_from_ros2 import NewCell, ros2_cell
from basecal.cli.next_step import next_step
from basecal.cli.option_types import Domain, Names, number_range
from basecal.cli.terminal import quote_path, say
from basecal.exchange.importing.described_target import (
    UNSTATED_SHAPE,
    Shape,
    are_indistinguishable,
    target_fields,
)
from basecal.exchange.importing.template import Kind, cell_text
from basecal.fields.typed_length import parse_name_options

if TYPE_CHECKING:
    from basecal.cell import Cell


def new(
    cell: Path,
    /,
    *,
    robots: Annotated[int | None, number_range(1, 9)] = None,
    names: Names = (),
    target: Kind = "charuco",
    shape: Annotated[Shape, Parameter(name="*")] = UNSTATED_SHAPE,
    from_: Annotated[Literal["ros2"] | None, Parameter(name="--from")] = None,
    robot: Names = (),
    domain: Domain = None,
    yes: bool = False,
) -> int:
    """Write a working cell.yaml to fill in, and an empty recording.

    One robot: a camera on its flange sees a target fixed in the world. Two: the
    camera is on the first, `eye`, the target on the second, `hand`. More: each
    robot's camera sees the target of the next; the targets differ in their
    dictionary or numbers, so that they cannot be confused. If the target's sizes
    are given, poses and images can be imported at once. With --from ros2, robots,
    cameras, lenses and drivers are taken from three seconds of messages of a
    running ROS 2 system. An existing cell is never overwritten.

    For example:

        basecal new mycell --robots 2 --target charuco
        basecal new mycell --names left right --squares 5x7 --square 40mm
        basecal new mycell --from ros2 --squares 5x7 --square 40mm
        basecal calibrate mycell

    Args:
        cell: Folder to make.
        robots: Number of robots; two if neither this nor names are given.
        names: Names of the robots; the first is the reference, in whose base results are expressed.
        target: Kind of target; `pose` if another program measures the target's pose.
        shape: Counts and sizes of the targets.
        from_: Running system to take the cell from.
        robot: NAME=BASE,FLANGE, frames of tf and links of the URDF, or NAME=/TOPIC of PoseStamped; with --from.
        domain: DDS domain; ROS_DOMAIN_ID, else 0, by default; with --from.
        yes: Connect without a question; with --from.
    """
    from basecal.cell.files import cell_from_dict, read_recording
    from basecal.cell.format.writing import make_folder, open_new
    from basecal.cell.format.yaml_text import parse_yaml

    if names and robots not in (None, len(names)):
        raise CycloptsError(msg=f"--robots {robots} and {len(names)} --names differ: leave --robots out")
    if target == "pose" and shape != UNSTATED_SHAPE:
        raise CycloptsError(msg="--target pose has no sizes: leave them out")
    fields = target_fields(target, shape) if shape != UNSTATED_SHAPE else None
    if (robot or domain is not None or yes) if from_ is None else (names or robots is not None):
        raise CycloptsError(msg="--robot, --domain and --yes go with --from ros2, --robots and --names without it")
    if from_ is None:
        text = cell_text(names or robots or 2, target, shape=fields)
        result = NewCell(text, cell_from_dict(parse_yaml(text, str(cell)).data, str(cell / "cell.yaml")))
    else:
        result = ros2_cell(cell, yes, domain, parse_name_options("--robot", robot, "NAME=BASE,FLANGE"), fields, target)
    write_cell_files(cell, result.text, result.urdfs)
    _warn_of_equal_targets(result.cell)
    samples = cell / "recording" / "samples.jsonl"
    make_folder(samples.parent, cell)
    if not os.path.lexists(samples):
        open_new(samples).close()
    then = f"record into {samples}, then: basecal calibrate {quote_path(cell)}"
    say(f"wrote {cell / 'cell.yaml'}: fill in what is known, {then}")
    if (missing := next_step(result.cell, read_recording(cell, result.cell), cell)) is not None:
        say(missing)
    return 0


def _warn_of_equal_targets(cell: Cell) -> None:
    shapes = [(name, entry.target) for name, entry in cell.targets.items() if entry.target is not None]
    for (first, shape), (second, other_shape) in combinations(shapes, 2):
        if are_indistinguishable(shape, other_shape):
            say(
                f"basecal: warning: {first!r} and {second!r} look the same, both {shape.kind}. Give "
                "them other counts in cell.yaml, or take --target charuco or apriltag, whose marks differ",
                sys.stderr,
            )
            return


def write_cell_files(folder: Path, text: str, urdfs: Mapping[str, str]) -> None:
    """Write a `cell.yaml`, and URDFs by file name, into a folder, which is made if it is missing.

    Raises:
        InputError: if one of the files exists.
    """
    from basecal.cell.format.writing import write_new

    write_new(folder / "cell.yaml", text)
    for name, urdf in urdfs.items():
        write_new(folder / name, urdf)
