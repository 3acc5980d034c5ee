"""`basecal simulate`."""

from __future__ import annotations

import os
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from basecal.cli.option_types import Port, Seed, given_options, number_range, refuse_options
from basecal.cli.simulated_process import RendererName, run_process
from basecal.cli.terminal import print_json, progress, progress_bar, quote_path, say
from basecal.errors import InputError, UsageError, count_text
from basecal.simulation.scenario import ObservedKind, Scenario

if TYPE_CHECKING:
    from collections.abc import Sequence

    from basecal.simulation.scenario import SimulatedCell

Positive = Annotated[float, number_range(0, 1e6)]
_SHARED_OPTIONS = ("--target", "--seed", "--json")
_RUNNING_OPTIONS = ("--process", "--port", "--speed", "--fault", "--renderer", "--until-eof")


def simulate(
    cell: Path,
    /,
    *,
    robots: Annotated[int, number_range(1, 9)] = 2,
    target: ObservedKind = "charuco",
    samples: Annotated[int, number_range(1, 200_000)] = 30,
    mounts: Literal["free", "prior", "fixed"] = "free",
    pixel_px: Positive = 0.2,
    robot_noise_mm: Positive = 0.0,
    robot_noise_mrad: Positive = 0.0,
    joints: bool = False,
    joint_offset_deg: Positive = 0.0,
    seed: Seed = 0,
    images: bool = False,
    process: bool = False,
    port: Port = 0,
    speed: Annotated[float, number_range(0, 1000)] = 1.0,
    fault: tuple[str, ...] = (),
    renderer: RendererName = "auto",
    until_eof: bool = False,
    json: bool = False,
) -> int:
    """Simulate a cell and a recording with known truth, or run such a cell.

    Writes cell.yaml, recording/samples.jsonl and truth.yaml.

    With --process nothing is recorded. Two UR5e, a camera and a target run as a
    process for `basecal capture` and other programs (docs/capture.md), until
    Ctrl-C. The cell is made if it is missing.

    For example:

        basecal simulate simulated --target led --mounts fixed --samples 50
        basecal calibrate simulated
        basecal simulate rendered --images
        basecal simulate off --joints --joint-offset-deg 0.2
        basecal simulate running --process
        basecal simulate pushed --process --speed 10 --fault base-bumped=5@12

    Args:
        cell: Folder to make.
        robots: One robot sees a target in the world; the first of two sees the second's target; more form a chain.
        target: Kind of target; pose and points3d are measurements of a depth camera.
        samples: Number of samples.
        mounts: Status of the mounts of cameras and targets in the cell.
        pixel_px: Noise of pixels, per coordinate.
        robot_noise_mm: Noise of the translation of recorded flange poses, per axis and stop.
        robot_noise_mrad: Noise of the rotation of recorded flange poses, per axis and stop.
        joints: Robots are six-axis arms that record joints, each with a URDF; for one or two robots.
        joint_offset_deg: Offset of each joint, one sigma, which the cell does not state.
        seed: Seed of the cell.
        images: Render images instead of recording pixels of points; pixel-px then has no effect.
        process: Run the cell; only --target, --seed and the options below apply.
        port: Port of the process, on this machine only; 0 selects a free one.
        speed: Simulated seconds per second; with 0, time advances only while a client waits.
        fault: Fault of the running cell: NAME, NAME=SIZE or NAME=SIZE@MOVES; an unknown name lists all faults.
        renderer: Renderer of images: mujoco (arms, table and clutter around the target; the extra sim) or analytic
            (only the target). With auto, MuJoCo is used if it is available.
        until_eof: End the process when its standard input ends.
        json: Print the written samples, or the address of the process, as JSON.
    """
    _refuse_unused_options(process, given_options(simulate, locals()))
    if process:
        return run_process(cell, target, seed, port, speed, fault, renderer, until_eof, json)
    scenario = Scenario(
        samples=samples,
        target=target,
        layout="eye_in_hand" if robots == 1 else "dual" if robots == 2 else "chain",
        robots=max(robots, 2),
        camera_mount=mounts,
        target_mount=mounts,
        pixel_px=pixel_px,
        state_pixel_noise=not images,
        robot_noise=(robot_noise_mm * 1e-3, robot_noise_mrad * 1e-3),
        joints=joints,
        joint_offset_rad=joint_offset_deg * pi / 180,
    )
    return _record(cell, scenario, seed, images, json)


def _refuse_unused_options(process: bool, options: Sequence[str]) -> None:
    """Refuse options that have no effect: of a recorded cell for a running one, the reverse, offsets without joints.

    Raises:
        UsageError: if there are any.
    """
    if process:
        refuse_options(options, (*_RUNNING_OPTIONS, *_SHARED_OPTIONS), "--process runs two arms and records nothing")
    else:
        unused = [option for option in options if option in _RUNNING_OPTIONS]
        refuse_options(unused, (), "without --process no cell runs")
        if "--joint-offset-deg" in options and "--joints" not in options:
            raise UsageError("--joint-offset-deg has no effect on recorded poses: add --joints")


def _record(cell: Path, scenario: Scenario, seed: int, images: bool, json: bool) -> int:
    from basecal.simulation.testbed import simulate as simulated

    refuse_existing(cell)
    with progress("simulating"):
        simulation = simulated(scenario, seed)
    simulation = write_simulation(cell, simulation, image_seed=seed if images else None)
    samples = len(simulation.recording.samples)
    if json:
        print_json({"cell": str(cell), "samples": samples, "seed": seed})
    else:
        say(f"wrote {count_text(samples, 'sample')} to {cell}, the truth to {cell / 'truth.yaml'}")
        say(f"next: basecal calibrate {quote_path(cell)}")
    return 0


def refuse_existing(folder: Path) -> None:
    """Refuse a folder that contains a cell or a recording.

    Raises:
        InputError: if it contains one.
    """
    for path in (folder / "cell.yaml", folder / "recording" / "samples.jsonl"):
        if os.path.lexists(path):
            raise InputError(f"{path} exists and is not overwritten: choose another folder, or remove it first")


def write_simulation(folder: Path, simulation: SimulatedCell, image_seed: int | None = None) -> SimulatedCell:
    """Write a simulated cell with its recording and truth to a folder, completely or not at all, and return it.

    Args:
        folder: The cell's folder.
        simulation: The simulated cell.
        image_seed: Seed of the noise of images that replace recorded points; None for no images.
    """
    from dataclasses import replace

    from basecal.cell.files import write_cell, write_recording, write_truth
    from basecal.cell.format.writing import stage_folder
    from basecal.simulation.running.world_file import write_urdfs

    with stage_folder(folder) as part:
        if image_seed is not None:
            from basecal.simulation.images import render_recording

            with progress_bar("rendering") as step:
                rendered = render_recording(simulation, part, image_seed, progress=step)
            simulation = replace(simulation, recording=rendered)
        write_cell(simulation.cell, part)
        write_recording(simulation.recording, part)
        write_urdfs(simulation.cell, part)
        offsets = {name: robot.kind_values("joint_offsets").tolist() for name, robot in simulation.robots.items()}
        write_truth(part, simulation.truth, **({"joint_offsets_rad": offsets} if offsets else {}))
    return replace(simulation, recording=replace(simulation.recording, folder=str(folder)))
