"""What a hand-eye recording is where a file holds only a part of one."""

from __future__ import annotations

from basecal.exchange.hand_eye.record import HandEyeRecord


def test_a_result_alone_has_no_samples() -> None:
    """Nothing but what was found: no poses, images or sizes."""
    record = HandEyeRecord("a.calib", "a calibration", True)
    assert len(record.base_from_flange) == 0
    assert (record.camera_from_target, record.images, dict(record.lens)) == (None, (), {})
