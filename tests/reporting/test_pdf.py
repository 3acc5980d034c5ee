"""Tests of PDF files: the table of objects, and the positions of shapes."""

from __future__ import annotations

import re
import zlib

import numpy as np
import pytest

from basecal.reporting import pdf


@pytest.fixture(scope="module")
def pdf_bytes() -> bytes:
    """PDF with two pages of shapes."""
    drawing = pdf.page_content(
        [pdf.rectangle(10, 20, 40, 60)], [pdf.line(0, 0, 5, 5)], [pdf.text(10, 20, "a(b) ü 漢", 3.2)], 0.15
    )
    return pdf.document([((210.0, 297.0), drawing), ((100.0, 50.0), "")])


def drawings(data: bytes) -> list[str]:
    """Drawing commands of each page."""
    streams = re.findall(rb"/Length (\d+)>>\nstream\n(.*?)\nendstream", data, re.DOTALL)
    assert all(int(length) == len(stream) for length, stream in streams)
    return [zlib.decompress(stream).decode() for _, stream in streams]


def test_cross_reference_table_has_true_offsets(pdf_bytes: bytes) -> None:
    """Each offset of the table leads to the object of its number, and the end of the file to the table."""
    start = int(re.search(rb"startxref\n(\d+)\n%%EOF\n$", pdf_bytes)[1])
    table = pdf_bytes[start:]
    assert table.startswith(b"xref\n0 8\n0000000000 65535 f \n")
    offsets = [int(each) for each in re.findall(rb"(\d{10}) 00000 n \n", table)]
    assert len(offsets) == 7
    for number, offset in enumerate(offsets, start=1):
        assert pdf_bytes[offset:].startswith(b"%d 0 obj\n" % number)


def test_coordinates_are_millimetres_from_the_top(pdf_bytes: bytes) -> None:
    """A corner at (10, 20) mm of an A4 page is 28.35 points from the left and 785.2 from below."""
    first, second = drawings(pdf_bytes)
    a, _, _, d, e, f = map(float, first.split(" cm")[0].split())
    left, top, width, height = map(float, re.search(r"\n(.*) re f", first)[1].split())
    assert (a * left + e, d * top + f) == pytest.approx((28.3465, 785.197), abs=1e-3)
    assert (a * width, d * height) == pytest.approx((85.0394, -113.386), abs=1e-3)
    assert second.strip().endswith("cm")
    assert b"/MediaBox[0 0 283.4646 141.7323]" in pdf_bytes


def test_circle_is_accurate() -> None:
    """The curves of a circle stay within 3e-4 of its radius."""
    numbers = [float(word) for word in re.findall(r"-?\d+\.\d+", pdf.circle(10, 20, 5))]
    points = np.array(numbers).reshape(-1, 2)
    t = np.linspace(0, 1, 21)[:, None]
    for k in range(4):
        a, b, c, d = points[3 * k : 3 * k + 4]
        curve = (1 - t) ** 3 * a + 3 * t * (1 - t) ** 2 * b + 3 * t**2 * (1 - t) * c + t**3 * d
        np.testing.assert_allclose(np.linalg.norm(curve - [10, 20], axis=1), 5, atol=3e-4 * 5)
    np.testing.assert_allclose(points[-1], points[0])


def test_text_is_written_as_hexadecimal(pdf_bytes: bytes) -> None:
    """Text is written as hexadecimal numbers, so that brackets end nothing.

    An unsupported letter becomes a question mark.
    """
    shown = bytes.fromhex(re.search(r"<([0-9a-f]+)> Tj", drawings(pdf_bytes)[0])[1])
    assert shown.decode("cp1252") == "a(b) ü ?"


def test_document_is_deterministic() -> None:
    """The same pages give the same bytes, without a date or a random number."""
    assert pdf.document([((1, 1), "")]) == pdf.document([((1, 1), "")])
