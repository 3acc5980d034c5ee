"""Tests of the detection of targets in the images of a recording."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import basecal.vision.detect as detect_module
from basecal.cell.cell import Cell, CellCamera, CellTarget, Intrinsics, Robot
from basecal.cell.recording import CandidateObservation, PixelObservation, PoseObservation, Recording, Sample
from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.led import led_target
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.vision.detect import detect
from basecal.vision.draw.led import LedSettings, render_led
from basecal.vision.draw.render import RenderSettings, render
from vision_scenes import PLAIN, TARGETS, with_exif

TAG = apriltag_target("tag36h11", [(2, 0.1, SE3.identity())])
CELL = Cell(
    "eye",
    {"eye": Robot("eye"), "hand": Robot("hand")},
    cameras={
        "wrist": CellCamera("wrist", "eye", size_px=(640, 480), intrinsics=Intrinsics(camera=PLAIN)),
        "depth": CellCamera("depth", "world"),
    },
    targets={"tag": CellTarget("tag", "hand", target=TAG), "far": CellTarget("far", "hand")},
)
LIT = replace(CELL, targets={"light": CellTarget("light", "hand", target=led_target())})


def seen_at(depth: float) -> SE3:
    return SE3(np.eye(3), np.array([0.02, 0.01, depth]))


def image(depth: float) -> np.ndarray:
    return render(PLAIN, TAG, seen_at(depth), RenderSettings(noise=1.0))


def recording(folder: Path, *images: np.ndarray | None) -> Recording:
    """Recording with a sample for each image; None is a missing file."""
    samples = []
    for index, picture in enumerate(images):
        if picture is not None:
            cv2.imwrite(str(folder / f"{index}.png"), picture)
        samples.append(Sample(index, images={"wrist": f"{index}.png"}))
    return Recording(tuple(samples))


def ids_of(sample: Sample) -> list[list[int]]:
    return [each.ids.tolist() for each in sample.observations if isinstance(each, PixelObservation)]


def test_detections_stay_with_their_samples(tmp_path: Path) -> None:
    """A view without the target gets no observation, and the following views stay with their own samples."""
    blank = np.full((480, 640), 100, np.uint8)
    depths = (0.4, None, 0.6, 0.8)
    found = detect(CELL, recording(tmp_path, *(blank if depth is None else image(depth) for depth in depths)), tmp_path)
    assert [ids_of(sample) for sample in found.samples] == [[[8, 9, 10, 11]], [], [[8, 9, 10, 11]], [[8, 9, 10, 11]]]
    for sample, depth in zip(found.samples, depths, strict=True):
        for each in sample.observations:
            assert isinstance(each, PixelObservation)
            np.testing.assert_allclose(each.pixels, PLAIN.project(seen_at(depth or 0) @ TAG.points), atol=0.05)
            assert each.sigma_px is not None
            assert np.all((each.sigma_px > 0.001) & (each.sigma_px < 0.1))
    (finding,) = found.findings
    assert (finding.code, finding.severity, finding.about) == ("dropped-sample", "info", ("wrist", "tag"))
    assert "sample 1" in finding.message


BAD = {
    "missing": (None, "is missing"),
    "empty": (b"", "is empty"),
    "text": (b"not an image", "is not an image"),
    "video": (b"\x00\x00\x00\x18ftypmp42" + bytes(1000), "is not an image"),
    "cut": (bytes(cv2.imencode(".png", image(0.5))[1])[:5000], "is truncated"),
    "small": (bytes(cv2.imencode(".png", image(0.5)[:400])[1]), "has 640 x 400 pixels, its camera 640 x 480"),
}


@pytest.mark.parametrize("bad", list(BAD))
def test_unusable_image_is_reported(bad: str, tmp_path: Path) -> None:
    """An unusable image is a finding with its path and the reason; the other images are searched."""
    data, reason = BAD[bad]
    views = recording(tmp_path, image(0.5), None, image(0.6))
    if data is not None:
        (tmp_path / "1.png").write_bytes(data)
    found = detect(CELL, views, tmp_path)
    assert [len(sample.observations) for sample in found.samples] == [1, 0, 1]
    (finding,) = found.findings
    assert (finding.code, finding.severity, finding.about) == ("dropped-sample", "info", ("1", "wrist"))
    assert f"1.png {reason}" in finding.message


@pytest.mark.parametrize("depth", ["sixteen", "colour"])
def test_sixteen_bit_and_colour_images_are_searched(depth: str, tmp_path: Path) -> None:
    """Detections in images of 16 bits and in colour are those in grey images of 8 bits."""
    grey = image(0.5)
    other = grey.astype(np.uint16) * 257 if depth == "sixteen" else np.repeat(grey[..., None], 3, axis=2)
    one, two = detect(CELL, recording(tmp_path, grey, other), tmp_path).samples
    assert isinstance(one.observations[0], PixelObservation)
    assert isinstance(two.observations[0], PixelObservation)
    np.testing.assert_allclose(one.observations[0].pixels, two.observations[0].pixels, atol=0.02)


def test_recorded_observation_is_kept(tmp_path: Path) -> None:
    """A recorded observation is unchanged, and its image is not read."""
    known = PoseObservation("wrist", "tag", seen_at(0.3))
    views = Recording((Sample(0, observations=(known,), images={"wrist": "none.png"}),))
    found = detect(CELL, views, tmp_path)
    assert found.samples[0].observations == (known,)
    assert found.findings == ()


def test_images_of_camera_without_lens_are_skipped(tmp_path: Path) -> None:
    """Images of a camera without intrinsics are not searched, because their pixels carry no information."""
    views = Recording((Sample(0, images={"depth": "none.png"}),))
    assert detect(CELL, views, tmp_path).findings == ()


def test_background_image_removes_other_lights(tmp_path: Path) -> None:
    """A constant lamp is a candidate beside the LED, unless there is an image with the LED off."""
    light, lamp = np.array([0.1, 0.05, 1.0]), np.array([-0.2, 0.1, 1.0])
    exposed = LedSettings(photons=2e4, spot_px=1.5, photons_per_level=10)
    for name, points in (("on", [light, lamp]), ("off", [lamp])):
        cv2.imwrite(str(tmp_path / f"{name}.png"), render_led(PLAIN, np.array(points), exposed, len(points)))
    images, background = {"wrist": "on.png"}, {"wrist": "off.png"}
    views = Recording((Sample(0, images=images), Sample(1, images=images, background=background)))
    alone, pair = (sample.observations[0] for sample in detect(LIT, views, tmp_path).samples)
    assert isinstance(alone, CandidateObservation)
    assert isinstance(pair, PixelObservation)
    np.testing.assert_allclose(pair.pixels, [PLAIN.project(light)], atol=0.1)
    lost = replace(views, samples=(Sample(2, images=images, background={"wrist": "gone.png"}),))
    assert "gone.png is missing" in detect(LIT, lost, tmp_path).findings[1].message


@pytest.mark.journey
def test_second_detection_uses_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No image is searched twice. A different image, target or size is searched anew."""
    calls = []

    def counted(*given: object) -> object:
        calls.append(given)
        return find(*given)

    find = detect_module.find_target
    monkeypatch.setattr(detect_module, "find_target", counted)
    views = recording(tmp_path, image(0.5), np.zeros((480, 640), np.uint8))
    first, again = (detect(CELL, views, tmp_path) for _ in range(2))
    assert len(calls) == 2
    assert first.findings == again.findings
    one, two = first.samples[0].observations[0], again.samples[0].observations[0]
    assert isinstance(one, PixelObservation)
    assert isinstance(two, PixelObservation)
    np.testing.assert_array_equal(one.pixels, two.pixels)
    np.testing.assert_array_equal(one.sigma_px, two.sigma_px)
    other = apriltag_target("tag36h11", [(3, 0.1, SE3.identity())])
    detect(replace(CELL, targets={"tag": CellTarget("tag", "hand", target=other)}), views, tmp_path)
    assert len(calls) == 4
    narrow = replace(CELL, cameras={"wrist": replace(CELL.cameras["wrist"], size_px=(600, 480))})
    assert [f.code for f in detect(narrow, views, tmp_path).findings] == ["few-images", "dropped-sample"]


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"pixels": [[1]]}', '{"ids": [1], "pixels": [[1, 2]], "sigma_px": []}']
)
def test_damaged_cache_is_rewritten(text: str, tmp_path: Path) -> None:
    """A cached detection that cannot be read is detected and written again."""
    views = recording(tmp_path, image(0.5))
    detect(CELL, views, tmp_path)
    (kept,) = (tmp_path / "derived" / "detections").iterdir()
    good = kept.read_text()
    kept.write_text(text)
    assert ids_of(detect(CELL, views, tmp_path).samples[0]) == [[8, 9, 10, 11]]
    assert json.loads(kept.read_text()) == json.loads(good)


