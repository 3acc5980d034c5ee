"""What the benchmarks tell: pages and figures made of their results."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from benchmarks import scale
from benchmarks.common import RESULTS
from benchmarks.figure import Panel, svg
from benchmarks.mutants import SOURCE, changed, mutants_of, room_tests
from benchmarks.peers.tables import brief
from benchmarks.real_errors import reality
from benchmarks.report import PAGE, page

from basecal.simulation import Scenario, simulate

ROOT = Path(__file__).parents[1]
SVG = "{http://www.w3.org/2000/svg}"


def test_page_is_made_of_the_results() -> None:
    """docs/benchmarks.md is what `python -m benchmarks.report` makes of benchmarks/results: no number is typed."""
    assert PAGE.read_text(encoding="utf-8") == page()


def test_scale_is_made_of_the_results() -> None:
    """docs/scale.md is what `python -m benchmarks.scale` makes of benchmarks/results."""
    assert scale.PAGE.read_text(encoding="utf-8") == scale.page()


def test_readme_takes_the_peers_from_the_results() -> None:
    """The README's table beside today's practice is made of benchmarks/results/peers.json."""
    rows = json.loads((RESULTS / "peers.json").read_text(encoding="utf-8"))["rows"]
    assert brief(rows) in (ROOT / "README.md").read_text(encoding="utf-8")


def test_figure_puts_points_where_they_are() -> None:
    """Decades are evenly spaced along both axes, and larger values stand further right and up."""
    panel = Panel("a < b", "x [m]", "y [s]", {"line": [(1, 10), (10, 100), (100, 1000)]})
    circles = list(ElementTree.fromstring(svg([panel])).iter(f"{SVG}circle"))
    (x0, y0), (x1, y1), (x2, y2) = ((float(c.attrib["cx"]), float(c.attrib["cy"])) for c in circles)
    assert abs(x2 - 2 * x1 + x0) <= 0.2
    assert abs(y2 - 2 * y1 + y0) <= 0.2
    assert x2 > x1 > x0
    assert y2 < y1 < y0


def test_mutants_change_one_expression() -> None:
    """Each mutant of a file is a file that parses and differs from the original, at the line it names."""
    path = SOURCE / "kinematics" / "inverse.py"
    original = ast.unparse(ast.parse(path.read_text(encoding="utf-8")))
    mutants = list(mutants_of(path))
    assert len(mutants) > 30
    for mutant in mutants:
        assert ast.unparse(ast.parse(mutant.source)) == mutant.source != original
        assert mutant.file == "kinematics/inverse.py"


def test_mutants_are_faults() -> None:
    """Comparisons turn round, counts shift by one, operators change, numbers grow; borders of real numbers stay."""

    def of(text: str) -> list[str]:
        return [ast.unparse(node) for node in changed(ast.parse(text, mode="eval").body)]

    assert of("a < b") == ["a >= b"]
    assert of("len(a) < 2") == ["len(a) >= 2", "len(a) <= 2"]
    assert of("a @ b") == []
    assert of("a * b") == ["a / b"]
    assert of("'a' + b") == []
    assert of("-a") == ["a"]
    assert of("0.5") == ["5.0"]
    assert of("3") == ["4"]
    assert of("a and b") == ["a or b"]


def test_mutants_are_judged_by_their_room() -> None:
    """By the tests of the folder that mirrors theirs, those under the file's name first."""
    tests = [str(path.relative_to(ROOT)) for path in room_tests("cell/format/plain.py")]
    assert tests[0] == "tests/cell/format/test_plain.py"
    assert {str(Path(each).parent) for each in tests} == {"tests/cell/format"}


def test_errors_of_a_recording_add_up_to_it() -> None:
    """Stops and views with the errors imputed to them are the recording again, pixel by pixel."""
    made = simulate(Scenario(samples=12, robot_noise=(3e-4, 5e-4), state_robot_noise=False, state_pixel_noise=False), 3)
    of = reality(made.cell, made.recording)
    again = of.drawn(of.imputed(np.random.default_rng(0)))
    for sample, recorded in zip(again.samples, made.recording.samples, strict=True):
        (seen,), (was,) = sample.observations, recorded.observations
        np.testing.assert_array_equal(seen.ids, was.ids)
        np.testing.assert_allclose(seen.pixels, was.pixels, atol=1e-9)


def test_errors_dealt_out_anew_are_as_large() -> None:
    """Rms over twenty draws: 0.2 px to a twentieth, of 30 views; 0.3 mm and 0.5 mrad to a quarter, of 60 stops."""
    made = simulate(Scenario(samples=30, robot_noise=(3e-4, 5e-4), state_robot_noise=False, state_pixel_noise=False), 4)
    of = reality(made.cell, made.recording)
    draws = [of.resampled(np.random.default_rng(seed)) for seed in range(20)]
    pixels = np.sqrt(np.mean([np.mean(draw.views[0] ** 2) for draw in draws]))
    assert abs(pixels - 0.2) < 0.01
    squares = np.mean([(draw.stops * of.problem.stops.sigma) ** 2 for draw in draws], axis=(0, 1))
    np.testing.assert_allclose(np.sqrt([squares[:3].mean(), squares[3:].mean()]), [3e-4, 5e-4], rtol=0.25)
