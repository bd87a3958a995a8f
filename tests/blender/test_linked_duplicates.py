"""Linked duplicates (Alt D): characters that share meshes are posed each by its own rig."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from scene import Rig, bend, fresh, native, rest, select, set_mesh, shown, update
from test_linked import library, override


def duplicated(rig: Rig, *, linked: bool = True) -> Rig:
    select([*rig.skins, rig.armature, rig.cage, rig.posed, rig.refit], rig.cage)
    bpy.ops.object.duplicate(linked=linked)
    update()
    cage = next(obj for obj in bpy.context.selected_objects if obj.cage_rig.state != "NONE")
    return Rig([skin.object for skin in cage.cage_rig.skins], cage.cage_rig.armature, cage)


def off(rig: Rig) -> float:
    """How far the skin is from Blender's own, where the rest cage is not edited."""
    assert rig.settings.state == "LIVE", rig.settings.message
    return float(np.abs(shown(rig.skin) - native(rig.skin)).max())


def test_each_has_its_own_pose(bar: Rig) -> None:
    bend(bar, 0.5)
    other = duplicated(bar)
    assert other.skin.data == bar.skin.data and other.cage.data == bar.cage.data
    assert other.posed.data != bar.posed.data
    for rig, angle in ((other, -0.5), (bar, 0.9), (other, 0.2)):
        bend(rig, angle)
        assert max(off(bar), off(other)) < 1e-6
    bpy.context.scene.frame_set(7)
    assert max(off(bar), off(other)) < 1e-6


def test_they_share_the_rest_cage(bar: Rig) -> None:
    other = duplicated(bar)
    bend(bar, 0.5)
    bend(other, -0.3)
    points = rest(bar.posed)
    points[3] += (0.1, 0.05, 0.0)
    set_mesh(bar.posed, points)
    assert np.abs(rest(bar.posed) - points).max() < 1e-5
    for rig in (bar, other):
        assert rig.settings.state == "LIVE" and np.abs(shown(rig.skin) - native(rig.skin)).max() > 0.01
        before = shown(rig.skin).copy()
        assert np.abs(fresh(rig)[0] - before).max() < 1e-6


def test_one_of_them_goes(bar: Rig) -> None:
    other = duplicated(bar)
    bend(bar, 0.5)
    select([other.cage], other.cage)
    assert bpy.ops.cage_rig.unbind() == {"FINISHED"}
    update()
    assert off(bar) < 1e-6
    bpy.data.objects.remove(other.skin)
    update()
    bend(bar, 0.7)
    assert off(bar) < 1e-6
    used = [obj for obj in bpy.data.objects if obj.name.endswith("Result") and obj.users]
    assert not used, "nobody needs one any more"


def test_they_are_saved_and_undone(bar: Rig, tmp_path: Path) -> None:
    names = [(rig.skin.name, rig.armature.name, rig.cage.name) for rig in (bar, duplicated(bar))]

    def again(k: int) -> Rig:
        skin, armature, cage = (bpy.data.objects[name] for name in names[k])
        return Rig([skin], armature, cage)

    bend(again(0), 0.5)
    bend(again(1), -0.5)
    bpy.ops.ed.undo_push(message="Bend")
    bend(again(1), -0.9)
    bpy.ops.ed.undo_push(message="Bend More")
    bpy.ops.ed.undo()
    update()
    assert max(off(again(0)), off(again(1))) < 1e-6
    path = str(tmp_path / "two.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    update()
    assert max(off(again(0)), off(again(1))) < 1e-6
    bend(again(0), 0.1)
    assert max(off(again(0)), off(again(1))) < 1e-6


def test_a_copy_of_the_skin_alone_leaves_the_rig_alone(bar: Rig) -> None:
    bend(bar, 0.5)
    select([bar.skin], bar.skin)
    bpy.ops.object.duplicate(linked=True)
    update()
    copy = bpy.context.object
    bend(bar, 0.9)
    assert off(bar) < 1e-6 and copy.cage_rig.part == "NONE"
    bpy.data.objects.remove(copy)
    bend(bar, 0.4)
    assert off(bar) < 1e-6


def test_a_duplicate_of_an_overridden_character_has_its_own_pose(bar: Rig, tmp_path: Path) -> None:
    path = library(bar, tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = override(path)
    bend(rig, 0.5)
    other = duplicated(rig, linked=False)
    assert other.skin != rig.skin
    bend(other, -0.4)
    bend(rig, 0.8)
    for found in (rig, other):
        assert found.settings.state == "LIVE", found.settings.message
        before = shown(found.skin).copy()
        assert np.abs(fresh(found)[0] - before).max() < 1e-6
    assert np.abs(shown(rig.skin) - shown(other.skin)).max() > 0.1
