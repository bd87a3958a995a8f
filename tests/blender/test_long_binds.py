"""Binds that run in a thread: nothing is written before the end, and nothing that has changed meanwhile is bound."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import bpy
import numpy as np
import pytest
from scene import (
    Rig,
    bend,
    bind,
    build_bar,
    fat_key,
    file_state,
    fresh,
    native,
    rest,
    select,
    set_mesh,
    shown,
    update,
)

from blend_fixtures.bar import bar as bar_character
from blend_fixtures.build import RigObjects, build_character


@pytest.fixture
def lifecycle() -> ModuleType:
    from bl_ext.user_default.cage_rig import lifecycle

    return lifecycle


def build_fine_bar() -> RigObjects:
    """The bar with vertices enough to be seen on the way, to be bound with centers of rotation."""
    objects = build_character(replace(bar_character(segments=200, across=30), shape_keys={}))
    objects.cage.cage_rig.method = "COR"
    return objects


def begin(lifecycle: ModuleType, objects: RigObjects) -> object:
    select(objects.all, objects.cage)
    return lifecycle.begin_bind(bpy.context, objects.cage, objects.armature, objects.skins)


def wait_for(work: object, share: float) -> bool:
    """Until so much is done; whether it is still under way."""
    while work.job.progress < share and not work.job.wait(0.001):
        pass
    return not work.job.wait(0.0)


def results(rig: Rig) -> dict[str, object]:
    """All that a bind gives, on the way and at the end."""
    bend(rig, 0.9)
    settings = rig.settings
    return {
        "skins": [shown(skin).tobytes() for skin in rig.skins],
        "posed": rest(rig.posed).tobytes(),
        "snapshots": [rest_of(settings.snapshot), *(rest_of(skin.snapshot) for skin in settings.skins)],
        "joints": [(j.name, tuple(j.head), tuple(j.tail), j.parent, j.weighted) for j in settings.joints],
        "settings": (settings.method, settings.state, settings.message, settings.coordinates),
        "file": {name: value for name, value in file_state().items() if name != settings.bind_id},
    }


def rest_of(mesh: bpy.types.Mesh) -> bytes:
    points = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    return points.tobytes()


def test_a_bind_cancelled_at_any_stage_changes_nothing(lifecycle: ModuleType) -> None:
    objects = build_fine_bar()
    objects.armature.data.pose_position = "POSE"
    before, midway, stages = file_state(), 0, set()
    for share in (0.0, 0.02, 0.2, 0.4, 0.6, 0.8, 0.95):
        work = begin(lifecycle, objects)
        midway += wait_for(work, share)
        stages.add(work.job.stage)
        assert file_state() == before
        work.job.cancel()
        del work
        assert file_state() == before
    assert midway >= 4 and len(stages) >= 2, "binds were cancelled on their way"
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    assert objects.cage.cage_rig.state == "LIVE"


def test_a_cancelled_bind_can_not_be_finished(lifecycle: ModuleType) -> None:
    objects = build_fine_bar()
    before = file_state()
    work = begin(lifecycle, objects)
    work.job.cancel()
    with pytest.raises(lifecycle.BindError, match="was cancelled"):
        work.finish(bpy.context, later=True)
    assert file_state() == before


@pytest.mark.parametrize("method", ["LBS", "DQS", "COR"])
@pytest.mark.parametrize("later", [True, False])
def test_a_bind_in_a_thread_is_the_bind_bit_for_bit(lifecycle: ModuleType, method: str, later: bool) -> None:
    found = []
    for threaded in (False, True):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        objects = build_bar()
        objects.cage.cage_rig.method = method
        if threaded:
            cage, note = begin(lifecycle, objects).finish(bpy.context, later=later)
            assert cage == objects.cage and note == ""
            found.append(results(Rig(objects.skins, objects.armature, objects.cage)))
        else:
            select(objects.all, objects.cage)
            lifecycle.bind(bpy.context, objects.cage, objects.armature, objects.skins)
            found.append(results(Rig(objects.skins, objects.armature, objects.cage)))
    assert found[0]["settings"][0] == method
    assert found[0].pop("file").keys() == found[1].pop("file").keys()
    assert found[0] == found[1]


def move_skin_vertex(objects: RigObjects) -> None:
    points = rest(objects.skins[0])
    points[5] += (0.0, 0.0, 1e-3)
    set_mesh(objects.skins[0], points)


def paint(objects: RigObjects) -> None:
    objects.skins[0].vertex_groups["upper"].add([3], 0.25, "REPLACE")


def move_cage_vertex(objects: RigObjects) -> None:
    set_mesh(objects.cage, rest(objects.cage) * np.float32(1.01))


def move_skin(objects: RigObjects) -> None:
    objects.skins[0].location.x += 0.01
    update()


def edit_a_bone(objects: RigObjects) -> None:
    select([objects.armature], objects.armature)
    bpy.ops.object.mode_set(mode="EDIT")
    objects.armature.data.edit_bones["upper"].tail.z += 0.1
    bpy.ops.object.mode_set(mode="OBJECT")


def rename_a_bone(objects: RigObjects) -> None:
    objects.armature.data.bones["lower"].name = "other"
    objects.armature.data.bones["other"].name = "root"


def delete_skin(objects: RigObjects) -> None:
    bpy.data.objects.remove(objects.skins[0])


def delete_cage_from_the_scene(objects: RigObjects) -> None:
    bpy.context.scene.collection.objects.unlink(objects.cage)
    for collection in objects.cage.users_collection:
        collection.objects.unlink(objects.cage)


def enter_edit_mode(objects: RigObjects) -> None:
    select([objects.cage], objects.cage)
    bpy.ops.object.mode_set(mode="EDIT")


def choose_preserve_volume(objects: RigObjects) -> None:
    objects.skins[0].modifiers["Armature"].use_deform_preserve_volume = True


def bind_meanwhile(objects: RigObjects) -> None:
    select(objects.all, objects.cage)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}


CHANGED = "were changed while they were being bound, so nothing was bound"
CHANGES: dict[str, tuple[Callable[[RigObjects], None], str]] = {
    "skin vertex": (move_skin_vertex, CHANGED),
    "weight": (paint, CHANGED),
    "cage vertex": (move_cage_vertex, CHANGED),
    "skin object": (move_skin, CHANGED),
    "bone": (edit_a_bone, CHANGED),
    "bone name": (rename_a_bone, CHANGED),
    "skin deleted": (delete_skin, CHANGED),
    "cage deleted": (delete_cage_from_the_scene, CHANGED),
    "edit mode": (enter_edit_mode, CHANGED),
    "preserve volume": (choose_preserve_volume, CHANGED),
    "bound by somebody else": (bind_meanwhile, "is the cage of a rig already"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_what_has_changed_meanwhile_is_not_bound(lifecycle: ModuleType, name: str) -> None:
    change, message = CHANGES[name]
    objects = build_bar()
    work = begin(lifecycle, objects)
    change(objects)
    update()
    before = file_state()
    with pytest.raises(lifecycle.BindError, match=message):
        work.finish(bpy.context, later=True)
    assert file_state() == before


def test_a_pose_and_other_objects_may_change_meanwhile(lifecycle: ModuleType) -> None:
    objects = build_bar()
    work = begin(lifecycle, objects)
    objects.armature.pose.bones["upper"].rotation_mode = "XYZ"
    objects.armature.pose.bones["upper"].rotation_euler.z = 1.0
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Other", None))
    select([], None)
    update()
    cage, _ = work.finish(bpy.context, later=True)
    rig = Rig(objects.skins, objects.armature, cage)
    update()
    assert np.abs(shown(rig.skin) - native(rig.skin)).max() < 1e-5 * rig.size


def test_a_rig_goes_on_while_it_is_bound_anew(lifecycle: ModuleType, bar: Rig) -> None:
    fat_key(bar)
    bend(bar, 0.8)
    before, shape = file_state(), shown(bar.skin).copy()
    work = lifecycle.begin_rebind(bpy.context, bar.cage)
    assert file_state() == before
    bend(bar, 0.2)
    assert np.abs(shown(bar.skin) - shape).max() > 0.05, "it follows the pose meanwhile"
    bend(bar, 0.8)
    work.job.cancel()
    del work
    assert file_state() == before and np.array_equal(shown(bar.skin), shape)
    lifecycle.begin_rebind(bpy.context, bar.cage).finish(bpy.context, later=True)
    update()
    assert bar.settings.state == "LIVE" and np.abs(shown(bar.skin) - shape).max() < 1e-6
    assert np.abs(shown(bar.skin) - fresh(bar)[0]).max() < 1e-6


def test_a_copy_of_a_bound_cage_stays_one_until_the_end(lifecycle: ModuleType, bar: Rig) -> None:
    twin = build_bar()
    bpy.data.objects.remove(twin.cage)
    cage = bar.cage.copy()
    cage.data = bar.cage.data.copy()
    bpy.context.scene.collection.objects.link(cage)
    update()
    objects = copy.copy(twin)
    objects = replace(objects, cage=cage)
    before = (cage.cage_rig.state, cage.cage_rig.posed_cage, file_state())
    work = begin(lifecycle, objects)
    work.job.cancel()
    del work
    assert (cage.cage_rig.state, cage.cage_rig.posed_cage, file_state()) == before
    found, _ = begin(lifecycle, objects).finish(bpy.context, later=True)
    assert found == cage and cage.cage_rig.state == "LIVE" and cage.cage_rig.posed_cage != bar.posed
    assert bar.settings.state == "LIVE"


def test_a_bind_in_a_thread_refuses_what_the_core_refuses(lifecycle: ModuleType) -> None:
    objects = build_bar()
    set_mesh(objects.cage, rest(objects.cage) + np.float32([0, 99, 0]))
    before = file_state()
    with pytest.raises(lifecycle.BindError, match="can't be bound: the cage encloses no vertex"):
        begin(lifecycle, objects).finish(bpy.context, later=True)
    assert file_state() == before


def test_without_a_window_a_button_waits() -> None:
    objects = build_bar()
    select(objects.all, objects.cage)
    assert bpy.ops.cage_rig.bind("INVOKE_DEFAULT") == {"FINISHED"}
    assert bpy.ops.cage_rig.rebind("INVOKE_DEFAULT") == {"FINISHED"}
    assert bind_is_live(objects)


def bind_is_live(objects: RigObjects) -> bool:
    rig = Rig(objects.skins, objects.armature, objects.cage)
    return rig.settings.state == "LIVE" and bool(np.isfinite(shown(rig.skin)).all())


def test_binds_by_the_operator_are_those_of_a_script(lifecycle: ModuleType) -> None:
    rig = bind(build_bar())
    by_operator = results(rig)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    objects = build_bar()
    lifecycle.bind(bpy.context, objects.cage, objects.armature, objects.skins)
    by_script = results(Rig(objects.skins, objects.armature, objects.cage))
    by_operator.pop("file"), by_script.pop("file")
    assert by_operator == by_script