def test_detection_works_without_cache_folder(tmp_path: Path) -> None:
    """Detection succeeds if the cache cannot be written."""
    (tmp_path / "derived").write_text("a file where a folder should be")
    assert ids_of(detect(CELL, recording(tmp_path, image(0.5)), tmp_path).samples[0]) == [[8, 9, 10, 11]]


def test_progress_is_reported_per_sample(tmp_path: Path) -> None:
    """Progress is reported after every sample and after the survey.

    The folder of the images is taken from the recording, or is required.
    """
    views = recording(tmp_path, image(0.5), image(0.7))
    steps: list[tuple[int, int]] = []
    detect(CELL, replace(views, folder=str(tmp_path)), progress=lambda done, of: steps.append((done, of)))
    assert steps == [(1, 3), (2, 3), (3, 3)]
    with pytest.raises(InputError, match="folder of the images is unknown"):
        detect(CELL, views)


def test_two_targets_in_one_image_are_detected(tmp_path: Path) -> None:
    """One camera may observe several targets in one image."""
    both = replace(CELL, targets={**CELL.targets, "board": CellTarget("board", "hand", target=TARGETS["charuco"])})
    tag = render(PLAIN, TAG, SE3(np.eye(3), np.array([0.2, 0.0, 0.7])))
    board = render(PLAIN, TARGETS["charuco"], SE3(np.eye(3), np.array([-0.3, -0.14, 0.6])))
    picture = np.where(np.arange(640) < 320, board, tag)
    (sample,) = detect(both, recording(tmp_path, picture), tmp_path).samples
    assert {each.target for each in sample.observations} == {"tag", "board"}


