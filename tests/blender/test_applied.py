"""An applied Cage Rig modifier: the mesh keeps what was shown, nothing deforms it again, and undo brings all back."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scene import (
    Points,
    Rig,
    bend,
    bind,
    build_bar,
    partly_caged,
    rest,
    select,
    set_mesh,
    shown,
    small_cage,
    update,
)  # fmt: skip

from blend_fixtures.build import RigObjects, build_character
from blend_fixtures.small import two_skins


def push(name: str) -> None:
    bpy.ops.ed.undo_push(message=name)


def reshape(rig: Rig) -> None:
    set_mesh(rig.cage, rest(rig.cage) * (1.2, 1.1, 1.0))


def apply(skin: bpy.types.Object) -> None:
    select([skin], skin)
    assert bpy.ops.object.modifier_apply(modifier="Cage Rig") == {"FINISHED"}
    push("Apply")  # as in the window: the step is saved before a handler is called
    update()


def convert(skin: bpy.types.Object) -> None:
    select([skin], skin)
    assert bpy.ops.object.convert(target="MESH") == {"FINISHED"}
    push("Convert")
    update()


def again(rig: Rig) -> Rig:
    """After an undo every reference is another one."""
    objects = bpy.data.objects
    return Rig([objects[name] for name in ("Bar",)], objects["BarRig"], objects["BarCage"])


def keeps(skin: bpy.types.Object, wanted: Points, near: float) -> None:
    assert np.abs(rest(skin) - wanted).max() < near
    assert np.abs(shown(skin) - wanted).max() < near


@pytest.fixture
def posed(bar: Rig) -> Points:
    bend(bar, 1.0)
    reshape(bar)
    before = shown(bar.skin).copy()
    assert np.abs(before - rest(bar.skin)).max() > 0.1
    return before


@pytest.mark.parametrize("how", [apply, convert])
def test_the_mesh_keeps_what_was_shown_and_is_not_deformed_again(bar: Rig, posed: Points, how: object) -> None:
    how(bar.skin)
    keeps(bar.skin, posed, 1e-6)
    bend(bar, 0.3)
    keeps(bar.skin, posed, 1e-6)
    assert bar.settings.state == "PAUSED" and bar.settings.fix == "unbind"
    assert bar.settings.message.startswith("Cage Rig was applied to 'Bar', which keeps its shape")
    assert not [found.name for found in bar.skin.data.attributes if found.name.startswith("cage_rig.")]
    assert all(not found.show_viewport and found.use_vertex_groups for found in bar.skin.modifiers)
    with pytest.raises(RuntimeError, match="deleted or applied"):
        select([bar.cage], bar.cage)
        bpy.ops.cage_rig.rebind()


def test_unbind_leaves_it_as_it_is_and_it_may_be_bound_again(bar: Rig, posed: Points) -> None:
    apply(bar.skin)
    select([bar.skin], bar.skin)
    assert bpy.ops.cage_rig.unbind() == {"FINISHED"}, "from the skin, whose panel says what happened"
    update()
    keeps(bar.skin, posed, 1e-6)
    assert bar.skin.cage_rig.part == "NONE" and not bar.skin.cage_rig.suspended
    bend(bar, 0.0)
    again = bind(RigObjects(bar.skins, bar.armature, bar.cage))
    assert again.settings.state == "LIVE" and np.abs(shown(bar.skin) - posed).max() < 1e-4


@pytest.mark.parametrize("how", [apply, convert])
def test_undo_and_redo(bar: Rig, posed: Points, how: object) -> None:
    push("Posed")
    how(bar.skin)
    bpy.ops.ed.undo()
    update()
    rig = again(bar)
    assert rig.settings.state == "LIVE" and not rig.settings.skins[0].applied, rig.settings.message
    assert np.abs(shown(rig.skin) - posed).max() < 1e-6 and np.abs(rest(rig.skin) - posed).max() > 0.1
    bend(rig, 0.2)
    assert np.abs(shown(rig.skin) - posed).max() > 0.1, "it follows"
    bpy.ops.ed.redo()
    update()
    rig = again(bar)
    keeps(rig.skin, posed, 1e-6)


def test_applied_is_saved_with_the_file(bar: Rig, posed: Points, tmp_path: object) -> None:
    apply(bar.skin)
    path = str(tmp_path / "applied.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    update()
    rig = again(bar)
    keeps(rig.skin, posed, 1e-6)
    set_mesh(rig.skin, rest(rig.skin) * 1.01)  # it is an ordinary mesh
    assert np.abs(shown(rig.skin) - 1.01 * posed).max() < 1e-5
    assert rig.settings.state == "PAUSED"


def test_one_skin_of_two_leaves_and_the_other_goes_on() -> None:
    rig = bind(build_character(two_skins()))
    bone = rig.armature.pose.bones[-1].name
    bend(rig, 0.8, bone)
    reshape(rig)
    first, second = (shown(skin).copy() for skin in rig.skins)
    apply(rig.skins[0])
    keeps(rig.skins[0], first, 1e-6)
    assert rig.settings.state == "LIVE" and np.abs(shown(rig.skins[1]) - second).max() < 1e-6
    assert f"Cage Rig was applied to '{rig.skins[0].name}'" in rig.settings.message
    bend(rig, 0.2, bone)
    moved = shown(rig.skins[1]).copy()
    assert np.abs(moved - second).max() > 0.01
    bpy.context.scene.frame_set(5)
    keeps(rig.skins[0], first, 1e-6)
    select([rig.cage], rig.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    update()
    assert len(rig.settings.skins) == 1 and rig.settings.message == "" and rig.settings.state == "LIVE"
    keeps(rig.skins[0], first, 1e-6)
    assert rig.skins[0].cage_rig.part == "NONE"
    apply(rig.skins[1])
    assert rig.settings.state == "PAUSED"
    keeps(rig.skins[0], first, 1e-6)


def test_all_skins_converted_at_once() -> None:
    rig = bind(build_character(two_skins()))
    for skin in rig.skins:
        skin.modifiers.new("Subdivision", "SUBSURF")
    bend(rig, 0.8, rig.armature.pose.bones[-1].name)
    before = [shown(skin).copy() for skin in rig.skins]
    select(rig.skins, rig.skins[0])
    assert bpy.ops.object.convert(target="MESH") == {"FINISHED"}
    update()
    for skin, wanted in zip(rig.skins, before, strict=True):
        keeps(skin, wanted, 1e-6)
    assert rig.settings.fix == "unbind" and rig.settings.message.startswith("Cage Rig was applied")


def test_the_upper_of_two_cages_applies_both() -> None:
    lower = bind(build_bar())
    upper = bind(RigObjects(lower.skins, lower.armature, small_cage()))
    bend(lower, 0.8)
    reshape(lower)
    set_mesh(upper.cage, rest(upper.cage) * (1.1, 1.0, 1.1))
    before = shown(lower.skin).copy()
    name = next(found.name for found in lower.skin.modifiers if found.type == "NODES" and leads(found))
    select([lower.skin], lower.skin)
    assert bpy.ops.object.modifier_apply(modifier=name) == {"FINISHED"}
    update()
    keeps(lower.skin, before, 1e-6)
    assert not [found for found in lower.skin.modifiers if found.type == "NODES"]
    for rig in (upper, lower):
        assert rig.settings.fix == "unbind"
        select([rig.cage], rig.cage)
        bpy.ops.cage_rig.unbind()
        update()
        keeps(lower.skin, before, 1e-6)


def leads(modifier: bpy.types.Modifier) -> bool:
    import bl_ext.user_default.cage_rig.adapters.modifier as ours

    return bool(ours.read(modifier, "Attribute"))


def test_another_cage_is_not_bound_to_an_applied_skin(bar: Rig, posed: Points) -> None:
    apply(bar.skin)
    other = small_cage()
    select([bar.skin, bar.armature, other], other)
    with pytest.raises(RuntimeError, match="'Bar' belongs to the rig of cage 'BarCage'; Unbind that first"):
        bpy.ops.cage_rig.bind()
    keeps(bar.skin, posed, 1e-6)


@pytest.mark.parametrize("pose", [0.0, 1.0])
def test_one_that_was_removed_is_told_from_one_that_was_applied(bar: Rig, pose: float) -> None:
    bend(bar, pose)
    bar.skin.modifiers.remove(bar.skin.modifiers["Cage Rig"])
    update()
    assert bar.settings.state == "PAUSED" and bar.settings.fix == "rebind"
    assert bar.skin.modifiers["Armature"].show_viewport and bar.skin.modifiers["Armature"].use_vertex_groups
    assert (np.abs(shown(bar.skin) - rest(bar.skin)).max() > 0.1) == (pose > 0)
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.state == "LIVE"


def test_applied_at_rest_nothing_is_deformed_twice(bar: Rig) -> None:
    apply(bar.skin)
    bend(bar, 0.7)
    assert bar.settings.state == "PAUSED" and bar.settings.fix == "rebind"
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.state == "LIVE"


def test_a_copy_as_a_mesh_leaves_the_rig_alone(bar: Rig, posed: Points) -> None:
    select([bar.skin], bar.skin)
    assert bpy.ops.object.convert(target="MESH", keep_original=True) == {"FINISHED"}
    update()
    copy = bpy.context.object
    assert copy != bar.skin and bar.settings.state == "LIVE", bar.settings.message
    keeps(copy, posed, 1e-6)
    bend(bar, 0.2)
    assert np.abs(shown(bar.skin) - posed).max() > 0.1
    keeps(copy, posed, 1e-6)


def test_with_shape_keys_blender_refuses_and_the_rig_goes_on(bar: Rig, posed: Points) -> None:
    bar.skin.shape_key_add(name="Basis")
    select([bar.skin], bar.skin)
    with pytest.raises(RuntimeError, match="shape keys"):
        bpy.ops.object.modifier_apply(modifier="Cage Rig")
    update()
    assert bar.settings.state == "LIVE" and np.abs(shown(bar.skin) - posed).max() < 1e-6


def test_a_partial_cage_and_a_modifier_before_ours() -> None:
    rig = partly_caged()
    wave = rig.skin.modifiers.new("Cast", "CAST")
    wave.factor = 0.2
    rig.skin.modifiers.move(rig.skin.modifiers.find("Cast"), 0)
    update()
    bpy.context.view_layer.update()
    bend(rig, 0.8)
    before = shown(rig.skin).copy()
    apply(rig.skin)
    assert np.abs(rest(rig.skin) - before).max() < 1e-6
    bend(rig, 0.1)
    assert np.abs(rest(rig.skin) - before).max() < 1e-6
    assert rig.settings.fix == "unbind" and not rig.skin.modifiers["Armature"].show_viewport
