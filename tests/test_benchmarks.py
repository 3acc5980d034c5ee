"""Tests of the benchmarks: pages and figures from results, mutants, and helpers of several benchmarks."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks import capture, report, running_check, scale
from benchmarks.capture import HEAD, Outcome, kept_outcomes, row, size_text
from benchmarks.capture_images import speeds
from benchmarks.common import RESULTS, Kept
from benchmarks.entered import FileOfTests, Judge, telling
from benchmarks.mutants import Verdict, kept_runs, room_tests, rows, run_of, survivors
from benchmarks.peers.tables import brief
from benchmarks.real_errors import reality
from benchmarks.report import PAGE, make_page
from benchmarks.rescues import RESCUES, locate
from benchmarks.small_faults import SOURCE, Mutant, mutants_of, replacements
from benchmarks.solve.task import make_task
from benchmarks.solve.whole import Whole

from basecal.simulation import Scenario, simulate
from derivatives import check_derivative

ROOT = Path(__file__).parents[1]
SVG = "{http://www.w3.org/2000/svg}"


def test_page_is_generated_from_results() -> None:
    """The page docs/benchmarks.md equals the output of `python -m benchmarks.report`: no number is typed."""
    assert PAGE.read_text(encoding="utf-8") == make_page()


def test_scale_page_is_generated_from_results() -> None:
    """docs/scale.md equals the output of `python -m benchmarks.scale` for benchmarks/results."""
    assert scale.PAGE.read_text(encoding="utf-8") == scale.page()


def test_readme_table_of_peers_is_generated_from_results() -> None:
    """The README's table of peers is generated from benchmarks/results/peers.json."""
    rows = json.loads((RESULTS / "peers.json").read_text(encoding="utf-8"))["rows"]
    assert brief(rows) in (ROOT / "README.md").read_text(encoding="utf-8")


def test_run_of_captures_continues_or_starts_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With no time left, a run prints the kept results and their start; `--anew` deletes them."""
    told: dict[str, Any] = {}
    monkeypatch.setattr(capture, "write", lambda name, result: told.update({name: result}))
    monkeypatch.setattr(report, "PAGE", tmp_path / "page.md")
    Kept(tmp_path / "kept.jsonl").keep("commit", "0ld")
    Kept(tmp_path / "kept.jsonl").keep("#0", outcome("good", 7.0))
    words = ["--keep", str(tmp_path / "kept.jsonl"), "--minutes", "0"]
    assert capture.main(words) == 0
    assert (told["capture"]["kept_since"], [each["cells"] for each in told["capture"]["rows"]]) == ("0ld", [1])
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == make_page()
    assert capture.main([*words, "--anew"]) == 0
    assert (told["capture"]["kept_since"], told["capture"]["rows"]) == (capture.commit(), [])


def test_mutants_change_one_expression() -> None:
    """Each mutant of a file parses and differs from the original at the line that it names."""
    path = SOURCE / "kinematics" / "inverse.py"
    original = ast.unparse(ast.parse(path.read_text(encoding="utf-8")))
    mutants = list(mutants_of(path))
    assert len(mutants) > 30
    for mutant in mutants:
        assert ast.unparse(ast.parse(mutant.source)) == mutant.source != original
        assert mutant.file == "kinematics/inverse.py"


def test_mutants_are_drawn_by_number_and_name_their_function() -> None:
    """Mutants drawn by number equal those of the full list; each lies within its function or its module."""
    path = SOURCE / "kinematics" / "inverse.py"
    every, lines = list(mutants_of(path)), path.read_text(encoding="utf-8").splitlines()
    assert list(mutants_of(path, {3, 30})) == [every[3], every[30]]
    assert len({mutant.place for mutant in every}) == len(every)
    outside = [mutant for mutant in every if not mutant.function]
    assert outside
    assert all(lines[mutant.line - 1].startswith(("_", "    ")) for mutant in outside)
    for mutant in every:
        if mutant.function:
            assert mutant.line in mutant.function
            assert lines[mutant.function[0] - 1].lstrip().startswith(("def ", "@"))


def test_tracer_reports_entered_functions_and_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    """A function reports the line of its first decorator on entry, and a module its import."""
    source = '''"""A module."""
from __future__ import annotations
def plain():
    """What it gives."""
    return 1
class Thing:
    @property
    def decorated(self):
        return plain()
'''
    told: list[tuple[object, ...]] = []
    monkeypatch.setattr("builtins._entered_", lambda *place: told.append(place), raising=False)
    monkeypatch.setattr("builtins._importing_", lambda step: told.append((step,)), raising=False)
    names: dict[str, Any] = {}
    exec(compile(telling(source, "a/b.py"), "b.py", "exec"), names)
    assert told == [(1,), (-1,)]
    assert names["Thing"]().decorated == 1
    assert told[2:] == [("a/b.py", 7), ("a/b.py", 3)]
    assert names["plain"].__doc__ == "What it gives."


def test_traced_sources_run_without_a_tracer(tmp_path: Path) -> None:
    """A process that imports the traced sources without a tracer runs all of them."""
    (tmp_path / "p").mkdir()
    for name, source in (("__init__.py", '"""A package."""'), ("a.py", "def f():\n    return 3")):
        (tmp_path / "p" / name).write_text(telling(source, name), encoding="utf-8")
    words = [sys.executable, "-c", "import p.a; print(p.a.f(), [name for name in vars(p) if name[0] != '_'])"]
    said = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert said.stdout == "3 ['a']\n", said.stderr


def test_mutant_is_judged_by_tests_that_enter_it() -> None:
    """Tests that enter the mutant's function or start a process judge it; all tests judge code that runs on import."""
    enters, other = Judge("a", frozenset({("f.py", 5)}), 0.1), Judge("b", frozenset(), 0.1)
    process = Judge("c", None, 0.1)
    of = FileOfTests((enters, other, process), frozenset({("f.py", 40)}))
    assert of.judges("f.py", range(4, 9)) == [enters, process]
    assert of.judges("f.py", range(10, 20)) == [process]
    assert of.judges("f.py", range(40, 50)) == of.judges("f.py", range(0)) == [enters, other, process]


