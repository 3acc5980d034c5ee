"""Detectors beside plain OpenCV on the same rendered images: errors, whether sigmas are true, and speed."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import cv2
import numpy as np

from basecal.cell.target import Target
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import circles_target
from basecal.cell.targets.led import led_target
from basecal.geometry import SE3, Array, Camera
from basecal.vision.detection import Image
from basecal.vision.detectors import find_target
from basecal.vision.draw.led import LedSettings, led_levels, render_led
from basecal.vision.draw.render import RenderSettings, render
from basecal.vision.kinds import led
from basecal.vision.kinds.preprocessing import charuco_board, dictionary
from benchmarks.common import on_one_core, table, write

CAMERA = Camera("pinhole", np.array([766.5, 765.4, 640.9, 358.8, -0.35, 0.179, 0.0, 0.0, 0.0]), (1280, 720))
CONDITIONS = [(noise, blur) for noise in (1.0, 2.0, 4.0, 8.0) for blur in (0.5, 1.0, 2.0)]
GOAL_PX, GOAL_RATIO, GOAL_BOUND = 0.06, (0.8, 1.2), 1.1
PHOTONS, SPOTS = (3e3, 3e4, 3e5), (0.8, 1.5)

Places = dict[int, Array]
Plain = Callable[[Image], Places]
_TIGHT = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)


def _charuco(shape: Target) -> dict[str, Plain]:
    detector = cv2.aruco.CharucoDetector(charuco_board(shape))

    def plain(image: Image) -> Places:
        corners, ids, _, _ = detector.detectBoard(image)
        return {} if ids is None else dict(zip(ids.ravel().tolist(), corners.reshape(-1, 2), strict=True))

    return {"CharucoDetector": plain, "CharucoDetector, cornerSubPix": lambda image: _sub_pixel(image, plain(image))}


def _sub_pixel(image: Image, rough: Places) -> Places:
    if not rough:
        return rough
    start = np.array(list(rough.values()), dtype=np.float32)
    return dict(
        zip(rough, cv2.cornerSubPix(image, start.reshape(-1, 1, 2), (5, 5), (-1, -1), _TIGHT)[:, 0], strict=True)
    )


def _tags(shape: Target) -> dict[str, Plain]:
    def make_detector(method: int) -> Plain:
        settings = cv2.aruco.DetectorParameters()
        settings.cornerRefinementMethod = method
        detector = cv2.aruco.ArucoDetector(dictionary(shape.options["family"]), settings)

        def plain(image: Image) -> Places:
            quads, ids, _ = detector.detectMarkers(image)
            tags = [] if ids is None else ids.ravel().tolist()
            return {4 * tag + k: quad[0, k] for tag, quad in zip(tags, quads, strict=True) for k in range(4)}

        return plain

    methods = {"NONE": cv2.aruco.CORNER_REFINE_NONE, "SUBPIX": cv2.aruco.CORNER_REFINE_SUBPIX}
    return {f"ArucoDetector, {name}": make_detector(method) for name, method in methods.items()}


def _chessboard(shape: Target) -> dict[str, Plain]:
    size = tuple(shape.options["corners"])

    def plain(image: Image) -> Places:
        is_found, corners = cv2.findChessboardCornersSB(image, size)
        return dict(enumerate(corners.reshape(-1, 2))) if is_found else {}

    return {
        "findChessboardCornersSB": plain,
        "findChessboardCornersSB, cornerSubPix": lambda image: _sub_pixel(image, plain(image)),
    }


def _circles(shape: Target) -> dict[str, Plain]:
    def plain(image: Image) -> Places:
        is_found, centres = cv2.findCirclesGrid(
            image, tuple(shape.options["circles"]), flags=cv2.CALIB_CB_ASYMMETRIC_GRID
        )
        return dict(enumerate(centres.reshape(-1, 2))) if is_found else {}

    return {"findCirclesGrid": plain}


KINDS: dict[str, tuple[Target, Callable[[Target], dict[str, Plain]]]] = {
    "charuco": (charuco_target((5, 7), 0.04, 0.03, "DICT_4X4_50"), _charuco),
    "tags": (
        apriltag_target(
            "tag36h11", [(k, 0.06, SE3(np.eye(3), np.array([0.09 * (k % 3), 0.09 * (k // 3), 0]))) for k in range(9)]
        ),
        _tags,
    ),
    "chessboard": (chessboard_target((9, 6), 0.03), _chessboard),
    "circles": (circles_target((4, 11), 0.02, asymmetric=True), _circles),
}


class Row(NamedTuple):
    """One detector under one condition: points found, rms per coordinate [px], error over sigma, CPU s an image."""

    kind: str
    detector: str
    noise: float
    blur_px: float
    points: int
    rms_px: float
    ratio: float | None
    seconds: float


def _poses(shape: Target, count: int) -> list[SE3]:
    rng, out = np.random.default_rng(0), []
    middle = (shape.points.max(axis=0) + shape.points.min(axis=0)) / 2
    for _ in range(count):
        rotation = SE3.from_rpy([*rng.uniform(-0.8, 0.8, 2), rng.uniform(-3, 3)], np.zeros(3)).rotation
        depth = rng.uniform(0.4, 0.6)
        place = np.array([*rng.uniform(-0.12, 0.12, 2) * depth, depth])
        out.append(SE3(rotation.copy(), place - rotation @ middle))
    return out


def _ours(shape: Target) -> Callable[[Image], tuple[Places, Array | None]]:
    def run(image: Image) -> tuple[Places, Array | None]:
        detection = find_target(image, shape)
        if detection is None or detection.ids is None:
            return {}, None
        return dict(zip(detection.ids.tolist(), detection.pixels, strict=True)), detection.sigma_px

    return run


def _errors(places: Places, shape: Target, true: Array) -> Array:
    """Errors of the points, (n, 2).

    A grid may be counted from its other end, so that errors of chessboards and circles are to the nearest true point.
    """
    pixels = np.array(list(places.values())).reshape(-1, 2)
    if shape.kind in ("chessboard", "circles"):
        return pixels - true[np.linalg.norm(pixels[:, None] - true, axis=2).argmin(axis=1)]
    return pixels - true[shape.rows(np.array(list(places), dtype=np.int64))]


def corners(kind: str, noise: float, blur: float, count: int) -> list[Row]:
    """Rows of all detectors of a kind on the same images."""
    shape, plain = KINDS[kind]
    works: dict[str, Callable[[Image], tuple[Places, Array | None]]] = {"basecal": _ours(shape)}
    works |= {name: lambda image, run=run: (run(image), None) for name, run in plain(shape).items()}
    error: dict[str, list[Array]] = {name: [] for name in works}
    sigma: list[Array] = []
    spent = dict.fromkeys(works, 0.0)
    for seed, pose in enumerate(_poses(shape, count)):
        image = render(CAMERA, shape, pose, RenderSettings(noise=noise, blur_px=blur), seed)
        true = CAMERA.project(pose @ shape.points)
        for name, work in works.items():
            began = time.process_time()
            places, sigma_px = work(image)
            spent[name] += time.process_time() - began
            error[name].append(_errors(places, shape, true))
            if sigma_px is not None:
                sigma.append(sigma_px)
    return [_row(kind, name, noise, blur, each, sigma, spent[name] / count) for name, each in error.items()]


def _row(
    kind: str, name: str, noise: float, blur: float, error: list[Array], sigma: list[Array], seconds: float
) -> Row:
    errors = np.concatenate(error)
    ratio = _rms(errors / np.concatenate(sigma)[:, None]) if name == "basecal" else None
    return Row(kind, name, noise, blur, len(errors), _rms(errors), ratio, seconds)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


class Light(NamedTuple):
    """An LED under one condition: rms and bound per coordinate [px], and error over sigma.

    Beside them are the rms error of the blob detector, and times of both.
    """

    photons: float
    spot_px: float
    pair: bool
    rms_px: float
    bound_px: float
    ratio: float
    blob_rms_px: float
    milliseconds: float
    blob_milliseconds: float


def lights(photons: float, spot: float, pair: bool, count: int) -> Light:
    """Our detector of LEDs beside the blob detector of OpenCV with settings for bright spots."""
    settings = LedSettings(photons, spot, photons / (2 * np.pi * (spot**2 + 1 / 12) * 160))
    rng, blobs = np.random.default_rng(1), _blob_detector()
    error, ratio, blob_error = [], [], []
    spent: list[tuple[float, float]] = []
    for seed in range(count):
        place = np.array([*rng.uniform(-0.4, 0.4, 2) * (1, 0.5), 1.0])
        true = CAMERA.project(place)
        on = render_led(CAMERA, place, settings, 2 * seed)
        off = render_led(CAMERA, place, replace(settings, photons=0.0), 2 * seed + 1) if pair else None
        began = time.process_time()
        found = led.detect(on, led_target(), off)
        middle = time.process_time()
        spots = blobs.detect(on)
        spent.append((middle - began, time.process_time() - middle))
        if found is None or not spots:
            raise RuntimeError(f"a light of {photons:g} photons was not found")
        error.append(found.pixels[0] - true)
        ratio.append(error[-1] / found.sigma_px[0])
        blob_error.append(min((np.array(each.pt) - true for each in spots), key=lambda each: float(np.hypot(*each))))
    mine, theirs = (1e3 * float(each) for each in np.median(spent, axis=0))
    bound = _bound(settings, pair)
    return Light(
        photons,
        spot,
        pair,
        _rms(np.array(error)),
        bound,
        _rms(np.array(ratio)),
        _rms(np.array(blob_error)),
        mine,
        theirs,
    )


def _blob_detector() -> Any:
    params = cv2.SimpleBlobDetector.Params()
    params.filterByColor, params.blobColor = True, 255
    params.minThreshold, params.maxThreshold, params.thresholdStep = 20.0, 255.0, 10.0
    params.filterByArea, params.minArea, params.maxArea = True, 3.0, 5000.0
    params.filterByCircularity = params.filterByConvexity = params.filterByInertia = False
    return cv2.SimpleBlobDetector.create(params)


def _bound(settings: LedSettings, pair: bool) -> float:
    """Cramer-Rao bound per coordinate [px], the mean over subpixel positions.

    Width, brightness and background are unknown too.
    """
    rng = np.random.default_rng(2)
    small = Camera("pinhole", np.array([500.0, 500.0, 30.0, 30.0]), (61, 61))
    each = [_squared_bound(settings, pair, small, np.array([*rng.uniform(-1e-3, 1e-3, 2), 1.0])) for _ in range(40)]
    return float(np.sqrt(np.mean(each)))


def _squared_bound(settings: LedSettings, pair: bool, camera: Camera, place: Array) -> float:
    step = 1e-4
    shifts = [np.zeros(3), np.array([step, 0, 0]), np.array([0, step, 0])]
    levels, right, down = (led_levels(camera, place + shift, settings).ravel() for shift in shifts)
    wider = led_levels(camera, place, replace(settings, spot_px=settings.spot_px + step)).ravel()
    derivatives = [(right - levels) / (500 * step), (down - levels) / (500 * step), (wider - levels) / step]
    jacobian = np.stack([*derivatives, levels - settings.background, np.ones_like(levels)], axis=1)
    variance = settings.read_noise**2 + 1 / 12 + levels / settings.photons_per_level
    if pair:
        variance = variance + settings.read_noise**2 + 1 / 12 + settings.background / settings.photons_per_level
    covariance = np.linalg.inv((jacobian / variance[:, None]).T @ jacobian)
    return float(covariance[0, 0] + covariance[1, 1]) / 2


def corner_table(rows: Iterable[Row]) -> str:
    """The table of corners: for each kind, noise and blur a line for each detector."""
    head = ["target", "noise", "blur [px]", "detector", "points", "rms [px]", "error / sigma", "ms an image"]
    return table(
        head,
        [
            (
                *(row.kind, f"{row.noise:g}", f"{row.blur_px:g}", row.detector, row.points, f"{row.rms_px:.4f}"),
                "" if row.ratio is None else f"{row.ratio:.2f}",
                f"{1e3 * row.seconds:.0f}",
            )
            for row in rows
        ],
    )


_SPEEDS = ("blob rms [px]", "ms", "blob ms")
LIGHT_HEAD = ("photons", "spot [px]", "images", "rms [px]", "rms / bound", "error / sigma", *_SPEEDS)


def light_row(light: Mapping[str, Any]) -> tuple[object, ...]:
    """A line of the table with `LIGHT_HEAD`, from the fields of a `Light`."""
    return (
        *(
            f"{light['photons']:g}",
            f"{light['spot_px']:g}",
            "pair" if light["pair"] else "one",
            f"{light['rms_px']:.4f}",
        ),
        *(f"{light['rms_px'] / light['bound_px']:.3f}", f"{light['ratio']:.2f}", f"{light['blob_rms_px']:.4f}"),
        *(f"{light['milliseconds']:.2f}", f"{light['blob_milliseconds']:.2f}"),
    )


def missed_goals(rows: list[Row], spots: list[Light]) -> list[str]:
    """Goals that are missed, in words."""
    ours = [row for row in rows if row.detector == "basecal"]
    far = [row for row in ours if row.kind in ("charuco", "tags") and row.noise == 2 and row.rms_px > GOAL_PX]
    untrue = [row for row in ours if not GOAL_RATIO[0] < (row.ratio or 0) < GOAL_RATIO[1]]
    return [
        *(f"{row.kind}, noise {row.noise:g}, blur {row.blur_px:g}: {row.rms_px:.3f} px" for row in far),
        *(f"{row.kind}, noise {row.noise:g}, blur {row.blur_px:g}: error / sigma {row.ratio:.2f}" for row in untrue),
        *(f"{row.photons:g} photons: beyond the bound" for row in spots if row.rms_px > GOAL_BOUND * row.bound_px),
        *(f"{row.photons:g} photons: blobs are nearer" for row in spots if row.rms_px > row.blob_rms_px),
        *(
            f"{row.photons:g} photons: blobs are faster"
            for row in spots
            if row.milliseconds > row.blob_milliseconds and not row.pair
        ),
    ]


def main() -> int:
    """Run, print the tables, and write results/detectors.json; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=10, help="images of boards for each condition")
    parser.add_argument("--lights", type=int, default=200, help="images of lights for each condition")
    chosen = parser.parse_args()
    on_one_core()
    cv2.setNumThreads(1)
    rows = [row for kind in KINDS for noise, blur in CONDITIONS for row in corners(kind, noise, blur, chosen.images)]
    print(corner_table(rows))
    spots = [
        lights(photons, spot, pair, chosen.lights) for pair in (False, True) for spot in SPOTS for photons in PHOTONS
    ]
    print("\n" + table(LIGHT_HEAD, (light_row(spot._asdict()) for spot in spots)))
    missed = missed_goals(rows, spots)
    print("\nmissed: " + ("; ".join(missed) or "none"))
    write(
        "detectors",
        {"corners": [row._asdict() for row in rows], "lights": [row._asdict() for row in spots], "missed": missed},
    )
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
