"""A local page that shows a capture while it goes on; NiceGUI serves it, from this machine to this machine."""

from __future__ import annotations

import base64
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from basecal.acquisition.driver import Grey
from basecal.acquisition.taking import visible_targets
from basecal.acquisition.watching import Watch
from basecal.cell import Cell, Target
from basecal.reporting.live.arms import ArmsView
from basecal.reporting.live.drawings import coverage_drawing, marks, sigma_drawing
from basecal.reporting.live.serving import serving
from basecal.reporting.statement.verdict import error_text
from basecal.vision.detectors import find
from basecal.vision.image_file import png_bytes
from basecal.vision.thumbnail import thumbnail

_REFRESH_S = 0.5  # between looks at the capture
_WIDTH_PX = 960


@contextmanager
def serve_page(watch: Watch, cell: Cell, port: int = 0) -> Iterator[str]:
    """The address of a page that shows a capture while this lasts, with the token it asks for.

    Raises:
        MissingExtra: if NiceGUI is not installed.
        InputError: if the port is taken.
    """

    def build(ui: Any, extra: Any) -> None:
        """See `Build`."""
        _build(ui, extra, watch, cell)

    with serving(build, "capture", "the page of a capture", port) as address:
        yield address
        if watch.snapshot.is_over:
            time.sleep(2 * _REFRESH_S)  # so that who looks sees the end


def _build(ui: Any, extra: Any, watch: Watch, cell: Cell) -> None:
    """The page, and what renews it; `extra` runs what takes long in a thread of its own."""
    with ui.column().style("max-width: 1100px; margin: auto; width: 100%"):
        doing = ui.label().style("font-size: 1.4rem; font-weight: 600")
        advice = ui.label().style("color: #b35c00; font-weight: 600; font-size: 1.1rem")
        doubts = ui.label().style("color: #b00020; font-weight: 600; white-space: pre-line")
        with ui.row().style("width: 100%"):
            pictures = {name: ui.interactive_image().style("width: 100%; max-width: 640px") for name in cell.cameras}
            with ui.column():
                counted = ui.label()
                covered = ui.html("", sanitize=False).style("width: 240px")
                sigma = ui.html("", sanitize=False).style("width: 360px")
            arms = ArmsView(ui, cell)
        said = ui.label().style("white-space: pre-line; opacity: 0.75")
    shown: dict[str, Grey] = {}

    async def renew() -> None:
        """Show what the capture says now."""
        glance = watch.snapshot
        step = glance.step
        doing.text, advice.text, said.text = glance.doing, glance.advice, "\n".join(reversed(glance.said))
        doubts.text = "\n".join(glance.doubts)
        if step is not None:
            share = 100 * step.coverage.share
            counted.text = f"{step.taken} taken, {step.planned} planned; {share:.0f} % of the picture"
            if step.sigma is not None:
                counted.text += f"; base known to {error_text(*step.sigma)} (1 sigma)"
            covered.content, sigma.content = coverage_drawing(step.coverage), sigma_drawing(glance.sigmas)
        arms.renew(dict(glance.states))
        for name, grey in glance.pictures:
            if shown.get(name) is not grey:
                shown[name] = grey
                pictures[name].set_source(await extra(_source, grey))
                pictures[name].content = await extra(_draw_crosses, grey, visible_targets(cell, name))

    ui.timer(_REFRESH_S, renew)


def _source(grey: Grey) -> str:
    small = thumbnail(png_bytes(grey), None, _WIDTH_PX)
    return "" if small is None else f"data:image/jpeg;base64,{base64.b64encode(small).decode()}"


def _draw_crosses(grey: Grey, targets: Sequence[Target]) -> str:
    """Crosses where targets are found, in the pixels of the small picture."""
    scale = min(1.0, _WIDTH_PX / grey.shape[1])
    seen = [found.pixels for target in targets if (found := find(grey, target)) is not None]
    return "".join(marks((pixels + 0.5) * scale - 0.5) for pixels in seen)
