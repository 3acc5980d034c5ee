"""A folder of a cell with the tracks of a scene."""

from __future__ import annotations

import json
from pathlib import Path

from scene_points import LENS, Scene

LENS_FIELDS = dict(zip(("fx", "fy", "cx", "cy"), LENS.parameters[:4].tolist(), strict=True))
LENS_FIELDS["distortion"] = LENS.parameters[4:].tolist()
CAMERA = {"model": "pinhole", "size_px": list(LENS.size_px or ()), "intrinsics": {"status": "fixed", **LENS_FIELDS}}


def write_tracks(folder: Path, scene: Scene) -> None:
    """Write a cell, and a line of samples.jsonl for each view."""
    views, tracks = scene.views, scene.tracks
    cameras = {camera.name: {"on": camera.robot, **CAMERA} for camera in views.cameras}
    robots = {name: {} for name in views.robots}
    cell = {"schema": "basecal/cell/1", "reference": "left", "robots": robots, "cameras": cameras}
    (folder / "recording").mkdir()
    (folder / "cell.yaml").write_text(json.dumps(cell))
    lines = []
    for view in range(len(views)):
        in_view, pose = tracks.view == view, views.base_from_flange[view]
        observation = {"tracks": tracks.point[in_view].tolist(), "pixels": tracks.pixels[in_view].tolist()}
        state = {"base_from_flange": {"t_m": pose.translation.tolist(), "q_xyzw": pose.quaternion.tolist()}}
        camera, robot = views.cameras[views.camera[view]].name, views.robots[views.robot[view]]
        lines.append({"sample": view, "robots": {robot: state}, "observations": [{"camera": camera, **observation}]})
    (folder / "recording" / "samples.jsonl").write_text("\n".join(map(json.dumps, lines)) + "\n")
