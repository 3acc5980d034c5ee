"""What the imports of lenses share: which camera a lens belongs to, and that it is of the pictures' size."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from basecal.cli.imported import finish_import
from basecal.errors import InputError

if TYPE_CHECKING:
    from basecal.cell import Cell
    from basecal.exchange.lens_files.stated import StatedLens
    from basecal.geometry import SE3

LensStatus = Literal["fixed", "free"]
_HEADER_BYTES = 2**24  # of a picture in which its size stands: metadata before it fill less


def import_lens(
    folder: Path,
    lens: StatedLens,
    source: str,
    *,
    camera: str | None,
    on: str | None,
    status: LensStatus,
    mount: SE3 | None = None,
) -> int:
    """The exit code, after a lens is in the cell.

    Args:
        folder: The cell, or where one is to be made.
        lens: What was read.
        source: The file, as the user named it.
        camera: Name of the camera; the only one of the cell where None.
        on: What carries a camera that is new.
        status: Whether its intrinsics are fixed, or free with these for a start.
        mount: Where the camera is roughly, in what carries it.

    Raises:
        InputError: if it does not fit the cell, or the pictures are of another size.
    """
    from basecal.exchange.importing.lens import chosen_camera, imported_lens

    cell = known_cell(folder)
    if cell is not None and lens.camera.size_px is not None:
        _check_pictures(folder, cell, chosen_camera(cell, camera), lens.camera.size_px, source)
    imported = imported_lens(cell, lens, source, camera, on, status, mount)
    return finish_import(folder, imported, advice="check that the file is of this camera")


def known_cell(folder: Path) -> Cell | None:
    """The cell of a folder; None where there is none yet."""
    from basecal.cell.files import read_cell

    return read_cell(folder) if (folder / "cell.yaml").exists() else None


def _check_pictures(folder: Path, cell: Cell, camera: str, size_px: tuple[int, int], source: str) -> None:
    """Nothing, where the first picture of the camera is of this size, or none can be read.

    Raises:
        InputError: if it is of another size.
    """
    from basecal.cell.files import read_recording

    if not (folder / "recording" / "samples.jsonl").exists():
        return
    samples = read_recording(folder, cell).samples
    image = next((sample.images[camera] for sample in samples if camera in sample.images), None)
    size = None if image is None else picture_size(folder / image)
    if size is not None and size != tuple(size_px):
        sizes = f"{source} is of {size_px[0]} x {size_px[1]} px, {image} has {size[0]} x {size[1]}"
        raise InputError(f"{sizes}: import the calibration of pictures of this size; a lens cannot be carried over")


def picture_size(path: Path) -> tuple[int, int] | None:
    """Width and height of a picture [px]; None where they cannot be read."""
    from basecal.vision.image_header import header

    try:
        with path.open("rb") as file:
            told = header(file.read(_HEADER_BYTES))
    except OSError:
        return None
    return None if told is None else told.size_px
