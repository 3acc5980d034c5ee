"""`basecal capture --touch`."""

from __future__ import annotations

from io import StringIO

import pytest
from tests.touch_cells import touch_data

from basecal.cell.files import read_cell, read_recording
from basecal.cell.format.yaml_text import yaml_text
from basecal.cli import main


def test_the_verb_asks_and_notes(tmp_path, monkeypatch, capsys):
    """A pose typed for each mark is a sample of the recording."""
    data = touch_data(["corner"])
    data["robots"] = {"eye": {"driver": {"kind": "typed", "notation": "ur"}}}
    data["tips"] = {"eye_tip": {"on": "eye"}}
    (tmp_path / "cell.yaml").write_text(yaml_text(data))
    lines = ["corner", "0.4, 0.0, 0.5, 0.1, 0.0, 0.0", "", "0.4, 0.1, 0.5, 0.0, 0.2, 0.0", "q"]
    assert main(["capture", str(tmp_path), "--touch", "--go"]) == 2
    monkeypatch.setattr("sys.stdin", StringIO("\n".join(lines) + "\n"))
    assert main(["capture", str(tmp_path), "--touch"]) == 0
    assert "2 touches taken" in capsys.readouterr().out
    samples = read_recording(tmp_path, read_cell(tmp_path)).samples
    assert samples[1].robots["eye"].base_from_flange.translation == pytest.approx([0.4, 0.1, 0.5])
