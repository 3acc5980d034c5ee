"""Mix-ups of recordings, applied to the lines of `samples.jsonl` without the library's own readings of them.

Each states the finding that must name it, and the mix-ups with which it is exactly exchangeable (`partners`).
docs/conventions_test.md gives the reasons.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from basecal.cell import Cell, Recording
from basecal.cell.files import read_recording, write_recording
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.points import points_target

Lines = list[dict[str, Any]]
Change = Callable[[Lines], Lines]
# Shifted by two and back, or cut in halves, fewer samples leave too little to solve from.
FEWEST_FOR_TWO, FEWEST_FOR_A_MISS = 15, 14


@dataclass(frozen=True, eq=False)
class Mutation:
    """One mix-up.

    Attributes:
        name: Description.
        row: Its line in the table of mutations and kinds of data.
        code: Code of the finding that names it.
        about: Names that the finding must hold.
        partners: Codes of mix-ups that the same data cannot distinguish from it.
        lines: Function that changes the lines of the recording.
        cell: The cell as it is stated then.
    """

    name: str
    row: str
    code: str
    about: tuple[str, ...]
    lines: Change
    cell: Cell
    partners: tuple[str, ...] = ()


def lines_of(recording: Recording) -> Lines:
    """The lines of a recording as data."""
    with TemporaryDirectory() as folder:
        path = write_recording(recording, folder)
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def recording_of(lines: Lines, cell: Cell) -> Recording:
    """Read lines as the recording of a cell."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "recording" / "samples.jsonl"
        path.parent.mkdir()
        path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
        return replace(read_recording(folder, cell), folder=None)


