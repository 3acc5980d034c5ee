"""Entries of `cell.yaml` for the selected parts of a bag."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from basecal.cell.schema.cell_schema import is_frame_name
from basecal.exchange.bags.sources import BagRequest, BagSources, ByFrames, ByJoints
from basecal.exchange.bags.survey import Survey, plain_frame
from basecal.exchange.fields import Field
from basecal.exchange.importing.imported import KnownCell, NoCell, ViewNames, view_entry
from basecal.exchange.importing.lens import StatedLens, camera_entry
from basecal.exchange.lens_files.camera_info import camera_info_lens

_RECTIFIED = "image_rect"


def bag_entry(
    cell: KnownCell,
    path: str,
    survey: Survey,
    sources: BagSources,
    request: BagRequest,
    sizes: Mapping[str, tuple[int, int]],
) -> dict[str, Any]:
    """Entries for new robots, cameras with their lenses, and targets; existing entries are not changed.

    Args:
        cell: The existing cell, or `NO_CELL`.
        path: Name of the bag in errors.
        survey: Content of the bag.
        sources: Selected sources of the bag.
        request: The user's request, with the carriers of cameras and targets.
        sizes: Width and height [px] of the images, by camera.

    Raises:
        InputError: if a lens model is not supported, or the carrier of a target is ambiguous.
    """
    data: dict[str, Any] = {"reference": next(iter(sources.robots))} if isinstance(cell, NoCell) else {}
    data |= {"robots": {}, "cameras": {}, "targets": {}}
    for name, source in sources.robots.items():
        is_new = isinstance(source, ByJoints) and source.urdf is not None
        links = {"base_link": source.base, "flange_link": source.flange} if isinstance(source, ByJoints) else {}
        data["robots"][name] = {"urdf": urdf_name(name), **links} if is_new else {}
        if isinstance(source, ByFrames) and name not in cell.robots:
            data["robots"][name] = _frames({"base": source.parent, "flange": source.child})
    for name, camera in sources.cameras.items():
        if name in cell.cameras:
            data["cameras"][name] = {}
            continue
        info = (
            None if camera.info is None else bag_lens(survey.infos[camera.info], f"{path}: {camera.info}", camera.topic)
        )
        lens = {"intrinsics": {"status": "free"}} if info is None else camera_entry(info.camera, "fixed")
        size = {"size_px": list(sizes[name])} if name in sizes and "size_px" not in lens else {}
        frame = _frames({"frame": plain_frame(survey.frame_ids.get(camera.topic, ""))}).get("frames", {})
        data["cameras"][name] = {"on": camera.on, "mount": {"status": "free"}, **size, **lens, **frame}
    for eye, target in sources.views:
        on = data["cameras"].get(eye, {}).get("on", request.on.get(eye))
        added = view_entry(cell, ViewNames(eye, target, on, request.on.get(target)))
        data["robots"] |= {name: {} for name in added["robots"] if name not in data["robots"]}
        data["cameras"] = {**added["cameras"], **data["cameras"]}
        data["targets"] |= added["targets"]
    return {key: value for key, value in data.items() if value}


def _frames(names: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Entry `frames` with the names that are valid in `cell.yaml`; empty if there are none."""
    known = {key: name for key, name in names.items() if is_frame_name(name)}
    return {"frames": known} if known else {}


def urdf_name(robot: str) -> str:
    """Name of a robot's URDF in a cell."""
    return f"{robot}.urdf"


def bag_lens(info: Any, location: str, topic: str) -> StatedLens | None:
    """Lens of a camera's images; None if the camera is not calibrated.

    The lens of rectified images is the matrix P without distortion.

    Args:
        info: CameraInfo message of ROS 1 or ROS 2.
        location: The bag and the topic of the message, for errors.
        topic: Topic of the images.

    Raises:
        DatasetError: if the lens is invalid or not supported.
    """
    # The names of these fields are upper case in ROS 1 and lower case in ROS 2.
    matrix, terms, projection = (
        [float(value) for value in (getattr(info, name) if hasattr(info, name) else getattr(info, name.upper()))]
        for name in "kdp"
    )
    if not any(matrix):
        return None
    kind = str(info.distortion_model)
    if topic.rpartition("/")[2].startswith(_RECTIFIED) or f"/{_RECTIFIED}" in topic:
        matrix, terms, kind = list(np.reshape(projection, (3, 4))[:, :3].ravel()), [], ""
    data = {
        "width": int(info.width),
        "height": int(info.height),
        "k": [float(value) for value in matrix],
        "d": terms,
        "distortion_model": kind,
        "binning_x": int(info.binning_x),
        "binning_y": int(info.binning_y),
        "roi": {side: int(getattr(info.roi, side)) for side in ("width", "height")},
    }
    return camera_info_lens(Field(location, data, {}))
