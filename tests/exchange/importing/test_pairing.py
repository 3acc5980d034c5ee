"""Tests of pairing rows with samples."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.cell import PoseObservation, RobotState, Sample
from basecal.errors import InputError
from basecal.exchange.importing.imported import Imported, PairingMethod, Row
from basecal.exchange.importing.pairing import _pairing_method, is_same_state, pair, plain_name
from basecal.geometry import SE3

TIMED = [Sample(n, 10.0 + n) for n in (0, 1, 2)]
IMAGES = [Sample(n, None, {}, (), {"cam": f"recording/images/cam/IMG_{n}.png"}) for n in (0, 1, 2)]


def rows(*each: Row, by: PairingMethod | None = None) -> Imported:
    return Imported("table.csv", "rows", each, by=by)


def test_first_rows_become_samples() -> None:
    """Without a recording rows are numbered from 0, or by their own numbers."""
    assert pair(rows(Row(), Row()), [], {}).numbers == (0, 1)
    assert pair(rows(Row(sample=4), Row(sample=9)), [], {}).numbers == (4, 9)


def test_rows_pair_in_order() -> None:
    """Equal counts of rows and samples are paired in order; other counts are an error with both."""
    assert pair(rows(Row(), Row(), Row()), IMAGES, {}).numbers == (0, 1, 2)
    with pytest.raises(InputError, match=r"table.csv holds 2, the recording has 3 samples"):
        pair(rows(Row(), Row()), IMAGES, {})


def test_rows_pair_by_image_name() -> None:
    """The image name decides, with or without folder and ending; unpaired rows and samples are reported."""
    paired = pair(rows(Row(image="IMG_2.png"), Row(image="x/IMG_0"), Row(image="IMG_7.png")), IMAGES, {})
    assert (paired.by, paired.numbers) == ("image", (2, 0, None))
    assert paired.unpaired_rows == ("IMG_7.png",)
    assert paired.unpaired_samples == (1,)


def test_unknown_image_names_become_samples() -> None:
    """A table, or a folder paired by name, with other images makes new samples; a folder alone is paired in order."""
    others = [Row(image="a.png"), Row(image="b.png"), Row(image="c.png")]
    assert pair(rows(*others), IMAGES, {}).numbers == (3, 4, 5)
    folder = [Row(images={"two": Path(row.image or "")}, image=row.image) for row in others]
    assert pair(rows(*folder, by="image"), IMAGES, {}).numbers == (3, 4, 5)
    assert pair(rows(*folder), IMAGES, {}).numbers == (0, 1, 2)
    with pytest.raises(InputError, match=r"the recording names no images to pair by\. Omit `--by name`"):
        pair(rows(*folder, by="image"), [Sample(0), Sample(1), Sample(2)], {})


def test_images_pair_by_names_of_earlier_table() -> None:
    """Images are paired with the samples whose rows named them before."""
    paired = pair(rows(Row(image="b.png"), Row(image="a.png")), [Sample(0), Sample(1)], {"a": 0, "b": 1})
    assert paired.numbers == (1, 0)


def test_rows_pair_by_nearest_time() -> None:
    """The nearest in time are paired, up to half a period of a slow camera; others are reported."""
    paired = pair(rows(Row(stamp_s=12.01), Row(stamp_s=9.97), Row(stamp_s=11.4)), TIMED, {})
    assert (paired.by, paired.numbers) == ("stamp_s", (2, 0, None))
    assert paired.unpaired_rows == ("row 3 (11.400 s)",)
    with pytest.raises(InputError, match="no time of a row is within"):
        pair(rows(Row(stamp_s=1e9)), TIMED, {})


def test_samples_without_time_are_left_out() -> None:
    """Rows paired by time use only timed samples; without any the message states this."""
    paired = pair(rows(Row(stamp_s=11.0), Row(stamp_s=12.0), by="stamp_s"), [Sample(7), *TIMED], {})
    assert (paired.numbers, paired.unpaired_samples) == ((1, 2), (7, 0))
    with pytest.raises(InputError, match="no recorded sample has a time to pair by"):
        pair(rows(Row(stamp_s=11.0), by="stamp_s"), [Sample(7)], {})


def test_two_rows_of_one_sample_are_refused() -> None:
    """The error names both rows."""
    with pytest.raises(InputError, match=r"two rows belong to sample 1 \(IMG_1.png, IMG_1\)"):
        pair(rows(Row(image="IMG_1.png"), Row(image="IMG_1")), IMAGES, {})


def test_requested_pairing_method_wins() -> None:
    """The requested method takes precedence over the keys of the rows."""
    assert pair(rows(*[Row(image="IMG_2")] * 3, by="order"), IMAGES, {}).numbers == (0, 1, 2)


def test_streams_get_new_lines() -> None:
    """Numbers continue after the recorded ones; a recorded robot is not recorded again at the same times."""
    samples = [Sample(7, 1.0, {"a": RobotState(SE3.identity())})]
    new = Imported("b.csv", "", (Row({"b": RobotState(SE3.identity())}, stamp_s=1.0),) * 2, is_stream=True)
    assert pair(new, samples, {}).numbers == (8, 9)
    again = Imported("a.csv", "", (Row({"a": RobotState(SE3.identity())}, stamp_s=1.0),), is_stream=True)
    with pytest.raises(InputError, match="robot 'a' is recorded already: add --session"):
        pair(again, samples, {})
    assert pair(replace(shift_times(again, 9.0), is_session=True), samples, {}).numbers == (8,)
    with pytest.raises(InputError, match="its times lie within those that are recorded"):
        pair(replace(again, is_session=True), samples, {})


def shift_times(imported: Imported, stamp_s: float) -> Imported:
    return replace(imported, rows=tuple(replace(row, stamp_s=stamp_s) for row in imported.rows))


def test_session_makes_new_samples() -> None:
    """A session has any length, and later rows are paired with those of its samples that lack them."""
    first = [Sample(n, None, {"a": at(n), "b": at(n)}) for n in range(3)]
    day_two = rows(*[Row({"a": at(n)}) for n in (7, 8)])
    with pytest.raises(InputError, match="robot 'a' is recorded already: add --session for other samples"):
        pair(day_two, first, {})
    assert pair(replace(day_two, is_session=True), first, {}).numbers == (3, 4)
    both = [*first, Sample(3, None, {"a": at(7)}), Sample(4, None, {"a": at(8)})]
    assert pair(rows(Row({"b": at(5)}), Row({"b": at(6)})), both, {}).numbers == (3, 4)


def test_complete_rows_need_no_pairing() -> None:
    """Rows with a robot and a view form a session of their own, unless they are recorded already."""
    seen = PoseObservation("cam", "tag", SE3.identity())
    first = [Sample(n, None, {"a": at(n)}, (seen,)) for n in range(3)]
    assert pair(rows(*[Row({"b": at(n)}, (seen,)) for n in range(2)]), first, {}).numbers == (3, 4)
    again = rows(*[Row({"a": at(n)}, (seen,)) for n in range(3)])
    with pytest.raises(InputError, match="recorded already: add --session"):
        pair(again, first, {})
    with pytest.raises(InputError, match="recorded already: nothing needs to be imported"):
        pair(replace(again, is_session=True), first, {})


def test_second_camera_with_equal_poses_joins_samples() -> None:
    """A robot at its recorded poses is not recorded again."""
    first = [Sample(n, None, {"a": at(n)}, (PoseObservation("one", "tag", SE3.identity()),)) for n in range(3)]
    second = PoseObservation("two", "tag", SE3.identity())
    assert pair(rows(*[Row({"a": at(n)}, (second,)) for n in range(3)]), first, {}).numbers == (0, 1, 2)


def at(place: float) -> RobotState:
    return RobotState(SE3.from_rotvec([0, 0, 0.1 * place], [0.1 * place, 0, 0.4]))


def test_images_pair_with_samples_of_camera_robot() -> None:
    """Two arms were recorded separately with three and two samples; a count that matches neither is an error."""
    apart = [Sample(n, None, {"left" if n < 3 else "right": at(0.1 * n)}) for n in range(5)]

    def folder(count: int) -> Imported:
        """Return an import of this many images of a camera on the right arm."""
        of_folder = tuple(Row(images={"eye": Path(f"{n}.png")}, image=f"{n}.png") for n in range(1, count + 1))
        return Imported("photos", "", of_folder, cell={"cameras": {"eye": {"on": "right"}}})

    paired = pair(folder(2), apart, {})
    assert (paired.by, paired.numbers, paired.unpaired_samples) == ("order", (3, 4), ())
    assert pair(folder(5), apart, {}).numbers == (0, 1, 2, 3, 4)
    with pytest.raises(InputError, match="photos holds 4, the recording has 5 samples"):
        pair(folder(4), apart, {})


@pytest.mark.parametrize(("off_s", "number"), [(0.0625, None), (0.05, 1), (-0.05, 1), (0.0, 1)])
def test_times_match_within_half_period(off_s: float, number: int | None) -> None:
    """The tolerance is half a period of ten images per second, in either direction."""
    samples = [Sample(1, 0.0), Sample(2, 50.0)]
    assert pair(rows(Row(stamp_s=off_s), Row(stamp_s=50.0)), samples, {}).numbers == (number, 2)


def test_nearer_of_two_rows_is_paired() -> None:
    """The other row is unpaired, though no other sample is nearer."""
    found = pair(rows(Row(stamp_s=11.03), Row(stamp_s=11.01), Row(stamp_s=10.02)), TIMED, {})
    assert found.numbers == (None, 1, 0)
    assert found.unpaired_rows == ("row 1 (11.030 s)",)
    assert found.unpaired_samples == (2,)


@pytest.mark.parametrize(
    ("rows_timed", "samples_timed", "by"), [(True, True, "stamp_s"), (False, True, "order"), (True, False, "order")]
)
def test_times_pair_only_if_all_are_timed(rows_timed: bool, samples_timed: bool, by: str) -> None:
    """One row or sample without a time makes it pairing by order."""
    samples = [*TIMED[:2], TIMED[2] if samples_timed else Sample(2)]
    made = rows(Row(stamp_s=10.0), Row(stamp_s=11.0), Row(stamp_s=12.0 if rows_timed else None))
    found = pair(made, samples, {})
    assert (found.by, found.numbers) == (by, (0, 1, 2))


def test_rows_pair_by_sample_number() -> None:
    """Numbers pair if all rows have one, including new ones; with one missing the order counts."""
    found = pair(rows(Row(sample=2), Row(sample=0), Row(sample=7)), IMAGES, {})
    assert (found.by, found.numbers, found.unpaired_samples) == ("sample", (2, 0, 7), (1,))
    found = pair(rows(Row(sample=2), Row(sample=0), Row()), IMAGES, {})
    assert (found.by, found.numbers) == ("order", (0, 1, 2))
    full = [Sample(n, None, {"a": at(n)}) for n in range(2)]
    assert pair(rows(Row({"a": at(0)}, sample=0)), full, {}, replace=True).numbers == (0,)


def test_image_names_ignore_folder_and_ending() -> None:
    """Both kinds of slash are recognised."""
    assert [plain_name(name) for name in ("a/b.c.png", "a\\b.PNG", "b", ".b")] == ["b.c", "b", "b", ".b"]


@pytest.mark.parametrize(("off", "is_same"), [(0.9e-9, True), (-1.1e-9, False)])
def test_states_are_equal_within_rounding(off: float, is_same: bool) -> None:
    """Joint states or poses of the same kind are compared; a larger tolerance may be given."""
    one, other = (RobotState(joints_rad=np.array([1.0, 2.0 + each])) for each in (0.0, off))
    assert is_same_state(one, other) == is_same
    assert is_same_state(one, other, 1e-6)
    assert not is_same_state(one, RobotState(SE3.identity()))
    moved = RobotState(SE3.from_rotvec([0, 0, 0], [off, 0, 0]))
    assert is_same_state(moved, RobotState(SE3.identity())) == is_same


@pytest.mark.parametrize(
    ("begin_s", "end_s", "is_apart"),
    [(2.5, 3.0, True), (2.0, 3.0, False), (-1.0, 0.0, False), (-1.0, -0.5, True), (0.5, 0.6, False)],
)
def test_streams_need_separate_times(begin_s: float, end_s: float, is_apart: bool) -> None:
    """A stream must lie before or after the recording, without touching it."""
    state = {"a": RobotState(SE3.identity())}
    recorded = [Sample(0, 0.0, state), Sample(1, 2.0, state)]
    stream = Imported(
        "a.csv", "", (Row(state, stamp_s=begin_s), Row(state, stamp_s=end_s)), is_stream=True, is_session=True
    )
    if is_apart:
        assert pair(stream, recorded, {}).numbers == (2, 3)
    else:
        with pytest.raises(InputError, match="its times lie within those that are recorded"):
            pair(stream, recorded, {})


def test_session_with_one_new_row_is_accepted() -> None:
    """Copies are refused only if all rows are copies; other robots, other views and moved arms are new."""
    seen, other = (PoseObservation(camera, "tag", SE3.identity()) for camera in ("one", "two"))
    recorded = [Sample(n, None, {"a": at(n), "b": at(n)}, (seen,)) for n in range(2)]

    def session(*states: dict[str, RobotState], view: PoseObservation = seen) -> tuple[int | None, ...]:
        """Return the sample numbers of a session."""
        return pair(replace(rows(*[Row(each, (view,)) for each in states]), is_session=True), recorded, {}).numbers

    assert session({"a": at(0)}, {"a": at(5)}) == (2, 3)
    assert session({"a": at(0)}, view=other) == (2,)
    assert session({"a": at(0), "c": at(0)}) == (2,)
    assert session({"a": at(0), "b": at(1)}) == (2,)
    with pytest.raises(InputError, match="nothing needs to be imported"):
        session({"a": at(1)}, {"a": at(0), "b": at(0)})


def test_pairing_method_follows_row_keys() -> None:
    """Images pair by name if any is known, tables by name, then by sample, by time, and by order."""
    path, timed = Path("a.png"), Sample(0, 1.0)
    table, folder = Row(image="a.png", sample=1, stamp_s=1.0), Row(image="a.png", images={"cam": path})
    other = Row(image="b.png", images={"cam": path})
    assert _pairing_method([table], [timed], {"c": 0}) == "image"
    assert _pairing_method([folder, other], [timed], {"a": 0}) == "image"
    assert _pairing_method([folder], [timed], {"c": 0}) == "order"
    assert _pairing_method([table], [timed], {}) == "sample"
    assert _pairing_method([table, Row(sample=1)], [timed], {"a": 0}) == "sample"
    assert _pairing_method([Row(stamp_s=1.0)], [timed], {}) == "stamp_s"
    for rows, samples in (
        ([Row(stamp_s=1.0), Row()], [timed]),
        ([Row(stamp_s=1.0)], [timed, Sample(1)]),
        ([], [timed]),
    ):
        assert _pairing_method(rows, samples, {"a": 0}) == "order"
    assert _pairing_method([Row(stamp_s=1.0)], [], {}) == "order"
