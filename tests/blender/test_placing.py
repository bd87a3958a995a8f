"""Apply (Ctrl A) and Set Origin on what belongs to a rig: points have other coordinates, and nothing moves."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scene import Points, Rig, bend, bind, build_bar, fat_key, fresh, rest, select, set_mesh, shown, small_cage, update

from blend_fixtures.build import RigObjects

PLACED = Matrix.LocRotScale((0.3, -0.2, 0.5), Matrix.Rotation(0.4, 3, "Z").to_quaternion(), (2.0, 2.0, 2.0))
UNEVEN = Matrix.LocRotScale((0.1, 0.2, 0.0), Matrix.Rotation(-0.3, 3, "X").to_quaternion(), (1.2, 0.7, 1.5))


def placed(cage: bpy.types.Object | None = None) -> Rig:
    """A bar whose objects have transforms of their own, bound."""
    objects = build_bar()
    if cage is not None:
        bpy.data.objects.remove(objects.cage)
        objects = RigObjects(objects.skins, objects.armature, cage)
    for obj in (*objects.skins, objects.cage):
        apart = UNEVEN.inverted()
        obj.data.transform(apart)
        obj.matrix_world = UNEVEN
    update()
    for obj in (objects.armature, objects.cage):
        obj.matrix_world = PLACED @ obj.matrix_world
    update()
    return bind(objects)


def in_world(obj: bpy.types.Object) -> Points:
    matrix = np.array(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)
    return shown(obj) @ matrix[:3, :3].T + matrix[:3, 3]


def every(rig: Rig) -> dict[str, list[bpy.types.Object]]:
    return {
        "cage": [rig.cage],
        "skin": [rig.skin],
        "armature": [rig.armature],
        "skin and cage": [rig.skin, rig.cage],
        "bound": [rig.skin, rig.armature, rig.cage],
        "posed": [rig.posed],
        "all": [rig.skin, rig.armature, rig.cage, rig.posed, rig.refit],
    }


def apply(objects: list[bpy.types.Object]) -> None:
    select(objects, objects[0])
    assert bpy.ops.object.transform_apply() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="Apply")  # before a handler is called, as in the window
    update()


def set_origin(objects: list[bpy.types.Object]) -> None:
    select(objects, objects[0])
    assert bpy.ops.object.origin_set(type="ORIGIN_GEOMETRY") == {"FINISHED"}
    bpy.ops.ed.undo_push(message="Set Origin")
    update()


def again(rig: Rig) -> Rig:
    objects = bpy.data.objects
    return Rig([objects["Bar"]], objects["BarRig"], next(obj for obj in objects if obj.cage_rig.state != "NONE"))


def edit(rig: Rig) -> None:
    fat_key(rig, 1.3)


def edit_base(rig: Rig) -> None:
    middle = rest(rig.cage).mean(0)
    set_mesh(rig.cage, (rest(rig.cage) - middle) * (1.2, 1.3, 1.1) + middle)


def nothing(_rig: Rig) -> None:
    pass


def check(rig: Rig, before: dict[str, Points]) -> None:
    """The skin is where it was, and the posed cage, which may hold on to other points of the skin after rounding."""
    assert rig.settings.state == "LIVE", rig.settings.message
    for name, obj, near in (("skin", rig.skin, 2e-4), ("posed", rig.posed, 0.05)):
        assert np.abs(in_world(obj) - before[name]).max() < near * rig.size, name


def look(rig: Rig) -> dict[str, Points]:
    return {"skin": in_world(rig.skin), "posed": in_world(rig.posed)}


@pytest.mark.parametrize("change", [nothing, edit, edit_base])
@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("what", ["cage", "skin", "armature", "skin and cage", "bound", "posed", "all"])
@pytest.mark.parametrize("do", [apply, set_origin])
def test_nothing_moves(
    do: Callable[[list[bpy.types.Object]], None], what: str, partial: bool, change: Callable[[Rig], None]
) -> None:
    rig = placed(small_cage() if partial else None)
    change(rig)
    bend(rig, 0.6)
    before = look(rig)
    other = bent(rig)
    do(every(rig)[what])
    check(rig, before)
    check_bent(rig, other)
    again = fresh(rig)[0]
    assert np.abs(again - shown(rig.skin)).max() < 1e-6
    points = rest(rig.posed)
    points[3] += 0.02 * rig.size
    set_mesh(rig.posed, points)
    assert np.abs(rest(rig.posed) - points).max() < 1e-5 * rig.size, "the posed cage is dragged as before"


def bent(rig: Rig) -> dict[str, Points]:
    bend(rig, -0.4)
    found = look(rig)
    bend(rig, 0.6)
    return found


def check_bent(rig: Rig, wanted: dict[str, Points]) -> None:
    bend(rig, -0.4)
    check(rig, wanted)
    bend(rig, 0.6)


@pytest.mark.parametrize("what", ["cage", "armature", "all"])
def test_undo_and_redo(what: str) -> None:
    rig = placed()
    edit(rig)
    bend(rig, 0.6)
    before = look(rig)
    bpy.ops.ed.undo_push(message="Bend")
    apply(every(rig)[what])
    bpy.ops.ed.undo()
    update()
    check(again(rig), before)
    bpy.ops.ed.redo()
    update()
    check(again(rig), before)
    bend(again(rig), -0.4)
    bpy.ops.ed.undo_push(message="Bend Back")
    edit_keys(again(rig))
    bpy.ops.ed.undo_push(message="Edit")
    for _ in range(2):
        bpy.ops.ed.undo()
    update()
    check(again(rig), before)
    bpy.ops.ed.undo()
    update()
    check(again(rig), before)


def edit_keys(rig: Rig) -> None:
    for block in rig.cage.data.shape_keys.key_blocks[1:]:
        block.value = 0.3
    update()


@pytest.mark.parametrize("what", ["skin", "armature", "bound"])
def test_a_skin_that_was_moved_stays_where_it_is(what: str) -> None:
    rig = placed()
    edit(rig)
    bend(rig, 0.6)
    rig.skin.rotation_euler.z += 0.3
    rig.skin.scale *= 1.2
    update()
    before = look(rig)
    apply(every(rig)[what])
    check(rig, before)
    assert np.abs(shown(rig.skin) - fresh(rig)[0]).max() < 1e-6


def test_a_cage_that_is_moved_stays_what_it_was() -> None:
    """Its transform is taken once, at the bind."""
    rig = placed()
    bend(rig, 0.6)
    before = look(rig)
    rig.cage.location.x += 1.0
    rig.cage.scale *= 1.5
    update()
    check(rig, before)
    apply([rig.cage])
    check(rig, before)
    set_mesh(rig.cage, rest(rig.cage) * 1.1)
    assert np.abs(in_world(rig.skin) - before["skin"]).max() > 0.01, "an edit is an edit"


@pytest.mark.parametrize("scale", [0.01, 100.0])
def test_a_character_that_was_moved_far_and_scaled(scale: float) -> None:
    rig = placed()
    edit(rig)
    bend(rig, 0.6)
    for obj in (rig.armature, rig.cage):
        obj.matrix_world = Matrix.LocRotScale((5.0, -7.0, 30.0), None, (scale,) * 3) @ obj.matrix_world
    update()
    before, size = in_world(rig.skin), scale * 3.6
    apply([rig.skin, rig.armature, rig.cage, rig.posed, rig.refit])
    assert rig.settings.state == "LIVE" and rig.settings.message == "", rig.settings.message
    assert np.abs(in_world(rig.skin) - before).max() < 2e-3 * size


def test_bones_that_are_scaled_in_edit_mode_are_another_rest_pose() -> None:
    rig = placed()
    before = list(rig.settings.joints[0].tail)
    select([rig.armature], rig.armature)
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in rig.armature.data.edit_bones:
        bone.head, bone.tail = bone.head * 1.5, bone.tail * 1.5
    bpy.ops.object.mode_set(mode="OBJECT")
    update()
    assert list(rig.settings.joints[0].tail) == before


def test_a_saved_file_has_taken_it_over(tmp_path: object) -> None:
    rig = placed()
    edit(rig)
    bend(rig, 0.6)
    before = look(rig)
    apply([rig.cage])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "applied.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "applied.blend"))
    update()
    check(again(rig), before)
