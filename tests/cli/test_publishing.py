"""Tests of `basecal export CELL --to ros2 --publish`."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cyclopts import CycloptsError

from basecal.cell.files import latest_run, read_calibration
from basecal.cli import main
from basecal.cli.publishing import check_publishing, publish_transforms
from basecal.exchange.bags.frames import pose_from_values, transform_values

pytest.importorskip("cyclonedds")
from basecal.acquisition.ros2 import static_frames
from basecal.acquisition.ros2.dds import Discovery, Subscriber
from export_example import BASE, CALIBRATION, CELL
from shared.ros2_domain import DOMAIN, LOOPBACK

ELSEWHERE = DOMAIN + 31


@pytest.mark.journey
def test_transforms_are_published_until_interrupted(tmp_path, monkeypatch):
    """Another process receives them with their frames; Ctrl-C ends without an error."""
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    cell = tmp_path / "cell"
    assert main(["simulate", str(cell), "--samples", "20"]) == 0
    assert main(["calibrate", str(cell)]) == 0
    words = ["export", str(cell), "--to", "ros2", "--publish", "--domain", str(ELSEWHERE)]
    with subprocess.Popen([sys.executable, "-m", "basecal", *words], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert "to " in process.stdout.readline()
            offer = Discovery(ELSEWHERE).wait_for_topic("/tf_static", 30.0)
            (message,) = Subscriber(ELSEWHERE, offer, 10).messages(15.0)
            os.kill(process.pid, signal.SIGINT)
            assert process.wait(timeout=20) == 0
        finally:
            process.kill()
    calibration = read_calibration(latest_run(cell))
    sent = {each.child_frame_id: each for each in message.transforms}
    found = calibration["eye_base_from_hand_base"].mean
    np.testing.assert_allclose(
        pose_from_values(transform_values(sent["hand_base"].transform), "").matrix, found.matrix, atol=1e-12
    )
    assert sent["hand_base"].header.frame_id == "eye_base"


@pytest.mark.parametrize("words", [["--to", "ur", "--publish"], ["--to", "ros2", "--domain", "3"]])
def test_contradictory_options_are_refused(tmp_path, words, capsys):
    """Only exports for ROS 2 are published, and a domain is accepted only there."""
    assert main(["export", str(tmp_path), *words]) == 2
    assert "--publish and --domain go with --to ros2" in capsys.readouterr().err


@pytest.mark.parametrize(("publish", "domain", "to", "output", "is_right"), [
    (False, None, None, None, True), (False, None, "ur", Path("a"), True), (True, None, "ros2", None, True),
    (True, 0, "ros2", None, True), (False, 0, "ros2", None, False), (True, None, None, None, False),
    (True, None, "ros2", Path("a"), False), (True, 3, "ur", None, False),
])  # fmt: skip
def test_options_of_publishing_need_publish(publish, domain, to, output, is_right):
    """They are accepted only with it; domain 0 is a domain."""
    if is_right:
        check_publishing(publish, domain, to, output)
    else:
        with pytest.raises(CycloptsError, match="--publish and --domain go with --to ros2"):
            check_publishing(publish, domain, to, output)


@pytest.mark.parametrize(("verdict", "is_warned"), [("good", False), ("doubtful", True)])
def test_published_transforms_are_printed(monkeypatch, capsys, verdict, is_warned):
    """Each transform is printed with its domain; a doubtful calibration is reported on stderr."""
    sent = []
    monkeypatch.setattr(static_frames, "send_static", lambda *given: sent.append(given))
    assert publish_transforms(replace(CALIBRATION, verdict=verdict), CELL, BASE, 7) == 0
    ((domain, ((parent, child, pose),)),) = sent
    assert (domain, pose) == (7, CALIBRATION[BASE].mean)
    out, err = capsys.readouterr()
    assert out.splitlines() == [
        f"on /tf_static in domain 7: {parent} to {child}", "published, also to later subscribers, until Ctrl-C",
    ]  # fmt: skip
    assert ("the calibration is doubtful" in err) == is_warned
