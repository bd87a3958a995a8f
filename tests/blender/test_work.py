"""Nothing is done twice, and nothing for nobody: work is counted, in the core and in Blender."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import bpy
import numpy as np
import pytest
from scene import Rig, rest, select, shown, update
from test_sync import key_the_bar


def key_pose(rig: Rig) -> None:
    """The upper bone turns from frame 1 to 10 and stands still after."""
    bone = rig.armature.pose.bones[1]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (10, 1.0)):
        bone.rotation_euler = (0.0, 0.0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)


def core_work(rig: Rig) -> dict[str, int]:
    import bl_ext.user_default.cage_rig.sync as sync

    return dict(sync.session_of(rig.cage).rig.work)


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of rest cages that were looked at closely."""
    import bl_ext.user_default.cage_rig.health as health

    found: list[str] = []
    problem: Callable[[bpy.types.Object], str] = health.problem
    monkeypatch.setattr(health, "problem", lambda cage: found.append(cage.name) or problem(cage))
    return found


def test_a_frame_in_which_nothing_moves_does_no_work(bar: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    import bl_ext.user_default.cage_rig.adapters.modifier as modifier

    key_pose(bar)
    bpy.context.scene.frame_set(12)
    before, written = core_work(bar), []
    monkeypatch.setattr(modifier, "write", lambda *given: written.append(given))
    for frame in range(13, 20):
        bpy.context.scene.frame_set(frame)
    assert core_work(bar) == before and not written


def test_a_pose_reads_no_coordinates_and_a_frame_skins_once(bar: Rig) -> None:
    key_pose(bar)
    before = core_work(bar)
    for frame in range(2, 7):
        bpy.context.scene.frame_set(frame)
    after = core_work(bar)
    assert after["rest_passes"] == before["rest_passes"]
    assert after["skin_passes"] == before["skin_passes"] + 5
    assert after["cage_fits"] == before["cage_fits"] + 5


def test_a_cage_between_its_keys_is_read_as_shapes_in_playback_and_as_a_whole_in_bakes(
    bar: Rig, tmp_path: Path
) -> None:
    import bl_ext.user_default.cage_rig.bake as bake

    key_the_bar(bar)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 24

    def shapes_of_a_round() -> tuple[int, int]:
        before = core_work(bar)
        for frame in range(1, 25):
            scene.frame_set(frame)
        after = core_work(bar)
        return tuple(after[name] - before[name] for name in ("rest_passes", "rest_shape_passes"))

    passes, shapes = shapes_of_a_round()
    assert shapes >= 12 and passes - shapes <= 8
    before = core_work(bar)
    bake.to_mesh_cache(bar.cage, str(tmp_path / "bar.pc2"), result=False)
    after = core_work(bar)
    assert after["rest_passes"] - before["rest_passes"] >= 15
    assert after["rest_shape_passes"] == before["rest_shape_passes"]
    assert shapes_of_a_round()[1] >= 12


def test_frames_are_not_looked_at_closely_and_edits_are(bar: Rig, looks: list[str]) -> None:
    key_pose(bar)
    bpy.context.scene.frame_set(2)
    looks.clear()
    for frame in range(3, 9):
        bpy.context.scene.frame_set(frame)
    assert not looks
    bar.armature.pose.bones[1].location.x = 0.1
    update()
    assert looks == [bar.cage.name]


def test_frames_read_no_inputs_of_the_modifier(bar: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    import bl_ext.user_default.cage_rig.adapters.modifier as modifier

    key_pose(bar)
    bpy.context.scene.frame_set(2)
    found: list[str] = []
    read = modifier.read
    monkeypatch.setattr(modifier, "read", lambda which, name: found.append(name) or read(which, name))
    for frame in range(3, 9):
        bpy.context.scene.frame_set(frame)
    assert not found  # each takes as long as a product of a small character
    bar.armature.pose.bones[1].location.x = 0.1
    update()
    assert "Use Feed" in found


def calls_of(act: Callable[[], None]) -> list[str]:
    """Names of what Python calls meanwhile: functions, and as `core.` those of the core."""
    found: list[str] = []

    def note(frame: FrameType, event: str, called: object) -> None:
        if event == "call":
            found.append(frame.f_code.co_name)
        elif event == "c_call":
            core = type(getattr(called, "__self__", None)).__module__ == "cage_rig_core"
            found.append(f"core.{called.__name__}" if core else called.__name__)

    sys.setprofile(note)
    try:
        act()
    finally:
        sys.setprofile(None)
    return found


@pytest.mark.parametrize("hidden", [False, True])
def test_a_frame_is_one_call_of_the_core_and_few_of_python(bar: Rig, hidden: bool) -> None:
    key_pose(bar)
    for obj in (bar.posed, bar.refit):
        obj.hide_set(hidden)
    bpy.context.scene.frame_set(2)
    bpy.context.scene.frame_set(3)
    before = shown(bar.skin).copy()
    found = calls_of(lambda: bpy.context.scene.frame_set(4))
    assert [name for name in found if name.startswith("core.")] == ["core.play"]
    assert len(found) <= 100  # a microsecond each, more than the deformation of a small character
    assert np.abs(shown(bar.skin) - before).max() > 1e-3


def grow_before(rig: Rig) -> None:
    """Something that a frame has to be told of: a modifier before ours."""
    modifier = rig.skin.modifiers.new("Subdivision", "SUBSURF")
    rig.skin.modifiers.move(rig.skin.modifiers.find(modifier.name), 0)


def remove_ours(rig: Rig) -> None:
    rig.skin.modifiers.remove(rig.skin.modifiers["Cage Rig"])


def unlink_cage(rig: Rig) -> None:
    for collection in rig.posed.users_collection:
        collection.objects.unlink(rig.posed)


def lose_armature(rig: Rig) -> None:
    for collection in rig.armature.users_collection:
        collection.objects.unlink(rig.armature)


def bend_bones(rig: Rig) -> None:
    rig.armature.data.bones[1].bbone_segments = 4


@pytest.mark.parametrize("change", [grow_before, remove_ours, unlink_cage, lose_armature, bend_bones])
def test_a_frame_after_a_script_sees_what_it_changed(bar: Rig, change: Callable[[Rig], None]) -> None:
    key_pose(bar)
    for frame in (2, 3):
        bpy.context.scene.frame_set(frame)
    assert bar.settings.state == "LIVE"
    change(bar)
    bpy.context.scene.frame_set(4)
    assert bar.settings.state == "PAUSED"


def test_a_skin_that_moves_between_frames_is_followed(bar: Rig) -> None:
    key_pose(bar)
    bpy.context.scene.frame_set(5)
    before = shown(bar.skin).copy()
    bar.skin.location.x += 0.5
    bpy.context.scene.frame_set(6)
    bpy.context.scene.frame_set(5)
    assert np.abs(shown(bar.skin) - before).max() > 1e-2  # the rest skin is elsewhere among the bones
    bar.skin.location.x -= 0.5
    bpy.context.scene.frame_set(6)
    bpy.context.scene.frame_set(5)
    assert np.abs(shown(bar.skin) - before).max() < 1e-6


def test_a_hidden_posed_cage_is_not_fitted_until_it_is_shown(bar: Rig) -> None:
    key_pose(bar)
    bpy.context.scene.frame_set(8)
    expected = rest(bar.posed).copy()
    bpy.context.scene.frame_set(1)
    bar.posed.hide_set(True)
    update()
    before, stale = core_work(bar)["cage_fits"], rest(bar.posed).copy()
    for frame in range(2, 9):
        bpy.context.scene.frame_set(frame)
    assert core_work(bar)["cage_fits"] == before
    assert np.array_equal(rest(bar.posed), stale)
    bar.posed.hide_set(False)
    update()
    assert np.abs(rest(bar.posed) - expected).max() < 1e-6


def test_a_script_moves_a_hidden_posed_cage_from_where_it_would_be(bar: Rig) -> None:
    key_pose(bar)
    bpy.context.scene.frame_set(8)
    expected = rest(bar.posed).copy()
    bpy.context.scene.frame_set(1)
    bar.posed.hide_set(True)
    bpy.context.scene.frame_set(8)
    moved = rest(bar.posed)
    moved[3] += (0.0, 0.02, 0.0)
    expected[3] += (0.0, 0.02, 0.0)
    bar.posed.data.attributes["position"].data.foreach_set("vector", moved.ravel())
    bar.posed.data.update_tag()
    update()
    bar.posed.hide_set(False)
    update()
    assert bar.settings.message == ""
    assert np.abs(rest(bar.posed) - expected).max() < 1e-5


def test_a_rig_out_of_the_view_layer_is_not_evaluated(bar: Rig) -> None:
    key_pose(bar)
    bpy.context.scene.frame_set(7)
    expected = shown(bar.skin).copy()
    bpy.context.scene.frame_set(1)
    apart = bpy.data.collections.new("Apart")
    bpy.context.scene.collection.children.link(apart)
    for obj in (bar.skin, bar.armature, bar.cage, bar.posed, bar.refit):
        for collection in obj.users_collection:
            collection.objects.unlink(obj)
        apart.objects.link(obj)
    layer = bpy.context.view_layer.layer_collection.children["Apart"]
    layer.exclude = True
    update()
    before = core_work(bar)
    for frame in range(2, 8):
        bpy.context.scene.frame_set(frame)
    assert core_work(bar) == before
    layer.exclude = False
    update()
    assert np.abs(shown(bar.skin) - expected).max() < 1e-6


@pytest.fixture
def first_evaluation() -> Iterator[list[str]]:
    """The names of objects whose geometry Blender has evaluated in a frame before our handler runs."""
    found: list[str] = []

    def look(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        updates = [update for update in depsgraph.updates if update.is_updated_geometry]
        found.extend(update.id.name for update in updates if isinstance(update.id, bpy.types.Object))

    bpy.app.handlers.frame_change_post.insert(0, look)
    yield found
    bpy.app.handlers.frame_change_post.remove(look)


def test_a_frame_evaluates_the_skin_once_when_its_points_are_written(bar: Rig, first_evaluation: list[str]) -> None:
    key_pose(bar)
    bpy.context.scene.frame_set(2)
    before = shown(bar.skin).copy()
    first_evaluation.clear()
    bpy.context.scene.frame_set(3)
    assert bar.armature.name in first_evaluation and bar.skin.name not in first_evaluation
    assert np.abs(shown(bar.skin) - before).max() > 1e-3


def awaited(rig: Rig) -> list[str]:
    """The bones that the skin's driver reads."""
    (curve,) = rig.skin.animation_data.drivers
    ends = [variable.targets[0] for variable in curve.driver.variables]
    return [end.bone_target for end in ends if end.id == rig.armature]


def test_a_skin_waits_for_the_last_bones_alone_whatever_their_parents(bar: Rig) -> None:
    assert awaited(bar) == ["upper"]
    key_pose(bar)
    select([bar.armature], bar.armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = bar.armature.data.edit_bones
    bones["upper"].use_connect, bones["upper"].parent = False, None
    bpy.ops.object.mode_set(mode="OBJECT")
    update()
    assert awaited(bar) == ["lower", "upper"]


def test_hidden_cages_and_bones_are_evaluated_for_whatever_is_shown(bar: Rig) -> None:
    key_pose(bar)
    bpy.context.scene.frame_set(6)
    skin, posed = shown(bar.skin).copy(), rest(bar.posed).copy()
    for visible, expected in ((bar.skin, skin), (bar.posed, posed)):
        bpy.context.scene.frame_set(1)
        for obj in (bar.skin, bar.posed, bar.cage, bar.armature, bar.refit):
            obj.hide_viewport = obj != visible
        update()
        bpy.context.scene.frame_set(6)
        found = shown(bar.skin) if visible == bar.skin else rest(bar.posed)
        assert np.abs(found - expected).max() < 1e-6, visible.name


def test_an_armature_modifier_has_its_vertex_groups_while_somebody_shows_it(bar: Rig) -> None:
    native = bar.skin.modifiers["Armature"]
    assert not native.use_vertex_groups and native.object == bar.armature
    native.show_viewport = True
    update()
    assert native.use_vertex_groups
    native.show_viewport = False
    update()
    assert not native.use_vertex_groups
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.unbind()
    assert native.use_vertex_groups and native.show_viewport
    assert not bar.skin.animation_data or not bar.skin.animation_data.drivers
