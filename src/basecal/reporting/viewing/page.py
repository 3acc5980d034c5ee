"""The local page of a cell's runs, on which samples are shown and excluded by hand."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from basecal.accuracy.residuals.point_residuals import PointResiduals, point_residuals
from basecal.accuracy.residuals.without_samples import WithoutSamples, without_samples
from basecal.cell import Calibration, Cell, Recording, SampleResidual
from basecal.errors import BasecalError, count_text
from basecal.fields.digits import two_digits
from basecal.reporting.cell_view.sample_labels import view_words
from basecal.reporting.figures.bars import QUANTITIES, bar_figure
from basecal.reporting.figures.thumbnails import sample_pictures
from basecal.reporting.live.serving import Answer, serving
from basecal.reporting.statement.verdict import COLOURS, error_text, headline, tangent_text
from basecal.reporting.templates.environment import fill_page, fill_part

_MOST_BARS = 600
_MOST_RUNS = 8  # cached runs

Query = Mapping[str, str]


@dataclass(frozen=True, eq=False)
class ViewPage:
    """The page of a cell's runs; the server stores no selection.

    Attributes:
        cell: The cell.
        recording: The recording with detections.
        folder: The cell's folder.
        runs: Names of the runs, latest first.
        read: Function that reads a run's calibration by its name.
    """

    cell: Cell
    recording: Recording
    folder: Path
    runs: tuple[str, ...]
    read: Callable[[str], Calibration]

    def page(self) -> str:
        """The page; its script requests further parts."""
        return fill_page(
            "view.html",
            ("templates/fragments.js", "templates/view.js"),
            is_served=True,
            **self._answer_values({}),
            **self._sample_values({}),
            name=self.folder.resolve().name,
            runs=self.runs,
            numbers=[sample.sample for sample in self.recording.samples],
        )

    def answer(self, query: Query) -> str:
        """The run's verdict, with the result and the residuals without excluded samples."""
        return fill_part("view_parts.html", **self._answer_values(query))

    def _answer_values(self, query: Query) -> dict[str, Any]:
        run, excluded = self._run(query), _excluded_numbers(query)
        calibration = self._cached_read(run)
        first, views = headline(self.cell, calibration), list(calibration.residuals.per_sample)
        answer: dict[str, Any] = {"error": "", "rows": (), "fit": ""}
        try:
            result = without_samples(self.cell, self.recording, calibration, excluded)
        except BasecalError as fault:
            answer["error"] = str(fault)
        else:
            answer |= {"fit": fit_sentence(result), "rows": list(answer_rows(self.cell, calibration, result))}
            kept = (each for each in result.residuals.per_sample if each.sample not in excluded)
            views = sorted([*kept, *(each for each in views if each.sample in excluded)], key=lambda each: each.sample)
        left_out = [each for each in views if each.sample in excluded]
        figures = [bar_figure(views, quantity, _MOST_BARS, left_out) for quantity in QUANTITIES]
        some = f"without {count_text(len(excluded), 'sample')}"
        return {
            "run": run,
            "first": first,
            "colour": COLOURS[first.word],
            "count": f"{some if excluded else 'with all samples'}, 1 sigma",
            "figures": list(filter(None, figures)),
            **answer,
        }

    def sample(self, query: Query) -> str:
        """Images of a sample with its points and residuals."""
        return fill_part("view_sample.html", **self._sample_values(query))

    def _sample_values(self, query: Query) -> dict[str, Any]:
        run = self._run(query)
        calibration, numbers = self._cached_read(run), [sample.sample for sample in self.recording.samples]
        number = next(iter((*_numbers(query.get("number", "")), *numbers)), 0)
        lines = sample_words(number, calibration.residuals.per_sample, _excluded_numbers(query))
        drawn = sample_pictures(self.cell, self.recording, calibration, self._points(run), number)
        return {"lines": lines, "drawn": list(drawn)}

    def _run(self, query: Query) -> str:
        """The requested run, or the latest."""
        return query["run"] if query.get("run") in self.runs else self.runs[0]

    @cached_property
    def _cached_read(self) -> Callable[[str], Calibration]:
        return lru_cache(_MOST_RUNS)(self.read)

    @cached_property
    def _points(self) -> Callable[[str], tuple[PointResiduals, ...]]:
        """Function that computes the point residuals of a run by its name."""

        @lru_cache(_MOST_RUNS)
        def read(run: str) -> tuple[PointResiduals, ...]:
            """Point residuals of one run; empty if they cannot be computed."""
            with suppress(BasecalError):  # such as after a change of the recording
                return point_residuals(self.cell, self.recording, self._cached_read(run))
            return ()

        return read


@contextmanager
def serve_view(page: ViewPage, port: int = 0) -> Iterator[str]:
    """A context that serves the page and yields its address with the token.

    Raises:
        InputError: if the port is in use.
    """
    routes = {
        ("GET", "/"): lambda query: Answer(page.page()),
        ("GET", "/answer"): lambda query: Answer(page.answer(query)),
        ("GET", "/sample"): lambda query: Answer(page.sample(query)),
    }
    with serving(routes, port) as address:
        yield address


def _excluded_numbers(query: Query) -> frozenset[int]:
    return frozenset(_numbers(query.get("without", "")))


def _numbers(text: str) -> tuple[int, ...]:
    """Parse comma-separated numbers of samples; invalid parts are ignored."""
    return tuple(int(each) for each in text.split(",") if each.isascii() and each.isdigit() and len(each) < 16)


def sample_words(number: int, residuals: Sequence[SampleResidual], exclusions: Collection[int]) -> list[str]:
    """Lines about a sample: a heading, and the residuals of each view."""
    own = [view_words(each) for each in residuals if each.sample == number]
    return [f"sample {number}{', left out' if number in exclusions else ''}", *own]


def answer_rows(cell: Cell, calibration: Calibration, result: WithoutSamples) -> Iterator[tuple[str, str, str, str]]:
    """Name of each requested transform, its sigma in the run and without excluded samples, and its shift."""
    for name in cell.requested_transforms:
        run, after = calibration.transforms.get(name), result.transforms.get(name)
        before = "unknown" if run is None else error_text(*run.sigma_norms)
        if after is None:
            yield name, before, "unobservable in some direction", ""
            continue
        shift = ""
        if run is not None and after is not run:
            shift = tangent_text((run.mean.inverse() @ after.mean).log())
        yield name, before, error_text(*after.sigma_norms), shift


def fit_sentence(result: WithoutSamples) -> str:
    """Sentence with the residuals of the included samples."""
    loop, rms_px = result.residuals.loop_rms_m, result.residuals.rms_px
    parts = [] if rms_px is None else [f"reprojection error {two_digits(rms_px)} px rms"]
    parts += [] if loop is None else [f"pose consistency error {error_text(loop, None)} rms"]
    parts += [] if result.converged else ["no optimum was found"]
    return f"{'; '.join(parts)}." if parts else ""
