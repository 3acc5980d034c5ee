"""README's table of figures and the sentences above it, from results/*.json: `python -m benchmarks.readme`."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from benchmarks.common import read, table

README = Path(__file__).parents[1] / "README.md"
HEAD = ("what", "measured", "command")
_TABLE = re.compile(r"(?<=\n\n)\| what \| measured \| command \|\n.*?\n(?=\n)", re.DOTALL)
_BULLETS = re.compile(r"(?<=\n\n)- \*\*True sigmas\.\*\*.*?\n(?=\n)", re.DOTALL)
Result = dict[str, Any]


class Figure(NamedTuple):
    """A row of the table: the benchmark, the measured quantity, and the formatter of its value from the results."""

    benchmark: str
    what: str
    value: Callable[[Result], str]


def _span(values: Iterable[float], digits: int) -> str:
    ordered = sorted(values)
    return f"{ordered[0]:.{digits}f} to {ordered[-1]:.{digits}f}"


def _percent(value: float, digits: int = 1) -> str:
    return f"{100 * value:.{digits}f} %"


def _find_row(rows: Iterable[Result], **fields: object) -> Result:
    """The only row with these values."""
    (match,) = (row for row in rows if all(row[key] == value for key, value in fields.items()))
    return match


def _real(recording: str, *what: str) -> Callable[[Result], str]:
    """Formatter of the figures of a recording, each with the unit in its name."""

    def value(result: Result) -> str:
        rows = [_find_row(result["figures"], recording=recording, what=each) for each in what]
        return ", ".join(
            f"{row['measured']:.{2 if row['measured'] < 9.95 else 1}f} {_unit(row['what'])}" for row in rows
        )

    return value


def _measured(value: float, unit: str) -> str:
    """With three digits at most."""
    return f"{value:.{2 if value < 9.995 else 1}f} {unit}"


def _unit(what: str) -> str:
    return what.rpartition("[")[2].rstrip("]")


def _few_images(result: Result) -> str:
    few = [row["within"] + row["refused"] for row in result["rows"] if 4 <= row["pictures"] <= 8]
    many = [row["mean"] for row in result["rows"] if row["pictures"] >= 10]
    return f"{min(few)} to {max(few)} of 40; {_span(many, 2)}"


def _semi_synthetic(result: Result) -> str:
    rows = [row for row in result["rows"] if row["kind"] in ("real", "student", "common") and row["draws"] >= 300]
    held = [100 * value for row in rows for value in row["held"].values()]
    return f"{_span(held, 1)} %"


def _certificate(result: Result) -> str:
    posed = [row for row in result["posed"] if row["spread_rad"] >= result["well_posed_rad"]]
    proven, cells = (sum(row[key] for row in posed) for key in ("proven", "cells"))
    claimed = sum(row["claimed"] for row in result["foes"])
    false = sum(len(row["false"]) for row in result["foes"])
    return f"{proven} of {cells}; {false} of {claimed:,}"


def _corners(result: Result) -> str:
    rows = [row for row in result["corners"] if row["kind"] == "charuco" and row["noise"] == 2]
    ours = [row["rms_px"] for row in rows if row["detector"] == "basecal"]
    best = [
        min(row["rms_px"] for row in rows if row["detector"] != "basecal" and row["blur_px"] == blur)
        for blur in sorted({row["blur_px"] for row in rows})
    ]
    return f"{_span(ours, 3)} px, {_span(best, 3)} px"


def _plan(result: Result) -> str:
    planned, few, many = (
        median(cell[key] for cell in result["cells"]) for key in ("planned_m", "random_m", "more_random_m")
    )
    return f"{planned / few:.2f}; {planned / many:.2f}"


def _verify(result: Result) -> str:
    every, from_four = result["rows"]["1 to 6"], result["rows"]["4 to 6"]
    return f"{every['alarms']}; {_percent(every['seen'])}; {_percent(from_four['named'])}"


def _outliers(result: Result) -> str:
    every = _find_row(result["cases"], outliers="all")
    return f"{_percent(every['found'], 2)}; {_percent(every['lost_samples'], 2)}; {every['ratio']:.2f}"


def _mutations(result: Result) -> str:
    every = _find_row(result["summary"], row="all")
    return f"{every['named']} of {every['named'] + every['missed']}; {every['passed']}"


def _clocks(result: Result) -> str:
    return f"{_percent(result['rows']['all']['within'])}; {result['rows']['all']['nees']:.2f}"


def _study(result: Result) -> str:
    return "; ".join(
        f"{_find_row(result['rows'], solver=solver)['rate']:,.0f}" for solver in ("maximum_likelihood", "closed_form")
    )


def _units(result: Result) -> str:
    return ", ".join(
        f"{_find_row(result['rows'], recording=name)['units']:.0f}" for name in ("rct_charuco", "ur5e_dual")
    )


_BOUNDS = ("", "shift_", "turn_")  # of all six components, of translations, of rotations
_BOARD, _LED = "UR5e, board, lens free", "UR5e, one corner as a light"
FIGURES = (
    Figure(
        "held_out",
        "seven real recordings of one arm, no noise stated: held-out error of the target over the best of OpenCV's"
        " seven methods in hindsight, mm and deg",
        lambda result: ", ".join(_span((row[key] for row in result["rows"]), 2) for key in ("ratio_mm", "ratio_deg")),
    ),
    Figure(
        "held_out",
        "the same: squared Mahalanobis distance between the mounts of two halves, drawn at random; split by place "
        "(median 5.3 if covariances are true)",
        lambda result: "; ".join(_span((row[key] for row in result["rows"]), 1) for key in ("random_m2", "blocked_m2")),
    ),
    Figure(
        "semi_synthetic",
        "ten real recordings' poses with their own errors drawn again about a known truth, 300 draws of each "
        "kind of error: within the 95 % ellipsoid",
        _semi_synthetic,
    ),
    Figure(
        "few_images",
        "4 to 8 rendered images of two arms, nothing stated, 40 draws each: within the 95 % ellipsoid, or "
        "refused; 10 to 24 images: mean squared error of the base in its own covariance, 1 is right",
        _few_images,
    ),
    Figure(
        "real",
        "two real UR5e, ten views, nothing known but the board: base against the published one, whose error is not"
        " given",
        _real(_BOARD, "base from the published one [mm]", "base from the published one [deg]"),
    ),
    Figure(
        "real",
        "the same, each corner alone as an LED: median of 24",
        _real(_LED, "base from the board's, median of 24 [mm]", "base from the board's, median of 24 [deg]"),
    ),
    Figure(
        "two_arms",
        "two NAO humanoids calibrated while each stood still: loops of 298 further poses, over the best of "
        "OpenCV's seven methods twice and concatenated, in hindsight; median of nine, mm and deg",
        lambda result: ", ".join(f"{median(row['ratios'][k] for row in result['rows']):.2f}" for k in (0, 1)),
    ),
    Figure(
        "real", "two NAO humanoids, 298 poses: loop, rms", _real("NAO, 298 poses", "loop, rms [mm]", "loop, rms [deg]")
    ),
    Figure(
        "starts",
        "simulated cells of 25 kinds: ends without a guess at the optimum that it finds from the truth",
        lambda result: f"{_percent(result['rate'], 2)} of {result['cells']:,}",
    ),
    Figure(
        "consistency",
        "54 designs, 2,000 cells each: mean squared error of the base in its own covariance, 1 is right",
        lambda result: _span((row["mean"] for row in result["scenarios"]), 3),
    ),
    Figure(
        "consistency",
        "the same: rms error of the base over the Cramer-Rao bound, at most",
        lambda result: f"{max(row[f'{key}over_bound'] for row in result['scenarios'] for key in _BOUNDS):.2f}",
    ),
    Figure(
        "robot_model",
        "joints off by 0.2 deg, two arms, 60 samples: held-out error of the target, ignored and estimated",
        lambda result: f"{1e3 * result['ignored_m']:.2f} mm, {1e3 * result['estimated_m']:.3f} mm",
    ),
    Figure(
        "wrong_answers",
        "errors that are no noise (lengths, clocks, steps, drift, sag, stated sigmas, rounding, orders): cells "
        "called good and wrong",
        lambda result: (
            f"{sum(row['good_and_wrong'] for row in result['rows'])} of {sum(row['cells'] for row in result['rows'])}"
        ),
    ),
    Figure(
        "mutations",
        "mix-ups of conventions on 4 real recordings and 50 simulated cells: named right, of those that move the "
        "answer; good all the same",
        _mutations,
    ),
    Figure(
        "clocks",
        "clocks off by up to 50 ms, two arms in motion, 500 recordings: 95 % intervals of the offset that hold it;"
        " mean squared error of the base in its own covariance",
        _clocks,
    ),
    Figure(
        "verify",
        "`verify` on simulated cells, one to six new samples: false alarms in 1,000; shifts of the length called "
        "detectable that are seen; what moved named first at three times that, from four samples on",
        _verify,
    ),
    Figure(
        "plan",
        "12 planned samples: median true error at the task over that of 12 random feasible ones; of 30, 30 "
        "simulated cells",
        _plan,
    ),
    Figure(
        "outliers",
        "gross outliers in 30 % of samples or 20 % of points, or in both at once, 310 cells: found; clean samples "
        "lost; rms error of the base over that from the clean data alone",
        _outliers,
    ),
    Figure(
        "certificate",
        "rotations proven optimal, pose noise up to 0.1 rad, arms that turn by 1 rad and more; claims undercut by "
        "a thousand random starts, of cells made to deceive",
        _certificate,
    ),
    Figure(
        "detectors",
        "rendered ChArUco corners, 2 grey levels of noise, blur 0.5 to 2 px: rms, beside OpenCV's best",
        _corners,
    ),
    Figure(
        "solve",
        "200 views of 36 points to the covariance, one thread: fastest of GTSAM, Ceres, SciPy on the same Jacobian"
        " over ours",
        lambda result: f"{result['times_faster_than_fastest_peer']:.1f}",
    ),
    Figure(
        "batch",
        "Monte Carlo of 30 samples of 24 points, with covariance, side by side: calibrations a second, one process"
        " and two",
        lambda result: "; ".join(f"{row['rate']:,.0f}" for row in result["rows"]),
    ),
    Figure(
        "study",
        "`basecal study`, draws and starts included, two processes: calibrations a second at pixel level (256 "
        "draws of a cell from one start); of the paper's closed form",
        _study,
    ),
    Figure(
        "calibrate",
        "`calibrate` whole on the shipped RCT and UR5e recordings, in units of 20 products of a 200x600 matrix "
        "with its transpose",
        _units,
    ),
    Figure(
        "scaling",
        "time against the number of samples, 1,000 to 100,000: slope",
        lambda result: _span((row["seconds_slope_from_1000"] for row in result["slopes"]), 2),
    ),
)


def figures() -> str:
    """The table, in Markdown."""
    rows = [(f.what, f.value(read(f.benchmark)), f"`python -m benchmarks.{f.benchmark}`") for f in FIGURES]
    return table(HEAD, rows) + "\n"


def _command_text(benchmark: str) -> str:
    return f" (`python -m benchmarks.{benchmark}`)."


def sentences() -> str:
    """The figures that the README gives in sentences, in Markdown."""
    values = {figure.benchmark: figure.value(read(figure.benchmark)) for figure in reversed(FIGURES)}
    named, passed = values["mutations"].split("; ")
    found, lost, _ = values["outliers"].split("; ")
    alarms, seen, _ = values["verify"].split("; ")
    starts, cells = values["starts"].split(" of ")
    lines = (
        f"**True sigmas.** Over 54 designs of 2,000 cells each, the mean squared error in its own covariance is "
        f"{values['consistency']}; 1 is right{_command_text('consistency')}",
        f"**No guess needed.** Of {cells} simulated cells of 25 kinds, {starts} end without a guess at the optimum "
        f"that the truth leads to{_command_text('starts')}",
        f"**Mix-ups are named.** Of mix-ups of conventions that move the answer, {named} are named right. Called good: "
        f"{passed}{_command_text('mutations')}",
        f"**Outliers are found.** Of gross outliers in up to 30 % of samples, {found} are found, and {lost} of clean "
        f"samples are lost{_command_text('outliers')}",
        f"**Motions are detected.** `verify` detects {seen} of shifts of the length that it calls detectable, with "
        f"{alarms} false alarms on 1,000 cells{_command_text('verify')}",
    )
    return "".join(f"- {line}\n" for line in lines)


def updated(text: str) -> str:
    """The text of the README with the latest figures."""
    with_table = _TABLE.sub(lambda _: figures(), text, count=1)
    return _BULLETS.sub(lambda _: sentences(), with_table, count=1)


if __name__ == "__main__":
    README.write_text(updated(README.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"written: {README.name}")
