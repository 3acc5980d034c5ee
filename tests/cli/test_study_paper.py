"""`basecal study paper`."""

from __future__ import annotations

import json

import pytest

from basecal.cli import main
from basecal.studies import paper


@pytest.fixture
def asked(monkeypatch):
    """What was asked of the study, which is made with few lengths."""
    calls = []
    study = paper.study_paper

    def few(seed, draws):
        """The study, with two draws of each length."""
        calls.append((seed, draws))
        return study(seed, draws, length_draws=2)

    monkeypatch.setattr(paper, "study_paper", few)
    return calls


def test_the_object_has_the_seed_and_draws_asked_for(asked, capsys):
    """In the keys of the paper's figures."""
    assert main(["study", "paper", "--json", "--draws", "5", "--seed", "7"]) == 0
    study = json.loads(capsys.readouterr().out)
    assert asked == [(7, 5)]
    assert study["settings"]["draws"] == 5
    assert study["paper"]["noiseless"].keys() == study["noiseless"].keys()


def test_text_and_figures(asked, tmp_path, capsys):
    """The folder is made, with a drawing of rotation and one of translation."""
    folder = tmp_path / "some" / "figures"
    assert main(["study", "paper", "--draws", "3", "--figures", str(folder)]) == 0
    assert "table 1" in capsys.readouterr().out
    assert {path.name for path in folder.iterdir()} == {"shift_length_rotation.svg", "shift_length_translation.svg"}
    assert asked == [(0, 3)]


def test_one_draw_has_no_spread(asked):
    """It is wrong usage."""
    assert main(["study", "paper", "--draws", "1"]) == 2
    assert asked == []
