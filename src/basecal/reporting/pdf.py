"""PDF files with filled and stroked shapes and text; lengths in millimetres from the top left corner of a page.

Source: ISO 32000-1:2008, 7.5 (file structure), 8.4 and 8.5 (graphics), 9.4 (text).
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from itertools import pairwise

_POINTS_PER_MM = 72 / 25.4
_KAPPA = 4 / 3 * (2**0.5 - 1)  # of a quarter circle by a Bezier curve, accurate to 3e-4 of the radius
_FONT = b"<</Type/Font/Subtype/Type1/BaseFont/Helvetica/Encoding/WinAnsiEncoding>>"


def rectangle(left: float, top: float, right: float, bottom: float) -> str:
    """The path of a rectangle."""
    return f"{left:.4f} {top:.4f} {right - left:.4f} {bottom - top:.4f} re"


def line(x0: float, y0: float, x1: float, y1: float) -> str:
    """The path of a line."""
    return f"{x0:.4f} {y0:.4f} m {x1:.4f} {y1:.4f} l"


def circle(x: float, y: float, radius: float) -> str:
    """The path of a circle, from four Bezier curves."""
    ends = ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 0))
    path = [f"{x + radius:.4f} {y:.4f} m"]
    for (a, b), (c, d) in pairwise(ends):
        curve = (a + _KAPPA * c, b + _KAPPA * d, c + _KAPPA * a, d + _KAPPA * b, c, d)
        at = [(x if k % 2 == 0 else y) + radius * value for k, value in enumerate(curve)]
        path.append(" ".join(f"{value:.4f}" for value in at) + " c")
    return " ".join(path) + " h"


def text(x: float, y: float, words: str, size_mm: float) -> str:
    """Text with its baseline starting at (x, y); characters outside Windows-1252 become question marks."""
    shown = words.encode("cp1252", "replace").hex()
    return f"BT /F1 {size_mm:g} Tf 1 0 0 -1 {x:.4f} {y:.4f} Tm <{shown}> Tj ET"


def page_content(fills: Iterable[str], strokes: Iterable[str], texts: Iterable[str], width_mm: float) -> str:
    """The drawing of a page: paths filled black, paths stroked `width_mm` wide, and texts."""
    stroke_lines = [f"{path} S" for path in strokes]
    return "\n".join([*(f"{path} f" for path in fills), f"{width_mm:g} w", *stroke_lines, *texts])


def document(pages: Sequence[tuple[tuple[float, float], str]]) -> bytes:
    """A PDF file of pages, each with width and height [mm] and drawing; equal pages give equal bytes."""
    count = len(pages)
    kids = " ".join(f"{4 + 2 * k} 0 R" for k in range(count))
    objects = [b"<</Type/Catalog/Pages 2 0 R>>", f"<</Type/Pages/Count {count}/Kids[{kids}]>>".encode(), _FONT]
    for number, ((width, height), drawing) in enumerate(pages):
        box = f"/MediaBox[0 0 {width * _POINTS_PER_MM:.4f} {height * _POINTS_PER_MM:.4f}]"
        resources = f"/Resources<</Font<</F1 3 0 R>>>>/Contents {5 + 2 * number} 0 R"
        objects.append(f"<</Type/Page/Parent 2 0 R{box}{resources}>>".encode())
        # Transform from points upwards from the bottom to millimetres downwards from the top.
        frame = f"{_POINTS_PER_MM:.6f} 0 0 {-_POINTS_PER_MM:.6f} 0 {height * _POINTS_PER_MM:.4f} cm\n"
        packed = zlib.compress((frame + drawing).encode("ascii"))
        objects.append(b"<</Filter/FlateDecode/Length %d>>\nstream\n%s\nendstream" % (len(packed), packed))
    # Objects are numbered from 1 and followed by a table of their offsets.
    out, offsets = bytearray(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n"), []
    for number, content in enumerate(objects, start=1):
        offsets.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (number, content)
    table = b"".join(b"%010d 00000 n \n" % offset for offset in offsets)
    start, size = len(out), len(objects) + 1
    out += b"xref\n0 %d\n0000000000 65535 f \n%s" % (size, table)
    out += b"trailer\n<</Size %d/Root 1 0 R>>\nstartxref\n%d\n%%%%EOF\n" % (size, start)
    return bytes(out)
