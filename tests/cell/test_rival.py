"""Other methods beside a calibration, in its file."""

from __future__ import annotations

from basecal.cell import Calibration, Rival, Validation
from basecal.cell.files import calibration_from_dict, calibration_to_dict


def test_file_holds_millimetres_and_degrees() -> None:
    """Errors are written in mm and deg, those of a method that fails as null, and read back the same."""
    rivals = (Rival("basecal", 2e-3, 0.01), Rival("OpenCV TSAI"))
    data = calibration_to_dict(Calibration("good", validation=Validation("k-fold", 5, rivals=rivals)))
    assert data["validation"]["rivals"][0]["target_mm"] == 2.0
    assert data["validation"]["rivals"][1] == {"name": "OpenCV TSAI", "target_mm": None, "target_deg": None}
    read = calibration_from_dict(data).validation.rivals
    assert [each.name for each in read] == ["basecal", "OpenCV TSAI"]
    assert abs(read[0].target_rad - 0.01) < 1e-15
