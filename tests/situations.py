"""Pages of reports in some 24 situations, to be looked at.

    python -m tests.situations FOLDER             a page each
    python -m tests.situations FOLDER --pictures  and pictures of it at three widths, light and dark, and as paper

Simulated cells are calibrated; what is found of them besides is put in, with the words of the check that finds it.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import FitDetails, fit_details
from basecal.cell import Calibration, Cell, Finding, Recording, Tolerance
from basecal.cell.calibration import Severity
from basecal.reporting.decision.checks import check_words
from basecal.reporting.page import page
from basecal.simulation.scenario import Scenario
from basecal.simulation.testbed import simulate

DOUBTS = (
    "outlier-samples", "poor-fit", "prior-contradicted", "inconsistent-folds", "overfit", "weak-direction",
    "better-optimum", "robot-model", "lens-model", "intrinsics",
)  # fmt: skip
REFUSALS = (
    "too-few-samples", "unobservable-direction", "not-converged", "prior-dominated", "identity-poses", "board-shape",
    "clock-offset", "reflection",
)  # fmt: skip
SIZES = ((1400, 900), (820, 1000), (420, 860))  # of windows [px]
SCHEMES = {"light": "1", "dark": "0"}

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


def picture(browser: str, path: Path) -> None:
    """Pictures of a page at each size and scheme, and as paper, beside it."""
    profile = f"--user-data-dir={path.parent / 'profile'}"
    flags = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", profile]
    for width, height in SIZES:
        for scheme, number in SCHEMES.items():
            to = f"--screenshot={path.with_name(f'{path.stem}_{width}_{scheme}.png')}"
            dark = f"--blink-settings=preferredColorScheme={number}"
            subprocess.run([*flags, to, dark, f"--window-size={width},{height}", path.as_uri()], capture_output=True)
    subprocess.run([*flags, f"--print-to-pdf={path.with_suffix('.pdf')}", path.as_uri()], capture_output=True)


def main() -> None:
    """Write the pages, and pictures if they are requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pictures", action="store_true")
    asked = parser.parse_args()
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    asked.folder.mkdir(parents=True, exist_ok=True)
    for name, (cell, recording, calibration, details) in situations():
        path = asked.folder.resolve() / f"{name}.html"
        path.write_text(page(cell, recording, calibration, details, title=name), encoding="utf-8")
        print(f"{path.stat().st_size / 1e3:6.0f} kB  {path}")
        if asked.pictures and browser is not None:
            picture(browser, path)


if __name__ == "__main__":
    main()