def _poses(lines: Lines, names: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    """Every pose of these robots, to be changed in place; for the name '' those of observed targets."""
    for line in lines:
        for name in names:
            if name:
                yield line["robots"][name]["base_from_flange"]
            else:
                yield from (o["camera_from_target"] for o in line["observations"])


def _on_copy(change: Callable[[Lines], object]) -> Change:
    def apply(lines: Lines) -> Lines:
        copy = json.loads(json.dumps(lines))
        change(copy)
        return list(copy)

    return apply


def _matrix(pose: dict[str, Any]) -> Any:
    x, y, z, w = pose["q_xyzw"]
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = pose["t_m"]
    return out


def _set_matrix(pose: dict[str, Any], matrix: Any) -> None:
    for key in ("q_xyzw", "t_m"):
        del pose[key]
    pose["matrix"] = matrix.tolist()


def _invert(names: tuple[str, ...]) -> Change:
    def change(lines: Lines) -> None:
        for pose in _poses(lines, names):
            _set_matrix(pose, np.linalg.inv(_matrix(pose)))

    return _on_copy(change)


def _stretch(names: tuple[str, ...], factor: float) -> Change:
    def change(lines: Lines) -> None:
        for pose in _poses(lines, names):
            pose["t_m"] = [factor * v for v in pose["t_m"]]

    return _on_copy(change)


def _stretch_points(factor: float) -> Change:
    def change(lines: Lines) -> None:
        for line in lines:
            for observation in line["observations"]:
                points = np.array(observation["points_in_camera_m"])
                observation["points_in_camera_m"] = (factor * points).tolist()

    return _on_copy(change)


def _chain(*changes: Change) -> Change:
    def apply(lines: Lines) -> Lines:
        for change in changes:
            lines = change(lines)
        return lines

    return apply


def _roll_quaternions(names: tuple[str, ...], scalar_first: bool) -> Change:
    """Rotate the components of quaternions: scalar-last ones become scalar-first, or the reverse."""

    def change(lines: Lines) -> None:
        for pose in _poses(lines, names):
            x, y, z, w = pose["q_xyzw"]
            pose["q_xyzw"] = [w, x, y, z] if scalar_first else [y, z, w, x]

    return _on_copy(change)


def _swap(first: str, second: str) -> Change:
    def change(lines: Lines) -> None:
        for line in lines:
            robots = line["robots"]
            robots[first], robots[second] = robots[second], robots[first]

    return _on_copy(change)


def _pair_late(stream: str, shift: int, start: int = 0) -> Change:
    """Give line i the stream of line i + `shift`, from `start` on; lines without a partner are removed."""

    def apply(lines: Lines) -> Lines:
        copy = json.loads(json.dumps(lines))
        out = copy[:start]
        for i in range(start, len(lines)):
            j = i + shift
            if start <= j < len(lines):
                line = copy[i]
                if stream:
                    line["robots"][stream] = lines[j]["robots"][stream]
                else:
                    line["observations"] = lines[j].get("observations", [])
                out.append(line)
        return list(out)

    return apply


def _change_angle_unit(robot: str, to_radians: bool) -> Change:
    def change(lines: Lines) -> None:
        for line in lines:
            state = line["robots"][robot]
            convert = np.radians if to_radians else np.degrees
            state["joints_rad"] = convert(state["joints_rad"]).tolist()

    return _on_copy(change)


def _mirror_views(lines: Lines) -> None:
    for pose in _poses(lines, ("",)):
        m = _matrix(pose)
        m[:3, :2] *= -1
        m[:3, 3] *= -1
        _set_matrix(pose, m)


def _turn_grids(width: float, height: float, share: float, rng: np.random.Generator) -> Change:
    """Read the grid from its other end in a share of the views."""
    turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    turn[:2, 3] = width, height

    def change(lines: Lines) -> None:
        poses = list(_poses(lines, ("",)))
        for k in rng.permutation(len(poses))[: int(share * len(poses))]:
            _set_matrix(poses[k], _matrix(poses[k]) @ turn)

    return _on_copy(change)


def _keep(lines: Lines) -> Lines:
    return lines


def _with_target_sizes(cell: Cell, factor: float) -> Cell:
    """The cell with its targets stated larger by a factor."""
    targets = {}
    for name, entry in cell.targets.items():
        shape = entry.target
        assert shape is not None
        options = dict(shape.options)
        if shape.kind == "charuco":
            options["square_m"], options["marker_m"] = options["square_m"] * factor, options["marker_m"] * factor
            target = charuco_target(**options)
        elif shape.kind == "chessboard":
            target = chessboard_target(options["corners"], options["square_m"] * factor)
        else:
            target = points_target([[factor * v for v in p] for p in shape.points.tolist()])
        targets[name] = replace(entry, target=target)
    return replace(cell, targets=targets)


def _with_focal_error(cell: Cell, factor: float) -> Cell:
    """The cell with focal lengths wrong by a factor, in lenses stated as fixed."""
    cameras = {}
    for name, camera in cell.cameras.items():
        assert camera.intrinsics is not None
        lens = camera.intrinsics.camera
        assert lens is not None
        wrong = lens.with_parameters(lens.parameters * np.array([factor, factor, *[1.0] * (len(lens.parameters) - 2)]))
        cameras[name] = replace(camera, intrinsics=replace(camera.intrinsics, camera=wrong, exact=False))
    return replace(cell, cameras=cameras)


def mutations(cell: Cell, lines: Lines, seed: int) -> Iterator[Mutation]:
    """All mix-ups that apply to such data, with numbers drawn by `seed`."""
    rng = np.random.default_rng([seed, 77])
    first = lines[0]
    observation = first["observations"][0]
    pose_robots = [name for name, state in first["robots"].items() if "base_from_flange" in state]
    poses, points, pixels = (
        "camera_from_target" in observation,
        "points_in_camera_m" in observation,
        "pixels" in observation,
    )
    yield from _robots(cell, pose_robots, poses)
    yield from _lengths(cell, pose_robots, len(first["robots"]), poses, points)
    yield from _pairs(cell, list(first["robots"]), len(lines), rng)
    yield from _joints(cell, [name for name in first["robots"] if name not in pose_robots])
    if poses:
        yield from _observed_poses(cell, pose_robots, rng)
    yield from _sizes(cell, pixels, points, rng)


def _robots(cell: Cell, by_pose: list[str], poses: bool) -> Iterator[Mutation]:
    several = [tuple(by_pose)] if len(by_pose) > 1 else []
    alone = ("target-pose-inverted",) if poses and len(cell.robots) == 1 else ()
    for names in [*((name,) for name in by_pose), *several]:
        who = " and ".join(names)
        row = "poses of one robot inverted" if len(names) == 1 else "poses of all robots inverted"
        yield Mutation(f"{who} inverted", row, "robot-pose-inverted", names, _invert(names), cell, alone)
        yield Mutation(
            f"{who} w x y z",
            "quaternion order of robots",
            "quaternion-order",
            names,
            _roll_quaternions(names, True),
            cell,
        )
    if by_pose:
        names = (by_pose[-1],)
        yield Mutation(
            f"{names[0]} y z w x",
            "quaternion order of robots",
            "quaternion-order",
            names,
            _roll_quaternions(names, False),
            cell,
        )
    if several:
        a, b = by_pose[:2]
        partners = ("target-pose-inverted",) if poses else ()
        yield Mutation(
            f"{a} and {b} swapped", "two robots swapped", "robots-swapped", (a, b), _swap(a, b), cell, partners
        )


def _lengths(cell: Cell, by_pose: list[str], robots: int, poses: bool, points: bool) -> Iterator[Mutation]:
    size = ("board-size",)
    for factor, unit in ((1e3, "in mm"), (1e-3, "1000 times too small")):
        if len(by_pose) > 1 or (by_pose and robots > 1):
            name = by_pose[0] if factor > 1 else by_pose[-1]
            change = _stretch((name,), factor)
            yield Mutation(f"{name} {unit}", "one robot in mm", "length-unit", (name,), change, cell)
    if by_pose and len(by_pose) == robots:
        every = _stretch(tuple(by_pose), 1e3)
        yield Mutation("robots in mm", "all robots in mm", "length-unit", tuple(by_pose), every, cell, size)
        shapes = [t.target for t in cell.targets.values()]
        observed = [_stretch(("",), 1e3)] if poses else [_stretch_points(1e3)] if points else []
        stated = cell if poses or any(s is None or s.is_point for s in shapes) else _with_target_sizes(cell, 1e3)
        yield Mutation("everything in mm", "everything in mm", "length-unit", (), _chain(every, *observed), stated)
    if poses:
        yield Mutation("targets in mm", "observed poses in mm", "length-unit", (), _stretch(("",), 1e3), cell, size)
    if points:
        yield Mutation("points in mm", "3-D points in mm", "length-unit", (), _stretch_points(1e3), cell, size)
        yield Mutation("points mirrored", "3-D points mirrored", "mirrored", (), _stretch_points(-1.0), cell)


def _pairs(cell: Cell, robots: list[str], count: int, rng: np.random.Generator) -> Iterator[Mutation]:
    code, row = "pairing-shifted", "observations shifted by one"
    yield Mutation("seen one late", row, code, (), _pair_late("", -1), cell)
    if count >= FEWEST_FOR_TWO:
        yield Mutation("seen two early", "observations shifted by two", code, (), _pair_late("", 2), cell)
    if len(robots) > 1:
        name = robots[int(rng.integers(len(robots)))]
        change = _pair_late(name, 1)
        yield Mutation(f"{name} one early", "one robot shifted by one", code, (name,), change, cell)
    start = int(rng.integers(int(0.3 * count), int(0.7 * count)))
    if count < FEWEST_FOR_A_MISS:
        return
    change = _pair_late("", 1, start)
    yield Mutation(f"a detection missed at {start}", "paired wrongly after a missed detection", code, (), change, cell)


def _joints(cell: Cell, robots: list[str]) -> Iterator[Mutation]:
    for name in robots:
        row = "joints in degrees, or radians turned twice"
        yield Mutation(f"{name} in degrees", row, "angle-unit", (name,), _change_angle_unit(name, False), cell)
        yield Mutation(f"{name} turned twice", row, "angle-unit", (name,), _change_angle_unit(name, True), cell)


def _observed_poses(cell: Cell, by_pose: list[str], rng: np.random.Generator) -> Iterator[Mutation]:
    """Mix-ups of observed poses; inverted ones equal exchanged robots, or the only robot inverted."""
    partners = ("robots-swapped",) if len(by_pose) > 1 else ("robot-pose-inverted",)
    code, row = "quaternion-order", "quaternion order of observed poses"
    yield Mutation(
        "target inverted", "observed poses inverted", "target-pose-inverted", (), _invert(("",)), cell, partners
    )
    yield Mutation("target w x y z", row, code, (), _roll_quaternions(("",), True), cell)
    yield Mutation("target mirrored", "observed poses mirrored", "mirrored", (), _on_copy(_mirror_views), cell)
    for name, entry in cell.targets.items():
        if entry.target is not None and entry.target.kind == "chessboard":
            (columns, rows), square = entry.target.options["corners"], entry.target.options["square_m"]
            change = _turn_grids((columns - 1) * square, (rows - 1) * square, 0.3, rng)
            yield Mutation("half turns", "half turn of a grid in some poses", "board-symmetry", (name,), change, cell)


def _sizes(cell: Cell, pixels: bool, points: bool, rng: np.random.Generator) -> Iterator[Mutation]:
    shapes = [t.target for t in cell.targets.values()]
    solid = all(s is not None and not s.is_point for s in shapes)
    factor = float(rng.choice([0.8, 0.9, 0.95, 1.05, 1.1, 1.25]))
    if solid and (pixels or points):
        code = "board-size"
        yield Mutation(f"target times {factor}", "target's size off", code, (), _keep, _with_target_sizes(cell, factor))
        stated = _with_target_sizes(cell, 1e3)
        yield Mutation("target in mm", "target's size in mm", code, (), _keep, stated, ("length-unit",))
    lenses = [c.intrinsics for c in cell.cameras.values()]
    if pixels and all(lens is not None and lens.status == "fixed" for lens in lenses):
        row = "lens stated wrongly as fixed"
        yield Mutation(
            f"focal length times {factor}",
            row,
            "intrinsics",
            (),
            _keep,
            _with_focal_error(cell, factor),
            ("board-size",),
        )
