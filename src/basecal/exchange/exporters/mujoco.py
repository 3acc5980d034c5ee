"""Export of transforms as bodies of a MuJoCo model (MJCF), to be loaded alone or included in another model."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from basecal.exchange.exports.exporter import Exporter, ExportRequest, comments, describe_transform, xml_comment
from basecal.exchange.exports.tree import FrameNode, frame_trees
from basecal.exchange.urdf import exact_text

_WORLD = "world"  # MuJoCo's name of `worldbody`


def export_text(request: ExportRequest) -> str:
    """Format a model with one body per frame, nested in its parent frame; root frames are at the origin.

    Source: mujoco.readthedocs.io, XML Reference, "body": pos in metres, quat with its scalar first.
    """
    model = Element("mujoco", model="basecal")
    for line in comments(
        [*request.remarks, *(describe_transform(transform, "m") for transform in request.transforms)], ""
    ):
        model.append(xml_comment(line))
    world = SubElement(model, "worldbody")
    for node in frame_trees(request.transforms, lambda name: "" if name == _WORLD else name):
        _add(world, node)
    indent(model)
    return tostring(model, encoding="unicode") + "\n"


def _add(parent: Element, node: FrameNode) -> None:
    body = SubElement(parent, "body", name=node.name)
    if node.parent_from_frame is not None:
        body.set("pos", exact_text(node.parent_from_frame.translation))
        body.set("quat", exact_text(np.roll(node.parent_from_frame.quaternion, 1)))
    for child in node.children:
        _add(body, child)


EXPORTER = Exporter("bodies of an MJCF model", export_text, is_pasted=True)
