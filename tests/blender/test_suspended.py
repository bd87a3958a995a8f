"""The Armature modifiers that a rig stands in for: they come back whole, whatever is done meanwhile."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from scene import Points, Rig, bend, file_state, native, rest, select, shown, unwatched, update


def suspended(rig: Rig) -> bpy.types.Modifier:
    return next(found for found in rig.skin.modifiers if found.type == "ARMATURE")


def unbind(rig: Rig) -> None:
    select([rig.cage], rig.cage)
    bpy.ops.cage_rig.unbind()
    update()


def posed_by(native_modifier: bpy.types.Modifier) -> Points:
    """What the artist sees who shows this modifier and hides ours."""
    skin = native_modifier.id_data
    skin.modifiers["Cage Rig"].show_viewport = False
    native_modifier.show_viewport = True
    update()
    return shown(skin)


def test_one_that_was_renamed_is_given_back_by_unbind(bar: Rig) -> None:
    bend(bar, 1.0)
    plain = native(bar.skin)
    suspended(bar).name = "Bones"
    unbind(bar)
    assert suspended(bar).use_vertex_groups and suspended(bar).show_viewport and suspended(bar).show_render
    assert np.abs(shown(bar.skin) - plain).max() < 1e-6


def test_one_that_was_renamed_moves_the_skin_while_somebody_shows_it(bar: Rig) -> None:
    bend(bar, 1.0)
    plain = native(bar.skin)
    suspended(bar).name = "Bones"
    assert np.abs(posed_by(suspended(bar)) - plain).max() < 1e-6


@pytest.mark.parametrize("where", ["show_viewport", "show_render"])
def test_one_that_is_shown_beside_ours_is_told(bar: Rig, where: str) -> None:
    bend(bar, 1.0)
    setattr(suspended(bar), where, True)
    update()
    assert bar.settings.message == "Modifier 'Armature' of 'Bar' deforms it a second time; hide it, or press Unbind"
    setattr(suspended(bar), where, False)
    update()
    assert bar.settings.state == "LIVE" and bar.settings.message == ""


def test_one_that_was_renamed_is_remembered_by_rebind(bar: Rig) -> None:
    suspended(bar).name = "Bones"
    select([bar.cage], bar.cage)
    assert bpy.ops.cage_rig.rebind() == {"FINISHED"}
    assert len(bar.skin.cage_rig.suspended) == 1
    unbind(bar)
    assert suspended(bar).use_vertex_groups and suspended(bar).show_viewport


def test_one_that_was_replaced_under_its_name_is_taken_for_it(bar: Rig) -> None:
    bar.skin.modifiers.remove(suspended(bar))
    made = bar.skin.modifiers.new("Armature", "ARMATURE")
    made.object, made.show_viewport = bar.armature, False
    update()
    unbind(bar)
    assert made.use_vertex_groups and made.show_viewport


def test_a_saved_file_has_it_whole_for_whoever_lacks_the_add_on(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 1.0)
    plain, before = native(bar.skin), shown(bar.skin)
    path = str(tmp_path / "bound.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert not suspended(bar).use_vertex_groups, "the rig goes on as it was"
    update()
    assert bar.settings.state == "LIVE" and np.array_equal(shown(bar.skin), before)
    with unwatched():
        bpy.ops.wm.open_mainfile(filepath=path)
        skin = bpy.data.objects["Bar"]
        assert skin.modifiers["Cage Rig"].show_viewport and not skin.modifiers["Armature"].show_viewport
        assert np.abs(shown(skin) - before).max() < 1e-6, "it keeps the last pose"
        assert np.abs(posed_by(skin.modifiers["Armature"]) - plain).max() < 1e-6


def test_what_was_saved_while_bound_is_unbound_later(bar: Rig, tmp_path: Path) -> None:
    path = str(tmp_path / "bound.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    update()
    cage = bpy.data.objects["BarCage"]
    rig = Rig([bpy.data.objects["Bar"]], bpy.data.objects["BarRig"], cage)
    assert rig.settings.state == "LIVE" and not suspended(rig).use_vertex_groups
    unbind(rig)
    assert suspended(rig).use_vertex_groups and suspended(rig).show_viewport


def test_a_save_that_fails_leaves_the_rig_as_it_was(bar: Rig, tmp_path: Path) -> None:
    state = file_state()
    (tmp_path / "bound.blend@").mkdir()  # in the way of the temporary file
    with pytest.raises(RuntimeError):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "bound.blend"))
    assert not suspended(bar).use_vertex_groups and file_state() == state


def test_a_save_while_paused_leaves_it_shown(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 1.0)
    bpy.data.objects.remove(bar.posed)
    update()
    assert bar.settings.state == "PAUSED"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "paused.blend"))
    update()
    assert suspended(bar).use_vertex_groups and suspended(bar).show_viewport
    assert np.abs(shown(bar.skin) - rest(bar.skin)).max() > 0.1


def test_it_is_whole_while_the_add_on_is_disabled_and_rests_again_after(bar: Rig) -> None:
    import addon_utils

    bend(bar, 1.0)
    plain, module = native(bar.skin), "bl_ext.user_default.cage_rig"
    addon_utils.disable(module)
    assert suspended(bar).use_vertex_groups
    assert np.abs(posed_by(suspended(bar)) - plain).max() < 1e-6
    suspended(bar).show_viewport, bar.skin.modifiers["Cage Rig"].show_viewport = False, True
    addon_utils.enable(module)
    update()
    assert bpy.data.objects["BarCage"].cage_rig.state == "LIVE" and not suspended(bar).use_vertex_groups
