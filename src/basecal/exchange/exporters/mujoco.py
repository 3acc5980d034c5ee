"""Export of transforms as bodies of a MuJoCo model (MJCF), to be loaded alone or included in another model."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from basecal.exchange.exports.exporter import Exporter, Wanted, comments, describe_transform, xml_comment
from basecal.exchange.exports.tree import Place, places
from basecal.exchange.urdf import exactly


def export_text(request: Wanted) -> str:
    """Format a model with one body per frame, nested in its parent frame; root frames are at the origin.

    Source: mujoco.readthedocs.io, XML Reference, "body": pos in metres, quat with its scalar first.
    """
    model = Element("mujoco", model="basecal")
    for line in comments([*request.remarks, *(describe_transform(one, "m") for one in request.transforms)], ""):
        model.append(xml_comment(line))
    world = SubElement(model, "worldbody")
    for place in places(request.transforms):
        _add(world, place)
    indent(model)
    return tostring(model, encoding="unicode") + "\n"


def _add(parent: Element, place: Place) -> None:
    body = SubElement(parent, "body", name=place.name)
    if place.parent_from_frame is not None:
        body.set("pos", exactly(place.parent_from_frame.translation))
        body.set("quat", exactly(np.roll(place.parent_from_frame.quaternion, 1)))
    for child in place.children:
        _add(body, child)


EXPORTER = Exporter("bodies of an MJCF model", export_text, is_pasted=True)
