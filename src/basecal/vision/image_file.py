"""Grey images from files, or the reason why a file cannot be used; no content of a file raises an error."""

from __future__ import annotations

import os
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from basecal.bounded_file import MissingFile, read_bounded
from basecal.errors import DatasetError, InputError
from basecal.vision.decoder import decode
from basecal.vision.detection import Image
from basecal.vision.image_header import png_chunks, read_header

_JPEG, _PNG, _BMP, _RIFF = b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"BM", b"RIFF"
_SCAN = b"\xff\xda"
_TO_GREY = {3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}
_LARGEST_BYTES = 2**28  # 256 MiB: 16 bits and two channels of 64 megapixels
_MOST_PIXELS = 2**26  # 64 megapixels: the largest sensors of machine vision have that
_MOST_SCANS = 100  # of a JPEG, each of which covers all pixels; encoders write ten
_MOST_DECODED_BYTES = 2**28  # 256 MiB; decoders need two such buffers, and the grey image is a third
_MOST_FILE_NAMES = 10_000  # of a folder that are compared
_TURNED_ORIENTATIONS = range(2, 9)  # EXIF orientations other than the stored one


def read_bytes(path: Path) -> bytes | str:
    """Content of a file, or why it cannot be read; pipes, devices and files above the size limit are refused."""
    try:
        return read_bounded(path, _LARGEST_BYTES)
    except MissingFile:
        return f"is missing{_similar_path(path)}"
    except DatasetError as error:
        return error.reason


def _similar_path(path: Path) -> str:
    """Hint at a similar file or an empty or missing folder for a missing file, as the end of a sentence."""
    if not path.parent.is_dir():
        return ", as is its folder"
    try:
        with os.scandir(path.parent) as entries:
            names = [entry.name for entry in islice(entries, _MOST_FILE_NAMES)]
    except OSError:
        return ""
    if not names:
        return ", its folder is empty"
    others = {os.path.splitext(name)[1] for name in names if os.path.splitext(name)[0] == path.stem}
    return f" (did you mean {min(others)}?)" if others - {""} else ""


def grey_image(data: bytes | str, size_px: tuple[int, int] | None) -> Image | str:
    """Decode an image to grey, (h, w) of uint8 or uint16, or return the reason why it cannot be used.

    Pixels are in the order of the sensor; the EXIF orientation is ignored. That orientation is for display, whereas a
    lens is calibrated as it is mounted on its sensor.

    Args:
        data: Content of the file, or why it cannot be read.
        size_px: Required width and height; None for any.
    """
    if isinstance(data, str):
        return data
    if (reason := _refusal_reason(data, size_px)) is not None:
        return reason
    pixels, damage = decode(data)
    if pixels is None:
        return f"is damaged ({damage or 'its pixels cannot be read'})"
    if damage:
        return f"is damaged ({damage})"
    if pixels.dtype not in (np.uint8, np.uint16):
        return f"has pixels of type {pixels.dtype}, expected 8 or 16 bits"
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] not in _TO_GREY:
        return f"has {pixels.shape[2]} channels, expected grey or colour"
    return np.asarray(cv2.cvtColor(pixels, _TO_GREY[pixels.shape[2]]))


def is_turned(data: bytes) -> bool:
    """Whether the EXIF orientation rotates or mirrors an image for display."""
    image_header = read_header(data)
    return image_header is not None and image_header.orientation in _TURNED_ORIENTATIONS


def _refusal_reason(data: bytes, size_px: tuple[int, int] | None) -> str | None:
    """Why an image is refused before its pixels are decoded; None if it is not."""
    if not data:
        return "is empty"
    image_header = read_header(data)
    if image_header is None:
        return "is not an image (PNG, JPEG, TIFF, BMP, WebP, PGM or PPM)"
    width, height = image_header.size_px
    if min(width, height) < 1 or width * height > _MOST_PIXELS:
        return f"has {width} x {height} pixels, expected 1 to {_MOST_PIXELS // 2**20} million"
    if width * height * image_header.pixel_bytes > _MOST_DECODED_BYTES:
        mb = width * height * image_header.pixel_bytes // 2**20
        return f"has {mb} MB of pixels, expected at most {_MOST_DECODED_BYTES // 2**20}: store it grey, or with 8 bits"
    if data.startswith(_JPEG) and (scans := data.count(_SCAN)) > _MOST_SCANS:
        return f"has {scans} scans, expected at most {_MOST_SCANS}: store it again"
    return size_fault(image_header.size_px, size_px) or ("is truncated" if _is_cut(data) else None)


def size_fault(size: tuple[int, int], size_px: tuple[int, int] | None) -> str | None:
    """Why an image of this width and height does not match its camera's `size_px`; None if it does."""
    if size_px is None or size == tuple(size_px):
        return None
    return f"has {size[0]} x {size[1]} pixels, its camera {size_px[0]} x {size_px[1]}{_cause(size, size_px)}"


def _cause(size: tuple[int, int], size_px: tuple[int, int]) -> str:
    """Likely cause of a wrong image size, as the end of a sentence."""
    if size == (size_px[1], size_px[0]):
        return ": width and height look swapped between image and lens; pixels count as the sensor gave them"
    if size[0] * size_px[1] == size[1] * size_px[0]:
        scale = f"the lens seems to be of images scaled by {size_px[0] / size[0]:g}"
        return f": {scale}; use these images, or state size_px and the lens of the recorded images"
    return ""


def png_bytes(image: Image) -> bytes:
    """Encode an image, (h, w), as PNG.

    Raises:
        InputError: if its type is neither uint8 nor uint16.
    """
    is_encoded, data = cv2.imencode(".png", image)
    if not is_encoded:
        raise InputError(f"an image of type {image.dtype} cannot be written as PNG")
    return bytes(data.tobytes())


def write_png(path: Path, image: Image) -> None:
    """Write an image, (h, w), as PNG and create missing folders.

    Raises:
        InputError: if the file cannot be written.
    """
    try:
        data = png_bytes(image)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except InputError as error:
        raise InputError(f"{path} cannot be written: {error}") from None
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None


def _is_cut(data: bytes) -> bool:
    """Whether the end of an image is missing; decoders fill it with grey and report it only on stderr."""
    if data.startswith(_JPEG):
        return data.rfind(b"\xff\xd9") < data.rfind(_SCAN)
    if data.startswith(_PNG):
        # A decoder would allocate the stated length of a chunk even if the file is shorter.
        return all(name != b"IEND" for name, _, _ in png_chunks(data))
    if data.startswith(_RIFF):
        return len(data) < 8 + int.from_bytes(data[4:8], "little")
    return data.startswith(_BMP) and len(data) < int.from_bytes(data[2:6], "little")
