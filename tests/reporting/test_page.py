"""Tests of the HTML page: contents, valid markup, safety and size.

The page agrees with the text report and depends on no other file.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import re
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import FitDetails, ViewPoses, fit_details
from basecal.accuracy.residuals.point_residuals import PointResiduals, point_residuals
from basecal.accuracy.task.expected_error import ExpectedError
from basecal.cell import (
    BudgetEntry,
    Calibration,
    Cell,
    ErrorMap,
    Finding,
    Outlier,
    Recording,
    Residuals,
    SampleResidual,
    Tolerance,
)
from basecal.cell.files import latest_run
from basecal.cli import main
from basecal.estimation.settings import Settings
from basecal.geometry import SE3
from basecal.reporting.page import _fit, page
from basecal.reporting.statement.verdict import headline
from basecal.reporting.text import text_report
from basecal.simulation.scenario import LayoutName, ObservedKind, Scenario
from basecal.simulation.testbed import simulate

VOID = {"meta", "wbr", "input", "br", "hr", "img", "link"}
EMBEDDED = re.compile(r"data:image/jpeg;base64,[A-Za-z0-9+/]+=*")
HOSTILE = '</script><script>alert(1)</script><img src=x onerror="alert(2)">&\'"'


class Walker(HTMLParser):
    """Parser that collects mismatched tags, text, attributes, ids, and contents of scripts and styles."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.faults: list[str] = []
        self.words: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.ids: list[str] = []
        self.inside: dict[str, list[str]] = {"script": [], "style": []}
        self.feed(html)
        self.close()
        self.faults += self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        if len(set(names)) != len(names):
            self.faults.append(f"an attribute of {tag} is given twice")
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        self.ids += [value or "" for name, value in attrs if name == "id"]
        if tag not in VOID:
            self.open.append(tag)
            if tag in self.inside:
                self.inside[tag].append("")

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"{tag} is closed and not open")

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in self.inside:
            self.inside[self.open[-1]][-1] += data
        else:
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def calibrated_cell() -> tuple[Cell, Recording, Calibration]:
    """A calibrated cell with a prior, a free lens and noise of robots and pixels."""
    scenario = Scenario(samples=15, robot_noise=(1e-4, 2e-4), target_mount="prior", intrinsics="free")
    simulated = simulate(scenario, 4)
    calibration = calibrate(simulated.cell, simulated.recording)
    note = Finding("intrinsics", "warning", ("wrist",), "the lens moved by 12.5 px: take its calibration again.")
    doubtful = replace(calibration, verdict="doubtful", findings=(note,), inputs={"cell.yaml": "sha256:0123abcd"})
    return simulated.cell, simulated.recording, doubtful


@pytest.fixture(scope="module")
def html(calibrated_cell: tuple[Cell, Recording, Calibration]) -> str:
    cell, recording, calibration = calibrated_cell
    return page(cell, recording, calibration, fit_details(cell, recording, calibration), title="mycell")


def refused_cell() -> tuple[Cell, Recording, Calibration]:
    cell = simulate(Scenario(samples=2), 0).cell
    return cell, Recording(), calibrate(cell, Recording())


def numbers(text: str) -> set[str]:
    return set(re.findall(r"-?\d+\.\d+(?:e-?\d+)?", text))


def test_page_contains_text_report(calibrated_cell: tuple[Cell, Recording, Calibration], html: str) -> None:
    """Every number of the text report, its first sentence and its findings are on the page, written the same way."""
    text, shown = text_report(calibrated_cell[0], calibrated_cell[2]), Walker(html).text
    assert len(numbers(text)) > 60
    assert numbers(text) - numbers(shown) == set()
    first = headline(calibrated_cell[0], calibrated_cell[2])
    assert first.doubt
    assert all(part.lower() in shown.lower() for part in (first.word, first.sentence, first.doubt))
    for line in (
        *re.findall(r"(?:<origin|ros2 run).*", text),
        calibrated_cell[2].findings[0].message,
        "rms",
        "worst view",
    ):
        assert line in shown
    assert "sha256:0123abcd" in shown


