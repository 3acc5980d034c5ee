"""How well a capture knows its answer."""

from __future__ import annotations

from basecal.acquisition.watching import Sigma, Snapshot
from basecal.reporting.live.progress import progress_figure


def test_the_error_of_a_capture_is_drawn_beside_its_tolerance() -> None:
    """Else the sigma of the base; one point is no line."""
    sigmas = tuple(Sigma(k, 2e-3 / k, 1e-3) for k in range(1, 6))
    assert progress_figure(Snapshot(sigmas=sigmas[:1])) is None
    alone = progress_figure(Snapshot(sigmas=sigmas))
    assert alone is not None
    assert "2.0 mm with 1, 0.40 mm with 5 samples." in alone.caption
    task = progress_figure(Snapshot(sigmas=sigmas, errors=((4, 1e-3), (5, 8e-4)), tolerance_m=5e-4))
    assert task is not None
    assert "1.0 mm with 4, 0.80 mm with 5 samples. Dashed: the tolerance, 0.5 mm." in task.caption
    assert task.svg.count('class="level"') == 1
