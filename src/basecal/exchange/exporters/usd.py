"""Export of transforms as frames of a USD stage in text form (.usda)."""

from __future__ import annotations

from typing import Any

from basecal.errors import MissingExtra
from basecal.exchange.exports.exporter import Exporter, ExportRequest, comments, describe_transform
from basecal.exchange.exports.tree import FrameNode, frame_trees


def export_text(request: ExportRequest) -> str:
    """Format a stage in metres, z up, with one prim per frame, nested in its parent frame.

    Raises:
        MissingExtra: if the USD library is not installed.

    Source: openusd.org, UsdGeomXformable: a prim's `xformOp:translate`, then `xformOp:orient` on its right.
    """
    try:
        from pxr import Sdf, Tf, Usd, UsdGeom
    except ImportError:
        raise MissingExtra("usd", "a file of USD") from None
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    remarks = comments(
        [*request.remarks, *(describe_transform(transform, "m") for transform in request.transforms)], ""
    )
    stage.GetRootLayer().documentation = "\n".join(remarks)
    trees = frame_trees(request.transforms, Tf.MakeValidIdentifier)
    roots = [_define_prims(stage, node, Sdf.Path.absoluteRootPath) for node in trees]
    stage.SetDefaultPrim(roots[0])
    text: str = stage.GetRootLayer().ExportToString()
    return text


def _define_prims(stage: Any, node: FrameNode, parents: Any) -> Any:
    """Define the prims of a frame and its descendants, and return the frame's prim."""
    from pxr import Gf, UsdGeom

    prim = UsdGeom.Xform.Define(stage, parents.AppendChild(node.name))
    if node.parent_from_frame is not None:
        x, y, z, w = node.parent_from_frame.quaternion.tolist()
        prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*node.parent_from_frame.translation.tolist()))
        prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(w, x, y, z))
    for child in node.children:
        _define_prims(stage, child, prim.GetPath())
    return prim.GetPrim()


EXPORTER = Exporter("frames of a USD stage, as text (.usda); needs the extra `usd`", export_text)
