"""Pages of reports in some 24 situations, to be looked at.

    python -m tests.situations FOLDER             a page each
    python -m tests.situations FOLDER --images  and images of it at three widths, light and dark, and as paper
    python -m tests.situations FOLDER --look      and what is wrong with them as a browser shows them

Simulated cells are calibrated; what is found of them besides is put in, with the words of the check that finds it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import FitDetails, fit_details
from basecal.cell import Calibration, Cell, Finding, Recording, Tolerance
from basecal.cell.calibration import Severity
from basecal.reporting.decision.tiles import check_words
from basecal.reporting.page import page
from basecal.simulation.scenario import Scenario
from basecal.simulation.testbed import simulate
from tests.shared.browser import browsing
from tests.shared.page_faults import SIZES, faults, shown_sizes

DOUBTS = (
    "outlier-samples", "poor-fit", "prior-contradicted", "inconsistent-folds", "overfit", "weak-direction",
    "better-optimum", "robot-model", "lens-model", "intrinsics",
)  # fmt: skip
REFUSALS = (
    "too-few-samples", "unobservable-direction", "not-converged", "prior-dominated", "identity-poses", "board-shape",
    "clock-offset", "reflection",
)  # fmt: skip

Made = tuple[Cell, Recording, Calibration, FitDetails]


def solved(scenario: Scenario, seed: int = 4) -> Made:
    """A simulated cell with its calibration."""
    made = simulate(scenario, seed)
    calibration = calibrate(made.cell, made.recording)
    return made.cell, made.recording, calibration, fit_details(made.cell, made.recording, calibration)


def found(code: str, severity: Severity) -> Finding:
    """A finding in the words of its check."""
    words = check_words()[code]
    return Finding(code, severity, ("wrist",), f"{words[:1].upper()}{words[1:]}", ("`basecal report CELL --verbose`",))


def situations() -> Iterator[tuple[str, Made]]:
    """Names and what is shown."""
    cell, recording, calibration, details = solved(Scenario(samples=15, robot_noise=(1e-4, 2e-4), intrinsics="free"))
    good = replace(calibration, verdict="good", findings=())
    yield "good", (cell, recording, good, details)
    for name, asked_m in (("pass", 1e-2), ("fail", 1e-4)):
        expected_m = max(each.length_m for each in details.errors)
        check = Tolerance(asked_m, expected_m, expected_m <= asked_m)
        told = replace(good, tolerance=check, settings={**good.settings, "tolerance_m": asked_m})
        yield name, (cell, recording, told, details)
    for code in DOUBTS:
        told = replace(good, verdict="doubtful", findings=(found(code, "warning"), found("same-stop", "info")))
        yield f"doubtful_{code}", (cell, recording, told, details)
    for code in REFUSALS:
        told = Calibration("refused", findings=(found(code, "error"),), settings=good.settings)
        yield f"refused_{code}", (cell, recording, told, FitDetails())
    yield "empty", (cell, Recording(), calibrate(cell, Recording()), FitDetails())
    yield "three_robots", solved(Scenario(samples=20, layout="chain", target="points"))
    yield "one_arm", solved(Scenario(samples=12, layout="eye_in_hand"))


def looked_at(paths: Sequence[Path], axe: Path | None, keeps_images: bool) -> Iterator[str]:
    """What is wrong with pages at each size and scheme; their images, and they as paper, are put beside them."""
    # A killed browser may write for some milliseconds more.
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile, browsing(Path(profile)) as tab:
        for path in paths:
            for name in shown_sizes(tab, path.as_uri()):
                yield from (f"{path.stem} {name}: {fault}" for fault in faults(tab, axe))
                if keeps_images:
                    tab.screenshot(path.with_name(f"{path.stem}_{name}.png"))
            if keeps_images:
                tab.print_pdf(path.with_suffix(".pdf"))


def main() -> None:
    """Write the pages, and look at them in a browser if it is requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--images", action="store_true", help="and their images, and as paper")
    parser.add_argument("--look", action="store_true", help="list text that is cut and errors of the console")
    parser.add_argument("--axe", type=Path, metavar="FILE", help="axe.min.js of axe-core, to list what it finds too")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, (cell, recording, calibration, details) in situations():
        paths.append(asked.folder.resolve() / f"{name}.html")
        paths[-1].write_text(page(cell, recording, calibration, details, title=name), encoding="utf-8")
        print(f"{paths[-1].stat().st_size / 1e3:6.0f} kB  {paths[-1]}")
    if asked.images or asked.look or asked.axe:
        found = list(looked_at(paths, asked.axe, asked.images))
        print(*found, f"{len(found)} faults at {len(SIZES)} sizes, light and dark", sep="\n")
        sys.exit(bool(found))


if __name__ == "__main__":
    main()
