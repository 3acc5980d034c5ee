"""Tests of `disagreement`: new samples compared with a calibration, and the causes of differences."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from basecal.accuracy.drift import disagreement as room
from basecal.accuracy.drift.disagreement import disagreement
from basecal.accuracy.drift.shifts import SIZE_KIND
from basecal.accuracy.model_comparison.nested_models import DISAGREEMENT_LEVEL
from basecal.cell import Recording
from drift_cells import BASE, later

HALF_A_DEGREE = np.radians(0.5)


def test_unchanged_cell_agrees():
    """Samples of an unchanged cell have a large chance, and no cause is searched."""
    made = later(0)
    found = disagreement(made.cell, made.calibration, made.recording)
    assert found.chance > DISAGREEMENT_LEVEL
    assert found.causes == ()


def test_large_shift_is_found_to_second_order():
    """A base moved by 30 mm and half a degree alone explains all samples, with its size."""
    made = later(0)
    tangent = np.array([0.03, 0, 0, 0, 0, HALF_A_DEGREE])
    found = disagreement(made.cell, made.calibration, made.with_base_moved(tangent))
    assert found.chance < 1e-6
    assert found.chance_left > 1e-3
    assert [cause.transform for cause in found.causes] == [BASE]
    np.testing.assert_allclose(np.abs(found.causes[0].size), np.abs(tangent), atol=1e-3)


def test_mispaired_views_have_no_cause():
    """Views paired with poses of other samples are explained by no movement."""
    made = later(0)
    samples = made.recording.samples
    turned = [*samples[1:], samples[0]]
    mixed = [replace(own, observations=other.observations) for own, other in zip(samples, turned, strict=True)]
    found = disagreement(made.cell, made.calibration, Recording(tuple(mixed)))
    assert found.chance_left < 1e-6


def test_other_board_is_named_by_size():
    """A board with points 2 % farther apart than stated is reported as 2 % larger."""
    made = later(0)
    name = next(iter(made.cell.targets))
    shape = made.cell.targets[name].target
    smaller = replace(shape, points=shape.points / 1.02)
    cell = replace(made.cell, targets={name: replace(made.cell.targets[name], target=smaller)})
    found = disagreement(cell, made.calibration, made.recording)
    assert (found.causes[0].frame, found.causes[0].transform) == (name, SIZE_KIND)
    np.testing.assert_allclose(found.causes[0].size, 0.02, atol=2e-3)


def make_disagreement(monkeypatch, off, shifts, root=None):
    """The disagreement of whitened innovations, for shifts with these gains and freedoms."""
    root = np.eye(len(off)) if root is None else root
    of = SimpleNamespace(deviation=np.array(off), root=root, covariance_inverse=np.eye(len(off)), noise_freedoms=np.inf)
    made = [SimpleNamespace(name=name, statistic=gain, freedoms=count) for name, (gain, count) in shifts.items()]
    monkeypatch.setattr(room, "innovations", lambda *given: of)
    monkeypatch.setattr(room, "frame_shifts", lambda of: iter([]))
    monkeypatch.setattr(room, "size_shifts", lambda of: iter(made[:1]))
    monkeypatch.setattr(room, "joint_shifts", lambda of: iter(made[1:]))
    return disagreement(None, None, None)


def test_unseen_coordinates_are_no_freedoms(monkeypatch):
    """Each nonzero column of the views' blocks counts as a freedom; without any there is no prediction."""
    root = np.zeros((2, 3, 3))
    root[0, :, 0] = [0.0, 0.0, 1.0]
    root[1, 1, 1] = -2.0
    root[1, 0, 2] = 1e-3
    found = make_disagreement(monkeypatch, [1.0, 1.0, 1.0], {"size": (0.0, 1)}, root)
    assert found.chance == found.chance_left == pytest.approx(chi2.sf(3.0, 3))
    assert found.causes == ()
    assert make_disagreement(monkeypatch, [1.0, 1.0, 1.0], {"size": (0.0, 1)}, 0 * root) is None


def test_causes_are_penalised_by_freedoms(monkeypatch):
    """Six numbers must explain five more than one number; the remainder is judged without the best cause's freedoms."""
    off = np.full(20, 2.5)
    found = make_disagreement(monkeypatch, off, {"size": (90.0, 1), "joint": (94.0, 6), "other": (20.0, 1)})
    assert found.chance == pytest.approx(chi2.sf(125.0, 20))
    assert found.causes[0].name == "size"
    assert found.chance_left == pytest.approx(chi2.sf(35.0, 19))
    assert "other" not in {each.name for each in found.causes}
    better = make_disagreement(monkeypatch, off, {"size": (90.0, 1), "joint": (96.0, 6)})
    assert [each.name for each in better.causes] == ["joint", "size"]
    assert better.chance_left == pytest.approx(chi2.sf(29.0, 14))
    everything = make_disagreement(monkeypatch, off, {"size": (126.0, 1)})
    assert everything.chance_left == 1.0
