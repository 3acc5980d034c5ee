"""`basecal study paper`."""

from __future__ import annotations

import json
from dataclasses import replace

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
    assert asked == [(None, 3)]


def test_the_file_is_tried_as_any_other(asked, tmp_path, capsys, monkeypatch):
    """Its table and summary stand in the folder, and the object says where, in a key of its own."""
    few = replace(paper.paper_study(), trials=8, text=paper.paper_study().text.replace("10000", "8"))
    monkeypatch.setattr(paper, "paper_study", lambda: few)
    assert main(["study", "paper", "--json", "-o", str(tmp_path / "out"), "--workers", "1"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["study"]["points"]) == 2
    assert (tmp_path / "out" / "summary.json").exists()
    assert told["paper"]["noiseless"].keys() == told["noiseless"].keys()
    assert asked == [(None, None)]


def test_what_does_not_go_together(asked, tmp_path):
    """Another seed or number is not the file; workers try the file alone."""
    assert main(["study", "paper", "-o", str(tmp_path / "out"), "--draws", "5"]) == 2
    assert main(["study", "paper", "--workers", "2"]) == 2
    assert asked == []


def test_one_draw_has_no_spread(asked):
    """It is wrong usage."""
    assert main(["study", "paper", "--draws", "1"]) == 2
    assert asked == []


@pytest.mark.parametrize(("words", "said"), [
    (["-o", "x", "--seed", "0"], "--output runs the study file as it is"),
    (["-o", "x", "--draws", "2"], "--output runs the study file as it is"),
    (["--workers", "1"], "--workers run the study file: give --output"),
    (["--draws", "1"], "2"),
    (["--draws", "10000001"], "10000000"),
])  # fmt: skip
def test_options_of_the_study_file_go_together(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Before anything is simulated."""
    assert main(["study", "paper", *words]) == 2
    assert said in capsys.readouterr().err
