"""Tests of the file of a study and of its validation."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from basecal.errors import DatasetError
from basecal.studies.jobs import WorkerPool
from basecal.studies.run import run_study
from basecal.studies.study_file import read_study, study_from_text
from basecal.studies.summary import summarise
from shared.study_defaults import documented_defaults

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "studies").glob("*.yaml"))
MANY = f"axes: {{distance_m: {[1 + k / 100 for k in range(200)]}}}"
HEAD = "schema: basecal/study/1\ntrials: 10\ncells: 2\n"


def test_minimal_study_has_defaults() -> None:
    """Title and axes are optional: the study then has one point and the name of its file."""
    made = study_from_text(HEAD, "some/where.yaml")
    assert (made.title, len(made.points), made.seed, made.transform) == ("where", 1, 0, None)
    assert study_from_text("schema: basecal/study/1\ntrials: 10\n", "where.yaml").cells == 10  # as docs/studies.md says


def test_defaults_match_documentation() -> None:
    """Each field except the board has a documented default, which is the actual one."""
    settings = study_from_text(HEAD, "where.yaml").points[0].settings
    stated = documented_defaults()
    assert {name: settings[name] for name in stated} == stated
    assert settings.keys() - stated.keys() == {"board"}


@pytest.mark.parametrize(("length", "is_read"), [(10_000, True), (10_001, False)])
def test_description_has_limited_length(length: int, is_read: bool) -> None:
    """The description is limited to ten thousand characters."""
    text = f"{HEAD}about: {'x' * length}\n"
    if is_read:
        assert len(study_from_text(text, "where.yaml").about) == length
        return
    with pytest.raises(DatasetError, match="10000 characters"):
        study_from_text(text, "where.yaml")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_can_be_read(path: Path) -> None:
    """Every example has points, a title and a description."""
    made = read_study(path)
    assert len(made.points) > 4
    assert made.title
    assert made.about


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(path: Path, tmp_path: Path) -> None:
    """With one trial per point, every point of an example has an answer."""
    text = re.sub(r"^(trials|cells): .*$", r"\1: 1", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    made = study_from_text(text, str(path))
    assert made.trials == made.cells == 1
    run_study(made, tmp_path / "out", WorkerPool(1))
    assert all(point["solved"] == 1 for point in summarise(made, tmp_path / "out")["points"])


def test_documented_examples_exist() -> None:
    """The examples are the three questions of the documentation."""
    assert [path.stem for path in EXAMPLES] == ["how_many_samples", "which_board", "which_shift_length"]


@pytest.mark.parametrize(
    ("text", "line", "field", "words"),
    [
        ("[]", 1, None, "expected a mapping that starts with `schema: basecal/study/1`"),
        ("schema: basecal/cell/1", 1, "schema", "expected basecal/study/1"),
        ("schema: basecal/study/1", 1, "trials", "missing"),
        (f"{HEAD}hold: {{sampels: 3}}", 4, "hold.sampels", "did you mean 'samples'?"),
        (f"{HEAD}axes: {{sampels: [3]}}", 4, "axes.sampels", "did you mean 'samples'?"),
        (f"{HEAD}trails: 3", 4, "trails", "did you mean 'trials'?"),
        (f"{HEAD}axes:\n  samples: []", 5, "axes.samples", "at least 1"),
        (f"{HEAD}axes:\n  samples: 5", 5, "axes.samples", "expected a list"),
        (f"{HEAD}axes:\n  samples: [5, x]", 5, "axes.samples[1]", "expected a whole number"),
        (f"{HEAD}axes:\n  samples:\n    - 5\n    - 5", 7, "axes.samples[1]", "already"),
        (f"{HEAD}hold: {{samples: 5}}\naxes: {{samples: [5, 6]}}", 4, "hold.samples", "keep only one"),
        (f"{HEAD}hold: {{pixel_px: .nan}}", 4, "hold.pixel_px", "finite"),
        (f"{HEAD}hold: {{pixel_px: -1}}", 4, "hold.pixel_px", "greater than or equal to 0"),
        (f"{HEAD}hold: {{solver: open_cv}}", 4, "hold.solver", "did you mean 'opencv'?"),
        (f"{HEAD}hold: {{solver: opencv}}", 4, "hold.solver", "two unknowns"),
        (f"{HEAD}axes: {{solver: [closed_form]}}", 4, "axes.solver", "needs layout shifts"),
        (f"{HEAD}hold: {{layout: duo}}", 4, "hold.layout", "no layout 'duo'"),
        (f"{HEAD}hold: {{board: {{kind: charucco}}}}", 4, "hold.board.kind", "did you mean 'charuco'?"),
        (f"{HEAD}hold: {{board: {{}}}}", 4, "hold.board", "needs `kind`"),
        (f"{HEAD}transform: eye_base", 4, "transform", "there are: eye_base_from_hand_base"),
        (f"{HEAD}hold: {{base: fixed, camera_mount: fixed, target_mount: fixed}}", 4, "hold.base", "nothing to solve"),
        (
            f"{HEAD}hold: {{samples: 2000}}",
            4,
            "hold.samples",
            "2000 samples of 36 points make 72000, at most 20000 are",
        ),
        (f"{HEAD}axes: {{samples: [5, 700]}}", 4, "axes.samples", "700 samples of 36 points"),
        (
            f"{HEAD}hold: {{board: {{kind: chessboard, corners: [1000, 900], square_m: 0.01}}}}",
            4,
            "hold.samples",
            "30 samples of 900000 points",
        ),
        (f"schema: basecal/study/1\ntrials: 9000000\n{MANY}", 2, "trials", "at most 100000000 are allowed in all"),
        (
            f"schema: basecal/study/1\ntrials: 30000\ncells: 10000\n{MANY}",
            3,
            "cells",
            "at most 1000000 are allowed in all",
        ),
        ("schema: basecal/study/1\ntrials: 2\ncells: 5", 1, None, "2 trials cannot be spread over 5 cells"),
    ],
)
def test_mistakes_are_reported_with_line_and_field(text: str, line: int, field: str | None, words: str) -> None:
    """Each mistake is reported with what was expected."""
    with pytest.raises(DatasetError) as error:
        study_from_text(text, "study.yaml")
    assert (error.value.line, error.value.field) == (line, field)
    assert words in error.value.reason


def test_all_mistakes_are_reported_together() -> None:
    """Mistakes are in the order of the file, one per line."""
    with pytest.raises(DatasetError) as error:
        study_from_text(f"{HEAD}hold:\n  sampels: 3\n  pixel_px: much\n", "study.yaml")
    assert [line.split(": ")[0] for line in str(error.value).splitlines()] == ["study.yaml:5", "study.yaml:6"]


def test_too_many_points_are_refused() -> None:
    """Too many points are refused before they are created."""
    values = ", ".join(str(k) for k in range(1, 1001))
    with pytest.raises(DatasetError, match="1000000 points"):
        study_from_text(f"{HEAD}axes:\n  samples: [{values}]\n  stations: [{values}]\n", "study.yaml")


def test_missing_file_is_reported(tmp_path: Path) -> None:
    """The error names the path."""
    with pytest.raises(DatasetError, match="there is no such file"):
        read_study(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("text", "over", "words"),
    [
        ("trials: 10000000", "trials: 10000001", "less than or equal to 10000000"),
        ("trials: 10000\ncells: 10000", "trials: 10001\ncells: 10001", "less than or equal to 10000"),
        ("trials: 10\nhold: {samples: 555}", "trials: 10\nhold: {samples: 556}", "at most 20000"),
        (
            "trials: 10\nhold: {samples: 1000, board: {kind: chessboard, corners: [4, 5], square_m: 0.1}}",
            "trials: 10\nhold: {samples: 1001, board: {kind: chessboard, corners: [4, 5], square_m: 0.1}}",
            "1001 samples of 20 points make 20020",
        ),
        ("trials: 1000000\nseed: 9223372036854775807", "trials: 1\nseed: 9223372036854775808", "less than"),
        ("trials: 10\nhold: {board_scale: 0.5}", "trials: 10\nhold: {board_scale: 0.49}", "0.5"),
        ("trials: 10\nhold: {focal_scale: 2}", "trials: 10\nhold: {focal_scale: 2.01}", "2"),
        ("trials: 10\nhold: {outlier_share: 1}", "trials: 10\nhold: {outlier_share: 1.01}", "1"),
        ("trials: 10\nhold: {spread_rad: 3.15}", "trials: 10\nhold: {spread_rad: 3.16}", "3.15"),
        ("trials: 10\nhold: {distance_m: 1e-9}", "trials: 10\nhold: {distance_m: 0}", "greater than 0"),
        ("trials: 10\nhold: {robots: 2}", "trials: 10\nhold: {robots: 1}", "2"),
    ],
)
def test_limits_are_inclusive(text: str, over: str, words: str) -> None:
    """A value at a limit is accepted, and one just beyond is refused with the limit."""
    read, refused = (each if "cells" in each else f"{each}\ncells: 1" for each in (text, over))
    study_from_text(f"schema: basecal/study/1\n{read}\n", "study.yaml")
    with pytest.raises(DatasetError) as error:
        study_from_text(f"schema: basecal/study/1\n{refused}\n", "study.yaml")
    assert words in str(error.value)


def test_total_trials_and_cells_are_limited() -> None:
    """A hundred million trials over ten points are accepted, at eleven points they are refused.

    The same holds for a million cells.
    """
    axes = f"axes: {{pixel_px: {[k / 10 for k in range(10)]}}}"
    hundred = f"axes: {{pixel_px: {[k / 10 for k in range(100)]}}}"
    head = "schema: basecal/study/1\n"
    assert len(study_from_text(f"{head}trials: 10000000\n{axes}\n", "study.yaml").points) == 10
    assert study_from_text(f"{head}trials: 10000\ncells: 10000\n{hundred}\n", "study.yaml").cells == 10000
    eleven = axes.replace("[0.0,", "[99.0, 0.0,")
    with pytest.raises(DatasetError, match="make 110000000, at most 100000000"):
        study_from_text(f"{head}trials: 10000000\n{eleven}\n", "study.yaml")
    more = hundred.replace("[0.0,", "[99.0, 0.0,")
    with pytest.raises(DatasetError, match="make 1010000, at most 1000000"):
        study_from_text(f"{head}trials: 10000\ncells: 10000\n{more}\n", "study.yaml")


def test_axis_is_limited_to_thousand_values() -> None:
    head = "schema: basecal/study/1\ntrials: 1\ncells: 1\n"
    values = list(range(1001))
    with pytest.raises(DatasetError, match="1000"):
        study_from_text(f"{head}axes: {{pixel_px: {values}}}", "study.yaml")
