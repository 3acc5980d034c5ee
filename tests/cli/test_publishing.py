"""`basecal export CELL --to ros2 --publish`."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from basecal.cell.files import latest_run, read_calibration
from basecal.cli import main
from basecal.exchange.bags.frames import pose_from_values, transform_values

pytest.importorskip("cyclonedds")
from basecal.acquisition.ros2.dds import Discovery, Listener
from shared.ros2_domain import DOMAIN, LOOPBACK

ELSEWHERE = DOMAIN + 31


@pytest.mark.journey
def test_what_was_found_is_sent_until_it_is_interrupted(tmp_path, monkeypatch):
    """Another process hears it with its frames, and it ends by Ctrl-C without an error."""
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    cell = tmp_path / "cell"
    assert main(["simulate", str(cell), "--samples", "20"]) == 0
    assert main(["calibrate", str(cell)]) == 0
    words = ["export", str(cell), "--to", "ros2", "--publish", "--domain", str(ELSEWHERE)]
    with subprocess.Popen([sys.executable, "-m", "basecal", *words], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert "to " in process.stdout.readline()
            offer = Discovery(ELSEWHERE).wait_for("/tf_static", 30.0)
            (message,) = Listener(ELSEWHERE, offer, 10).messages(15.0)
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
def test_what_does_not_go_together(tmp_path, words, capsys):
    """Only what ROS 2 takes is sent, and a domain is said only where it is."""
    assert main(["export", str(tmp_path), *words]) == 2
    assert "--publish and --domain go with --to ros2" in capsys.readouterr().err
