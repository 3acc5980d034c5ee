"""Tests of `basecal capture --touch`."""

from __future__ import annotations

import json
from contextlib import nullcontext
from io import StringIO

import pytest
from tests.touch_cells import touch_data

from basecal.cell import Sample, TouchObservation
from basecal.cell.files import read_cell, read_recording
from basecal.cell.format.yaml_text import yaml_text
from basecal.cli import main
from basecal.cli.capture_touch import capture_touches
from basecal.cli.connecting import ConnectionOptions


def test_typed_poses_are_recorded(tmp_path, monkeypatch, capsys):
    """A pose typed for each mark is a sample of the recording."""
    data = touch_data(["corner"])
    data["robots"] = {"eye": {"driver": {"kind": "typed", "notation": "ur"}}}
    data["tips"] = {"eye_tip": {"on": "eye"}}
    (tmp_path / "cell.yaml").write_text(yaml_text(data))
    lines = ["corner", "0.4, 0.0, 0.5, 0.1, 0.0, 0.0", "", "0.4, 0.1, 0.5, 0.0, 0.2, 0.0", "q"]
    for words in (["--go"], ["--more"], ["--samples", "5"], ["--tolerance", "1mm"], ["--plan", "plan.jsonl"]):
        assert main(["capture", str(tmp_path), "--touch", *words]) == 2
    monkeypatch.setattr("sys.stdin", StringIO("\n".join(lines) + "\n"))
    assert main(["capture", str(tmp_path), "--touch"]) == 0
    assert "2 touches taken" in capsys.readouterr().out
    samples = read_recording(tmp_path, read_cell(tmp_path)).samples
    assert samples[1].robots["eye"].base_from_flange.translation == pytest.approx([0.4, 0.1, 0.5])


def touched(monkeypatch, samples):
    """Replace the rig, and return these samples."""
    monkeypatch.setattr("basecal.cli.capture_touch.allowed_rig", lambda *_: nullcontext())
    monkeypatch.setattr("basecal.acquisition.hand_guided_touches.take_touches", lambda *_: iter(samples))


@pytest.mark.parametrize("count", [0, 1, 2])
def test_touches_are_counted(tmp_path, monkeypatch, capsys, count):
    """Users get the touched marks, programs get numbers; no touch at all is a failure."""
    (tmp_path / "cell.yaml").write_text(yaml_text(touch_data(["corner"])))
    seen = TouchObservation("eye_tip", "corner")
    touched(monkeypatch, [Sample(number, observations=(seen,)) for number in range(3, 3 + count)])
    assert capture_touches(tmp_path, ConnectionOptions(), json=True) == (0 if count else 1)
    out, err = capsys.readouterr()
    assert (json.loads(out), err) == ({"cell": str(tmp_path), "captured": list(range(3, 3 + count))}, "")
    assert capture_touches(tmp_path, ConnectionOptions(), json=False) == (0 if count else 1)
    out, err = capsys.readouterr()
    assert out.splitlines() == [
        *(f"sample {number}: eye_tip at corner" for number in range(3, 3 + count)),
        f"{count} touch{'' if count == 1 else 'es'} taken",
    ]
    assert err == f"next: basecal calibrate {tmp_path}\n"


@pytest.mark.parametrize(
    "words",
    [
        ["--go"], ["--dry-run"], ["--freedrive"], ["--web"], ["--pattern", "shifts"], ["--task-point", "0 0 0"],
        ["--task-box", "0 0 0 1 1 1"], ["--seed", "1"], ["--port", "5000"], ["--speed-limit-deg-s", "5"],
        ["--tool-speed-limit", "1m/s"], ["--accept-no-watchdog"], ["--stop-on-disagreement"],
    ],
)  # fmt: skip
def test_touch_excludes_other_ways_of_capture(tmp_path, capsys, words):
    """An option of another way of capture is reported before the cell is read."""
    assert main(["capture", str(tmp_path / "none"), "--touch", *words]) == 2
    assert f"as many as are typed: leave {words[0]} out" in capsys.readouterr().err
