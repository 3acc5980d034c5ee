"""Tests of `basecal study paper`."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from basecal.cli import main
from basecal.studies import paper


@pytest.fixture
def asked(monkeypatch):
    """Arguments of the study, which is run with few lengths."""
    calls = []
    study = paper.study_paper

    def few(seed, draws):
        """Study with two draws of each length."""
        calls.append((seed, draws))
        return study(seed, draws, length_draws=2)

    monkeypatch.setattr(paper, "study_paper", few)
    return calls


def test_json_has_the_given_seed_and_draws(asked, capsys):
    """The object has the keys of the paper's figures."""
    assert main(["study", "paper", "--json", "--draws", "5", "--seed", "7"]) == 0
    study = json.loads(capsys.readouterr().out)
    assert asked == [(7, 5)]
    assert study["settings"]["draws"] == 5
    assert study["paper"]["noiseless"].keys() == study["noiseless"].keys()


def test_text_and_figures_are_written(asked, tmp_path, capsys):
    """The folder is made, with a figure of rotation and one of translation."""
    folder = tmp_path / "some" / "figures"
    assert main(["study", "paper", "--draws", "3", "--figures", str(folder)]) == 0
    assert "table 1" in capsys.readouterr().out
    assert {path.name for path in folder.iterdir()} == {"shift_length_rotation.svg", "shift_length_translation.svg"}
    assert asked == [(None, 3)]


def test_study_file_runs_like_any_other(asked, tmp_path, capsys, monkeypatch):
    """Table and summary are in the folder, and a key of the object has its path."""
    few = replace(paper.paper_study(), trials=8, text=paper.paper_study().text.replace("10000", "8"))
    monkeypatch.setattr(paper, "paper_study", lambda: few)
    assert main(["study", "paper", "--json", "-o", str(tmp_path / "out"), "--workers", "1"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["study"]["points"]) == 2
    assert (tmp_path / "out" / "summary.json").exists()
    assert told["paper"]["noiseless"].keys() == told["noiseless"].keys()
    assert asked == [(None, None)]


def test_contradictory_options_are_wrong_usage(asked, tmp_path):
    """The file has its own seed and number of draws; workers need the file."""
    assert main(["study", "paper", "-o", str(tmp_path / "out"), "--draws", "5"]) == 2
    assert main(["study", "paper", "--workers", "2"]) == 2
    assert asked == []


def test_single_draw_is_wrong_usage(asked):
    """One draw has no standard deviation."""
    assert main(["study", "paper", "--draws", "1"]) == 2
    assert asked == []


@pytest.mark.parametrize(("words", "said"), [
    (["-o", "x", "--seed", "0"], "--output runs the study file as it is"),
    (["-o", "x", "--draws", "2"], "--output runs the study file as it is"),
    (["--workers", "1"], "--workers run the study file: give --output"),
    (["--draws", "1"], "2"),
    (["--draws", "10000001"], "10000000"),
])  # fmt: skip
def test_options_of_the_study_file_are_checked_first(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """They are checked before any simulation."""
    assert main(["study", "paper", *words]) == 2
    assert said in capsys.readouterr().err
