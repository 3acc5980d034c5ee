"""A local page that shows a running capture, with a button that stops all arms."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from basecal.acquisition.taking import visible_targets
from basecal.acquisition.watching import Snapshot, Watch
from basecal.cell import Cell, Sample
from basecal.errors import BasecalError, count_text
from basecal.planning.sketch import Sketch, sketch_cell
from basecal.reporting.cell_view.scene import scene_data
from basecal.reporting.cell_view.stage import json_inside_html, stated_scene
from basecal.reporting.decision.outlook import error_curve
from basecal.reporting.decision.tiles import Tile, error_tile
from basecal.reporting.figures.thumbnails import image_drawing
from basecal.reporting.live.serving import Answer, serving
from basecal.reporting.statement.verdict import COLOURS, error_text
from basecal.reporting.svg import Figure
from basecal.reporting.templates.environment import fill_page, fill_part
from basecal.vision.detectors import find_target
from basecal.vision.image_file import png_bytes
from basecal.vision.thumbnail import thumbnail

STOP_REASON = "Stop was pressed on the page"

_REFRESH_S = 0.5  # between requests of the page for the state
_WIDTH_PX = 960
_SCRIPTS = ("templates/copies.js", "templates/fragments.js", "templates/live.js")


@contextmanager
def serve_page(watch: Watch, cell: Cell, stop: Callable[[str], None], port: int = 0) -> Iterator[str]:
    """A context that serves the page of a capture and yields its address with the token.

    Args:
        watch: State of the capture.
        cell: The cell that is captured.
        stop: Function that stops all arms and ends the capture with a reason.
        port: Port of the page; 0 selects a free one.

    Raises:
        InputError: if the port is in use.
    """
    live = LivePage(watch, cell)

    def stop_arms(query: Mapping[str, str]) -> Answer:
        """Stop all arms."""
        stop(STOP_REASON)
        return Answer("stopped", "text/plain")

    routes = {
        ("GET", "/"): lambda query: Answer(live.page()),
        ("GET", "/state"): lambda query: Answer(json.dumps(live.state()), "application/json"),
        ("GET", "/image"): lambda query: Answer(live.image(query.get("camera", ""))),
        ("POST", "/stop"): stop_arms,
    }
    with serving(routes, port) as address:
        try:
            yield address
        finally:
            if watch.snapshot.end is not None:
                time.sleep(2 * _REFRESH_S)  # so that the page shows the end


@dataclass(frozen=True, eq=False)
class LivePage:
    """The local page of a capture, from its watch and its cell."""

    watch: Watch
    cell: Cell

    @cached_property
    def _sketch(self) -> Sketch | None:
        """Sketch of the cell; None if too little is known to draw it."""
        with suppress(BasecalError):
            return sketch_cell(self.cell)
        return None

    def page(self) -> str:
        """The page in its current state; its script requests changes."""
        drawn = self._scene(self.watch.snapshot)
        return fill_page(
            "live.html",
            _SCRIPTS,
            is_served=True,
            **self._part_values(self.watch.snapshot),
            cameras=list(self.cell.cameras),
            scene_json=json_inside_html(drawn) if drawn else "",
        )

    def state(self) -> dict[str, Any]:
        """The changing state: a part of the page, the number of each image, and the arms' poses and goals."""
        snapshot = self.watch.snapshot
        drawn = self._scene(snapshot)
        return {
            "html": fill_part("live_state.html", **self._part_values(snapshot)),
            "images": {name: id(grey) for name, grey in snapshot.images},
            "arms": drawn["arms"] if drawn else [],
            "over": snapshot.end is not None,
        }

    def image(self, camera: str) -> str:
        """The last image of a camera with its detections; empty if there is none."""
        grey = dict(self.watch.snapshot.images).get(camera)
        small = None if grey is None else thumbnail(png_bytes(grey), None, _WIDTH_PX)
        if grey is None or small is None:
            return ""
        detected = [
            detection.pixels
            for target in visible_targets(self.cell, camera)
            if (detection := find_target(grey, target))
        ]
        pixels = np.concatenate(detected) if detected else np.zeros((0, 2))
        label = f"last image of {camera}, {count_text(len(pixels), 'point')} found"
        used = np.ones(len(pixels), dtype=bool)
        return image_drawing(label, small, (grey.shape[1], grey.shape[0]), pixels, 0 * pixels, used)

    def _part_values(self, snapshot: Snapshot) -> dict[str, Any]:
        """Template values of the changing parts."""
        end = snapshot.end
        word = end.word if end else "CAPTURING"
        return {
            "now": snapshot,
            "word": word,
            "colour": COLOURS.get(word, "refused") if end else "",
            "tiles": list(_tiles(snapshot)),
            "motions": list(self._motions(snapshot)),
            "progress": _progress_figure(snapshot),
        }

    def _motions(self, snapshot: Snapshot) -> Iterator[str]:
        """Text with the remaining distance of each arm to its goal."""
        states, goals = dict(snapshot.states), dict(snapshot.goals)
        if self._sketch is None:
            return
        for robot in states.keys() & goals.keys():
            with suppress(BasecalError):
                base_from_flange, base_from_goal = (
                    self._sketch.base_from_flange(robot, each[robot]) for each in (states, goals)
                )
                error = (base_from_flange.inverse() @ base_from_goal).log()
                left_m, left_rad = (float(np.linalg.norm(each)) for each in np.split(error, 2))
                yield f"{robot}: {1e3 * left_m:.1f} mm and {np.degrees(left_rad):.2f} deg to go"

    def _scene(self, snapshot: Snapshot) -> dict[str, Any]:
        """Scene of the arms at their poses and at their goals in the stated cell; empty if it cannot be drawn."""
        if self._sketch is None:
            return {}
        states = dict(snapshot.states)
        samples = [Sample(0, robots=states), Sample(1, robots={**states, **dict(snapshot.goals)})]
        return scene_data(stated_scene(self._sketch, samples))


def _tiles(snapshot: Snapshot) -> Iterator[Tile]:
    step, is_over, left_s = snapshot.step, snapshot.end is not None, snapshot.time_left_s
    if snapshot.errors and snapshot.tolerance_m is not None:
        yield error_tile(snapshot.errors[-1][1], snapshot.tolerance_m, is_over)
    if step is not None:
        if step.sigma is not None:
            yield Tile(
                error_text(*step.sigma).replace(" and ", ", "), f"1 sigma (3-D norm) of the base{step.sigma_note}"
            )
        yield Tile(f"{step.taken} of {step.planned}", "samples taken")
        yield Tile(f"{100 * step.coverage.share:.0f} %", "of the image covered")
    if left_s is not None and not is_over:
        yield Tile(f"{left_s / 60:.0f} min" if left_s > 90 else f"{left_s:.0f} s", "left, at the pace so far")


def _progress_figure(snapshot: Snapshot) -> Figure | None:
    """Curve of the expected error at the task, or of the base's sigma; None with fewer than two values."""
    if len(snapshot.errors) > 1:
        return error_curve("expected error at the task, 95 %", snapshot.errors, snapshot.tolerance_m)
    sigmas = [(sigma.samples, sigma.t_m) for sigma in snapshot.sigmas]
    return error_curve("sigma of the base", sigmas, None) if len(sigmas) > 1 else None
