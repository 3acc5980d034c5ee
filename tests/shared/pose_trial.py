"""Samples of cameras that delay images: whether each image shows the pose beside it.

Arms, cameras, threads and clocks run in real time; a move takes 0.3 s. An image shows the time of its exposure.
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
from tests.shared.image_sources import PROCESSES, Arm, ArmPath, BufferingCapture, Scene, mjpeg_server, saving

FOCAL_PX, AWAY_M, REACH_M = 600.0, 0.5, 0.05
SIZE_PX = (640, 480)
SIGMAS = 3.0
STILLS = 6  # images of a standing arm, from which the sigma of a point is estimated
TEXTURES = (0.0, 25.0)  # around the board, in turn: of the second all of the image moves
PAUSES_S = (0.0, 0.0, 0.5)  # before a move, as while a plan is made


@dataclass(frozen=True)
class Source:
    """A camera to be tested.

    Attributes:
        kind: Kind of the driver.
        way: For a folder, how files arrive; for a device, its backend; empty for a stream.
        held: Number of images that wait in buffers or in the server; for a growing delay, the first and the last.
        late: Images by which a device itself is late.
    """

    kind: str
    way: str = ""
    held: tuple[int, ...] = (0,)
    late: int = 0

    @property
    def name(self) -> str:
        """Description of the source."""
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
    """All sources: buffers of 1 to 10 images in the driver, in the camera, and in a server."""
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
    camera_from_board = SE3(np.eye(3), np.array([0.0, 0.0, AWAY_M]) - shape.points.mean(0))
    image = render(lens, shape, camera_from_board, RenderSettings(noise=0.0, texture=texture), 0)
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
        targets={"board": CellTarget("board", "world", Unknown("fixed", camera_from_board), shape)},
    )
    return cell, image


@contextmanager
def _open_source(source: Source, cell: Cell, scene: Scene, folder: Path, seed: int) -> Iterator[tuple[Rig, Any]]:
    """The rig of a source, and the number of images by which its server is late."""
    delay = PROCESSES.Value("i", source.held[0])
    options: dict[str, Any] = {"source": 0}
    with ExitStack() as held:
        if source.kind == "folder":
            held.enter_context(saving(scene, folder / "images", source.way, seed))
            options = {"path": "images", "wait_s": 10.0}
        elif source.way:
            attributes = {"scene": scene, "buffers": source.held[0], "delay": source.late, "backend": source.way}
            original = cv2.VideoCapture
            cv2.VideoCapture = type("Device", (BufferingCapture,), attributes)
            held.callback(setattr, cv2, "VideoCapture", original)
        else:
            options = {"source": held.enter_context(mjpeg_server(scene, delay))}
        camera = replace(cell.cameras["wrist"], driver=Driver(source.kind, options))
        kind = DriverKind(lambda place: Arm(scene.path), needs_own_process=False)
        held.enter_context(_with_driver("trial", kind))
        yield held.enter_context(open_rig(replace(cell, cameras={"wrist": camera}), folder)), delay


@contextmanager
def _with_driver(name: str, kind: DriverKind) -> Iterator[None]:
    """Register a driver of this name within the context."""
    original = rig_module.driver_kind
    rig_module.driver_kind = lambda requested: kind if requested == name else original(requested)
    try:
        yield
    finally:
        rig_module.driver_kind = original


def sigma_px(cell: Cell, scene: Scene) -> float:
    """Sigma of a point found in images of a still arm, per axis [px]."""
    rng, errors = np.random.default_rng(0), []
    for _ in range(STILLS):
        scene.path.go(rng.uniform(-REACH_M, REACH_M, 2), 0.0)
        file = cv2.imencode(".jpg", scene.image(time.monotonic()))[1]
        detection = find_target(cv2.imdecode(file, cv2.IMREAD_GRAYSCALE), cell.targets["board"].target)
        errors.append(detection.pixels - _expected_pixels(cell, scene.path.position(time.monotonic()), detection.ids))
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def _expected_pixels(cell: Cell, position_m: np.ndarray[Any, Any], ids: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    target, lens = cell.targets["board"], cell.cameras["wrist"].intrinsics.camera
    points = target.mount.mean @ target.target.points[ids]
    return lens.project(points - [*position_m, 0.0])


def trial(source: Source, samples: int, seed: int) -> dict[str, Any]:
    """Take samples of a source, and count those whose image is of another pose."""
    cell, board = _board(TEXTURES[seed % len(TEXTURES)])
    path = ArmPath()
    scene = Scene(board, FOCAL_PX / AWAY_M, path, seed)
    sigma = sigma_px(cell, scene)
    rng, distances_px, refused, reports = np.random.default_rng(seed), list[float](), list[str](), list[str]()
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory() as name, _open_source(source, cell, scene, Path(name), seed) as (rig, behind):
        settings = CaptureSettings(1.0, 10.0, 6.0)
        taker = Taker(rig, sketch_cell(cell), Path(name), settings, report=reports.append)
        for number in range(samples):
            if number == samples // 2:
                behind.value = source.held[-1]
            time.sleep(rng.choice(PAUSES_S))
            place = rng.uniform(-REACH_M, REACH_M, 2)
            goal = RobotState(SE3(np.eye(3), np.array([*place, 0.0])))
            try:
                sample = taker.take(Sample(number, robots={"eye": goal}), [])
            except Unfit as why:
                refused.append(str(why))
                continue
            (view,) = (each for each in sample.observations if isinstance(each, PixelObservation))
            distances_px.append(float(np.linalg.norm((view.pixels - _expected_pixels(cell, place, view.ids)).mean(0))))
    wrong = [each for each in distances_px if each > SIGMAS * sigma]
    return {
        "source": source.name,
        "samples": samples,
        "taken": len(distances_px),
        "wrong": len(wrong),
        "most_px": max(distances_px, default=0.0),
        "sigma_px": sigma,
        "refused": refused,
        "reports": [each for each in reports if "after exposure" in each][:3],
        "late_files": sum("not used" in each for each in reports),
        "seconds_a_sample": (time.monotonic() - began_s) / samples,
    }
