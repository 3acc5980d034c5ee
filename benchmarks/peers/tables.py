"""Tables of errors and speeds, and their requirements."""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

from benchmarks.common import table
from benchmarks.peers.by_opencv import METHODS
from benchmarks.peers.ours import ESTIMATED, PIXELS, POSES, UNSTATED
from benchmarks.peers.trial import SCIPY

Row = dict[str, Any]
TIMES = 3.0
OURS = (PIXELS, POSES, PIXELS + UNSTATED, POSES + UNSTATED)
_DEFAULT = "TSAI"
_METRE_MM = 1e3
_MEASURES = {"rms_mm": "mm", "rms_mrad": "mrad"}
_TITLES = {
    "halves": "The base of two arms, in halves",
    "hand-eye": "The camera's mount on one arm",
    "both": "The base of two arms, both moving",
}


class MethodResult(NamedTuple):
    """A method's name and statistics."""

    name: str
    found: dict[str, Any]


def opencv(row: Row, method: str | None = None, measure: str = "rms_mm") -> MethodResult | None:
    """The best in hindsight of OpenCV's results, or of one method's two chains; None if there is none."""
    results = [
        MethodResult(name, found) for name, found in row["methods"].items() if name.startswith(f"OpenCV {method or ''}")
    ]
    return min(results, key=lambda each: float(each.found[measure]), default=None)


def times(row: Row, method: str | None = None, measure: str = "rms_mm") -> float | None:
    """Error of OpenCV's best, or of one method, over ours from pixels."""
    theirs = opencv(row, method, measure)
    return None if theirs is None else float(theirs.found[measure] / row["methods"][PIXELS][measure])


def missed_goals(rows: list[Row]) -> list[str]:
    """Missed goals in words: ours smallest in every row, and `TIMES` better from pixels than OpenCV's best."""
    return [words for row in rows for words in (*_larger_errors(row), *_small_lead(row))]


def _nearest_peer(row: Row, measure: str) -> str:
    peers: list[str] = [name for name in row["methods"] if not name.startswith("basecal")]
    return min(peers, key=lambda name: float(row["methods"][name][measure]))


def _smallest(row: Row, mine: str, measure: str) -> bool:
    methods = row["methods"]
    return bool(methods[mine][measure] < methods[_nearest_peer(row, measure)][measure])


def _larger_errors(row: Row) -> list[str]:
    out = []
    for mine, (measure, unit) in product(OURS, _MEASURES.items()):
        if not _smallest(row, mine, measure):
            peer = _nearest_peer(row, measure)
            own, other = row["methods"][mine][measure], row["methods"][peer][measure]
            out.append(f"{_row_name(row)}: {mine} {own:.3g} {unit}, {peer} {other:.3g}")
    return out


def _small_lead(row: Row) -> list[str]:
    ratio = times(row)
    return (
        [] if ratio is None or ratio >= TIMES else [f"{_row_name(row)}: OpenCV's best only {ratio:.2f} times ours [mm]"]
    )


def claims(rows: list[Row]) -> str:
    """The table of requirements, with the number of rows in which each holds."""
    lines: list[tuple[str, str]] = []
    for mine, (measure, unit) in product(OURS, _MEASURES.items()):
        count = sum(_smallest(row, mine, measure) for row in rows)
        lines.append((f"{mine}: less than every peer's [{unit}]", f"{count} of {len(rows)}"))
    with_opencv = [row for row in rows if opencv(row) is not None]
    possible = [row for row in with_opencv if _possible(row) >= TIMES]
    for label, method, counted in (
        ("the default of OpenCV's", _DEFAULT, with_opencv),
        ("the best of OpenCV's", None, with_opencv),
        (f"the best of OpenCV's, where best / predicted is {TIMES:g} or more", None, possible),
    ):
        count = sum((times(row, method) or 0.0) >= TIMES for row in counted)
        lines.append((f"{label}: at least {TIMES:g} times ours from pixels [mm]", f"{count} of {len(counted)}"))
    return table(("required", "holds in rows"), lines)


def _possible(row: Row) -> float:
    best = opencv(row)
    assert best is not None
    return float(best.found["rms_mm"] / row["predicted"]["rms_mm"])


def _row_name(row: Row) -> str:
    return f"{row['design']}, {', '.join(_conditions(row))}"


def _conditions(row: Row) -> tuple[str, str, str]:
    mm, mrad = row["robot_mm_mrad"]
    return str(row["samples"]), f"{row['pixel_px']:g} px", f"{mm:.1g} mm, {mrad:.1g} mrad" if mm else "none"


def _lengths_and_angles(found: dict[str, Any]) -> str:
    failed = f" ({found['failed']} failed)" if found.get("failed") else ""
    mm = f"{found['rms_mm']:.2f}" if found["rms_mm"] < _METRE_MM else f"{found['rms_mm'] / _METRE_MM:.0f} m"
    return f"{mm} / {found['rms_mrad']:.2f}{failed}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"