def test_table_lists_only_the_worst_views(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """The table has the 400 worst of 410 views, in the order of their samples."""
    views = tuple(SampleResidual(k, "wrist", "board", 0.1 + (k * 7 % 410) / 1000) for k in range(410))
    many = replace(calibrated_cell[2], residuals=Residuals(per_sample=views))
    rows = _fit(calibrated_cell[0], calibrated_cell[1], many, FitDetails())["rows"]
    worst = sorted(range(410), key=lambda k: k * 7 % 410)[10:]
    assert [row[0] for row in rows] == [str(k) for k in sorted(worst)]


def test_refused_calibration_has_a_page() -> None:
    """The page of a refused calibration gives the reason first.

    The transforms that were not estimated follow, without plots.
    """
    cell, recording, calibration = refused_cell()
    walker = Walker(page(cell, recording, calibration))
    text = text_report(cell, calibration)
    assert walker.faults == []
    word, sentence = text.splitlines()[0].split(": ", 1)
    assert walker.text.index(word) < walker.text.index(sentence) < walker.text.index("Not estimated")
    assert all(name in walker.text for name in cell.requested_transforms)
    assert 'class="plot' not in page(cell, recording, calibration)


def test_page_lists_outliers_and_validation(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """The page has the cross-validation errors, and each excluded view or point with its reason, escaped."""
    cell, recording, calibration = calibrated_cell
    left_out = (Outlier(3, "wrist", "board", (4, 5), HOSTILE),)
    walker = Walker(page(cell, recording, replace(calibration, outliers=left_out)))
    assert walker.faults == []
    assert f"sample 3, board by wrist, points 4, 5: {HOSTILE}" in walker.text
    assert "cross-validation error (k-fold, 5 folds), rms: " in walker.text
    bare = Walker(page(cell, recording, replace(calibration, validation=None, outliers=()))).text
    assert "Cross-validation" not in bare
    assert "Outliers" not in bare


def test_refused_numbers_are_behind_a_warning(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """Snippets of a refused calibration with numbers are folded away. The findings precede the answer."""
    cell, recording, calibration = calibrated_cell
    shown = page(cell, recording, replace(calibration, verdict="refused"))
    assert shown.index("though the calibration is refused") < shown.index("static_transform_publisher")
    assert shown.index(">REFUSED<") < shown.index('class="card answer"')


@pytest.mark.parametrize(("met", "word", "colour"), [(True, "PASS", "good"), (False, "FAIL", "refused")])
def test_tolerance_verdict_is_in_the_banner(
    calibrated_cell: tuple[Cell, Recording, Calibration], met: bool, word: str, colour: str
) -> None:
    """PASS or FAIL has its colour in the banner, with no other verdict beside it."""
    cell, recording, calibration = calibrated_cell
    with_tolerance = replace(calibration, verdict="good", tolerance=Tolerance(1e-3, 0.5e-3 if met else 2e-3, met))
    html = page(cell, recording, with_tolerance)
    banner = html[html.index("<header") : html.index("</header>")]
    assert f'<header class="verdict {colour}">' in banner
    assert "GOOD" not in banner
    assert html.count(f">{word}<") == 1


def test_missed_tolerance_offers_plan_command(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """The first item is the command that plans more samples.

    The intervals of all positions beyond the tolerance are marked.
    """
    cell, recording, calibration = calibrated_cell
    settings = {**calibration.settings, "tolerance_m": 1e-4}
    missed = replace(calibration, verdict="good", settings=settings, tolerance=Tolerance(1e-4, 2e-3, False))
    html = page(cell, recording, missed, title="my cell")
    first = html[html.index('<ol class="findings">') :].split("</li>")[0]
    assert "<code>basecal plan &#39;my cell&#39; --tolerance 0.1mm -o plan.jsonl</code>" in first
    assert html.count('class="interval beyond"') == 3
    assert 'class="beyond"' in html
    met = page(cell, recording, replace(missed, tolerance=Tolerance(1e-2, 2e-3, True)))
    assert "basecal plan" not in met
    assert "beyond" not in met.replace("rect.beyond", "").replace(".interval.beyond", "")


def test_unknown_error_offers_no_plan(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """If a tolerance is missed because a transform is unknown, the page states this and offers no plan."""
    cell, recording, calibration = calibrated_cell
    settings = {**calibration.settings, "tolerance_m": 1e-4}
    html = page(cell, recording, replace(calibration, settings=settings, tolerance=Tolerance(1e-4, None, False)))
    first = html[html.index('<ol class="findings">') :].split("</li>")[0]
    assert "A requested transform is unknown, so that no error can be predicted." in first
    assert "above the tolerance" not in html
    assert "basecal plan" not in html


def test_passed_checks_are_listed(calibrated_cell: tuple[Cell, Recording, Calibration], html: str) -> None:
    """Checks without findings are counted and described; checks with findings are not among them."""
    passed = html[html.index("checks found nothing") :].split("</details>")[0]
    assert "<dt><code>overfit</code></dt><dd>prediction errors of held-out samples" in passed
    assert "<code>intrinsics</code>" not in passed
    assert "checks found nothing" not in page(*refused_cell())


def test_table_of_contents_omits_missing_sections(html: str) -> None:
    """The contents of a full page have more than six entries.

    The page of a refused calibration has no section of residuals and no script that draws a cell.
    """
    walker = Walker(html)
    entries = [value for tag, name, value in walker.attributes if (tag, name) == ("a", "href")]
    assert len(entries) > 6
    short = page(*refused_cell())
    assert "#residuals" not in short
    assert len(short) < 60_000


def test_html_is_well_formed(html: str) -> None:
    """All tags are closed in order, and no attribute or id occurs twice."""
    walker = Walker(html)
    assert walker.faults == []
    assert len(set(walker.ids)) == len(walker.ids)
    assert html.startswith("<!DOCTYPE html>")


def test_walker_detects_malformed_html() -> None:
    """The HTML walker detects a tag left open, a tag closed twice, and an attribute given twice."""
    for bad in ("<p><b>x</p>", "<p>x</p></p>", '<p a="1" a="2">x</p>'):
        assert Walker(bad).faults


def test_page_makes_no_requests(html: str) -> None:
    """No attribute or style refers to another file, and the content security policy forbids any request."""
    walker = Walker(html)
    fetching = {"src", "href", "srcset", "data", "action", "poster", "xlink:href", "style"}
    named = [each for each in walker.attributes if each[1] in fetching or each[1].startswith("on")]
    places = {f"#{each}" for each in walker.ids}
    others = [each for each in named if each[:2] != ("a", "href") or each[2] not in places]
    assert [each for each in others if each[:2] != ("image", "href") or not EMBEDDED.fullmatch(each[2])] == []
    assert all("url(" not in style and "@import" not in style for style in walker.inside["style"])
    assert "default-src 'none'" in policy(walker)
    assert "unsafe" not in policy(walker)
    assert set(re.findall(r"[a-z]+:", policy(walker))) == {"data:"}


def policy(walker: Walker) -> str:
    return next(value for tag, name, value in walker.attributes if tag == "meta" and "default-src" in value)


def test_policy_allows_only_own_scripts(html: str) -> None:
    """The policy has the hashes of the page's own scripts and its style, and no others."""
    walker = Walker(html)
    *scripts, data, packed = walker.inside["script"]
    assert data.startswith('{"arms"')
    own = [gzip.decompress(base64.b64decode(packed)).decode(), *scripts, *walker.inside["style"]]
    hashes = {f"sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}" for s in own}
    assert len(own) == 5
    assert set(re.findall(r"sha256-[^']+", policy(walker))) == hashes


def test_markup_in_names_is_escaped(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """Names and messages that look like HTML are shown as text and create no element."""
    cell, recording, calibration = calibrated_cell
    bad = replace(
        calibration,
        findings=(Finding(HOSTILE, "warning", (HOSTILE,), HOSTILE),),
        unobservable=(HOSTILE,),
        settings={HOSTILE: HOSTILE},
        inputs={HOSTILE: HOSTILE},
        residuals=Residuals(per_sample=(SampleResidual(0, HOSTILE, HOSTILE, 1.0),)),
    )
    camera = next(iter(cell.cameras.values()))
    renamed = replace(cell, cameras={HOSTILE: replace(camera, name=HOSTILE)})
    zero, one = np.zeros(1, int), np.ones((1, 2))
    seen = PointResiduals(HOSTILE, "board", zero, zero, one, one, np.ones(1, bool))
    views = ViewPoses(HOSTILE, HOSTILE, zero, SE3.exp(np.array([[0, 0, 1, 0, 0, 0]])))
    details = FitDetails((seen,), (views,), (ExpectedError(HOSTILE, 1e-3, np.zeros(3)),))
    walker = Walker(page(renamed, recording, bad, details, title=HOSTILE, notes=[HOSTILE]))
    assert walker.faults == []
    assert (
        len(walker.inside["script"]) == 5
    )  # scene data, its renderer, the unpacker, copying, and the page's own script
    assert "img" not in {tag for tag, _, _ in walker.attributes}
    assert walker.text.count("alert(2)") >= 12


def many(samples: int, points: int) -> Iterator[PointResiduals]:
    rng = np.random.default_rng(1)
    count = samples * points
    pixels, off = rng.uniform(0, 1280, (count, 2)), rng.normal(size=(count, 2))
    used = np.ones(count, dtype=bool)
    yield PointResiduals("wrist", "board", np.repeat(np.arange(samples), points), np.arange(count), pixels, off, used)


@pytest.mark.journey
def test_page_size_is_bounded(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """A page of 300 samples of 100 points is below 2 MB, and so is one of 20 times as many samples.

    The page states what it omits.
    """
    cell, recording, calibration = calibrated_cell
    for samples in (300, 6000):
        views = tuple(SampleResidual(k, "wrist", "board", 0.2 + 1e-5 * k, 1e-3, 1e-3) for k in range(samples))
        record = Recording(tuple(replace(recording.samples[k % 15], sample=k) for k in range(samples)))
        bigger = replace(calibration, residuals=replace(calibration.residuals, per_sample=views))
        html = page(cell, record, bigger, FitDetails(tuple(many(samples, 100))))
        assert len(html.encode()) < 2e6
        assert f"1500 of {samples * 100} points drawn" in html
    assert "the 600 largest of 6000 views" in html
    assert "401 of 6000 samples are shown" in html


def test_point_residuals_reproduce_stated_rms(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """Residuals of the points, recomputed from the calibration alone, have the stated rms within 0.5 %.

    The calibration does not contain the bends of mounts, which are estimated with it and change the residuals slightly.
    """
    cell, recording, calibration = calibrated_cell
    off = np.concatenate([each.off_px.ravel() for each in point_residuals(cell, recording, calibration)])
    assert calibration.residuals.rms_px == pytest.approx(float(np.sqrt(np.mean(off**2))), rel=5e-3)


KINDS: tuple[ObservedKind, ...] = ("led", "points", "pose", "points3d", "chessboard")
SEEN_BY_DUAL_ARMS = ("led", "points", "pose")


@pytest.mark.journey
@pytest.mark.parametrize(
    ("target", "layout"),
    [
        *((target, "dual" if target in SEEN_BY_DUAL_ARMS else "eye_in_hand") for target in KINDS),
        *(pytest.param(target, "chain", marks=pytest.mark.slow) for target in KINDS),
    ],
)
def test_every_target_kind_has_a_page(target: ObservedKind, layout: LayoutName) -> None:
    """The page is well formed and contains the numbers of the text report, for every kind of target and layout."""
    scenario = Scenario(samples=20 if layout == "chain" else 8, target=target, layout=layout, target_mount="fixed")
    simulated = simulate(scenario, 2)
    calibration = calibrate(simulated.cell, simulated.recording, Settings(robot_noise="stated"))
    details = fit_details(simulated.cell, simulated.recording, calibration)
    walker = Walker(page(simulated.cell, simulated.recording, calibration, details))
    assert walker.faults == []
    assert numbers(text_report(simulated.cell, calibration)) - numbers(walker.text) == set()


@pytest.mark.journey
def test_exact_fit_has_a_page() -> None:
    """Residuals of exactly zero, as without any noise, do not break any figure."""
    simulated = simulate(Scenario(samples=8, pixel_px=0.0), 1)
    calibration = calibrate(simulated.cell, simulated.recording)
    details = fit_details(simulated.cell, simulated.recording, calibration)
    zero = tuple(replace(each, off_px=np.zeros_like(each.off_px)) for each in details.points)
    assert Walker(page(simulated.cell, simulated.recording, calibration, replace(details, points=zero))).faults == []


@pytest.mark.journey
def test_images_are_embedded(tmp_path: Path) -> None:
    """Recorded images are embedded in the page as data, and the page still makes no requests."""
    assert main(["simulate", str(tmp_path / "cell"), "--images", "--samples", "5"]) == 0
    main(["calibrate", str(tmp_path / "cell")])
    run = latest_run(tmp_path / "cell")
    assert run is not None
    html = (run / "report.html").read_text(encoding="utf-8")
    walker = Walker(html)
    assert len([value for tag, name, value in walker.attributes if (tag, name) == ("image", "href")]) == 5
    assert walker.faults == []
    assert len(html.encode()) < 3e6
    test_page_makes_no_requests(html)


def test_backticks_in_messages_become_code(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """Text between backticks in a message is shown as code; an unpaired backtick has no effect. Both are escaped."""
    cell, recording, calibration = calibrated_cell
    findings = tuple(
        Finding("robot-model", "warning", (), message) for message in ("write `a: <b>` there", "a ` alone <i>")
    )
    html = page(cell, recording, replace(calibration, findings=findings))
    assert "write <code>a: &lt;b&gt;</code> there" in html
    assert "a ` alone &lt;i&gt;" in html


def test_task_shows_outlook_for_more_samples(calibrated_cell: tuple[Cell, Recording, Calibration]) -> None:
    """The page shows the error for each number of samples and the command that plans them.

    It has all sentences about the task.
    """
    cell, recording, calibration = calibrated_cell
    at_task = replace(
        calibration,
        settings={**calibration.settings, "task_point": [0.5, 0.1, 0.3]},
        budget=(BudgetEntry("views of wrist", 1e-4, 1.0, 5e-5),),
        error_map=ErrorMap(np.zeros((1, 3)), np.array([4e-4]), np.array([1e-3])),
    )
    html = page(cell, recording, at_task, outlook=[(0, 3e-4), (10, 1.234e-4)])
    assert f">samples {10 + len(recording.samples)}: 0.12 mm<" in html
    assert "10 more samples would leave 0.12 mm (95 %)." in html
    assert "--samples 10 --task-point 0.5 0.1 0.3 -o plan.jsonl" in html
    assert "over the workspace 95 % of errors" in html
    assert "<td>0.10</td><td>100.0</td><td>0.050</td>" in html  # the budget, in two digits
    assert "more: " not in page(cell, recording, at_task)
