"""A target of which views show single points goes by the one that most of them see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.estimation.problem.build import build_problem
from basecal.estimation.start.light_search import light_search
from basecal.estimation.start.pair_views import pair_views
from basecal.estimation.start.refinement import Refinement, refine_jointly
from basecal.simulation import Scenario, simulate


def partial_views():
    """Views of a board, two of its third point alone and ten of its second; what is known of its loop."""
    made = simulate(Scenario(samples=12, camera_mount="fixed"), 1)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    seen = np.zeros_like(group.measurement.seen)
    seen[:2, 2], seen[2:, 1] = True, True
    weight = np.where(seen, group.measurement.weight, 0.0)
    group = replace(group, measurement=replace(group.measurement, seen=seen, weight=weight))
    pair = pair_views(group, made.cameras["wrist"], 100, 1000)
    truth = [made.truth[name] for name in (group.eye.mount, group.hand.base, group.hand.mount)]
    return pair, pair.loop(truth[0], None, truth[2], np.zeros(len(pair.group), dtype=int)), truth


def test_the_point_that_most_views_see_is_the_light():
    """Views without it are left out, and where its mount is known the light stands at the point."""
    pair, loop, truth = partial_views()
    one, light, starts = light_search(pair, loop, 3)
    assert one.group.measurement.points_in_target.shape == (1, 3)
    assert (len(one.group), len(pair.group)) == (10, 12)
    point = pair.group.measurement.points_in_target[1]
    np.testing.assert_allclose(light.z.translation, truth[2] @ point)
    assert 1 <= len(starts) <= 3


def test_refined_the_best_start_is_the_truth():
    """With camera and light known, the starts of the grid lead to the base, to a milliradian."""
    pair, loop, truth = partial_views()
    (found,) = refine_jointly([Refinement(*light_search(pair, loop, 3), is_point=True)])
    assert np.linalg.norm((found[1].inverse() @ truth[1]).rotvec) < 1e-3


def test_views_count_however_little_they_weigh():
    """What has no weight alone is not seen."""
    pair, loop, _ = partial_views()
    faint = replace(pair.group.measurement, weight=1e-9 * pair.group.measurement.weight)
    one, _, _ = light_search(replace(pair, group=replace(pair.group, measurement=faint)), loop, 1)
    assert len(one.group) == 10