_CONDITIONS = ("samples", "pixels", "robots' noise")


def errors(rows: list[Row]) -> str:
    """Errors of all methods; ours is given the sigmas."""
    methods = METHODS if opencv(rows[0]) else ()
    ratios = ("default / ours", "best / ours", "best / ours, medians", "best / predicted") if methods else ()
    head = (*_CONDITIONS, *methods, "SciPy, poses", "ours, poses", "ours, pixels", "predicted", *ratios)
    return table(head, (_error_row(row, methods) for row in rows))


def _error_row(row: Row, methods: tuple[str, ...]) -> tuple[str, ...]:
    theirs = [opencv(row, method) for method in methods]
    mine = [_lengths_and_angles(row["methods"][name]) for name in (SCIPY, POSES, PIXELS)]
    cells = (
        *_conditions(row),
        *(_lengths_and_angles(each.found) for each in theirs if each),
        *mine,
        _lengths_and_angles(row["predicted"]),
    )
    if not methods:
        return cells
    ratios = times(row, _DEFAULT), times(row), times(row, measure="median_mm"), _possible(row)
    return (*cells, *map(_number, ratios))


def unstated_errors(rows: list[Row]) -> str:
    """Errors with no sigma stated."""
    head = (*_CONDITIONS, "OpenCV's best", "SciPy, poses", "ours, poses", "ours, pixels", "ours, pixels" + ESTIMATED)
    return table(head, map(_unstated_row, rows))


def _unstated_row(row: Row) -> tuple[str, ...]:
    best = opencv(row)
    mine = [_lengths_and_angles(row["methods"][name]) for name in (SCIPY, POSES + UNSTATED, PIXELS + UNSTATED)]
    estimated = row["methods"].get(PIXELS + ESTIMATED)
    last = "" if estimated is None else _lengths_and_angles(estimated)
    return (*_conditions(row), "" if best is None else _lengths_and_angles(best.found), *mine, last)


def speeds(rows: list[Row]) -> str:
    """Median times of one estimate from pixels on [ms], over the rows with the same number of samples."""
    groups = dict.fromkeys((row["design"], row["samples"]) for row in rows)
    by_group = [[row for row in rows if (row["design"], row["samples"]) == group] for group in groups]
    head = ("design", "samples", "solvePnP alone", *METHODS, "SciPy, poses", "ours, poses", "ours, pixels")
    return table(head, map(_speed_row, by_group))


def _speed_row(rows: list[Row]) -> tuple[str, ...]:
    pnp = _mean([row["pnp_ms"] for row in rows])
    own = _mean([row["methods"][PIXELS]["median_ms"] for row in rows])

    def time_text(names: list[str]) -> str:
        if not names:
            return ""
        ms = pnp + _mean([row["methods"][name]["median_ms"] for row in rows for name in names])
        return f"{ms:.1f} ({ms / own:.1f})"

    there = list(rows[0]["methods"])
    theirs = [time_text([name for name in there if name.startswith(f"OpenCV {method}")]) for method in METHODS]
    ours = time_text([SCIPY]), time_text([POSES]), f"{own:.1f} (1)"
    return (rows[0]["design"], str(rows[0]["samples"]), f"{pnp:.1f}", *theirs, *ours)


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


BRIEF_SAMPLES, BRIEF_PX = 30, 0.2


def brief(rows: list[Row]) -> str:
    """The table of the README: errors of the base's position of two arms in halves, by the robots' noise."""
    names = (SCIPY, POSES, PIXELS, PIXELS + ESTIMATED)
    lines = []
    for row in rows:
        if (row["design"], row["samples"], row["pixel_px"]) == ("halves", BRIEF_SAMPLES, BRIEF_PX):
            best = opencv(row)
            assert best is not None
            methods = [best.found, *(row["methods"][name] for name in names)]
            lines.append((_conditions(row)[2], *(f"{each['rms_mm']:.2f} mm" for each in methods)))
    head = ("OpenCV's best", "SciPy, poses", "ours, poses", "ours, pixels", "ours, pixels, noise not stated")
    return table(("robots' noise", *head), lines)


def text(rows: list[Row]) -> str:
    """All tables, in markdown."""
    parts = []
    for name, title in _TITLES.items():
        design_rows = [row for row in rows if row["design"] == name]
        if design_rows:
            parts += [f"### {title}", errors(design_rows), "No sigma stated:", unstated_errors(design_rows)]
    about = "Median times [ms] from pixels on; in parentheses, the ratio to ours from pixels."
    return "\n\n".join([claims(rows), *parts, "### Time of one estimate", about, speeds(rows)])
