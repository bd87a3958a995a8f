"""Bind, unbind, rebind: what they make, what they refuse, and that nothing else changes."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector
from scene import (
    Rig,
    bend,
    bind,
    bound_bar,
    build_bar,
    fat_key,
    file_state,
    native,
    rest,
    select,
    set_mesh,
    shown,
    update,
)

from blend_fixtures.build import RigObjects


def test_bind_makes_a_live_rig() -> None:
    rig = bound_bar()
    assert rig.settings.state == "LIVE", rig.settings.message
    assert rig.settings.armature == rig.armature
    assert [skin.object for skin in rig.settings.skins] == rig.skins
    assert rig.posed.parent == rig.armature and rig.refit.parent == rig.armature
    assert np.abs(shown(rig.skin) - rest(rig.skin)).max() < 1e-6 * rig.size
    assert np.abs(rest(rig.posed) - rest(rig.cage)).max() < 1e-6 * rig.size
    assert not rig.skin.modifiers["Armature"].show_viewport


def test_refit_bones_are_parentless_and_named_alike(bar: Rig) -> None:
    assert [b.name for b in bar.refit.data.bones] == [b.name for b in bar.armature.data.bones]
    assert all(b.parent is None and not b.use_connect for b in bar.refit.data.bones)


@pytest.mark.parametrize("angle", [0.0, 0.8, 1.6, -2.2])
def test_rest_cage_unedited_is_blenders_armature_modifier(bar: Rig, angle: float) -> None:
    bend(bar, angle)
    bend(bar, angle / 3, "lower")
    bar.armature.pose.bones["upper"].location = (0.05, 0.1, -0.02)
    bar.armature.pose.bones["lower"].scale = (1.1, 0.9, 1.2)
    update()
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


@pytest.mark.parametrize("parented", [True, False])
def test_unapplied_transforms_change_nothing(parented: bool) -> None:
    objects = build_bar()
    skin, armature, cage = objects.skins[0], objects.armature, objects.cage
    placed = Matrix.LocRotScale(Vector((1, 2, 3)), Euler((0.3, 0.4, 0.5)), Vector((2, 2, 2)))
    own = {
        skin: Matrix.LocRotScale(Vector((0, 5, 1)), Euler((1, 0.2, 0)), Vector((-1, 2, 0.7))),
        cage: Matrix.LocRotScale(Vector((-1, 0, 2)), Euler((0.1, -0.7, 0.2)), Vector((0.5, 3, 1))),
    }
    armature.matrix_world = placed
    for obj, matrix in own.items():
        obj.data.transform(matrix.inverted() @ placed)  # where it is seen stays the same
        if obj == skin and not parented:
            obj.parent = None
        update()
        obj.matrix_world = matrix
    update()
    rig = bind(objects)
    assert rig.settings.state == "LIVE", rig.settings.message
    size = rig.size
    assert np.abs(shown(skin) - rest(skin)).max() < 1e-5 * size
    bend(rig, 1.2)
    assert np.abs(shown(skin) - native(skin)).max() < 1e-5 * size
    fat_key(rig)
    fattened = shown(skin).copy()
    assert np.abs(fattened - native(skin)).max() > 1e-2 * size
    cage.location += Vector((4, 4, 4))
    update()
    assert np.abs(shown(skin) - fattened).max() < 1e-6 * size, "a moved cage object must not deform"


@pytest.mark.parametrize("parented", [True, False])
def test_moving_armature_or_skin_later_is_blenders_armature_modifier(parented: bool) -> None:
    objects = build_bar()
    if not parented:
        objects.skins[0].parent = None
    rig = bind(objects)
    bend(rig, 1.0)
    rig.armature.location = (3, -1, 2)
    rig.armature.rotation_euler = (0.2, 0.5, 1.0)
    update()
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 2e-5 * rig.size
    rig.skin.location.z += 0.3
    update()
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 2e-5 * rig.size


def test_the_cage_is_the_mesh_that_encloses_the_others() -> None:
    objects = build_bar()
    select(objects.all, objects.skins[0])
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    assert objects.cage.cage_rig.state == "LIVE"


def test_unbind_restores_everything() -> None:
    objects = build_bar()
    fat_key(Rig(objects.skins, objects.armature, objects.cage), value=0.0)
    select(objects.all, objects.cage)
    before = file_state()
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    assert file_state() != before
    assert bpy.ops.cage_rig.unbind() == {"FINISHED"}
    assert file_state() == before


def test_unbind_works_from_a_skin_and_after_edits(bar: Rig) -> None:
    bend(bar, 1.0)
    fat_key(bar)
    base = rest(bar.skin)
    select([bar.skin], bar.skin)
    assert bpy.ops.cage_rig.unbind() == {"FINISHED"}
    update()
    assert np.array_equal(rest(bar.skin), base)
    assert [m.name for m in bar.skin.modifiers] == ["Armature"]
    assert bar.skin.modifiers["Armature"].show_viewport
    assert not bpy.data.node_groups


def test_rebind_takes_present_meshes_and_keeps_keys(bar: Rig) -> None:
    key = fat_key(bar)
    key.keyframe_insert("value", frame=1)
    bar.settings.influence = 0.5
    set_mesh(bar.skin, rest(bar.skin) * np.float32([1, 0.8, 0.8]))
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.state == "LIVE" and bar.settings.influence == 0.5
    assert [block.name for block in bar.cage.data.shape_keys.key_blocks] == ["Basis", "Fat"]
    assert bar.cage.data.shape_keys.animation_data.action is not None
    key.keyframe_delete("value", frame=1)
    key.value = 0.0
    update()
    assert np.abs(shown(bar.skin) - rest(bar.skin)).max() < 1e-6 * bar.size


def no_armature(objects: RigObjects) -> str:
    select([*objects.skins, objects.cage], objects.cage)
    return "armature"


def no_skin(objects: RigObjects) -> str:
    select([objects.armature, objects.cage], objects.cage)
    return "skin"


def open_cage(objects: RigObjects) -> str:
    import bmesh

    edit = bmesh.new()
    edit.from_mesh(objects.cage.data)
    edit.faces.ensure_lookup_table()
    bmesh.ops.delete(edit, geom=[edit.faces[3]], context="FACES_ONLY")
    edit.to_mesh(objects.cage.data)
    return "edge"


def flipped_face(objects: RigObjects) -> str:
    objects.cage.data.polygons[4].flip()
    objects.cage.data.update()
    return "face"


def no_weights(objects: RigObjects) -> str:
    objects.skins[0].vertex_groups.clear()
    return objects.skins[0].name


def shared_mesh(objects: RigObjects) -> str:
    other = bpy.data.objects.new("Twin", objects.skins[0].data)
    bpy.context.scene.collection.objects.link(other)
    return "shared"


def bendy_bone(objects: RigObjects) -> str:
    objects.armature.data.bones["upper"].bbone_segments = 4
    return "upper"


def subdivision_first(objects: RigObjects) -> str:
    skin = objects.skins[0]
    skin.modifiers.new("Smooth it", "SUBSURF")
    skin.modifiers.move(1, 0)
    return "Smooth it"


def flat_skin(objects: RigObjects) -> str:
    objects.skins[0].scale.x = 0.0
    update()
    return "scale"


@pytest.mark.parametrize(
    "spoil",
    [
        no_armature,
        no_skin,
        open_cage,
        flipped_face,
        no_weights,
        shared_mesh,
        bendy_bone,
        subdivision_first,
        flat_skin,
    ],
)
def test_refusals_say_what_and_change_nothing(spoil: object) -> None:
    objects = build_bar()
    select(objects.all, objects.cage)
    word = spoil(objects)
    before = file_state()
    with pytest.raises(RuntimeError, match="Error: ") as refused:
        bpy.ops.cage_rig.bind()
    assert word in str(refused.value)
    assert file_state() == before


def test_a_skin_of_another_armatures_rig_is_refused_by_name(bar: Rig) -> None:
    other = build_bar()
    select([bar.skin, other.armature, other.cage], other.cage)
    with pytest.raises(RuntimeError, match=bar.cage.name):
        bpy.ops.cage_rig.bind()
    assert other.cage.cage_rig.state == "NONE" and bar.settings.state == "LIVE"


def test_a_cage_inside_out_is_turned() -> None:
    objects = build_bar()
    objects.cage.data.flip_normals()
    rig = bind(objects)
    bend(rig, 1.0)
    fat_key(rig)
    assert np.isfinite(shown(rig.skin)).all()
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < rig.size


def test_bind_while_posed_binds_the_rest_position() -> None:
    objects = build_bar()
    pose_bone = objects.armature.pose.bones["upper"]
    pose_bone.rotation_mode = "XYZ"
    pose_bone.rotation_euler = (0, 0, 1.0)
    update()
    rig = bind(objects)
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 1e-5 * rig.size
    assert objects.armature.data.pose_position == "POSE"


def test_a_cage_that_follows_the_armature_already_does_not_follow_twice() -> None:
    objects = build_bar()
    group = objects.cage.vertex_groups.new(name="upper")
    group.add(list(range(len(objects.cage.data.vertices))), 1.0, "REPLACE")
    objects.cage.modifiers.new("Armature", "ARMATURE").object = objects.armature
    rig = bind(objects)
    bend(rig, 1.0)
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 1e-5 * rig.size
    select([rig.cage], rig.cage)
    bpy.ops.cage_rig.unbind()
    assert rig.cage.modifiers["Armature"].show_viewport and rig.cage.modifiers["Armature"].show_render


def test_modifiers_after_ours_work_on_the_posed_skin() -> None:
    objects = build_bar()
    objects.skins[0].modifiers.new("Smooth it", "SUBSURF").levels = 1
    rig = bind(objects)
    bend(rig, 1.0)
    assert rig.settings.state == "LIVE", rig.settings.message
    live = shown(rig.skin)
    assert len(live) > len(rest(rig.skin))
    assert np.abs(live - native(rig.skin)).max() < 1e-5 * rig.size
