"""Publication of a calibration on `/tf_static` of ROS 2: `basecal export CELL --to ros2 --publish`."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import CycloptsError

from basecal.cli.terminal import say

if TYPE_CHECKING:
    from basecal.cell import Calibration, Cell

_A_DAY_S = 86_400.0


def check_publishing(publish: bool, domain: int | None, to: str | None, output: Path | None) -> None:
    """Check that options of publishing are used with --to ros2 and without --output.

    Raises:
        CycloptsError: if they are not.
    """
    if (publish or domain is not None) and not (publish and to == "ros2" and output is None):
        raise CycloptsError(msg="--publish and --domain go with --to ros2, and with no --output")


def publish_transforms(calibration: Calibration, cell: Cell, transform: str | None, domain: int | None) -> int:
    """Publish transforms until Ctrl-C.

    Raises:
        RefusedCalibration: if the calibration is refused.
        FrameNotFound: if there is no such transform.
        MissingExtra: if cyclonedds or rosbags is not installed.
    """
    from basecal.acquisition.ros2.dds import choose_domain
    from basecal.acquisition.ros2.static_frames import STATIC_TOPIC, send_static
    from basecal.exchange.exports.choice import chosen_transforms
    from basecal.exchange.exports.exporter import check_exportable

    check_exportable(calibration)
    transforms, domain_id = chosen_transforms(calibration, cell, transform), choose_domain(domain)
    sender = send_static(domain_id, [(each.parent, each.child, each.estimate.mean) for each in transforms])
    for each in transforms:
        say(f"on {STATIC_TOPIC} in domain {domain_id}: {each.parent} to {each.child}")
    if calibration.verdict == "doubtful":
        say("basecal: warning: the calibration is doubtful: look at its report", sys.stderr)
    say("published, also to later subscribers, until Ctrl-C")
    with suppress(KeyboardInterrupt):
        while sender is not None:
            time.sleep(_A_DAY_S)
    return 0
