"""Apply Refit: the armature's rest bones go to the refit joints, and nothing that is shown changes."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scene import Rig, bend, bind, bound_bar, fat_key, fresh, rest, select, set_mesh, shown, update

from blend_fixtures.biped import biped
from blend_fixtures.build import build_character
from blend_fixtures.walk import add_walk


def apply(rig: Rig) -> None:
    select([rig.cage], rig.cage)
    assert bpy.ops.cage_rig.apply_refit() == {"FINISHED"}
    update()


def heads(armature: bpy.types.Object) -> np.ndarray:
    return np.array([bone.matrix for bone in armature.pose.bones])[:, :3, 3]


@pytest.mark.parametrize("aside", [0.0, 0.4], ids=["on the axis", "off the axis"])
def test_joints_move_orientations_and_skin_stay(bar: Rig, aside: float) -> None:
    bend(bar, 1.1)
    bar.armature.pose.bones["upper"].location = (0.05, 0.0, 0.02)  # hidden, as long as the bone is connected
    bar.armature.pose.bones["lower"].location = (0.1, 0.0, 0.3)
    scaled = rest(bar.cage) * np.float32([1.4, 1.0, 1.0]) + np.float32([0.3, 0.0, 0.0])
    set_mesh(bar.cage, scaled + np.float32([0.0, aside, 0.0]) * (scaled[:, :1] > 0.0))
    before, refit = shown(bar.skin).copy(), heads(bar.refit)
    turns = [bone.matrix_local.to_3x3() for bone in bar.armature.data.bones]
    apply(bar)
    assert np.abs(heads(bar.armature) - refit).max() < 1e-5, "the user's bones are where the refit bones are"
    for bone, turn in zip(bar.armature.data.bones, turns, strict=True):
        assert np.allclose(np.array(bone.matrix_local.to_3x3()), np.array(turn), atol=1e-5)
    assert bar.armature.data.bones["upper"].use_connect == (aside == 0.0)
    assert np.abs(shown(bar.skin) - before).max() < 1e-5 * bar.size
    assert np.abs(fresh(bar)[0] - before).max() < 1e-5 * bar.size


def test_the_motion_of_an_action_is_unchanged() -> None:
    """The biped in other proportions, walking: every frame as before, connected bones and root motion included."""
    character = biped()
    objects = build_character(replace(character, shape_keys={}))
    add_walk(objects.armature)
    rig = bind(objects)
    set_mesh(rig.cage, character.shape_keys["Short"])
    scene, before = bpy.context.scene, {}
    for frame in (1, 12, 25, 40):
        scene.frame_set(frame)
        before[frame] = [shown(skin).copy() for skin in rig.skins]
    apply(rig)
    for frame, points in before.items():
        scene.frame_set(frame)
        for skin, wanted in zip(rig.skins, points, strict=True):
            assert np.abs(shown(skin) - wanted).max() < 1e-5 * rig.size, f"frame {frame}"
    assert rig.settings.state == "LIVE"


def test_twice_is_once(bar: Rig) -> None:
    set_mesh(bar.cage, rest(bar.cage) * np.float32([1.4, 1.0, 1.0]))
    apply(bar)
    once = heads(bar.armature)
    apply(bar)
    assert np.abs(heads(bar.armature) - once).max() < 1e-6


def test_renamed_bones_are_still_followed(bar: Rig) -> None:
    set_mesh(bar.cage, rest(bar.cage) * np.float32([1.4, 1.0, 1.0]))
    apply(bar)
    bar.armature.data.bones["upper"].name = "forearm"
    update()
    assert bar.settings.state == "LIVE", bar.settings.message


def test_a_hidden_armature_can_be_refit(bar: Rig) -> None:
    bar.armature.hide_viewport = True
    set_mesh(bar.cage, rest(bar.cage) * np.float32([1.4, 1.0, 1.0]))
    apply(bar)
    assert bar.armature.hide_viewport
    assert abs(bar.armature.data.bones["lower"].head_local.x - -1.4) < 1e-4


def keyed(rig: Rig) -> str:
    fat_key(rig).keyframe_insert("value", frame=1)
    return "animated"


def driven(rig: Rig) -> str:
    fat_key(rig).driver_add("value")
    return "animated"


def jiggling(rig: Rig) -> str:
    rig.cage.modifiers.new("Wave", "WAVE")
    return "animated"


def paused(rig: Rig) -> str:
    bpy.data.objects.remove(rig.posed)
    return "not live"


def keyed_while_connected(rig: Rig) -> str:
    rig.armature.pose.bones["upper"].keyframe_insert("location", frame=1)
    set_mesh(rig.cage, rest(rig.cage) + np.float32([0.0, 0.3, 0.0]) * (rest(rig.cage)[:, :1] > -0.5))
    return "'upper'"


@pytest.mark.parametrize("spoil", [keyed, driven, jiggling, paused, keyed_while_connected])
def test_refusals_change_nothing(spoil: object) -> None:
    rig = bound_bar()
    word = spoil(rig)
    update()
    before = heads(rig.armature)
    select([rig.cage], rig.cage)
    with pytest.raises(RuntimeError, match=word):
        bpy.ops.cage_rig.apply_refit()
    assert np.array_equal(heads(rig.armature), before)