def test_mutants_invert_comparisons_and_change_numbers() -> None:
    """Comparisons are inverted, counts shift by one, operators change, numbers grow; real thresholds stay."""

    def of(text: str) -> list[str]:
        return [ast.unparse(node) for node in replacements(ast.parse(text, mode="eval").body)]

    assert of("a < b") == ["a >= b"]
    assert of("len(a) < 2") == ["len(a) >= 2", "len(a) <= 2"]
    assert of("a @ b") == []
    assert of("a * b") == ["a / b"]
    assert of("'a' + b") == []
    assert of("-a") == ["a"]
    assert of("0.5") == ["5.0"]
    assert of("3") == ["4"]
    assert of("a and b") == ["a or b"]


def test_run_keeps_the_reasons_for_surviving_mutants() -> None:
    """Reasons are found by the replacement, wherever it is; an equivalent mutant does not count as a fault."""
    known = next(each for run in kept_runs() for each in run["survived"] if each.get("why", "").startswith("equiv"))
    mutant = Mutant(known["file"], 1, known["text"], known["old"], known["new"], 9, range(0), "")
    other = mutant._replace(text="something else")
    run = run_of(["any"], 0, [Verdict(mutant, "survived"), Verdict(other, "survived"), Verdict(other, "killed")])
    assert [each.get("why") for each in run["survived"]] == [known["why"], None]
    assert rows(run)[-1][1:] == (3, 1, 1, "50.0 %", "", "", 1, "50.0 %")


def test_mutant_killed_by_another_folder_counts_for_all_tests() -> None:
    """It does not count for the tests of its own room; current tests include it."""
    mutants = [Mutant("a/b.py", 1, text, "1", "2", 0, range(0), "") for text in "xyz"]
    run = run_of(["a"], 0, [Verdict(each, "survived") for each in mutants])
    missed, elsewhere, added = run["survived"]
    missed["elsewhere"], elsewhere["elsewhere"], added["now"] = "survived", "killed", "killed"
    assert rows(run)[-1][1:] == (3, 0, 0, "0.0 %", 1, "33.3 %", 2, "66.7 %")
    assert [row[0] for row in survivors([run])] == ["a/b.py:1"]


def test_mutant_is_judged_by_the_tests_of_its_room() -> None:
    """The tests are those of the folder that mirrors the source folder, the file of the same name first."""
    tests = [str(path.relative_to(ROOT)) for path in room_tests("cell/format/plain.py")]
    assert tests[0] == "tests/cell/format/test_plain.py"
    assert {str(Path(each).parent) for each in tests} == {"tests/cell/format"}


