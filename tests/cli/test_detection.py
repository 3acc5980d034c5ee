"""Recordings whose images are looked at where they hold no detections."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from basecal.cell.files import read_cell
from basecal.cli import detection, main
from basecal.cli.detection import counting, detected_recording


def test_a_recording_without_images_is_taken_as_it_is(tmp_path, monkeypatch):
    """Nothing is looked for, no detector is loaded."""
    main(["simulate", str(tmp_path / "c"), "--samples", "3"])
    monkeypatch.setitem(sys.modules, "basecal.vision.detect", None)
    recording = detected_recording(tmp_path / "c", read_cell(tmp_path / "c"))
    assert [len(sample.observations) for sample in recording.samples] == [1, 1, 1]


def test_images_are_looked_at(tmp_path):
    """Every corner that is rendered, within a pixel of where a second look finds it."""
    main(["simulate", str(tmp_path / "c"), "--samples", "2", "--images"])
    cell = read_cell(tmp_path / "c")
    first, again = (detected_recording(tmp_path / "c", cell) for _ in range(2))
    for a, b in zip(first.samples, again.samples, strict=True):
        assert len(a.observations) == 1
        np.testing.assert_array_equal(a.observations[0].pixels, b.observations[0].pixels)


def test_steps_are_counted_on_a_terminal_alone(monkeypatch, capsys):
    """Elsewhere nothing is written."""
    with counting("detecting") as step:
        step(1, 2)
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(detection, "is_terminal", lambda stream: True)
    monkeypatch.setenv("FORCE_COLOR", "1")
    with counting("detecting") as step:
        step(2, 2)
    assert "detecting" in capsys.readouterr().err


@pytest.mark.parametrize("total", [1, 50])
def test_the_last_step_is_the_whole(monkeypatch, capsys, total):
    """A bar that is full says 100 %."""
    monkeypatch.setattr(detection, "is_terminal", lambda stream: True)
    monkeypatch.setenv("FORCE_COLOR", "1")
    with counting("detecting") as step:
        step(total, total)
    assert "100%" in capsys.readouterr().err
