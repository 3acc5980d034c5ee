"""docs/benchmarks.md from results/*.json, so that no number stands there that no command gave."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks import consistency, outliers, real, scaling
from benchmarks.common import RESULTS, table

PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"

Result = dict[str, Any]

INTRODUCTION = """\
# Benchmarks

The numbers of each section were written by the command that it begins with (`make bench` runs them all;
`python -m benchmarks.report` makes this page of their results). Times are of one thread, on the machine named.
"""


def _real(result: Result) -> str:
    about = """\
What is asked of each recording, and what is measured, without a guess. Of boards nothing is known but their shape; with
one corner as a light the lens too, from the whole board. A loop is `(A X B).inverse() @ Y C Z`, B from the view alone.
The UR5e and RCT recordings ship in `examples/`."""
    return f"{about}\n\n{table(real.HEAD, map(real.row, result['figures']))}"


def _starts(result: Result) -> str:
    about = f"""\
{result["cells"]} simulated cells of 15 to 30 samples (0.2 px, orientations within 0.6 rad), each solved without a guess
and from the truth: do both descents end at one optimum (1e-6 m and rad)? Asked: {100 * result["target"]:.1f} %."""
    rows = []
    for of in result["kinds"]:
        rate = "" if of["rate"] is None else f"{100 * of['rate']:.2f} %"
        seeds = "" if of["kind"] == "all" else " ".join(str(seed) for _, seed in of["failing"])
        times = f"{of['median_ms']:.0f}", f"{of['slowest_ms']:.0f}"
        rows.append((of["kind"], of["same"], of["other"], of["unseen"], rate, *times, seeds))
    head = ("kind", "same", "another", "not observable", "rate", "median [ms]", "slowest [ms]", "failing seeds")
    return f"{about}\n\n{table(head, rows)}"


def _consistency(result: Result) -> str:
    count, (low, high) = result["cells"], result["band"]
    about = f"""\
Is the covariance true? Over the {count:,} simulated cells of a scenario, xi' C^-1 xi / 6 of the base must have mean
1: with {6 * count:,} degrees of freedom within [{low:.3f}, {high:.3f}], 3.5 standard errors to either side. Of all
cells 1 % lie beyond the 99 % point by right. All scenarios share their seeds, and so their scenes: their means are not
independent. The sigmas are stated: 0.2 px; where there is robot noise, 0.3 mm and 0.5 mrad for boards, 0.1 mm and
0.1 mrad for lights, per axis and stop. Priors: 5 mm and 0.05 rad. `benchmarks/consistency.py` has the reasons."""
    return f"{about}\n\n{table(consistency.HEAD, map(consistency.row, result['scenarios']))}"


def _solve(result: Result) -> str:
    ours = result["median_ms"]["basecal"]
    rows = []
    for name, ms in sorted(result["median_ms"].items(), key=lambda item: item[1]):
        agreement = result["agreement"].get(name)
        differs = f"{agreement['cost_differs']:.0e}" if agreement else ""
        rows.append((name, f"{ms:.2f}", f"{result['least_ms'][name]:.2f}", f"{ms / ours:.2f}", differs))
    head = ("solver", "median [ms]", "least [ms]", "over ours", "cost differs by")
    faster, start = result["times_faster_than_fastest_peer"], result["start_over_solve"]
    about = f"""\
From a start near the answer to the covariance: {result["samples"]} samples of 36 points, three free mounts, all solvers
in turn, {result["repeats"]} rounds. The fastest of the others, {result["fastest_peer"]}, takes {faster:.2f} times our
time; the closed-form start takes {start:.2f} times our solve."""
    return f"{about}\n\n{table(head, rows)}"


def _scaling(result: Result) -> str:
    about = """\
From a start near the answer to the covariance, by the number of samples of 4 points: time of the processor, and the
most memory held at once above the packed recording. A slope of 1 in these axes is linear; with few samples the calls
themselves count, which do not grow, so that slopes are given from 1,000 samples on as well."""
    slopes = table(scaling.SLOPE_HEAD, map(scaling.slope_row, result["slopes"]))
    figure = "![Time and peak memory over the number of samples](figures/scaling.svg)"
    return f"{about}\n\n{figure}\n\n{slopes}\n\n{table(scaling.HEAD, map(scaling.row, result['rows']))}"


def _detectors(result: Result) -> str:
    about = """\
Points found in rendered images of 1280 x 720 pixels beside plain OpenCV on the same images, by noise [grey levels] and
blur [px]. Error over sigma is 1 where the sigma that a detector states is true. Of lights the error is given over the
Cramer-Rao bound of the data used, one image or the pair with the light on and off."""
    corners = [
        (c["kind"], c["noise"], c["blur_px"], c["detector"], f"{c['rms_px']:.4f}", _ratio(c["ratio"]))
        for c in result["corners"]
    ]
    lights = [
        (
            f"{e['photons']:g}",
            e["spot_px"],
            "pair" if e["pair"] else "one",
            f"{e['rms_px']:.4f}",
            f"{e['rms_px'] / e['bound_px']:.3f}",
            _ratio(e["ratio"]),
            f"{e['blob_rms_px']:.4f}",
            f"{e['milliseconds']:.2f}",
            f"{e['blob_milliseconds']:.2f}",
        )
        for e in result["lights"]
    ]
    heads = (
        ("kind", "noise", "blur", "detector", "rms [px]", "error / sigma"),
        (
            "photons",
            "spot [px]",
            "images",
            "rms [px]",
            "rms / bound",
            "error / sigma",
            "blob rms [px]",
            "ms",
            "blob ms",
        ),
    )
    return f"{about}\n\n{table(heads[0], corners)}\n\n{table(heads[1], lights)}"


def _ratio(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _outliers(result: Result) -> str:
    about = f"""\
In each of {result["cells"]} simulated cells a case 30 % of the samples, or 20 % of the points, are gross outliers: at
least 8 sigma, whitened by the noise of pixels and robots at the true state. The oracle is the plain solver, given the
clean ones only; the ratio is that of the base's rms error over the cells, ours to the oracle's, the larger of
translation and rotation. Asked over all: at most {outliers.MOST_RATIO}; {100 * outliers.LEAST_FOUND:.0f} % found;
at most {100 * outliers.MOST_LOST:.0f} % of the clean samples and of the clean points lost."""
    return f"{about}\n\n{table(outliers.HEAD, map(outliers.row, result['cases']))}"


SECTIONS: dict[str, tuple[str, Callable[[Result], str]]] = {
    "real": ("Real recordings", _real),
    "starts": ("Starts without a guess", _starts),
    "consistency": ("Consistency", _consistency),
    "outliers": ("Outliers", _outliers),
    "solve": ("Speed beside other solvers", _solve),
    "scaling": ("Time and memory", _scaling),
    "detectors": ("Detectors beside OpenCV", _detectors),
}


def _machine(result: Result) -> str:
    on = result["machine"]
    return f"{on['cpu']}, {on['cores']} cores, Python {on['python']}, NumPy {on['numpy']}"


def _section(name: str) -> str:
    title, write = SECTIONS[name]
    path = RESULTS / f"{name}.json"
    command = f"    python -m benchmarks.{name}"
    if not path.exists():
        return f"## {title}\n\n{command}\n\nNot run yet.\n"
    result = json.loads(path.read_text(encoding="utf-8"))
    return f"## {title}\n\n{command}\n\n{write(result)}\n\nMeasured on: {_machine(result)}.\n"


def page() -> str:
    """The text of docs/benchmarks.md."""
    return "\n".join([INTRODUCTION, *map(_section, SECTIONS)])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"written: {PAGE.name}")