def test_imputed_errors_reproduce_the_recording() -> None:
    """Stops and views with their imputed errors equal the recording, pixel by pixel."""
    made = simulate(Scenario(samples=12, robot_noise=(3e-4, 5e-4), state_robot_noise=False, state_pixel_noise=False), 3)
    of = reality(made.cell, made.recording)
    again = of.make_recording(of.impute(np.random.default_rng(0)))
    for sample, recorded in zip(again.samples, made.recording.samples, strict=True):
        (seen,), (was,) = sample.observations, recorded.observations
        np.testing.assert_array_equal(seen.ids, was.ids)
        np.testing.assert_allclose(seen.pixels, was.pixels, atol=1e-9)


def test_redrawn_errors_have_the_same_size() -> None:
    """The rms over twenty draws is 0.2 px to 5 % for 30 views, and 0.3 mm and 0.5 mrad to 25 % for 60 stops."""
    made = simulate(Scenario(samples=30, robot_noise=(3e-4, 5e-4), state_robot_noise=False, state_pixel_noise=False), 4)
    of = reality(made.cell, made.recording)
    draws = [of.resample(np.random.default_rng(seed)) for seed in range(20)]
    pixels = np.sqrt(np.mean([np.mean(draw.views[0] ** 2) for draw in draws]))
    assert abs(pixels - 0.2) < 0.01
    squares = np.mean([(draw.stops * of.problem.stops.sigma) ** 2 for draw in draws], axis=(0, 1))
    np.testing.assert_allclose(np.sqrt([squares[:3].mean(), squares[3:].mean()]), [3e-4, 5e-4], rtol=0.25)


def outcome(verdict: str, nees: float | None, *findings: str) -> Outcome:
    return Outcome(verdict, nees, 0.1, list(findings), 0, 1.0)


def test_cell_is_safe_inside_the_ellipsoid_or_if_named_first() -> None:
    """A good answer outside the ellipsoid is unsafe.

    So is a cell with another first finding; a cell without an answer is not inside.
    """
    cells = [
        outcome("good", 5.0),
        outcome("doubtful", 90.0, "base-moved", "poor-fit"),
        outcome("doubtful", 90.0, "poor-fit", "base-moved"),
        outcome("good", 90.0),
        outcome("refused", None, "too-few-samples"),
    ]
    told = dict(zip(HEAD, row("base-bumped", "5 mm", cells), strict=True))
    assert (told["cells"], told["good"], told["in 99.7 %"], told["in 99.7 % or named first"]) == (5, 2, 1, 2)
    assert told["first finding"] == "base-moved 1, poor-fit 1, too-few-samples 1"


@pytest.mark.parametrize("name", RESCUES)
def test_rescues_name_existing_functions(name: str) -> None:
    """Each name of a rescue exists in its module, so that a renamed function is not silently left active."""
    place, attribute = locate(RESCUES[name])
    assert callable(getattr(place, attribute))


def test_outcomes_are_kept_between_runs(tmp_path: Path) -> None:
    """Kept outcomes are read again in the order of their seeds, separate from those of other faults."""
    kept = Kept(tmp_path / "kept.jsonl")
    for seed in (0, 1, 10, 2):
        kept.keep(f"sag#{seed}", outcome("good", float(seed)))
    kept.keep("#0", outcome("good", 7.0))
    kept.keep("size:sag", {"size": 0.0123, "is_usual": False})
    again = Kept(tmp_path / "kept.jsonl")
    assert [each.nees for each in kept_outcomes(again, "sag")] == [0.0, 1.0, 2.0, 10.0]
    assert [each.nees for each in kept_outcomes(again, "")] == [7.0]
    assert size_text(again, "sag") == "0.0123 deg"
    assert (size_text(again, "backlash"), again.get("sag#3")) == ("", None)


def test_jacobian_of_general_solvers_is_that_of_the_residuals() -> None:
    """The Jacobian is correct away from the start, too."""
    task, step = make_task(4, 0), np.full(18, 1e-2)
    whole = Whole(task.problem, task.start)
    _, jacobian = whole.at_step(step)
    check_derivative(lambda d: whole.at_step(step + d)[0], jacobian, step=1e-3, tolerance=1e-7)


def test_speed_is_measured_for_all_targets() -> None:
    """The number of images is the same for each target."""
    assert len(speeds(1)["milliseconds"]) == 4


@pytest.mark.parametrize("kind", running_check.KINDS)
def test_fault_is_tested_with_all_samples(kind: str) -> None:
    """The test of a known fault uses the views linearised at the solution."""
    fault = running_check.draw_fault(kind, 1)
    assert running_check.show_fault(fault, len(fault.samples))[0]
