"""Reports in 24 situations, for a look at the pages.

    python -m tests.situations FOLDER             write a page for each
    python -m tests.situations FOLDER --images    and images at three widths, light and dark, and a PDF
    python -m tests.situations FOLDER --look      and list faults that a browser finds

Simulated cells are calibrated. Further findings are put into the result, with the words of their checks.
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

ReportInputs = tuple[Cell, Recording, Calibration, FitDetails]


def solve(scenario: Scenario, seed: int = 4) -> ReportInputs:
    """Calibrate a simulated cell."""
    simulated = simulate(scenario, seed)
    calibration = calibrate(simulated.cell, simulated.recording)
    details = fit_details(simulated.cell, simulated.recording, calibration)
    return simulated.cell, simulated.recording, calibration, details


def make_finding(code: str, severity: Severity) -> Finding:
    """Make a finding with the words of its check."""
    words = check_words()[code]
    return Finding(code, severity, ("wrist",), f"{words[:1].upper()}{words[1:]}", ("`basecal report CELL --verbose`",))


def situations() -> Iterator[tuple[str, ReportInputs]]:
    """Yield the name and the content of each report."""
    cell, recording, calibration, details = solve(Scenario(samples=15, robot_noise=(1e-4, 2e-4), intrinsics="free"))
    good = replace(calibration, verdict="good", findings=())
    yield "good", (cell, recording, good, details)
    for name, tolerance_m in (("pass", 1e-2), ("fail", 1e-4)):
        expected_m = max(each.length_m for each in details.errors)
        check = Tolerance(tolerance_m, expected_m, expected_m <= tolerance_m)
        changed = replace(good, tolerance=check, settings={**good.settings, "tolerance_m": tolerance_m})
        yield name, (cell, recording, changed, details)
    for code in DOUBTS:
        changed = replace(
            good, verdict="doubtful", findings=(make_finding(code, "warning"), make_finding("same-stop", "info"))
        )
        yield f"doubtful_{code}", (cell, recording, changed, details)
    for code in REFUSALS:
        changed = Calibration("refused", findings=(make_finding(code, "error"),), settings=good.settings)
        yield f"refused_{code}", (cell, recording, changed, FitDetails())
    yield "empty", (cell, Recording(), calibrate(cell, Recording()), FitDetails())
    yield "three_robots", solve(Scenario(samples=20, layout="chain", target="points"))
    yield "one_arm", solve(Scenario(samples=12, layout="eye_in_hand"))


def find_faults(paths: Sequence[Path], axe: Path | None, keeps_images: bool) -> Iterator[str]:
    """Yield faults of pages at each size and scheme; put images and PDFs beside the pages if `keeps_images`."""
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
    """Write the pages; look at them in a browser if it is requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--images", action="store_true", help="write images and PDFs of the pages too")
    parser.add_argument("--look", action="store_true", help="list text that is cut and errors of the console")
    parser.add_argument("--axe", type=Path, metavar="FILE", help="axe.min.js of axe-core, to list what it finds too")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, (cell, recording, calibration, details) in situations():
        paths.append(options.folder.resolve() / f"{name}.html")
        paths[-1].write_text(page(cell, recording, calibration, details, title=name), encoding="utf-8")
        print(f"{paths[-1].stat().st_size / 1e3:6.0f} kB  {paths[-1]}")
    if options.images or options.look or options.axe:
        all_faults = list(find_faults(paths, options.axe, options.images))
        print(*all_faults, f"{len(all_faults)} faults at {len(SIZES)} sizes, light and dark", sep="\n")
        sys.exit(bool(all_faults))


if __name__ == "__main__":
    main()
