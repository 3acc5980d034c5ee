"""Images of captures: reflections distinguished from a light, its error beside the photon bound, stillness, and speed.

Reflections: cells of two UR5e with a light, whose arms take random poses about their home positions. A tray below
reflects the light with 0.4 of its brightness. An image counts if it shows the reflection of the light. It is right if
the answer uses a pixel within a pixel of the light itself.

Stillness: joints swing by 2 mrad for half a second after they arrive. Speed: CPU time of one process for an image of
1280 x 720. Other programs slow it, so the load is given beside it.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.residuals.point_residuals import point_residuals
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell import CandidateObservation, PixelObservation, Recording, RobotState, Sample, Target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.led import led_target
from basecal.geometry import Array
from basecal.planning.sketch import sketch_cell
from basecal.simulation.running.faults import read_faults
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.two_arms import two_arms
from basecal.vision.detection import Detection, Image
from basecal.vision.detectors import find_target
from basecal.vision.draw.led import LedSettings, render_led
from basecal.vision.draw.render import RenderSettings, render
from benchmarks.common import Kept, label, table, write
from benchmarks.detectors import CAMERA, KINDS, Light, _poses, lights
from benchmarks.direct_rig import direct_rig

WANTED = 2000  # images with a reflection
CELL_IMAGES = 60  # of one cell
WANDER_RAD = 0.1  # sigma of each joint about its home position
RIGHT_PX = 1.0
PHOTONS, SPOTS = (3e3, 3e4), (0.8, 1.5)  # nothing is saturated
GOALS = {"reflections": 0.99, "bound": 1.15, "lost_s": 0.3, "pictures_a_second": 20.0}


def reflections(wanted: int, has_dark: bool, outcomes: Kept, minutes: float) -> dict[str, Any]:
    """Count images with a reflection in which the light was identified, until there are enough or time is up."""
    total = right = left_out = 0
    findings = cells = 0
    end_s = time.monotonic() + 60 * minutes
    while total < wanted and (not cells or time.monotonic() < end_s):
        outcome = outcomes.of(f"{has_dark}#{cells}", partial(_cell, cells, has_dark))
        cells += 1
        total, right, left_out = total + outcome[0], right + outcome[1], left_out + outcome[2]
        findings += outcome[3]
        print("reflections", has_dark, cells, total, right, left_out, findings, flush=True)
    return {"pictures": total, "right": right, "left_out": left_out, "cells": cells, "named": findings}


def _cell(seed: int, has_dark: bool) -> tuple[int, int, int, int]:
    """Number of images of a cell with a reflection, of right ones, of those left out, and 1 if it was reported."""
    world = two_arms("led", seed, read_faults(["reflection"]))
    plant, rng = Plant(world, Clock(0)), np.random.default_rng([seed, 31])
    light = world.cell.targets["light"].target
    assert light is not None
    samples: list[Sample] = []
    true: dict[int, Array] = {}
    mirrored: set[int] = set()
    while len(samples) < CELL_IMAGES:
        joints = {name: home + WANDER_RAD * rng.standard_normal(len(home)) for name, home in world.home.items()}
        for name, each in joints.items():
            plant.move(name, each, 3.0)
        plant.wait(30.0)
        scene, lens = plant.camera_scene("wrist"), world.lenses["wrist"]
        if not lens.sees(scene.camera_from_target @ light.points).all():
            continue
        states = {name: RobotState(joints_rad=plant.state(name)[1]) for name in joints}
        detection = _detect(plant, light, has_dark)
        if detection is None:
            continue
        number = len(samples)
        true[number] = lens.project(scene.camera_from_target @ light.points)[0]
        if lens.sees(scene.reflected).any():
            mirrored.add(number)
        samples.append(Sample(number, float(number), states, (_observation(detection),)))
    calibration = calibrate(world.cell, Recording(tuple(samples)))
    (points,) = point_residuals(world.cell, Recording(tuple(samples)), calibration)
    residual_by_sample = {
        int(number): (pixel, used)
        for number, pixel, used in zip(points.sample, points.pixels, points.used, strict=True)
    }
    near = {
        number
        for number, (pixel, used) in residual_by_sample.items()
        if used and np.hypot(*(pixel - true[number])) < RIGHT_PX
    }
    excluded = {number for number in true if number not in residual_by_sample or not residual_by_sample[number][1]}
    named = any(finding.code == "reflection" for finding in calibration.findings)
    return len(mirrored), len(mirrored & near), len(mirrored & excluded), int(named)


def _detect(plant: Plant, light: Target, has_dark: bool) -> Detection | None:
    lit = plant.shot("wrist").image
    if not has_dark:
        return find_target(lit, light)
    plant.light(False)
    dark = plant.shot("wrist").image
    plant.light(True)
    return find_target(lit, light, dark)


def _observation(detection: Detection) -> CandidateObservation | PixelObservation:
    if detection.ids is None:
        return CandidateObservation("wrist", "light", detection.pixels, detection.sigma_px, detected=True)
    return PixelObservation("wrist", "light", detection.ids, detection.pixels, detection.sigma_px, detected=True)


def stillness(cells: int, stops: int) -> dict[str, Any]:
    """Delays between the end of a ring of half a second and the image that is taken [s]."""
    delays_s: list[float] = []
    for seed in range(cells):
        world = two_arms("charuco", seed, read_faults(["ringing"]))
        plant, rng = Plant(world, Clock(0)), np.random.default_rng([seed, 37])
        rig = direct_rig(plant, tuple(world.home))
        with tempfile.TemporaryDirectory() as name:
            taker = Taker(rig, sketch_cell(world.cell), Path(name), CaptureSettings(2.0, 10.0))
            taken: list[Sample] = []
            for number in range(stops):
                goal = {
                    each: RobotState(joints_rad=home + 0.03 * rng.standard_normal(len(home)))
                    for each, home in world.home.items()
                }
                sample = taker.take(Sample(number, robots=goal), taken)
                delays_s.append(float(sample.stamp_s or 0.0) - plant.arrived_s)
                taken.append(sample)
        print("stillness", seed, delays_s[-stops:], flush=True)
    lost = np.array(delays_s) - 0.5
    return {
        "samples": len(delays_s),
        "within_ring": int((lost < 0).sum()),
        "median_lost_s": float(np.median(lost)),
        "most_lost_s": float(lost.max()),
    }


def speeds(images: int) -> dict[str, Any]:
    """Median time of an image [ms] by target, and the load of the machine."""
    rng, milliseconds = np.random.default_rng(0), {}
    boards: dict[str, Target] = {
        "charuco, 24 corners": charuco_target((5, 7), 0.04, 0.03, "DICT_4X4_50"),
        "tags, 9": KINDS["tags"][0],
    }
    for name, shape in boards.items():
        rendered = [render(CAMERA, shape, pose, RenderSettings(), k) for k, pose in enumerate(_poses(shape, images))]
        milliseconds[name] = _median_ms(rendered, shape)
    places = np.column_stack([rng.uniform(-0.4, 0.4, (images, 2)) * (1, 0.5), np.ones(images)])
    on = [render_led(CAMERA, place, LedSettings(), 2 * k) for k, place in enumerate(places)]
    off = [render_led(CAMERA, place, replace(LedSettings(), photons=0.0), 2 * k + 1) for k, place in enumerate(places)]
    milliseconds["light"] = _median_ms(on, led_target())
    milliseconds["light, with an image without it"] = _median_ms(on, led_target(), off)
    return {"milliseconds": milliseconds, "load": os.getloadavg()[0]}


def _median_ms(images: Sequence[Image], shape: Target, dark: Sequence[Image] | None = None) -> float:
    find_target(images[0], shape)
    took = []
    for k, image in enumerate(images):
        began = time.process_time()
        find_target(image, shape, None if dark is None else dark[k])
        took.append(1e3 * (time.process_time() - began))
    return float(np.median(took))


def _relative_to_bound(light: Light) -> dict[str, Any]:
    condition = {"photons": light.photons, "spot_px": light.spot_px, "pair": light.pair}
    return {**condition, "rms_over_bound": light.rms_px / light.bound_px}


def main(words: Sequence[str] | None = None) -> int:
    """Measure, print and write; return 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--images", type=int, default=WANTED, help="with a reflection, each with and without a dark one"
    )
    parser.add_argument("--lights", type=int, default=200, help="images for each condition")
    parser.add_argument("--cells", type=int, default=2, help="cells whose arms ring")
    parser.add_argument("--stops", type=int, default=20, help="stops of each cell whose arms ring")
    parser.add_argument("--keep", type=Path, help="file in which cells with a reflection are kept, to go on from")
    parser.add_argument(
        "--minutes",
        type=float,
        default=np.inf,
        help="time for these cells, half for switched lights and half for constant ones",
    )
    asked = parser.parse_args(words)
    kept = Kept(asked.keep)
    conditions = [(photons, spot, pair) for pair in (False, True) for spot in SPOTS for photons in PHOTONS]
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "speed": lambda: speeds(10),
        "stillness": lambda: stillness(asked.cells, asked.stops),
        "reflections, switched": lambda: reflections(asked.images, True, kept, asked.minutes / 2),
        "reflections, always on": lambda: reflections(asked.images, False, kept, asked.minutes / 2),
        "lights": lambda: {
            "pictures": asked.lights,
            "of": [_relative_to_bound(lights(*each, asked.lights)) for each in conditions],
        },
    }
    result: dict[str, Any] = {"goals": GOALS}
    for name, part in parts.items():
        result[name] = part()
        print(name, result[name], flush=True)
        write("capture_images", result)
    missed = missed_goals(result)
    print("missed: " + ("; ".join(missed) or "none"))
    return int(bool(missed))


