"""The local page of a cell's runs: a run is chosen, samples are looked through, and left out by hand."""

from __future__ import annotations

import base64
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from basecal.accuracy.residuals.without_samples import without_samples
from basecal.bounded_file import read_bounded
from basecal.cell import Calibration, Cell, Recording
from basecal.errors import BasecalError
from basecal.reporting.live.serving import serving
from basecal.reporting.viewing.words import answer_words, sample_words
from basecal.vision.thumbnail import thumbnail

_WIDTH_PX = 960
_LARGEST_BYTES = 2**26  # 64 MB: pictures of fifty million pixels
_MOST_BOXES = 400  # samples that can be left out by hand


@dataclass(frozen=True, eq=False)
class Viewed:
    """A cell to look through.

    Attributes:
        cell: The cell.
        recording: Its samples, with what was found in their pictures.
        folder: Where its pictures are.
        runs: Names of its runs, the latest first.
        read: A run's calibration, by its name.
    """

    cell: Cell
    recording: Recording
    folder: Path
    runs: tuple[str, ...]
    read: Callable[[str], Calibration]


@dataclass(eq=False)
class _Choice:
    """What a visitor looks at."""

    run: str
    calibration: Calibration
    left_out: set[int] = field(default_factory=set)

    @property
    def state(self) -> tuple[Calibration, frozenset[int]]:
        """What is looked at now, as it stays."""
        return self.calibration, frozenset(self.left_out)


@contextmanager
def serve_view(view: Viewed, port: int = 0) -> Iterator[str]:
    """The address of the page while this lasts, with the token it asks for.

    Raises:
        MissingExtra: if NiceGUI is not installed.
        InputError: if the port is taken.
    """

    def build(ui: Any, extra: Any) -> None:
        """See `Build`."""
        _build(ui, extra, view)

    with serving(build, "runs", "the page of a cell's runs", port) as address:
        yield address


def _build(ui: Any, extra: Any, view: Viewed) -> None:
    """The page; `extra` runs what takes long in a thread of its own."""
    choice = _Choice(view.runs[0], view.read(view.runs[0]))
    numbers = [sample.sample for sample in view.recording.samples]

    async def renew() -> None:
        """Say what comes out of the latest choice: an answer to an earlier one may come after it."""
        asked = choice.state
        words = await extra(_answer, view, *asked)
        answer.text = words if asked == choice.state else answer.text

    async def look(place: float) -> None:
        """Show a sample."""
        number = numbers[int(place)]
        said.text = sample_words(number, choice.calibration.residuals.per_sample, choice.left_out)
        _show(pictures, await extra(_pictures, view, number))

    async def choose(name: str) -> None:
        """Take another run."""
        choice.run, choice.calibration = name, await extra(view.read, name)
        await renew()
        await look(slider.value)

    async def toggle(number: int, used: bool) -> None:
        """Leave a sample out, or take it again."""
        (choice.left_out.discard if used else choice.left_out.add)(number)
        await renew()

    with ui.column().style("max-width: 1100px; margin: auto; width: 100%"):
        name = view.folder.resolve().name
        ui.select(list(view.runs), value=choice.run, label=f"run of {name}", on_change=lambda e: choose(e.value))
        answer = ui.label().style("white-space: pre-line; font-size: 1.1rem; overflow-wrap: anywhere")
        ui.label("sample")
        slider = ui.slider(min=0, max=max(len(numbers) - 1, 1), value=0, on_change=lambda e: look(e.value))
        said = ui.label().style("white-space: pre-line; overflow-wrap: anywhere")
        with ui.row().style("width: 100%"):
            pictures = {name: ui.image().style("width: 100%; max-width: 520px") for name in view.cell.cameras}
        _add_boxes(ui, numbers[:_MOST_BOXES], toggle)
    ui.timer(0.1, lambda: choose(choice.run), once=True)


def _add_boxes(ui: Any, numbers: Sequence[int], toggle: Callable[[int, bool], Awaitable[None]]) -> None:
    """A box for each sample."""
    ui.label("samples that count")
    with ui.row().style("gap: 0 0.6rem"):
        for number in numbers:
            box = ui.checkbox(str(number), value=True)
            box.on_value_change(lambda e, number=number: toggle(number, e.value))


def _show(pictures: Mapping[str, Any], sources: Mapping[str, str]) -> None:
    """Pictures by camera, and no room for those that are not there."""
    for camera, picture in pictures.items():
        picture.set_visibility(camera in sources)
        if camera in sources:
            picture.set_source(sources[camera])


def _answer(view: Viewed, calibration: Calibration, excluded: frozenset[int]) -> str:
    try:
        found = without_samples(view.cell, view.recording, calibration, excluded)
    except BasecalError as error:
        return str(error)
    return answer_words(view.cell, calibration, found, excluded)


def _pictures(view: Viewed, number: int) -> Mapping[str, str]:
    """Pictures of a sample as the page takes them, by camera; those that cannot be read are left out."""
    (sample,) = (each for each in view.recording.samples if each.sample == number)
    found = {}
    for camera, path in sample.images.items():
        try:
            small = thumbnail(read_bounded(view.folder / path, _LARGEST_BYTES), None, _WIDTH_PX)
        except BasecalError:
            continue
        if small is not None:
            found[camera] = f"data:image/jpeg;base64,{base64.b64encode(small).decode()}"
    return found