@pytest.mark.journey
def test_wrong_tag_id_is_the_first_finding(tmp_path: Path) -> None:
    """If the stated tag differs from the one in the images, the first finding is a warning with the visible tag."""
    views = recording(tmp_path, *(image(depth) for depth in (0.4, 0.5, 0.6, 0.7)))
    other = apriltag_target("tag36h11", [(0, 0.1, SE3.identity())])
    found = detect(replace(CELL, targets={"tag": CellTarget("tag", "hand", target=other)}), views, tmp_path)
    first = found.findings[0]
    assert (first.code, first.severity, first.about) == ("few-images", "warning", ("wrist",))
    assert first.message == "4 of 4 images of 'wrist' show no target. 'tag': tag 2 is there, not 0."


@pytest.mark.filterwarnings("error")
def test_damaged_image_is_dropped(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A JPEG of which half is missing is a finding with its path, and no decoder prints anything."""
    views = recording(tmp_path, *(image(depth) for depth in (0.4, 0.5, 0.6, 0.7)))
    data = bytes(cv2.imencode(".jpg", image(0.5))[1])
    (tmp_path / "1.png").write_bytes(data[: len(data) // 2] + data[-2:])
    found = detect(CELL, views, tmp_path)
    assert [len(sample.observations) for sample in found.samples] == [1, 0, 1, 1]
    (finding,) = found.findings
    assert finding.code == "dropped-sample"
    assert "Sample 1: 1.png is damaged (premature end of data segment)" in finding.message
    assert capfd.readouterr() == ("", "")


def test_exif_rotated_images_are_reported(tmp_path: Path) -> None:
    """Images with an EXIF rotation are searched as stored, also from the cache, and are reported."""
    views = recording(tmp_path, image(0.5), image(0.6))
    (tmp_path / "0.png").write_bytes(with_exif(bytes(cv2.imencode(".jpg", image(0.5))[1]), 6))
    for _ in range(2):
        found = detect(CELL, views, tmp_path)
        assert [ids_of(sample) for sample in found.samples] == [[[8, 9, 10, 11]]] * 2
        (finding,) = found.findings
        assert (finding.code, finding.severity, finding.about) == ("turned-images", "info", ("wrist",))
        assert "EXIF rotates 1 image of 'wrist'" in finding.message


@pytest.mark.journey
def test_search_stops_if_first_images_show_another_target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only eight of 25 images that show another tag are searched.

    All are searched if there are few, or if one shows the target.
    """
    calls = []

    def counted(*given: object) -> object:
        calls.append(given)
        return find(*given)

    find = detect_module.find_target
    monkeypatch.setattr(detect_module, "find_target", counted)
    views = recording(tmp_path, *[image(0.5)] * 25)
    for number, data in enumerate(Path(tmp_path).glob("*.png")):
        data.write_bytes(data.read_bytes() + bytes([number]))
    other = apriltag_target("tag36h11", [(3, 0.1, SE3.identity())])
    stated = replace(CELL, targets={"tag": CellTarget("tag", "hand", target=other)})
    found = detect(stated, views, tmp_path)
    assert len(calls) == 8
    assert found.findings[0].message.startswith("8 of 8 images of 'wrist' show no target. 'tag': tag 2 is there, not 3")
    assert [sample.sample for sample in found.samples] == list(range(25))
    calls.clear()
    detect(stated, replace(views, samples=views.samples[:19]), tmp_path)
    assert len(calls) >= 11
    calls.clear()
    assert detect(CELL, views, tmp_path).findings == ()
    assert len(calls) == 25
