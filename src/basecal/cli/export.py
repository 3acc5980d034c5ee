"""`basecal export`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import CycloptsError, Parameter

from basecal.cli.option_types import Domain, Output
from basecal.cli.page import find_run
from basecal.cli.publishing import check_publishing, publish_transforms
from basecal.cli.terminal import quote_path, say, say_next
from basecal.errors import FrameNotFound
from basecal.exchange.exporters.registry import EXPORTERS

_KINDS = "; ".join(f"{name}: {each.words}" for name, each in EXPORTERS.items())


def export(
    cell: Path,
    /,
    *,
    to: Annotated[str | None, Parameter(help=f"The program. {_KINDS}.")] = None,
    transform: str | None = None,
    robot: str | None = None,
    camera: str | None = None,
    urdf: Annotated[tuple[Path, ...], Parameter(consume_multiple=True)] = (),
    joint: str | None = None,
    run: str | None = None,
    output: Output = None,
    publish: bool = False,
    domain: Domain = None,
) -> int:
    """Write the results of a calibration in the format of another program.

    A transform a_from_b is the pose of b in a. --transform accepts any two frames
    that do not move relative to each other, such as the bases of any two robots,
    in either direction. Without it, the requested transforms are written. Without
    --to, each robot's result is written for the controller that wrote its poses,
    in the frame in which they were recorded. Numbers have two digits more than
    their sigma justifies. A refused calibration is not exported, and a doubtful
    one is marked.

    For example:

        basecal export mycell
        basecal export mycell --to ur
        basecal export mycell --to kuka --transform hand_base_from_eye_base
        basecal export ring --to json --transform robot2_base_from_robot3_base
        basecal export mycell --to urdf --robot hand -o hand_corrected.urdf
        basecal export mycell --to urdf_cell --urdf eye.urdf hand.urdf -o both.urdf
        basecal export mycell --to ros2 --publish

    Args:
        cell: Folder of the cell.
        to: The program; the robots' own controllers if not given.
        transform: Name of a transform, a_from_b of any two frames that the calibration determines.
        robot: The robot, for formats of a single robot.
        camera: The camera, for formats of a single camera.
        urdf: URDF files to extend; for several robots in the order of cell.yaml.
        joint: The joint whose origin is replaced, if several are possible.
        run: Name of a run in the cell's folder `runs`; the latest by default.
        output: File to write; printed by default.
        publish: With --to ros2, publish it on /tf_static until Ctrl-C, also to later subscribers.
        domain: DDS domain, with --publish; ROS_DOMAIN_ID, else 0, by default.
    """
    from basecal.cell.files import read_calibration, read_cell, run_folder
    from basecal.exchange.exporters.controllers import controllers_text
    from basecal.exchange.exporters.exporter import export as exported

    to = None if to is None else to.lower()
    _check_usage(to, {"transform": transform, "robot": robot, "camera": camera, "urdf": urdf, "joint": joint})
    check_publishing(publish, domain, to, output)
    described = read_cell(cell)
    folder = find_run(cell) if run is None else run_folder(cell, run)
    calibration = read_calibration(folder)
    if publish:
        return publish_transforms(calibration, described, transform, domain)
    if to is None:
        text = controllers_text(calibration, described, transform, folder.name)
    else:
        named: dict[str, Any] = {"robot": robot, "camera": camera, "urdf": urdf, "joint": joint}
        text = exported(calibration, to, transform, **named, cell=described, folder=cell, run=folder.name)
    _write(text, output, cell)
    if calibration.verdict == "doubtful":
        say(f"basecal: warning: the calibration is doubtful: basecal report {quote_path(cell)}", sys.stderr)
    return 0


def _check_usage(to: str | None, options: Mapping[str, object]) -> None:
    """Check that the format exists and accepts the given options.

    Raises:
        CycloptsError: if it does not.
    """
    if to is None and any(value for option, value in options.items() if option != "transform"):
        raise CycloptsError(msg="without --to only --transform is accepted: name the program with --to")
    if to is None:
        return
    if to not in EXPORTERS:
        raise CycloptsError(msg=f"--to: {FrameNotFound(to, list(EXPORTERS))}")
    takes = EXPORTERS[to].options
    for option, value in options.items():
        if value and option not in takes:
            raise CycloptsError(msg=f"--to {to} takes --{' or --'.join(takes)}, not --{option}")


def _write(text: str, output: Path | None, cell: Path) -> None:
    from basecal.cell.format.writing import write_output

    if output is None:
        say(text.rstrip("\n"))
    else:
        write_output(output, text)
        say(f"written: {output}")
    say_next(f"later, to check whether anything moved: basecal verify {quote_path(cell)} NEW.jsonl")
