"""Images that are worth a search."""

from __future__ import annotations

from dataclasses import replace

from basecal.accuracy.input_screening.images import count_searchable_images, needs_search
from basecal.cell import Recording
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def test_images_of_poses_in_metres_are(tmp_path) -> None:
    """Those of poses in millimetres are not, nor is a recording without any."""
    made = simulate(Scenario(samples=4), 1)
    shown = [replace(sample, images={"wrist": "images/wrist/0.png"}) for sample in made.recording.samples]
    assert not needs_search(made.cell, made.recording)
    assert needs_search(made.cell, Recording(tuple(shown)))

    def in_millimetres(state):
        """The pose as a controller that counts in them says it."""
        pose = state.base_from_flange
        return replace(state, base_from_flange=SE3(pose.rotation, 1e3 * pose.translation))

    wrong = [replace(s, robots={name: in_millimetres(of) for name, of in s.robots.items()}) for s in shown]
    assert not needs_search(made.cell, Recording(tuple(wrong)))


def test_images_of_targets_are_searchable() -> None:
    """Each image by a camera with a lens counts; of a target that no image shows, none does."""
    for target, count in (("charuco", 4), ("pose", 0)):
        made = simulate(Scenario(samples=4, target=target), 1)
        shown = [replace(sample, images={"wrist": "images/wrist/0.png"}) for sample in made.recording.samples]
        assert count_searchable_images(made.cell, Recording(tuple(shown))) == count
        assert count_searchable_images(made.cell, made.recording) == 0
