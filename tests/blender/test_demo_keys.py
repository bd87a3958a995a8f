"""What the picture of cage keys claims: bones' keys untouched, a big fist at the strike alone, linear in between."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scene import Points, shown

from blend_fixtures.build import build_biped
from blend_fixtures.punch import KEYS, STRIKE, add_punch
from blend_fixtures.walk import add_walk

ROOT = Path(__file__).parents[2]
PLACES = Matrix.Translation((-1.0, 0.0, 0.0)), Matrix.Translation((1.0, 0.0, 0.0)) @ Matrix.Rotation(1.0, 4, "Z")


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(str(ROOT / "demo"))
    from showcase import keys

    yield keys
    for name in [name for name in sys.modules if name.split(".")[0] == "showcase"]:
        del sys.modules[name]


@pytest.fixture
def act(keys: ModuleType) -> object:
    return keys.punch_act(PLACES)


def curves(owner: bpy.types.ID) -> list[bpy.types.FCurve]:
    from bl_ext.user_default.cage_rig import compat

    return list(compat.action_curves(owner))


def written(armature: bpy.types.Object) -> dict[tuple[str, int], list[tuple[float, float, str]]]:
    """Every key of an action."""
    return {
        (curve.data_path, curve.array_index): [(*point.co, point.interpolation) for point in curve.keyframe_points]
        for curve in curves(armature)
    }


def shift(owner: bpy.types.ID, frames: float) -> None:
    """Grab all its keys in the dope sheet and move them."""
    for curve in curves(owner):
        for point in curve.keyframe_points:
            point.co.x += frames
            point.handle_left.x += frames
            point.handle_right.x += frames
        curve.update()
    owner.update_tag(refresh={"TIME"})


def apart(act: object, frame: float) -> float:
    """How far the keyed skin is from the plain one, at most."""
    go(frame)
    return max(np.abs(shown(a) - shown(b)).max() for a, b in zip(act.rig.skins, act.plain.skins, strict=True))


def go(frame: float) -> None:
    bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)


def fist(skin: bpy.types.Object) -> Points:
    """The right hand of the body, posed."""
    hand = skin.vertex_groups["hand.R"].index
    inside = [any(g.group == hand and g.weight > 0.3 for g in vertex.groups) for vertex in skin.data.vertices]
    return shown(skin)[np.array(inside)]


def breadth(points: Points) -> float:
    return float(np.linalg.norm(points - points.mean(axis=0), axis=1).mean())


def test_the_bones_action_is_unchanged_by_the_cage_keys(keys: ModuleType, act: object) -> None:
    untouched = build_biped(walk=False).armature
    add_punch(untouched)
    assert act.bone_keys() == list(KEYS)
    assert written(act.rig.armature) == written(untouched) == written(act.plain.armature)


def test_the_fist_is_big_as_it_strikes_and_as_bound_at_the_envelope_keys(act: object) -> None:
    first, strike, last = act.cage_keys()
    assert strike == STRIKE
    for frame in (1, first, last, 24):
        assert apart(act, frame) < 2e-4, frame
    go(strike)
    keyed, plain = fist(act.rig.skins[0]), fist(act.plain.skins[0])
    assert breadth(keyed) > 1.6 * breadth(plain)
    shoulder = np.array(act.plain.armature.pose.bones["upper_arm.R"].head)
    reach = [np.linalg.norm(points.mean(axis=0) - shoulder) for points in (plain, keyed)]
    assert reach[1] > 1.3 * reach[0]


def test_the_cage_is_linear_between_its_keys(act: object) -> None:
    cages = {}
    for frame in (7, 10, 11.5, 13, 15, 21):
        go(frame)
        cages[frame] = shown(act.rig.cage).copy()
    assert np.abs(cages[7] - cages[21]).max() < 1e-6
    for low, frame, high in ((7, 10, 13), (7, 11.5, 13), (13, 15, 21)):
        part = np.float32((frame - low) / (high - low))
        assert np.abs(cages[frame] - (1 - part) * cages[low] - part * cages[high]).max() < 1e-5, frame


def test_keys_of_bones_and_cage_are_shifted_apart(act: object) -> None:
    go(STRIKE)
    cage, plain = shown(act.rig.cage).copy(), [shown(skin).copy() for skin in act.plain.skins]
    shift(act.rig.cage.data.shape_keys, 6)
    go(STRIKE + 6)
    assert np.abs(shown(act.rig.cage) - cage).max() < 1e-6
    assert apart(act, STRIKE) < 2e-4, "at the first envelope key now, and the bones where they were"
    assert all(np.abs(shown(skin) - points).max() < 1e-6 for skin, points in zip(act.plain.skins, plain, strict=True))
    shift(act.rig.armature, 6)
    go(STRIKE + 6)
    assert breadth(fist(act.rig.skins[0])) > 1.6 * breadth(fist(act.plain.skins[0]))
    assert act.rig.cage.cage_rig.state == "LIVE"


def test_the_walk_grows_stout_and_thin_again(keys: ModuleType) -> None:
    act = keys.walk_act(PLACES)
    girth = {}
    for frame in act.cage_keys():
        go(frame)
        girth[frame] = [
            breadth(shown(skins[1])[np.array([vertex.co.z < 0.95 for vertex in skins[1].data.vertices])])
            for skins in (act.plain.skins, act.rig.skins)
        ]
    (first, stout, fat, last) = (keyed / plain for plain, keyed in girth.values())
    assert first == pytest.approx(1.0, abs=1e-4) == last
    assert 1.02 < stout < fat - 0.02
    untouched = build_biped(walk=False).armature
    add_walk(untouched)
    assert written(act.rig.armature) == written(untouched)


def test_the_strips_show_what_they_say(keys: ModuleType, act: object) -> None:
    strip = keys.strip(act)
    assert [figure.title for figure in strip.keyed] == [f"{frame}" for frame in act.shown]
    assert [figure.title for figure in strip.keys] == ["7", "13", "21"]
    assert {len(figure.cage_vertices) for figure in strip.keys} == {len(act.moved)}
    assert act.rig.armature.data.pose_position == "POSE"
