"""Save, reload, undo, duplicate, delete, rename, change counts: each has one outcome, and never a wrong skin."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from scene import (
    Rig,
    bend,
    bind,
    bound_bar,
    build_bar,
    drag,
    enter_edit_mode,
    fat_key,
    leave_edit_mode,
    native,
    rest,
    select,
    set_mesh,
    shown,
    update,
)


def assert_paused_and_plain(rig: Rig, word: str) -> None:
    """The rig is paused for a reason that holds `word`; its skins do what Blender's own modifier does."""
    assert rig.settings.state == "PAUSED"
    assert word in rig.settings.message, rig.settings.message
    assert not rig.skin.modifiers["Cage Rig"].show_viewport
    assert rig.skin.modifiers["Armature"].show_viewport


def test_save_and_reload(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 1.0)
    fat_key(bar, value=0.8)
    before, posed = shown(bar.skin).copy(), rest(bar.posed)
    path = str(tmp_path / "bar.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    skin, cage = bpy.data.objects["Bar"], bpy.data.objects["BarCage"]
    rig = Rig([skin], cage.cage_rig.armature, cage)
    assert rig.settings.state == "LIVE"
    assert np.abs(shown(skin) - before).max() < 1e-6 * rig.size
    assert np.abs(rest(rig.posed) - posed).max() < 1e-6 * rig.size
    bend(rig, -0.4)
    assert np.abs(shown(skin) - before).max() > 0.1, "live after reload"


def test_append_into_another_file(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 1.0)
    before = shown(bar.skin).copy()
    path = str(tmp_path / "bar.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.append(directory=path + "/Object/", filename="Bar")
    update()
    skin = bpy.data.objects["Bar"]
    cage = skin.cage_rig.owner
    for obj in (cage, cage.cage_rig.armature, cage.cage_rig.posed_cage):
        if not obj.users_collection:
            bpy.context.scene.collection.objects.link(obj)
    update()
    rig = Rig([skin], cage.cage_rig.armature, cage)
    assert rig.settings.state == "LIVE", rig.settings.message
    assert np.abs(shown(skin) - before).max() < 1e-6 * rig.size
    bend(rig, 0.0)
    assert np.abs(shown(skin) - rest(skin)).max() < 1e-5


def test_duplicate_of_the_whole_character_lives_on_its_own(bar: Rig) -> None:
    bend(bar, 0.5)
    select([*bar.skins, bar.armature, bar.cage, bar.posed, bar.refit], bar.cage)
    bpy.ops.object.duplicate()
    update()
    cage = bpy.context.view_layer.objects.active
    assert cage != bar.cage
    twin = Rig([skin.object for skin in cage.cage_rig.skins], cage.cage_rig.armature, cage)
    assert twin.settings.state == "LIVE", twin.settings.message
    assert twin.skin != bar.skin and twin.armature != bar.armature and twin.posed != bar.posed
    before = shown(bar.skin).copy()
    bend(twin, -1.0)
    fat_key(twin)
    assert np.abs(shown(bar.skin) - before).max() == 0.0, "the first is untouched"
    assert np.abs(shown(twin.skin) - native(twin.skin)).max() > 1e-2
    assert bar.settings.state == "LIVE"


def test_duplicate_of_a_skin_alone_is_a_plain_skin(bar: Rig) -> None:
    bend(bar, 1.0)
    fat_key(bar)
    select([bar.skin], bar.skin)
    bpy.ops.object.duplicate()
    update()
    twin = bpy.context.view_layer.objects.active
    assert [m.name for m in twin.modifiers] == ["Armature"] and twin.modifiers["Armature"].show_viewport
    update()
    assert np.abs(shown(twin) - native(bar.skin)).max() < 1e-6
    assert bar.settings.state == "LIVE"


def test_duplicate_of_the_cage_alone_is_paused_and_can_start_anew(bar: Rig) -> None:
    before = shown(bar.skin).copy()
    select([bar.cage], bar.cage)
    bpy.ops.object.duplicate()
    update()
    twin = bpy.context.view_layer.objects.active
    assert twin.cage_rig.state == "PAUSED" and bar.cage.name in twin.cage_rig.message
    assert bar.settings.state == "LIVE"
    set_mesh(twin, rest(twin) * 2.0)
    assert np.array_equal(shown(bar.skin), before)
    select([twin], twin)
    bpy.ops.cage_rig.unbind()
    assert twin.cage_rig.state == "NONE"
    assert bar.settings.state == "LIVE" and bar.skin.modifiers["Cage Rig"].show_viewport


def delete(obj: bpy.types.Object, how: str) -> None:
    if how == "operator":
        select([obj], obj)
        bpy.ops.object.delete()
    else:
        bpy.data.objects.remove(obj)
    update()


@pytest.mark.parametrize("how", ["operator", "script"])
@pytest.mark.parametrize("part", ["armature", "posed"])
def test_deleted_part_pauses_the_rig(bar: Rig, part: str, how: str) -> None:
    bend(bar, 1.0)
    delete(getattr(bar, part), how)
    assert_paused_and_plain(bar, "deleted")


@pytest.mark.parametrize("how", ["operator", "script"])
def test_deleted_refit_bones_are_missed_by_nobody(bar: Rig, how: str) -> None:
    delete(bar.refit, how)
    bend(bar, 1.0)
    assert bar.settings.state == "LIVE"
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


@pytest.mark.parametrize("how", ["operator", "script"])
def test_deleted_cage_gives_the_skins_back(bar: Rig, how: str) -> None:
    bend(bar, 1.0)
    fat_key(bar)
    skin = bar.skin
    delete(bar.cage, how)
    update()
    assert skin.modifiers["Armature"].show_viewport
    ours = skin.modifiers.get("Cage Rig")
    assert ours is None or not ours.show_viewport


def test_what_a_handler_gives_back_is_removed_when_the_file_is_saved(bar: Rig, tmp_path: Path) -> None:
    """Not before: Blender's list of what was updated may still name it, for the handlers that come after."""
    bpy.data.objects.remove(bar.cage)
    update()
    assert bar.skin.cage_rig.part == "NONE" and [group.users for group in bpy.data.node_groups] == [0]
    path = str(tmp_path / "plain.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not bpy.data.node_groups


def test_deleted_posed_cage_comes_back_with_rebind(bar: Rig) -> None:
    delete(bar.posed, "script")
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.state == "LIVE" and bar.posed is not None
    bend(bar, 1.0)
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


def test_one_of_two_skins_deleted() -> None:
    objects = build_bar()
    twin = objects.skins[0].copy()
    twin.data = twin.data.copy()
    bpy.context.scene.collection.objects.link(twin)
    objects.skins.append(twin)
    rig = bind(objects)
    delete(twin, "operator")
    assert rig.settings.state == "LIVE" and "deleted" in rig.settings.message
    bend(rig, 1.0)
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 1e-5 * rig.size
    select([rig.cage], rig.cage)
    bpy.ops.cage_rig.rebind()
    assert len(rig.settings.skins) == 1 and rig.settings.message == ""


def test_all_skins_deleted(bar: Rig) -> None:
    delete(bar.skin, "script")
    assert bar.settings.state == "PAUSED" and "skins" in bar.settings.message


def test_renamed_bones_and_objects_are_followed(bar: Rig) -> None:
    bar.armature.data.bones["upper"].name = "forearm"
    bar.cage.name, bar.skin.name, bar.armature.name = "A", "B", "C"
    update()
    bend(bar, 1.0, "forearm")
    assert bar.settings.state == "LIVE", bar.settings.message
    assert [joint.name for joint in bar.settings.joints] == ["lower", "forearm"]
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


def test_renamed_bones_still_drive_when_hidden(bar: Rig) -> None:
    bar.armature.data.bones["upper"].name = "forearm"
    bar.armature.hide_viewport = bar.cage.hide_viewport = bar.posed.hide_viewport = bar.refit.hide_viewport = True
    update()
    before = shown(bar.skin).copy()
    bend(bar, 1.0, "forearm")
    assert np.abs(shown(bar.skin) - before).max() > 0.1


def edit_bones(rig: Rig, change: object) -> None:
    select([rig.armature], rig.armature)
    bpy.ops.object.mode_set(mode="EDIT")
    change(rig.armature.data.edit_bones)
    bpy.ops.object.mode_set(mode="OBJECT")
    update()


def test_bones_that_exchange_their_names_are_followed(bar: Rig) -> None:
    one, other = (bone.name for bone in bar.armature.data.bones)
    bones = bar.armature.data.bones
    bones[one].name, bones[other].name = "between", one
    bones["between"].name = other
    update()
    bend(bar, 0.6, one)
    bend(bar, -0.3, other)
    assert bar.settings.state == "LIVE" and bar.settings.message == ""
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-6


def test_moved_rest_bones_are_told(bar: Rig) -> None:
    bend(bar, 0.6)
    enter_edit_mode(bar.armature)
    bar.armature.data.edit_bones["upper"].head.x += 0.1
    leave_edit_mode()
    assert bar.settings.state == "LIVE"
    assert "' of 'BarRig' rests otherwise than when it was bound" in bar.settings.message
    bpy.context.scene.frame_set(3)
    assert "rests otherwise" in bar.settings.message
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.message == "" and np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-6


@pytest.mark.parametrize("mode", ["EDIT", "SCULPT"])
def test_moved_vertices_of_a_skin_are_told(bar: Rig, mode: str) -> None:
    bend(bar, 0.6)
    bpy.ops.ed.undo_push(message="Bend")
    select([bar.skin], bar.skin)
    bpy.ops.object.mode_set(mode=mode)
    if mode == "EDIT":
        drag(bar.skin, 7, (0.0, 0.0, 0.1))
    else:
        points = rest(bar.skin)
        points[7, 2] += 0.1
        set_mesh(bar.skin, points)
    leave_edit_mode()
    assert bar.settings.state == "LIVE"
    assert bar.settings.message.startswith("The vertices of 'Bar' were moved since it was bound; press Rebind")
    bend(bar, 0.5)
    assert bar.settings.message != ""
    bpy.ops.ed.undo_push(message="Edit")
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.message == "" and np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-6


def test_deleted_bone_pauses_by_name(bar: Rig) -> None:
    edit_bones(bar, lambda bones: bones.remove(bones["upper"]))
    assert_paused_and_plain(bar, "'upper'")


def test_added_bone_changes_nothing(bar: Rig) -> None:
    bend(bar, 1.0)
    before = shown(bar.skin).copy()

    def add(bones: bpy.types.ArmatureEditBones) -> None:
        bone = bones.new("extra")
        bone.head, bone.tail = (0, 0, 1), (0, 0, 2)

    edit_bones(bar, add)
    update()
    assert bar.settings.state == "LIVE"
    assert np.abs(shown(bar.skin) - before).max() < 1e-6


def change_vertex_count(obj: bpy.types.Object) -> None:
    select([obj], obj)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode="OBJECT")
    update()


@pytest.mark.parametrize("part", ["skin", "cage", "posed"])
def test_changed_vertex_count_pauses_and_rebind_mends(bar: Rig, part: str) -> None:
    bend(bar, 0.8)
    obj = getattr(bar, part)
    change_vertex_count(obj)
    assert_paused_and_plain(bar, f"'{obj.name}'")
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert bar.settings.state == "LIVE", bar.settings.message
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


def test_subdivision_on_the_cage_pauses_until_it_is_off(bar: Rig) -> None:
    modifier = bar.cage.modifiers.new("Subdivision", "SUBSURF")
    update()
    assert_paused_and_plain(bar, "vertices")
    modifier.show_viewport = False
    update()
    assert bar.settings.state == "LIVE"


@pytest.mark.parametrize("part", ["cage", "posed"])
def test_vertices_in_another_order_pause(bar: Rig, part: str) -> None:
    obj = getattr(bar, part)
    enter_edit_mode(obj)
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.sort_elements(type="RANDOMIZE", elements={"VERT"}, seed=3)
    leave_edit_mode()
    assert bar.settings.state == "PAUSED" and bar.settings.fix == "rebind"
    assert f"'{obj.name}' has other vertices or faces" in bar.settings.message


def test_flipped_or_sorted_faces_change_nothing(bar: Rig) -> None:
    bend(bar, 0.7)
    before = shown(bar.skin).copy()
    enter_edit_mode(bar.cage)
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.flip_normals()
    bpy.ops.mesh.sort_elements(type="REVERSE", elements={"FACE"})
    leave_edit_mode()
    assert bar.settings.state == "LIVE" and np.array_equal(shown(bar.skin), before)


def test_removed_modifier_pauses(bar: Rig) -> None:
    bar.skin.modifiers.remove(bar.skin.modifiers["Cage Rig"])
    update()
    assert bar.settings.state == "PAUSED" and "modifier" in bar.settings.message
    assert bar.skin.modifiers["Armature"].show_viewport


def test_skin_in_edit_mode_is_left_alone(bar: Rig) -> None:
    bend(bar, 1.0)
    select([bar.skin], bar.skin)
    bpy.ops.object.mode_set(mode="EDIT")
    update()
    bend(bar, 0.5)
    assert bar.settings.state == "LIVE", bar.settings.message
    bpy.ops.object.mode_set(mode="OBJECT")
    update()
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


def test_armature_in_rest_position_shows_the_rest_skin(bar: Rig) -> None:
    bend(bar, 1.0)
    bar.armature.data.pose_position = "REST"
    update()
    assert np.abs(shown(bar.skin) - rest(bar.skin)).max() < 1e-6


def test_two_rigs_in_one_file_do_not_meet() -> None:
    first, second = bound_bar(), bound_bar()
    bend(first, 1.0)
    before = shown(first.skin).copy()
    bend(second, -0.5)
    fat_key(second)
    assert np.array_equal(shown(first.skin), before)
    assert first.settings.state == second.settings.state == "LIVE"


def test_a_newer_file_opens_paused(bar: Rig) -> None:
    bar.settings.version = 99
    bend(bar, 1.0)
    assert_paused_and_plain(bar, "newer")


def test_idle_updates_do_no_work(bar: Rig) -> None:
    import bl_ext.user_default.cage_rig.sync as sync

    bend(bar, 1.0)
    session = sync._running[bar.cage.session_uid].session
    before, revision = dict(session.rig.work), session.revision
    other = bpy.data.objects.new("Elsewhere", None)
    bpy.context.scene.collection.objects.link(other)
    for step in range(20):
        other.location.x = step
        update()
    bar.cage.update_tag()
    update()
    assert session.revision == revision and dict(session.rig.work) == before


def test_disable_and_enable_again(bar: Rig) -> None:
    import addon_utils

    bend(bar, 1.0)
    fat_key(bar)
    before = shown(bar.skin).copy()
    module = "bl_ext.user_default.cage_rig"
    addon_utils.disable(module)
    for name in ("depsgraph_update_post", "frame_change_post", "undo_post", "redo_post", "load_post"):
        assert not [h for h in getattr(bpy.app.handlers, name) if "cage_rig" in h.__module__]
    addon_utils.enable(module)
    update()
    cage = bpy.data.objects["BarCage"]
    assert cage.cage_rig.state == "LIVE"
    assert np.abs(shown(bar.skin) - before).max() < 1e-6
    bend(bar, 0.2)
    assert np.abs(shown(bar.skin) - before).max() > 0.05


def test_a_panic_of_the_core_pauses_and_rebind_starts_anew(bar: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    import bl_ext.user_default.cage_rig.sync as sync
    import cage_rig_core

    class Panicking:
        method = "lbs"

        def play_posed(self, *_: object) -> None:
            raise cage_rig_core.PanicException("index out of bounds")

        offset_rest_skin = play_posed

    monkeypatch.setattr(sync._running[bar.cage.session_uid].session, "rig", Panicking())
    bend(bar, 1.0)
    assert_paused_and_plain(bar, "index out of bounds")
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.rebind()
    assert bar.settings.state == "LIVE"


def test_an_unforeseen_error_pauses_and_never_raises(bar: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    import bl_ext.user_default.cage_rig.sync as sync

    def fail(*_: object) -> None:
        raise KeyError("whatever")

    monkeypatch.setattr(sync, "_advance", fail)
    bend(bar, 1.0)
    assert_paused_and_plain(bar, "please report")
    monkeypatch.undo()
    bend(bar, 0.5)
    assert bar.settings.state == "LIVE"
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


def test_rigs_that_exchange_their_names_are_told_apart() -> None:
    one, other = bound_bar(), bound_bar()
    names = one.cage.name, other.cage.name
    one.cage.name, other.cage.name = "Between", names[0]
    one.cage.name = names[1]
    bend(one, 0.8)
    assert np.abs(shown(one.skin) - native(one.skin)).max() < 1e-6


def test_a_rig_that_takes_the_place_of_as_many_objects_is_found(tmp_path: Path) -> None:
    path = str(tmp_path / "bar.blend")
    count = len(bpy.data.objects)
    bound_bar()
    count = len(bpy.data.objects) - count
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for k in range(count):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Empty {k}", None))
    update()
    for _ in range(2):  # in place of other objects, and of a rig of the same name
        bpy.data.batch_remove(list(bpy.data.objects))
        with bpy.data.libraries.load(path) as (there, here):
            here.objects = list(there.objects)
        for obj in here.objects:
            if obj.cage_rig.part != "NONE" or obj.type == "ARMATURE" or obj.cage_rig.state != "NONE":
                bpy.context.scene.collection.objects.link(obj)
        update()
        objects = bpy.data.objects
        rig = Rig([objects["Bar"]], objects["BarRig"], objects["BarCage"])
        bend(rig, 0.8)
        assert np.abs(shown(rig.skin) - rest(rig.skin)).max() > 0.1, rig.settings.message
        assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 1e-6
