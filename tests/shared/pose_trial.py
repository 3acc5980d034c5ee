"""Samples of cameras that hold images back: whether each image shows the pose beside it.

Arms, cameras, threads and clocks are real in time; a move takes 0.3 s. What an image shows says when it was exposed.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from basecal.acquisition import rig as rig_module
from basecal.acquisition.driver import DriverKind
from basecal.acquisition.rig import Rig, open_rig
from basecal.acquisition.stillness import Unfit
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell import Cell, CellCamera, CellTarget, Driver, PixelObservation, Robot, RobotState, Sample
from basecal.cell.cell import Intrinsics, Unknown
from basecal.cell.targets.charuco import charuco_target
from basecal.geometry import SE3, Camera
from basecal.planning.sketch import sketch_cell
from basecal.vision.detectors import find_target
from basecal.vision.draw.render import RenderSettings, render
from tests.shared.image_sources import PROCESSES, Arm, BufferingCapture, Path2, Scene, mjpeg_server, saving

FOCAL_PX, AWAY_M, REACH_M = 600.0, 0.5, 0.05
SIZE_PX = (640, 480)
SIGMAS = 3.0
STILLS = 6  # images of a standing arm, from which the sigma of a point is estimated
TEXTURES = (0.0, 25.0)  # around the board, in turn: of the second all of the image moves
PAUSES_S = (0.0, 0.0, 0.5)  # before a move, as while a plan is made


@dataclass(frozen=True)
class Source:
    """A camera that is tried.

    Attributes:
        kind: Of the driver.
        way: Of a folder, how files come; of a device, its backend; empty for a stream.
        held: Images that wait in buffers or in the server; of a stream that falls behind, the first and last.
        late: Images by which a device itself is late.
    """

    kind: str
    way: str = ""
    held: tuple[int, ...] = (0,)
    late: int = 0

    @property
    def name(self) -> str:
        """What it is, in words."""
        if self.kind == "folder":
            return {"at once": "folder, saved at once", "slow": "folder, saved 0.25 s late"}.get(
                self.way, "folder, late and out of order"
            )
        if self.way:
            stamps = "with times" if self.way == "V4L2" else "without times"
            late = f", {self.late} late" if self.late else ""
            return f"device {stamps}, {self.held[0]} buffers{late}"
        if len(self.held) > 1:
            return f"MJPEG over HTTP, {self.held[0]} and then {self.held[-1]} images behind"
        return f"MJPEG over HTTP, {self.held[0]} images behind"


def sources() -> list[Source]:
    """All that are tried: buffers of 1 to 10 images in the driver, in the camera, and in a server."""
    devices = [
        Source("opencv", way, (held,), late)
        for held in range(1, 11)
        for way, late in (("OTHER", 0), ("OTHER", held), ("V4L2", held))
    ]
    streams = [Source("opencv", held=(held,)) for held in (0, 1, 2, 5, 10)]
    falling = [Source("opencv", held=(2, 10))]
    return [*devices, *streams, *falling, *(Source("folder", way) for way in ("at once", "slow", "shuffled"))]


def _board(texture: float) -> tuple[Cell, np.ndarray[Any, Any]]:
    lens = Camera("pinhole", np.array([FOCAL_PX, FOCAL_PX, 319.5, 239.5]), SIZE_PX)
    shape = charuco_target((5, 4), 0.03, 0.022, "DICT_4X4_50")
    at = SE3(np.eye(3), np.array([0.0, 0.0, AWAY_M]) - shape.points.mean(0))
    image = render(lens, shape, at, RenderSettings(noise=0.0, texture=texture), 0)
    cell = Cell(
        "eye",
        {"eye": Robot("eye", driver=Driver("trial"))},
        cameras={
            "wrist": CellCamera(
                "wrist",
                "eye",
                Unknown("fixed", SE3.identity()),
                "pinhole",
                SIZE_PX,
                Intrinsics("fixed", lens, exact=True),
            )
        },
        targets={"board": CellTarget("board", "world", Unknown("fixed", at), shape)},
    )
    return cell, image


@contextmanager
def _opened(source: Source, cell: Cell, scene: Scene, folder: Path, seed: int) -> Iterator[tuple[Rig, Any]]:
    """The rig of a source, and how many images its server is behind."""
    behind = PROCESSES.Value("i", source.held[0])
    options: dict[str, Any] = {"source": 0}
    with ExitStack() as held:
        if source.kind == "folder":
            held.enter_context(saving(scene, folder / "images", source.way, seed))
            options = {"path": "images", "wait_s": 10.0}
        elif source.way:
            given = {"scene": scene, "buffers": source.held[0], "delay": source.late, "backend": source.way}
            before = cv2.VideoCapture
            cv2.VideoCapture = type("Device", (BufferingCapture,), given)
            held.callback(setattr, cv2, "VideoCapture", before)
        else:
            options = {"source": held.enter_context(mjpeg_server(scene, behind))}
        camera = replace(cell.cameras["wrist"], driver=Driver(source.kind, options))
        trial = DriverKind(lambda place: Arm(scene.path), needs_own_process=False)
        held.enter_context(_known("trial", trial))
        yield held.enter_context(open_rig(replace(cell, cameras={"wrist": camera}), folder)), behind


@contextmanager
def _known(name: str, kind: DriverKind) -> Iterator[None]:
    """A driver of this name, while this lasts."""
    before = rig_module.driver_kind
    rig_module.driver_kind = lambda wanted: kind if wanted == name else before(wanted)
    try:
        yield
    finally:
        rig_module.driver_kind = before


def sigma_px(cell: Cell, scene: Scene) -> float:
    """Sigma of a point found in images of an arm that stands, per axis [px]."""
    rng, errors = np.random.default_rng(0), []
    for _ in range(STILLS):
        scene.path.go(rng.uniform(-REACH_M, REACH_M, 2), 0.0)
        file = cv2.imencode(".jpg", scene.image(time.monotonic()))[1]
        found = find_target(cv2.imdecode(file, cv2.IMREAD_GRAYSCALE), cell.targets["board"].target)
        errors.append(found.pixels - _expected(cell, scene.path.at(time.monotonic()), found.ids))
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _expected(cell: Cell, at_m: np.ndarray[Any, Any], ids: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    target, lens = cell.targets["board"], cell.cameras["wrist"].intrinsics.camera
    points = target.mount.mean @ target.target.points[ids]
    return lens.project(points - [*at_m, 0.0])


def tried(source: Source, samples: int, seed: int) -> dict[str, Any]:
    """Samples of a source: those taken, those whose image is of another pose, and how far that was [px]."""
    cell, board = _board(TEXTURES[seed % len(TEXTURES)])
    path = Path2()
    scene = Scene(board, FOCAL_PX / AWAY_M, path, seed)
    sigma = sigma_px(cell, scene)
    rng, off, refused, reports = np.random.default_rng(seed), list[float](), list[str](), list[str]()
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory() as name, _opened(source, cell, scene, Path(name), seed) as (rig, behind):
        by = Taker(rig, sketch_cell(cell), Path(name), CaptureSettings(1.0, 10.0, 6.0))
        if hasattr(by, "report"):
            by = replace(by, report=reports.append)
        for number in range(samples):
            if number == samples // 2:
                behind.value = source.held[-1]
            time.sleep(rng.choice(PAUSES_S))
            place = rng.uniform(-REACH_M, REACH_M, 2)
            goal = RobotState(SE3(np.eye(3), np.array([*place, 0.0])))
            try:
                seen = by.take(Sample(number, robots={"eye": goal}), [])
            except Unfit as why:
                refused.append(str(why))
                continue
            (view,) = (each for each in seen.observations if isinstance(each, PixelObservation))
            off.append(float(np.linalg.norm((view.pixels - _expected(cell, place, view.ids)).mean(0))))
    wrong = [each for each in off if each > SIGMAS * sigma]
    return {
        "source": source.name,
        "samples": samples,
        "taken": len(off),
        "wrong": len(wrong),
        "most_px": max(off, default=0.0),
        "sigma_px": sigma,
        "refused": refused,
        "reports": [each for each in reports if "after exposure" in each][:3],
        "late_files": sum("not used" in each for each in reports),
        "seconds_a_sample": (time.monotonic() - began_s) / samples,
    }
