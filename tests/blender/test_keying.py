"""Key Cage: the rest cage keyed beside an action, in Blender's own shape keys and curves."""

from __future__ import annotations

from pathlib import Path

import bmesh
import bpy
import numpy as np
import pytest
from scene import (
    Points,
    Rig,
    bend,
    drag,
    edited,
    enter_edit_mode,
    fresh,
    leave_edit_mode,
    rest,
    select,
    set_mesh,
    shown,
    update,
)
from test_sync import assert_rendered

FAT, THIN = np.float32([1.0, 1.6, 1.6]), np.float32([1.0, 0.7, 0.7])


def go(frame: float) -> None:
    bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)


def key(rig: Rig, operator: str = "key_cage", **options: object) -> None:
    select([rig.cage], rig.cage)
    assert getattr(bpy.ops.cage_rig, operator)(**options) == {"FINISHED"}


def cage(rig: Rig) -> Points:
    """The rest cage as Blender evaluates it."""
    return shown(rig.cage).copy()


def bound(rig: Rig) -> Points:
    """The cage as it was bound."""
    points = np.empty((len(rig.settings.snapshot.vertices), 3), np.float32)
    rig.settings.snapshot.vertices.foreach_get("co", points.ravel())
    return points


def reshape(rig: Rig, scale: Points) -> Points:
    """Edit the posed cage, the bones at rest, so that the rest cage becomes the bound one times `scale`."""
    wanted = bound(rig) * scale
    rig.armature.data.pose_position = "REST"
    update()
    enter_edit_mode(rig.posed)
    mesh = bmesh.from_edit_mesh(rig.posed.data)
    for vertex, place in zip(mesh.verts, wanted.tolist(), strict=True):
        vertex.co = place
    bmesh.update_edit_mesh(rig.posed.data)
    update()
    leave_edit_mode()
    rig.armature.data.pose_position = "POSE"
    update()
    return wanted


def columns(rig: Rig) -> list[float]:
    """Frames of every keyframe of the cage's keys, checked to be whole columns that sum to 1."""
    from bl_ext.user_default.cage_rig import compat

    curves = compat.action_curves(rig.cage.data.shape_keys)
    frames = [[point.co.x for point in curve.keyframe_points] for curve in curves]
    assert all(found == frames[0] for found in frames)
    for frame in np.arange(frames[0][0] - 3, frames[0][-1] + 3, 0.25):
        assert abs(sum(curve.evaluate(frame) for curve in curves) - 1.0) < 1e-6
    return frames[0]


