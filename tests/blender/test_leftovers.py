"""A rig that is deleted as a whole is not in the file any more once it is saved; what is used stays."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from scene import Rig, bend, rest, select, shown, update


def everything(rig: Rig) -> list[bpy.types.Object]:
    return [*rig.skins, rig.armature, rig.cage, rig.posed, rig.refit]


def delete(rig: Rig) -> None:
    select(everything(rig), rig.cage)
    bpy.ops.object.delete()
    update()


def reopened(path: Path) -> bpy.types.BlendData:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data


def test_a_deleted_rig_is_not_saved(bar: Rig, tmp_path: Path) -> None:
    delete(bar)
    data = reopened(tmp_path / "empty.blend")
    kinds = ("objects", "meshes", "armatures", "node_groups", "shape_keys", "actions")
    assert {kind: list(getattr(data, kind)) for kind in kinds} == {kind: [] for kind in kinds}


def test_copies_come_and_go_without_a_trace(bar: Rig, tmp_path: Path) -> None:
    counts = []
    for turn in range(3):
        rig = Rig([bpy.data.objects["Bar"]], bpy.data.objects["BarRig"], bpy.data.objects["BarCage"])
        select(everything(rig), rig.cage)
        bpy.ops.object.duplicate()
        update()
        bpy.ops.object.delete()
        update()
        data = reopened(tmp_path / f"{turn}.blend")
        counts.append([len(data.objects), len(data.meshes), len(data.armatures)])
    assert counts == [[5, 5, 2]] * 3
    assert data.objects["BarCage"].cage_rig.state == "LIVE"


def test_undo_brings_back_what_a_save_has_dropped(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 0.7)
    before = shown(bar.skin).copy()
    bpy.ops.ed.undo_push(message="bent")
    delete(bar)
    bpy.ops.ed.undo_push(message="deleted")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "empty.blend"))
    assert "BarCage" not in bpy.data.objects
    bpy.ops.ed.undo()
    update()
    cage = bpy.data.objects["BarCage"]
    assert cage.cage_rig.state == "LIVE", cage.cage_rig.message
    assert np.abs(shown(bpy.data.objects["Bar"]) - before).max() < 1e-5


def _in_another_scene(rig: Rig) -> None:
    bpy.data.scenes.new("Other").collection.objects.link(rig.cage)


def _fake_user(rig: Rig) -> None:
    rig.cage.use_fake_user = True


def _asset(rig: Rig) -> None:
    rig.cage.asset_mark()


def _target_of_a_modifier(rig: Rig) -> None:
    other = bpy.data.objects.new("Other", bpy.data.meshes.new("Other"))
    bpy.context.scene.collection.objects.link(other)
    other.modifiers.new("Wrap", "SHRINKWRAP").target = rig.skin


@pytest.mark.parametrize("use", [_in_another_scene, _fake_user, _asset, _target_of_a_modifier])
def test_what_something_uses_stays_whole(bar: Rig, tmp_path: Path, use: object) -> None:
    use(bar)
    names = sorted(obj.name for obj in everything(bar))
    points = rest(bar.cage)
    for obj in everything(bar):
        for collection in obj.users_collection:
            if obj != bar.cage or collection == bpy.context.scene.collection:
                collection.objects.unlink(obj)
    update()
    data = reopened(tmp_path / "kept.blend")
    assert {obj.name for obj in data.objects} >= set(names)
    cage = data.objects["BarCage"]
    assert np.array_equal(rest(cage), points) and cage.cage_rig.skins[0].snapshot is not None


def test_a_skin_that_stays_keeps_its_rig(bar: Rig, tmp_path: Path) -> None:
    select([bar.armature, bar.cage, bar.posed, bar.refit], bar.cage)
    bpy.ops.object.delete()
    update()
    cage = reopened(tmp_path / "kept.blend").objects["BarCage"]
    assert cage.cage_rig.state == "PAUSED" and "was deleted" in cage.cage_rig.message
