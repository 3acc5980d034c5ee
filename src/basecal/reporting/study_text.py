"""The simulations of the paper as plain text and as figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from basecal.reporting.figures.curves import HEIGHT, WIDTH, Band, curves
from basecal.reporting.svg import element

_SOLVER_NAMES = {"closed_form": "closed form", "maximum_likelihood": "maximum likelihood", "bound": "Cramer-Rao bound"}
_TOP, _LINE = 60, 20
_COLOURS = ("#c0392b", "#1f6fb2", "#444444", "#2e8b57")
_STYLE = (
    "svg{font:13px system-ui,sans-serif;background:#fff}.title{font-size:15px;font-weight:600}.rule{stroke:#e4e4e4}"
    ".tick{fill:#444}.median{fill:none;stroke:currentColor;stroke-width:2}.band{fill:none}g{fill:currentColor}"
    ".line-2 .median{stroke-dasharray:6 4}.line-3 .median{stroke-dasharray:2 4}"
) + "".join(f".line-{k}{{color:{colour}}}" for k, colour in enumerate(_COLOURS))


def paper_text(study: Mapping[str, Any]) -> str:
    """Comparison of the paper's tables with ours, the two orders of orthonormalisation, and the shift lengths."""
    paper = study["paper"]
    noiseless, table_3 = "noiseless", "table3_eye_base_from_hand_base"
    blocks = [
        *(_side_by_side(f"noiseless {key}", paper[noiseless][key], ours) for key, ours in study[noiseless].items()),
        *(_table_1(level, paper, study) for level in study["table1_camera_from_led"]),
        *(_table_2(level, paper, study) for level in study["table2_orthonormalised"]),
        *(
            _side_by_side(f"table 3, {level}, from table 2 by eq. (10)", paper[table_3][level], ours)
            for level, ours in study[table_3].items()
        ),
        list(_orders(study)),
        list(_lengths(study)),
        ["errors of the paper:", *(f"  - {slip}" for slip in paper["known_slips_of_the_paper"])],
    ]
    return "\n\n".join("\n".join(block) for block in blocks)


def shift_length_figures(study: Mapping[str, Any]) -> dict[str, str]:
    """Figures of the error over the length of the shifts, as SVG by file name."""
    pixel = study["settings"]["sigma_px"]
    figures = {}
    for unit, what in (("deg", "rotation"), ("mm", "translation")):
        lines = {
            name: [(row["shift_m"], row[f"{key}_{unit}"]) for row in study["shift_length"]]
            for key, name in _SOLVER_NAMES.items()
        }
        title = f"Error of {what} of one station, {pixel} px, one-sided shifts"
        figures[f"shift_length_{what}.svg"] = chart_file(
            title, "length of the shifts [m]", f"rms error [{unit}]", lines
        )
    return figures


def _row(values: list[float]) -> str:
    return " ".join(f"{v:9.4f}" for v in values)


def _side_by_side(title: str, theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> list[str]:
    rows = [f"  {_row(a)}   {_row(b)}" for a, b in zip(theirs["R"], ours["R"], strict=True)]
    return [f"{title}: the paper, ours", *rows, f"t {_row(theirs['t'])}   {_row(ours['t'])}"]


def _table_1(level: str, paper: Mapping[str, Any], study: Mapping[str, Any]) -> list[str]:
    ours, draws = study["table1_camera_from_led"][level], study["settings"]["draws"]
    quantile = ours["paper_quantile"]
    lines = _side_by_side(
        f"table 1, {level} noise (ours: mean of {draws} draws)", paper["table1_camera_from_led"][level], ours
    )
    spread = [f"  spread over draws of t: {_row(ours['t_sd'])}"]
    turn, shift = quantile["rotation"], quantile["translation"]
    nearer = f"  draws nearer the truth than the paper's: rotation {turn:.0%}, translation {shift:.0%}"
    return [*lines, *spread, nearer]


def _table_2(level: str, paper: Mapping[str, Any], study: Mapping[str, Any]) -> list[str]:
    pairs = zip(paper["table2_orthonormalised"][level], study["table2_orthonormalised"][level], strict=True)
    return [
        f"table 2, {level}, from the paper's table 1: the paper, ours",
        *(f"  {_row(a)}   {_row(b)}" for a, b in pairs),
    ]


def _orders(study: Mapping[str, Any]) -> Iterator[str]:
    yield "error of the base's translation, orthonormalised before eq. (10) and after; the rotations are equal"
    for level, order in study["orders_of_orthonormalising"].items():
        before, after = order["translation_error_before"], order["translation_error_after"]
        apart = order["rotations_differ_by"]
        yield f"  {level}: {before:.4f} before, {after:.4f} after; rotations differ by {apart:.0e}"


def _lengths(study: Mapping[str, Any]) -> Iterator[str]:
    yield "rms error of one station against the length of its shifts: closed form, maximum likelihood, bound"
    for row in study["shift_length"]:
        turn = " ".join(f"{row[f'{key}_deg']:8.4f}" for key in _SOLVER_NAMES)
        shift = " ".join(f"{row[f'{key}_mm']:9.3f}" for key in _SOLVER_NAMES)
        yield f"  {row['shift_m']:5.2f} m   {turn} deg   {shift} mm"


def chart_file(title: str, x_label: str, y_label: str, series: Mapping[str, Sequence[tuple[float, float]]]) -> str:
    """An SVG of lines over logarithmic axes, with a legend below.

    Args:
        title: Title of the chart.
        x_label: Name of the x axis with its unit.
        y_label: Name of the y axis with its unit.
        series: Points of at most four lines as (x, y), all positive, by name.
    """
    lines = {name: [Band(x, (y, y, y)) for x, y in points] for name, points in series.items()}
    chart = curves(title, x_label, y_label, lines, logarithmic=True)
    bottom = _TOP + HEIGHT
    names = [
        element("text", f"\u25cf {name}", class_=f"line-{k}", x=62, y=bottom + _LINE * (k + 1), fill="currentColor")
        for k, name in enumerate(series)
    ]
    parts = [
        element("style", Markup(_STYLE)),
        element("text", title, class_="title", x=10, y=24),
        element("text", f"{y_label} over {x_label}", x=10, y=46),
        element("svg", chart, y=_TOP, height=HEIGHT),
        *names,
    ]
    page = {"xmlns": "http://www.w3.org/2000/svg", "viewBox": f"0 0 {WIDTH:g} {bottom + _LINE * (len(series) + 1):g}"}
    return element("svg", *parts, **page, role="img", aria_label=title) + "\n"