HEAD = ("what", "measured", "required")


def section(result: dict[str, Any]) -> str:
    """The section of docs/benchmarks.md."""
    goals, speed, still = result["goals"], result["speed"], result["stillness"]
    most = 1e3 / goals["pictures_a_second"]
    rows: list[tuple[object, ...]] = [
        (f"time of an image: {label(name)}", f"{each:.1f} ms", f"{most:g} ms")
        for name, each in speed["milliseconds"].items()
    ]
    rows.append((f"within half a second of ringing, of {still['samples']} samples", still["within_ring"], 0))
    rows.append(("time lost beyond it, at most", f"{still['most_lost_s']:.2f} s", f"{goals['lost_s']:g} s"))
    for name in ("reflections, switched", "reflections, always on"):
        counts = result[name]
        share = f"{counts['right']} of {counts['pictures']}, named in {counts['named']} of {counts['cells']} cells"
        rows.append((f"{name}: LED identified", share, f"{100 * goals['reflections']:g} %"))
    worst = max(each["rms_over_bound"] for each in result["lights"]["of"])
    images = result["lights"]["pictures"]
    rows.append(
        (
            f"error of an LED over the photon bound, worst condition of {images} images",
            f"{worst:.2f}",
            goals["bound"],
        )
    )
    about = f"""\
Detection in images of 1280 x 720 during a capture:

- The time is that of one process for each image, beside other programs (the load was {speed["load"]:.1f}).
- Arms ring for half a second after they arrive.
- A tray reflects an LED. {WANTED} images are required, and the table gives the number tried."""
    return f"{about}\n\n{table(HEAD, rows)}"


def missed_goals(result: dict[str, Any]) -> list[str]:
    """Goals that are missed, in words."""
    slow = [name for name, each in result["speed"]["milliseconds"].items() if each > 1e3 / GOALS["pictures_a_second"]]
    wrong = [
        name
        for name in ("reflections, switched", "reflections, always on")
        if result[name]["right"] < GOALS["reflections"] * result[name]["pictures"]
    ]
    beyond = [str(each) for each in result["lights"]["of"] if each["rms_over_bound"] > GOALS["bound"]]
    still = result["stillness"]
    not_still = ["stillness"] if still["within_ring"] or still["most_lost_s"] > GOALS["lost_s"] else []
    return [*slow, *wrong, *beyond, *not_still]


if __name__ == "__main__":
    sys.exit(main())
