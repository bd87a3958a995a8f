"""Every way to pose bones that Blender has: at rest cage we show what Blender shows, and the cage still works."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
import truth
from scene import Rig, bend, bind, fat_key, rest, select, set_mesh, shown, update

from blend_fixtures import rigs
from blend_fixtures.build import RigObjects

EVERY = pytest.mark.parametrize("name", rigs.RIGS)
ORDER = (13, 1, 25, 6, 19)


def bound(name: str) -> Rig:
    rig = bind(rigs.build_rig(name))
    assert rig.settings.state == "LIVE", rig.settings.message
    return rig


@EVERY
def test_an_action_plays_as_blenders_armature_modifier(name: str) -> None:
    rig = bound(name)
    moved = 0.0
    for frame in ORDER:
        bpy.context.scene.frame_set(frame)
        assert truth.worst_against_blender(rig) < 1e-5, f"frame {frame}"
        moved = max(moved, truth.motion(rig))
    assert moved > 0.1, "the action does something"
    assert rig.settings.state == "LIVE", rig.settings.message


@EVERY
def test_refit_bones_are_the_pose_bones_at_rest_cage(name: str) -> None:
    rig = bound(name)
    size = truth.Bound.of(rig).size
    for frame in ORDER:
        bpy.context.scene.frame_set(frame)
        assert np.abs(truth.refit_heads(rig) - truth.pose_heads(rig)).max() < 1e-5 * size, f"frame {frame}"


@EVERY
def test_a_fat_cage_carries_the_posed_skin(name: str) -> None:
    objects = rigs.build_rig(name)
    before = truth.Bound.of(objects)
    rig = bind(objects)
    fat_key(rig)
    for frame in ORDER:
        bpy.context.scene.frame_set(frame)
        _, skins = truth.fat_rig(rig, before)
        for expected, live in zip(skins, truth.shown_in_rig(rig), strict=True):
            assert np.abs(live - expected).max() < 1e-5 * before.size, f"frame {frame}"


@EVERY
def test_a_fat_cage_refits_the_joints(name: str) -> None:
    objects = rigs.build_rig(name)
    before = truth.Bound.of(objects)
    rig = bind(objects)
    fat_key(rig)
    for frame in ORDER:
        bpy.context.scene.frame_set(frame)
        heads, _ = truth.fat_rig(rig, before)
        assert np.abs(truth.refit_heads(rig) - heads).max() < 1e-5 * before.size, f"frame {frame}"


@EVERY
def test_a_posed_cage_edit_lands_in_a_pose(name: str) -> None:
    rig = bound(name)
    fat_key(rig, value=0.5)
    size = truth.Bound.of(rig).size
    for frame in (13, 19):
        bpy.context.scene.frame_set(frame)
        before, skins = shown(rig.cage).copy(), [shown(skin).copy() for skin in rig.skins]
        wanted = rest(rig.posed)
        wanted[6] += np.float32([0.02, -0.03, 0.02]) * np.float32(size)
        set_mesh(rig.posed, wanted)
        assert rig.settings.message == "" and rig.settings.state == "LIVE", rig.settings.message
        assert np.abs(rest(rig.posed) - wanted).max() < 1e-5 * size, f"frame {frame}"
        assert np.abs(shown(rig.cage) - before).max() > 1e-3 * rig.size
        now = [shown(skin) for skin in rig.skins]
        assert all(np.isfinite(points).all() for points in now)
        assert max(np.abs(a - b).max() for a, b in zip(now, skins, strict=True)) > 1e-3 * rig.size


def test_a_collapsed_bone_refuses_a_posed_cage_edit_and_plays_on() -> None:
    rig = bound("collapsed_bone")
    bpy.context.scene.frame_set(25)
    before = rest(rig.posed)
    set_mesh(rig.posed, before + np.float32([0.0, 0.1, 0.0]))
    assert "squashed" in rig.settings.message and rig.settings.state == "LIVE"
    assert np.abs(rest(rig.posed) - before).max() < 1e-5 * rig.size, "the posed cage is put back"
    bpy.context.scene.frame_set(13)
    assert rig.settings.message == "" and truth.worst_against_blender(rig) < 1e-5


def test_bendy_bones_that_deform_are_refused_by_name() -> None:
    objects = rigs.bendy_bones()
    select(objects.all, objects.cage)
    with pytest.raises(RuntimeError, match=r"bone\.1.*B-bone"):
        bpy.ops.cage_rig.bind()
    assert [modifier.name for modifier in objects.skins[0].modifiers] == ["Armature"]


@pytest.mark.parametrize("spared", ["does not deform", "has no weights"])
def test_bendy_bones_that_move_nothing_are_welcome(spared: str) -> None:
    objects = rigs.bendy_bones()
    if spared == "does not deform":
        objects.armature.data.bones["bone.1"].use_deform = False
    else:
        groups = objects.skins[0].vertex_groups
        groups.remove(groups["bone.1"])
    rig = bind(objects)
    for frame in ORDER:
        bpy.context.scene.frame_set(frame)
        assert truth.worst_against_blender(rig) < 1e-5, f"frame {frame}"


def test_a_bone_made_bendy_after_the_bind_pauses_the_rig() -> None:
    objects = rigs.bendy_bones()
    objects.armature.data.bones["bone.1"].bbone_segments = 1
    rig = bind(objects)
    objects.armature.data.bones["bone.1"].bbone_segments = 8
    bpy.context.scene.frame_set(13)
    assert rig.settings.state == "PAUSED" and "bone.1" in rig.settings.message


def test_refit_bones_move_although_bound_in_rest_position() -> None:
    objects = rigs.build_rig("keyed_locations")
    objects.armature.data.pose_position = "REST"
    update()
    rig = bind(objects)
    objects.armature.data.pose_position = "POSE"
    bpy.context.scene.frame_set(13)
    assert truth.worst_against_blender(rig) < 1e-5
    assert np.abs(truth.refit_heads(rig) - truth.pose_heads(rig)).max() < 1e-5 * rig.size


def test_a_very_small_armature_object_binds() -> None:
    objects = rigs.build_rig("mirrored_armature")
    objects.armature.scale = (1e-4, 1e-4, 1e-4)
    update()
    objects.cage.matrix_world = objects.armature.matrix_world
    update()
    rig = bind(objects)
    bpy.context.scene.frame_set(13)
    assert truth.worst_against_blender(rig) < 1e-5


@pytest.mark.parametrize("hidden", ["the_root", "the_armature", "the_skin"])
@pytest.mark.parametrize("scale", [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0)])
def test_a_character_scaled_to_nothing_stays_live(bar: Rig, hidden: str, scale: tuple[float, float, float]) -> None:
    rig = bar
    bend(rig, 1.0)
    before = shown(rig.skin)
    root = bpy.data.objects.new("Root", None)
    bpy.context.scene.collection.objects.link(root)
    rig.armature.parent = rig.skin.parent = root
    obj = {"the_root": root, "the_armature": rig.armature, "the_skin": rig.skin}[hidden]
    for frame, factor in ((1, (1.0, 1.0, 1.0)), (2, scale), (3, (1.0, 1.0, 1.0))):
        obj.scale = factor
        obj.keyframe_insert("scale", frame=frame)
    for frame in (1, 2, 3):
        bpy.context.scene.frame_set(frame)
        assert (rig.settings.state, rig.settings.message) == ("LIVE", "")
        assert np.abs(shown(rig.skin) - before).max() < 1e-6, frame


def envelope_multiplied(objects: RigObjects) -> str:
    for bone in objects.armature.data.bones:
        bone.head_radius = bone.tail_radius = bone.envelope_distance = 0.05
        bone.use_envelope_multiply = True
    return "envelope"


def envelopes_for_the_rest(objects: RigObjects) -> str:
    for group in objects.skins[0].vertex_groups:
        group.remove(list(range(100)))
    objects.skins[0].modifiers["Armature"].use_bone_envelopes = True
    return "envelope"


def envelopes_alone(objects: RigObjects) -> str:
    modifier = objects.skins[0].modifiers["Armature"]
    modifier.use_vertex_groups, modifier.use_bone_envelopes = False, True
    return "envelope"


def masked_modifier(objects: RigObjects) -> str:
    skin = objects.skins[0]
    skin.vertex_groups.new(name="Mask").add(list(range(200)), 0.5, "REPLACE")
    skin.modifiers["Armature"].vertex_group = "Mask"
    return "Mask"


def deformed_twice(objects: RigObjects) -> str:
    objects.skins[0].modifiers.new("Second", "ARMATURE").object = objects.armature
    return "Second"


@pytest.mark.parametrize(
    "setting", [envelope_multiplied, envelopes_for_the_rest, envelopes_alone, masked_modifier, deformed_twice]
)
def test_settings_of_the_armature_modifier_are_honoured_or_refused(setting: Callable[[RigObjects], str]) -> None:
    objects = rigs.build_rig("groups_without_bones")
    word = setting(objects)
    bpy.context.scene.frame_set(13)
    blender = shown(objects.skins[0]).copy()
    select(objects.all, objects.cage)
    try:
        bpy.ops.cage_rig.bind()
    except RuntimeError as refused:
        assert word in str(refused)
    else:
        assert np.abs(shown(objects.skins[0]) - blender).max() < 2e-5


def test_vertices_with_next_to_no_weight_stay() -> None:
    objects = rigs.build_rig("two_skins_and_a_hidden_bone_collection")
    for skin in objects.skins:
        for group in skin.vertex_groups:
            group.add([0, 1, 2], 2e-5, "REPLACE")
    rig = bind(objects)
    bpy.context.scene.frame_set(13)
    assert truth.worst_against_blender(rig) < 1e-5


def test_an_armature_modifier_of_another_rig_goes_on_after_ours() -> None:
    other = rigs.build_rig("keyed_locations").armature
    objects = rigs.build_rig("mirrored_bones")
    objects.skins[0].modifiers.new("Other", "ARMATURE").object = other
    for bone in other.pose.bones:
        objects.skins[0].vertex_groups.new(name=bone.name).add(list(range(200)), 0.5, "REPLACE")
    rig = bind(objects)
    for frame in ORDER:
        bpy.context.scene.frame_set(frame)
        assert truth.worst_against_blender(rig) < 1e-5, f"frame {frame}"


def test_shape_keys_of_the_skin_talk_over_an_action() -> None:
    rig = bound("keyed_locations")
    rig.skin.shape_key_add(name="Basis", from_mix=False)
    for name, offset, values in (("Smile", 0.1, (0.0, 1.0, 0.3)), ("Frown", -0.07, (1.0, 0.2, 0.7))):
        key = rig.skin.shape_key_add(name=name, from_mix=False)
        moved = rest(rig.skin)
        moved[::2] += np.float32([0.0, offset, 0.5 * offset])
        key.points.foreach_set("co", moved.ravel())
        for frame, value in zip((1, 13, 25), values, strict=True):
            key.value = value
            key.keyframe_insert("value", frame=frame)
    seen = []
    for frame in ORDER:
        bpy.context.scene.frame_set(frame)
        assert truth.worst_against_blender(rig) < 1e-5, f"frame {frame}"
        seen.append(shown(rig.skin).copy())
    rig.skin.data.shape_keys.key_blocks["Smile"].mute = True
    bpy.context.scene.frame_set(ORDER[0])
    assert np.abs(shown(rig.skin) - seen[0]).max() > 1e-2, "the key was seen"
    fat_key(rig)
    muted = shown(rig.skin).copy()
    rig.skin.data.shape_keys.key_blocks["Smile"].mute = False
    update()
    assert np.abs(shown(rig.skin) - muted).max() > 1e-2, "the face talks while the cage is fat"


def test_subdivision_after_ours_smooths_the_posed_skin() -> None:
    objects = rigs.build_rig("ik_with_pole")
    objects.skins[0].modifiers.new("Smooth it", "SUBSURF").levels = 2
    rig = bind(objects)
    for frame in ORDER:
        bpy.context.scene.frame_set(frame)
        assert len(shown(rig.skin)) > 10 * len(rest(rig.skin))
        assert truth.worst_against_blender(rig) < 1e-5, f"frame {frame}"
