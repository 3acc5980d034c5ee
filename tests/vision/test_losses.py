"""Tests of the findings about images without detections."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.vision import losses
from basecal.vision.losses import SearchedImage, explain_no_target, image_findings
from vision_scenes import TARGETS, scene


def searched_images(found: int, missed: int, **more: bool) -> list[SearchedImage]:
    """Images of which the first `found` show a board and the next `missed` do not."""
    shown = [SearchedImage(k, "wrist", f"{k}.png", found=("board",), **more) for k in range(found)]
    return [*shown, *(SearchedImage(found + k, "wrist", f"{found + k}.png", missed=("board",)) for k in range(missed))]


@pytest.mark.parametrize(("found", "missed", "many"), [(10, 0, False), (8, 4, False), (7, 4, True), (1, 9, True)])
def test_loss_above_one_third_is_a_warning(found: int, missed: int, many: bool, tmp_path: Path) -> None:
    """Losing more than a third of the images is a warning, and is the first finding."""
    findings = list(image_findings(searched_images(found, missed), {"board": TARGETS["charuco"]}, tmp_path))
    codes = [(finding.code, finding.severity) for finding in findings]
    assert codes == [("few-images", "warning")] * many + [("dropped-sample", "info")] * (missed > 0)
    assert not many or findings[0].message.startswith(
        f"{missed} of {found + missed} images of 'wrist' show no target. Look at"
    )


def test_alternating_targets_lose_no_image(tmp_path: Path) -> None:
    """Two targets that a camera observes alternately lose no image, though each is missing in half of them."""
    pairs = [("one", "other"), ("other", "one")] * 4
    images = [
        SearchedImage(k, "wrist", "x.png", found=(seen,), missed=(not_seen,))
        for k, (seen, not_seen) in enumerate(pairs)
    ]
    findings = list(image_findings(images, {"one": TARGETS["charuco"], "other": TARGETS["tags"]}, tmp_path))
    assert [finding.about for finding in findings] == [("wrist", "other"), ("wrist", "one")]
    assert findings[0].message == "'other' is not found in 4 images of 'wrist': samples 0, 2, 4, 6."


def test_unusable_images_are_lost(tmp_path: Path) -> None:
    """Unusable images count as lost, each reason is given once, and lighting is not mentioned."""
    images = [*searched_images(2, 0), *(SearchedImage(k, "wrist", f"{k}.png", unusable="is missing") for k in (2, 3))]
    few, dropped = image_findings(images, {"board": TARGETS["charuco"]}, tmp_path)
    assert few.why == "Each of them, such as 2.png, is missing."
    assert few.do == ("Replace these images, or remove them from the recording.",)
    assert dropped.about == ("2", "3", "wrist")
    assert dropped.message == "Each of samples 2, 3, such as 2.png, is missing. They are left out for 'wrist'."


def test_single_unusable_image_states_its_path(tmp_path: Path) -> None:
    """The finding of a single unusable image has its path."""
    (finding,) = image_findings(
        [*searched_images(9, 0), SearchedImage(9, "wrist", "9.png", unusable="is empty")], {}, tmp_path
    )
    assert finding.message == "Sample 9: 9.png is empty. It is left out for 'wrist'."


def test_missing_targets_are_explained(tmp_path: Path) -> None:
    """An explanation exists if images are unusable or show another target, but not if one of them shows a target."""
    board = {"board": TARGETS["charuco"]}
    cv2.imwrite(str(tmp_path / "0.png"), np.full((480, 640), 128, np.uint8))
    assert explain_no_target(searched_images(0, 1), board, tmp_path) == ""
    cv2.imwrite(str(tmp_path / "0.png"), scene(TARGETS["legacy"]))
    assert "write `dictionary: DICT_5X5_50`" in explain_no_target(searched_images(0, 1), board, tmp_path)
    assert explain_no_target(searched_images(1, 1), board, tmp_path) == ""
    assert explain_no_target([], board, tmp_path) == ""


@pytest.mark.journey
def test_visible_other_target_is_named(tmp_path: Path) -> None:
    """If most images lack the target, the finding names the target that they show."""
    for k in range(1, 6):
        cv2.imwrite(str(tmp_path / f"{k}.png"), scene(TARGETS["legacy"]))
    (tmp_path / "3.png").write_bytes(b"no image")
    first, *_ = image_findings(searched_images(1, 5), {"board": TARGETS["charuco"]}, tmp_path)
    assert first.message == (
        "5 of 6 images of 'wrist' show no target. 'board': no board of DICT_4X4_50; "
        "DICT_5X5_50 has 20 markers here: write `dictionary: DICT_5X5_50`."
    )


def test_first_ten_rotated_images_are_listed(tmp_path: Path) -> None:
    """Of many samples with rotated images the first ten are listed."""
    (finding,) = image_findings(searched_images(12, 0, turned=True), {"board": TARGETS["charuco"]}, tmp_path)
    assert finding.code == "turned-images"
    assert finding.what.endswith("samples " + ", ".join(map(str, np.arange(10))) + ", ....")


@pytest.mark.parametrize(("count", "end"), [(10, "8, 9."), (11, "8, 9, ....")])
def test_at_most_ten_samples_are_listed(count: int, end: str, tmp_path: Path) -> None:
    """Of eleven samples the first ten are listed."""
    (finding,) = image_findings(searched_images(count, 0, turned=True), {}, tmp_path)
    assert finding.what.startswith(f"EXIF rotates {count} images of 'wrist'")
    assert finding.what.endswith(end)


def test_most_frequent_reason_comes_first(tmp_path: Path) -> None:
    """Each reason has its samples; if it applies to all images of a camera, this is stated instead."""
    faults = ["is empty", "is missing", "is missing", "is empty", "is missing"]
    images = [SearchedImage(k, "wrist", f"{k}.png", unusable=fault) for k, fault in enumerate(faults)]
    assert explain_no_target(images, {}, tmp_path) == (
        "each of samples 1, 2, 4, such as 1.png, is missing; each of samples 0, 3, such as 0.png, is empty"
    )
    assert explain_no_target(images[:1], {}, tmp_path) == "sample 0: 0.png is empty"
    assert explain_no_target(images[1:3], {}, tmp_path) == "each of them, such as 1.png, is missing"


@pytest.mark.parametrize(("missed", "surveyed"), [(9, [0, 3, 6]), (2, [0, 1]), (1, [0]), (5, [0, 1, 2])])
def test_three_images_across_the_recording_are_surveyed(
    missed: int, surveyed: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The survey reads images in which the target was missed. Its result is given for each target."""
    surveys: list[list[int]] = []

    def read(images: list[SearchedImage], folder: Path) -> list[int]:
        surveys.append([image.sample for image in images])
        return surveys[-1]

    monkeypatch.setattr(losses, "_read_images", read)
    monkeypatch.setattr(losses, "describe_other_targets", lambda images, target: "another board" if images else None)
    targets = {"board": TARGETS["charuco"], "other": TARGETS["tags"]}
    assert explain_no_target(searched_images(0, missed), targets, tmp_path) == "'board': another board"
    assert surveys == [surveyed, []]


