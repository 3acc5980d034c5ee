"""Lenses of camera_info messages, of ROS 1 and ROS 2."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, Kind, new_bag

from basecal.errors import DatasetError
from basecal.exchange.bags.lenses import bag_lens

K = np.array([500.0, 0, 320, 0, 510, 240, 0, 0, 1])
D = np.array([0.1, -0.2, 0.001, 0.002, 0.05])


def info(tmp_path: Path, kind: Kind = "mcap", k: np.ndarray = K, model: str = "plumb_bob") -> Any:
    bag = new_bag(tmp_path, kind)
    bag.camera_info("/eye/camera_info", BEGIN_S, (640, 480), k, D, model)
    return bag.messages[0][3]


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_a_lens(kind: Kind, tmp_path: Path) -> None:
    found = bag_lens(info(tmp_path, kind), "x", "/eye/image_raw")
    assert found is not None
    assert found.camera.size_px == (640, 480)
    np.testing.assert_array_equal(found.camera.parameters, [500, 510, 320, 240, *D])


def test_rectified_images_have_no_distortion(tmp_path: Path) -> None:
    found = bag_lens(info(tmp_path), "x", "/eye/image_rect")
    assert found is not None
    np.testing.assert_array_equal(found.camera.parameters, [500, 510, 320, 240])


def test_none_and_unknown(tmp_path: Path) -> None:
    assert bag_lens(info(tmp_path, k=np.zeros(9)), "x", "/eye/image_raw") is None
    with pytest.raises(DatasetError, match="'odd' has no equal here"):
        bag_lens(info(tmp_path, model="odd"), "x", "/eye/image_raw")
