"""Tests of the MuJoCo model of a cell."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from basecal.cell.targets.led import led_target
from basecal.cell.targets.registry import TARGETS
from basecal.simulation.running.ur5e import ur5e
from basecal.simulation.surroundings.model import TABLE_M, TRAY, Stage, _rod, body_names, mjcf

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'basecal[sim]'")


def stage(target):
    return Stage({"eye": ur5e(), "hand": ur5e()}, {"eye": np.zeros(3), "hand": np.array([1.7, 0, 0])}, target, 0)


@pytest.mark.parametrize("kind", TARGETS)
def test_model_of_every_target_is_valid(kind):
    """MuJoCo reads the model, all of whose bodies are positioned from outside."""
    of = stage(TARGETS[kind].usual(np.random.default_rng(0)))
    model = mujoco.MjModel.from_xml_string(mjcf(of, (64, 48), 40.0))
    assert model.nmocap == len(body_names(of)) + 1
    assert {model.body(k).name for k in range(1, model.nbody)} == {*body_names(of), "eye"}


def test_tray_is_at_its_stated_position():
    """The top of the tray is the mirror of the LED; there is no tray without one stated."""
    tray = np.array([0.8, 0.1, 0.4])
    plain = stage(led_target())
    model = mujoco.MjModel.from_xml_string(mjcf(replace(plain, tray=tray), (64, 48), 40.0))
    under = np.array([0, 0, model.geom(TRAY).size[2]])
    assert model.geom(TRAY).pos + under == pytest.approx(tray)
    assert TRAY not in mjcf(plain, (64, 48), 40.0)


def test_seed_changes_only_the_clutter():
    """Another seed changes the clutter, and no other part of the model."""
    one, other = (mjcf(Stage({}, {"eye": np.zeros(3)}, led_target(), seed), (64, 48), 40.0) for seed in (0, 1))
    different = [(a, b) for a, b in zip(one.splitlines(), other.splitlines(), strict=True) if a != b]
    assert len(different) == 1


def geoms(xml):
    """Geometries of the world by their order, and of each body by its name."""
    root = ElementTree.fromstring(xml)
    world = root.find("worldbody")
    return world.findall("geom"), {body.get("name"): body.findall("geom") for body in world.findall("body")}


def numbers(geom, key):
    return np.array([float(word) for word in geom.get(key).split()])


def test_table_extends_beyond_the_bases():
    """The table extends by 1.3 m on all sides; its top is at its height, and the floor is below."""
    (table, floor, *_), _ = geoms(mjcf(stage(led_target()), (64, 48), 40.0))
    middle, half = numbers(table, "pos"), numbers(table, "size")
    np.testing.assert_allclose(middle[:2] - half[:2], [-1.3, -1.3])
    np.testing.assert_allclose(middle[:2] + half[:2], [3.0, 1.3])
    assert middle[2] + half[2] == pytest.approx(TABLE_M)
    assert numbers(floor, "pos")[2] < TABLE_M - 0.5


def test_clutter_is_on_the_table_beside_the_arms():
    """Sixteen grey objects are on both sides of the line between the bases, each on its lowest point."""
    (_, _, *things), _ = geoms(mjcf(stage(led_target()), (64, 48), 40.0))
    assert len(things) == 16
    places = np.array([numbers(thing, "pos") for thing in things])
    assert np.all((np.abs(places[:, 1]) >= 0.45) & (np.abs(places[:, 1]) <= 1.1))
    assert {-1.0, 1.0} == set(np.sign(places[:, 1]))
    assert np.all((places[:, 0] >= -0.5) & (places[:, 0] <= 2.5))
    for thing, place in zip(things, places, strict=True):
        size = numbers(thing, "size")
        assert np.all((size >= 0.03) & (size <= 0.12))
        half = {"box": size[2], "cylinder": size[1], "sphere": size[0]}[thing.get("type")]
        assert place[2] - half == pytest.approx(TABLE_M)
        red, green, blue, alpha = numbers(thing, "rgba")
        assert red == green == blue < 1
        assert alpha == 1


def test_links_connect_joints_with_decreasing_radius():
    """Radii decrease from 55 to 40 mm; housings along the axes are a fifth thicker."""
    _, bodies = geoms(mjcf(stage(led_target()), (64, 48), 40.0))
    chain, radii = ur5e(), []
    for k in range(7):
        link, *housings = bodies[f"eye/{k}"]
        radii.append(float(link.get("size")))
        ahead = chain.origins[k].translation if k < 6 else chain.tip.translation
        if np.linalg.norm(ahead) > 1e-4:
            np.testing.assert_allclose(numbers(link, "fromto"), [0, 0, 0, *ahead])
        else:
            assert link.get("type") == "sphere"
        assert len(housings) == (k > 0)
        for housing in housings:
            assert float(housing.get("size")) == pytest.approx(1.2 * radii[-1])
            start, end = np.split(numbers(housing, "fromto"), 2)
            np.testing.assert_allclose([end, -start], [1.2 * radii[-1] * chain.axes[k - 1]] * 2)
    np.testing.assert_allclose(radii, np.linspace(0.055, 0.04, 7))


def test_plates_are_behind_their_paper():
    """The plate has the size of the sheet and a thickness of 4 mm, with a stem of 46 mm from the centre of its back."""
    target = TARGETS["chessboard"].usual(np.random.default_rng(0))
    _, bodies = geoms(mjcf(stage(target), (64, 48), 40.0))
    (sheet,), (plate, stem) = target.sheets, bodies["target"]
    left, top, right, bottom = sheet.paper
    np.testing.assert_allclose(2 * numbers(plate, "size"), [right - left, bottom - top, 0.004])
    sheet_from_target = sheet.target_from_sheet.inverse()
    middle = [(left + right) / 2, (top + bottom) / 2]
    np.testing.assert_allclose(sheet_from_target @ numbers(plate, "pos"), [*middle, 0.002], atol=1e-12)
    start, end = np.split(numbers(stem, "fromto"), 2)
    np.testing.assert_allclose(
        sheet_from_target @ np.stack([start, end]), [[*middle, 0.004], [*middle, 0.05]], atol=1e-12
    )
    np.testing.assert_allclose(numbers(plate, "xyaxes").reshape(2, 3), sheet.target_from_sheet.rotation[:, :2].T)
    _, lights = geoms(mjcf(stage(led_target([[0, 0, 0], [0.05, 0.02, 0]])), (64, 48), 40.0))
    np.testing.assert_allclose([numbers(each, "pos") for each in lights["target"]], [[0, 0, 0], [0.05, 0.02, 0]])


def test_surroundings_follow_the_bases():
    """The table ends 1.3 m beyond the outermost base along each axis, the clutter 0.8 m beyond the farthest."""
    bases = {"eye": np.zeros(3), "hand": np.array([2.7, -0.6, 0.4])}
    (table, _, *things), _ = geoms(mjcf(Stage({}, bases, led_target(), 0), (64, 48), 40.0))
    middle, half = numbers(table, "pos"), numbers(table, "size")
    np.testing.assert_allclose(middle[:2] - half[:2], [-1.3, -1.9])
    np.testing.assert_allclose(middle[:2] + half[:2], [4.0, 1.3])
    places = np.array([numbers(thing, "pos")[0] for thing in things])
    assert -0.5 <= places.min() < 0.3
    assert 2.7 < places.max() <= 3.5


def test_tray_is_a_square_of_half_a_metre():
    """The tray is six millimetres thick."""
    (_, _, tray, *_), _ = geoms(mjcf(replace(stage(led_target()), tray=np.array([0.8, 0.1, 0.4])), (64, 48), 40.0))
    np.testing.assert_allclose(2 * numbers(tray, "size"), [0.5, 0.5, 0.006])


def test_rods_of_zero_length_are_spheres():
    """A rod below a tenth of a millimetre is a sphere. A stem has the thickness of the thinnest link."""
    for length, kind in ((9e-5, "sphere"), (1.1e-4, "capsule")):
        geom = ElementTree.fromstring(_rod(np.zeros(3), np.array([0, 0, length]), 0.01, "metal"))
        assert (geom.get("type"), geom.get("size")) == (kind, "0.01")
    target = TARGETS["chessboard"].usual(np.random.default_rng(0))
    _, bodies = geoms(mjcf(stage(target), (64, 48), 40.0))
    assert float(bodies["target"][1].get("size")) == 0.02
