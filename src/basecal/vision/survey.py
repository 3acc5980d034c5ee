"""Diagnosis of images in which a target is not found: other tags, other dictionaries, boards of another size."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

import cv2
import numpy as np

from basecal.cell.target import Target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.circles import circles_target
from basecal.vision.kinds import charuco, circles
from basecal.vision.kinds.charuco_layout import likely_boards
from basecal.vision.kinds.preprocessing import MARKER_SETS, Grey, Preprocessing, best_result, detect_markers, dictionary

_LISTED_IDS = 5  # ids listed in a sentence
_LEAST_MARKERS = 4  # markers in an image: clutter may resemble a few of a thousand codes of 16 cells
_ENOUGH_IMAGES = 2  # in which all dictionaries are searched if other images show the target
_FEWEST_OF_BOARD = 3  # markers that identify a dictionary: one or two may be clutter
_PREPROCESSINGS = (Preprocessing(), Preprocessing(stretched=True))  # each is tried with every dictionary
_SMALLEST_BOARD = 3  # corners per side of the chessboard from which OpenCV grows a board
_DARK_LEVEL = 40  # level of the 99th percentile below which an image is dark
_DARK_PERCENT = 99
_BLURRED_PX = 4.0  # sigma of edges: markers are read up to 3 px, whose codes have cells of some 8 px
_DENOISED_PX = 1.0  # sigma of the smoothing against pixel noise
_STEEPEST_PERCENT = 99.9  # percentile of gradients: some hundred pixels are on the sharpest edges


def describe_darkness(images: list[Grey]) -> str | None:
    """Clause about dark images; None if they are not."""
    top = max((float(np.percentile(image, _DARK_PERCENT)) for image in images), default=255.0)
    if top >= _DARK_LEVEL:
        return None
    level = f"{_DARK_PERCENT} % of their pixels are below level {top + 1:.0f} of 255"
    return f"the images are dark: {level}; more light, or a longer exposure"


def describe_blur(images: list[Grey]) -> str | None:
    """Clause about blur in all images, from the steepest gradients over the contrast; None if they are sharp."""
    widths = [width for image in images if (width := _edge_px(image)) is not None]
    if len(widths) < len(images) or min(widths, default=0.0) < _BLURRED_PX:
        return None
    return f"the images are blurred, their edges by about {min(widths):.0f} px: look at focus, and record at rest"


def _edge_px(image: Grey) -> float | None:
    """Sigma of the blur of the sharpest edges [px]; None if there is hardly any contrast.

    The steepest gradient of a step that is blurred by a Gaussian is its height over sqrt(2 pi) sigma. The variance of
    the smoothing against noise is subtracted.
    """
    low, high = np.percentile(image, (100 - _DARK_PERCENT, _DARK_PERCENT))
    if high - low < _DARK_LEVEL:
        return None
    smooth = cv2.GaussianBlur(image, (0, 0), _DENOISED_PX).astype(np.float64)
    down, right = np.gradient(smooth)
    slope = float(np.percentile(np.hypot(down, right), _STEEPEST_PERCENT))
    blur = float(high - low) / (np.sqrt(2 * np.pi) * max(slope, 1e-9))
    return float(np.sqrt(max(blur**2 - _DENOISED_PX**2, 0.0)))


def describe_print_error(images: list[Grey], target: Target) -> str | None:
    """Clause about markers of a target without markers, or about markers that appear twice; None if neither."""
    if target.is_point or _dictionary_name(target) is not None:
        return describe_repeats(images, target)
    return markers_instead(images[:_ENOUGH_IMAGES])


def _dictionary_name(target: Target) -> str | None:
    name: str | None = target.options.get("dictionary") if target.tags is None else target.tags.family
    return name


def describe_repeats(images: list[Grey], target: Target) -> str | None:
    """Clause about an image in which most markers of a target appear twice; None if there is no such image."""
    name = _dictionary_name(target)
    if name is None:
        return None
    detector = cv2.aruco.ArucoDetector(dictionary(name))
    for image in images:
        count = Counter(detect_markers(detector, image)[0].tolist())
        if 2 * sum(times > 1 for times in count.values()) > len(count):
            return "its markers are seen twice in one image: cover or remove the second print, or change its dictionary"
    return None


def other_tags(images: list[Grey], target: Target) -> str | None:
    """Clause about other tags, or tags of another family; None if there are none."""
    if target.tags is None:
        return None
    family, expected = target.tags.family, {int(number) for number in target.tags.numbers}
    found_numbers = _found_markers(images, family)
    if not found_numbers:
        return _other_set(images, family, "tag")
    verb = "tag {} is" if len(found_numbers) == 1 else "tags {} are"
    return f"{verb.format(_ids(found_numbers))} there, not {_ids(expected)}" if not expected & found_numbers else None


def other_charuco(images: list[Grey], target: Target) -> str | None:
    """Clause about a ChArUco board of another dictionary, layout or size; None if unknown."""
    options = target.options
    found_numbers, stated = _found_markers(images, options["dictionary"]), _marker_count(target)
    if not found_numbers:
        clause = _other_set(images, options["dictionary"], "marker")
        if clause is None:
            return None
        return f"no board of {options['dictionary']}; {clause}: write `dictionary: {clause.partition(' ')[0]}`"
    for board in (*_other_layouts(target), *likely_boards(images, target)):
        if max(found_numbers) < _marker_count(board) and any(
            charuco.detect(image, board) is not None for image in images
        ):
            (columns, rows), legacy = board.options["squares"], bool(board.options["legacy_pattern"])
            fields = {
                "squares": f"`squares: [{columns}, {rows}]`",
                "legacy_pattern": f"`legacy_pattern: {str(legacy).lower()}`",
                "dictionary": f"`dictionary: {board.options['dictionary']}`",
            }
            written = ", ".join(text for name, text in fields.items() if board.options[name] != options[name])
            return f"{_layout(board)} fit, not {_layout(target)}: write {written}"
    ids = f"markers {_ids(found_numbers)} of {options['dictionary']} are there"
    if max(found_numbers) < stated:
        return f"{ids}, but no corner between"
    return f"{ids}, the board stated has 0 to {stated - 1}: count its squares, squares: [columns, rows]"


def _marker_count(board: Target) -> int:
    columns, rows = board.options["squares"]
    return int(columns * rows // 2)


def _other_layouts(target: Target) -> Iterator[Target]:
    options = target.options
    columns, rows = options["squares"]
    legacy = bool(options["legacy_pattern"])
    for size, pattern in (((columns, rows), not legacy), ((rows, columns), legacy), ((rows, columns), not legacy)):
        yield charuco_target(size, options["square_m"], options["marker_m"], options["dictionary"], pattern)


def _layout(target: Target) -> str:
    columns, rows = target.options["squares"]
    return f"{columns}x{rows} squares{' with' if target.options['legacy_pattern'] else ' without'} legacy_pattern"


def markers_instead(images: list[Grey]) -> str | None:
    """Clause about markers in images of a target without markers; None if there are none."""
    other = _other_set(images, "", "marker")
    return None if other is None else f"{other}: write kind: charuco, aprilgrid or apriltag, whichever it is"


def other_chessboard(images: list[Grey], target: Target) -> str | None:
    """Clause about markers or a chessboard of another size; None if there is neither."""
    if markers := markers_instead(images):
        return markers
    columns, rows = target.options["corners"]
    stated = columns, rows
    sizes = Counter(size for image in images for size in _sizes_of_board(image, stated))
    size, times = max(sizes.items(), key=lambda each: each[1], default=((0, 0), 0))
    # A board that OpenCV grows from a few corners may be a part; the part differs between images.
    if times < min(len(images), 2) or sorted(size) == sorted(stated):
        return None
    return f"{max(size)}x{min(size)} inner corners are seen, not {stated[0]}x{stated[1]}"


def _sizes_of_board(image: Grey, stated_size: tuple[int, int]) -> list[tuple[int, int]]:
    """Size of a chessboard in an image: close to the stated one, or as OpenCV grows it; empty if there is none."""
    small = Preprocessing(0.5).apply(image)
    for size in _near_sizes(*stated_size):
        if min(size) >= _SMALLEST_BOARD and cv2.findChessboardCornersSB(small, size)[0]:
            return [size]
    smallest = (_SMALLEST_BOARD, _SMALLEST_BOARD)
    is_found, _, board = cv2.findChessboardCornersSBWithMeta(image, smallest, cv2.CALIB_CB_LARGER)
    # A board that did not grow may be clutter.
    return [(max(board.shape), min(board.shape))] if is_found and min(board.shape) > _SMALLEST_BOARD else []


def _near_sizes(columns: int, rows: int) -> list[tuple[int, int]]:
    """Sizes with one more column, row or both, then with one less."""
    return [(columns + a, rows + b) for a, b in ((1, 0), (0, 1), (1, 1), (-1, 0), (0, -1), (-1, -1))]


def other_circles(images: list[Grey], target: Target) -> str | None:
    """Clause about a grid of another size or pattern, or about markers; None if there is neither."""
    columns, rows = target.options["circles"]
    asymmetric = bool(target.options["asymmetric"])
    sizes = [(rows, columns), *_near_sizes(columns, rows)]
    candidates = [(size, asymmetric) for size in sizes]
    candidates += [(size, not asymmetric) for size in [(columns, rows), *sizes]]
    for size, is_asymmetric in candidates:
        if min(size) >= _SMALLEST_BOARD:
            other = circles_target(size, target.options["spacing_m"], asymmetric=is_asymmetric)
            if any(circles.has_grid(image, other) for image in images):
                return f"{_grid_phrase(other)} circles fits, not {_grid_phrase(target)}"
    return markers_instead(images)


def _grid_phrase(target: Target) -> str:
    columns, rows = target.options["circles"]
    return f"{'an asymmetric' if target.options['asymmetric'] else 'a symmetric'} grid of {columns}x{rows}"


def _found_markers(images: list[Grey], name: str) -> set[int]:
    """Markers of a dictionary that are in several images, or in an image with too many for clutter."""
    detector = cv2.aruco.ArucoDetector(dictionary(name))

    def search(image: Grey, _: Preprocessing) -> set[int]:
        """Numbers of the markers in an image."""
        return set(detect_markers(detector, image)[0].tolist())

    numbers_by_image = [best_result(image, _PREPROCESSINGS, search, 1) or set[int]() for image in images]
    count = Counter(number for each in numbers_by_image for number in each)
    repeated = {number for number, times in count.items() if times > 1 or len(images) == 1}
    return repeated.union(*(each for each in numbers_by_image if len(each) >= _LEAST_MARKERS))


def _other_set(images: list[Grey], stated_name: str, kind: str) -> str | None:
    """Clause about the dictionary with the most markers, the smallest that has them all; None if too few."""
    numbers_by_set: dict[tuple[str, ...], set[int]] = {}
    for names in MARKER_SETS:
        numbers_by_set[names] = set() if stated_name in names else _found_markers(images, names[-1])
        if len(numbers_by_set[names]) > _LEAST_MARKERS:
            break
    best_set = max(numbers_by_set, key=lambda names: len(numbers_by_set[names]))
    if len(numbers_by_set[best_set]) < (1 if kind == "tag" else _FEWEST_OF_BOARD):
        return None
    name = next(each for each in best_set if max(numbers_by_set[best_set]) < len(dictionary(each).bytesList))
    count = len(numbers_by_set[best_set])
    return f"{name} has {f'{count} {kind}s' if count > 1 else f'{kind} {max(numbers_by_set[best_set])}'} here"


def _ids(numbers: Iterable[int]) -> str:
    some = sorted(numbers)
    return ", ".join(map(str, some[:_LISTED_IDS])) + (", ..." if len(some) > _LISTED_IDS else "")