@pytest.fixture
def three(bar: Rig) -> Rig:
    """The bar bent over frames 1 to 20, and three cage keys: as bound at 5, fat at 10, thin at 20."""
    bone = bar.armature.pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (20, 1.4)):
        bone.rotation_euler = (0.0, 0.0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    go(5)
    key(bar)
    go(10)
    reshape(bar, FAT)
    key(bar)
    go(20)
    reshape(bar, THIN)
    key(bar)
    return bar


def truth(rig: Rig, keys: list[tuple[float, Points]], frame: float) -> Points:
    """Linear between the shapes of `keys`, constant outside."""
    times = [time for time, _ in keys]
    place = np.interp(frame, times, range(len(times)))
    low = min(int(place), len(times) - 2)
    part = np.float32(place - low)
    return bound(rig) * ((1 - part) * keys[low][1] + part * keys[low + 1][1])


ONE = np.float32([1.0, 1.0, 1.0])
KEYS = [(5.0, ONE), (10.0, FAT), (20.0, THIN)]
FRAMES = (1, 5, 7, 7.5, 10, 13, 20, 30)


def assert_plays(rig: Rig, keys: list[tuple[float, Points]]) -> None:
    for frame in FRAMES:
        go(frame)
        assert np.abs(cage(rig) - truth(rig, keys, frame)).max() < 2e-5, frame
        assert rig.settings.state == "LIVE", rig.settings.message


def test_between_keys_the_cage_moves_linearly_and_bones_as_they_did(three: Rig) -> None:
    assert columns(three) == [5.0, 10.0, 20.0]
    assert_plays(three, KEYS)
    angles = []
    for frame in (1, 7, 13, 20):
        go(frame)
        angles.append(three.armature.pose.bones["upper"].rotation_euler.z)
    curve_ends = angles[0], angles[-1]
    assert np.allclose(curve_ends, (0.0, 1.4), atol=1e-6) and angles[1] != pytest.approx(1.4 * 6 / 19, abs=1e-3)


def test_keys_and_action_are_moved_apart(three: Rig) -> None:
    from bl_ext.user_default.cage_rig import compat

    for curve in compat.action_curves(three.armature):
        for point in curve.keyframe_points:
            point.co.x += 7
        curve.update()
    assert_plays(three, KEYS)


def move_column(rig: Rig, old: float, new: float, *, copy: bool = False) -> None:
    """As grabbing (or duplicating) the summary's key in the dope sheet does: every channel's key."""
    from bl_ext.user_default.cage_rig import compat

    for curve in compat.action_curves(rig.cage.data.shape_keys):
        (point,) = [p for p in curve.keyframe_points if abs(p.co.x - old) < 1e-3]
        if copy:
            twin = curve.keyframe_points.insert(new, point.co.y)
            twin.interpolation = point.interpolation
        else:
            point.co.x = new
            curve.keyframe_points.sort()
        curve.update()
    rig.cage.data.shape_keys.update_tag(refresh={"TIME"})
    update()


def test_reordered_keys_never_pass_through_a_third_shape(three: Rig) -> None:
    move_column(three, 5.0, 15.0)
    assert columns(three) == [10.0, 15.0, 20.0]
    assert_plays(three, [(10.0, FAT), (15.0, ONE), (20.0, THIN)])
    move_column(three, 20.0, 3.0)
    assert_plays(three, [(3.0, THIN), (10.0, FAT), (15.0, ONE)])


def test_a_copied_key_shows_the_same_shape_until_one_of_them_is_edited(three: Rig) -> None:
    move_column(three, 10.0, 25.0, copy=True)
    assert_plays(three, [*KEYS, (25.0, FAT)])
    go(25)
    reshape(three, np.float32([1.0, 2.0, 2.0]))
    assert_plays(three, [*KEYS, (25.0, np.float32([1.0, 2.0, 2.0]))])
    assert columns(three) == [5.0, 10.0, 20.0, 25.0]


def test_deleted_keys_are_gone_and_their_shapes_too(three: Rig) -> None:
    go(10)
    key(three, "delete_key")
    assert_plays(three, [KEYS[0], KEYS[2]])
    assert len(three.cage.data.shape_keys.key_blocks) == 3
    go(11)
    select([three.cage], three.cage)
    assert bpy.ops.cage_rig.delete_key() == {"CANCELLED"}
    for frame in (5, 20):
        go(frame)
        key(three, "delete_key")
    assert [block.name for block in three.cage.data.shape_keys.key_blocks] == ["Basis"]
    assert np.abs(cage(three) - bound(three)).max() < 1e-6


def test_an_edit_at_a_key_changes_that_key_alone(three: Rig) -> None:
    go(10)
    reshape(three, np.float32([1.0, 1.2, 1.2]))
    assert_plays(three, [KEYS[0], (10.0, np.float32([1.0, 1.2, 1.2])), KEYS[2]])


def test_an_edit_between_keys_waits_to_be_keyed(three: Rig) -> None:
    go(15)
    wanted = reshape(three, np.float32([1.0, 1.3, 1.3]))
    assert np.abs(cage(three) - wanted).max() < 1e-5
    assert "Cage Draft" in three.cage.data.shape_keys.key_blocks
    key(three)
    assert "Cage Draft" not in three.cage.data.shape_keys.key_blocks
    assert_plays(three, [KEYS[0], KEYS[1], (15.0, np.float32([1.0, 1.3, 1.3])), KEYS[2]])


def test_an_unkeyed_edit_begins_at_the_basis_also_where_the_mesh_is_another(three: Rig) -> None:
    """A script that writes the basis key leaves the mesh as it was, and Blender makes new keys of the mesh."""
    basis = three.cage.data.shape_keys.reference_key
    basis.points[0].co.z -= 0.07
    three.cage.data.update()
    update()
    go(15)
    wanted = reshape(three, np.float32([1.0, 1.3, 1.3]))
    assert np.abs(cage(three) - wanted).max() < 1e-5


def test_an_unkeyed_edit_can_be_discarded(three: Rig) -> None:
    go(15)
    reshape(three, np.float32([1.0, 1.3, 1.3]))
    key(three, "discard_edit")
    assert_plays(three, KEYS)
    select([three.cage], three.cage)
    assert bpy.ops.cage_rig.discard_edit() == {"CANCELLED"}


def test_with_auto_keying_an_edit_between_keys_is_keyed(three: Rig) -> None:
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    go(15)
    reshape(three, np.float32([1.0, 1.3, 1.3]))
    assert_plays(three, [KEYS[0], KEYS[1], (15.0, np.float32([1.0, 1.3, 1.3])), KEYS[2]])


def test_the_envelope_can_be_keyed(three: Rig) -> None:
    for frame in (25, 35):
        go(frame)
        key(three, "key_envelope")
    assert_plays(three, [*KEYS, (25.0, ONE)])
    assert sum(block.name.startswith("Cage Envelope") for block in three.cage.data.shape_keys.key_blocks) == 1
    go(35)
    reshape(three, FAT)
    go(25)
    assert np.abs(cage(three) - bound(three)).max() < 1e-5, "the other envelope key stays"
    go(35)
    assert np.abs(cage(three) - bound(three) * FAT).max() < 1e-4


def test_next_and_previous_key(three: Rig) -> None:
    go(7.5)
    frames = []
    for forward in (True, True, False, False):
        key(three, "jump_to_key", forward=forward)
        frames.append(bpy.context.scene.frame_current)
    assert frames == [10, 20, 10, 5]
    select([three.cage], three.cage)
    assert bpy.ops.cage_rig.jump_to_key(forward=False) == {"CANCELLED"}


def test_keying_again_at_a_key_and_at_a_sub_frame(three: Rig) -> None:
    go(10)
    key(three)
    assert columns(three) == [5.0, 10.0, 20.0]
    assert_plays(three, KEYS)
    go(12.5)
    key(three)
    assert columns(three) == [5.0, 10.0, 12.5, 20.0]
    assert_plays(three, KEYS)


def test_shape_keys_of_the_artists_own_stay_on_top(three: Rig) -> None:
    envelope = bound(three)
    own = three.cage.shape_key_add(name="Longer", from_mix=False)
    own.points.foreach_set("co", (envelope * np.float32([1.5, 1, 1])).ravel())
    own.value = 1.0
    update()
    for frame in (5, 10, 15):
        go(frame)
        assert np.abs(cage(three) - truth(three, KEYS, frame) - envelope * np.float32([0.5, 0, 0])).max() < 2e-5
    go(15)
    key(three)
    own.value = 0.0
    assert_plays(three, KEYS)
    # active, it takes the edits
    own.value = 1.0
    three.cage.active_shape_key_index = three.cage.data.shape_keys.key_blocks.find("Longer")
    go(7)
    before = np.empty((len(envelope), 3), np.float32)
    own.points.foreach_get("co", before.ravel())
    enter_edit_mode(three.posed)
    drag(three.posed, 4, (0.2, 0.1, 0.0))
    leave_edit_mode()
    after = np.empty_like(before)
    own.points.foreach_get("co", after.ravel())
    assert np.abs(after - before).max() > 0.05 and "Cage Draft" not in three.cage.data.shape_keys.key_blocks


def test_keying_in_edit_mode_of_either_cage(three: Rig) -> None:
    go(15)
    enter_edit_mode(three.posed)
    drag(three.posed, 4, (0.1, 0.2, 0.0))
    wanted = edited(three.posed).copy()
    assert bpy.ops.cage_rig.key_cage() == {"FINISHED"}
    assert np.abs(edited(three.posed) - wanted).max() < 1e-5
    leave_edit_mode()
    assert columns(three) == [5.0, 10.0, 15.0, 20.0]
    enter_edit_mode(three.cage)
    drag(three.cage, 4, (0.1, 0.2, 0.0))
    shape = edited(three.cage).copy()
    assert bpy.ops.cage_rig.key_cage() == {"FINISHED"}
    assert three.cage.mode == "EDIT"
    leave_edit_mode()
    assert np.abs(cage(three) - shape).max() < 1e-5
    assert np.abs(shown(three.skin) - fresh(three)[0]).max() < 1e-5


def found(name: str) -> Rig:
    cage = bpy.data.objects[name]
    return Rig([cage.cage_rig.skins[0].object], cage.cage_rig.armature, cage)


def test_keys_are_undone_and_redone(three: Rig) -> None:
    bpy.ops.ed.undo_push(message="three")
    go(15)
    key(three, "key_envelope")
    bpy.ops.ed.undo_push(message="envelope")
    name = three.cage.name
    bpy.ops.ed.undo()
    rig = found(name)
    assert columns(rig) == [5.0, 10.0, 20.0]
    bpy.ops.ed.redo()
    rig = found(name)
    assert columns(rig) == [5.0, 10.0, 15.0, 20.0]
    go(15)
    assert np.abs(cage(rig) - bound(rig)).max() < 1e-6


def test_keys_render_reload_and_play_without_the_add_on(three: Rig, tmp_path: Path) -> None:
    shapes, cages = {}, {}
    for frame in (4, 5, 6, 15):
        go(frame)
        shapes[frame], cages[frame] = shown(three.skin).copy(), cage(three)
    assert_rendered(three, shapes, tmp_path)
    path = str(tmp_path / "keys.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    obj = next(obj for obj in bpy.data.objects if obj.cage_rig.state != "NONE")
    for frame in (15, 6):
        go(frame)
        assert np.abs(shown(obj) - cages[frame]).max() < 1e-6
        assert np.abs(shown(obj.cage_rig.skins[0].object) - shapes[frame]).max() < 1e-5


def test_a_paused_rig_is_not_keyed(bar: Rig) -> None:
    bend(bar, 0.0)
    set_mesh(bar.cage, rest(bar.cage))
    bar.skin.modifiers.remove(bar.skin.modifiers["Cage Rig"])
    update()
    assert bar.settings.state == "PAUSED"
    select([bar.cage], bar.cage)
    with pytest.raises(RuntimeError, match="paused"):
        bpy.ops.cage_rig.key_cage()