@pytest.mark.parametrize(("found", "hinted"), [(5, False), (4, True)])
def test_survey_requires_loss_above_one_half(
    found: int, hinted: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Images are surveyed if more than half are lost; five of ten do not suffice."""
    monkeypatch.setattr(losses, "_read_images", lambda *_: [])
    monkeypatch.setattr(losses, "describe_other_targets", lambda *_: "another board")
    first, *_ = image_findings(searched_images(found, 10 - found), {"board": TARGETS["charuco"]}, tmp_path)
    assert first.code == "few-images"
    assert (first.do == ("'board': another board.",)) == hinted


def test_unusable_images_are_stated_as_cause(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An unusable image is the cause of the finding, not its advice. A single image is written in the singular."""
    monkeypatch.setattr(losses, "_read_images", lambda *_: [])
    unusable = SearchedImage(5, "wrist", "5.png", unusable="is empty")
    few, _ = image_findings([unusable], {"board": TARGETS["charuco"]}, tmp_path)
    assert (few.code, few.why) == ("few-images", "Sample 5: 5.png is empty.")
    (turned,) = image_findings([SearchedImage(5, "wrist", "5.png", found=("board",), turned=True)], {}, tmp_path)
    assert turned.what == "EXIF rotates 1 image of 'wrist' for display: sample 5."


def test_visible_target_suppresses_explanation(tmp_path: Path) -> None:
    """There is no explanation if an image shows a target, whatever the others lack, nor without images."""
    unusable = SearchedImage(5, "wrist", "5.png", unusable="is empty")
    assert explain_no_target([*searched_images(1, 0), unusable], {}, tmp_path) == ""
    assert explain_no_target([unusable], {}, tmp_path) == "sample 5: 5.png is empty"
    assert explain_no_target([], {"board": TARGETS["charuco"]}, tmp_path) == ""
