"""Whatever is edited, in any order, everything else follows in the same update."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from scene import (
    Rig,
    bend,
    drag,
    edited,
    enter_edit_mode,
    fat_key,
    fresh,
    leave_edit_mode,
    native,
    rest,
    set_mesh,
    shown,
    update,
)


def test_rest_cage_edit_moves_skin_joints_and_posed_cage(bar: Rig) -> None:
    bend(bar, 1.0)
    before, posed = shown(bar.skin).copy(), rest(bar.posed)
    set_mesh(bar.cage, rest(bar.cage) * np.float32([1.5, 1, 1]))
    assert np.abs(shown(bar.skin) - before).max() > 0.1
    assert np.abs(rest(bar.posed) - posed).max() > 0.1
    lower, upper = bar.refit.pose.bones["lower"], bar.refit.pose.bones["upper"]
    assert abs(lower.head.x - -1.5) < 1e-4, "joints scale with the cage"
    assert abs(upper.head.x) < 1e-4
    assert (lower.tail - upper.head).length < 1e-4, "a refit bone reaches its child"


def test_refit_bones_are_the_pose_bones_at_rest_cage(bar: Rig) -> None:
    bend(bar, 1.1)
    for bone in bar.armature.pose.bones:
        assert np.allclose(bar.refit.pose.bones[bone.name].matrix, bone.matrix, atol=1e-5)


def test_posed_cage_edit_lands_and_moves_the_rest_cage(bar: Rig) -> None:
    bend(bar, 1.2)
    fat_key(bar, value=0.4)
    cage = shown(bar.cage).copy()
    wanted = rest(bar.posed)
    wanted[17] += (0.1, -0.05, 0.08)
    set_mesh(bar.posed, wanted)
    assert np.abs(rest(bar.posed) - wanted).max() < 1e-6 * bar.size
    assert np.abs(shown(bar.cage) - cage).max() > 0.05
    update()
    assert np.abs(rest(bar.posed) - wanted).max() < 2e-6 * bar.size, "the next update keeps it"
    assert np.abs(shown(bar.skin) - fresh(bar)[0]).max() < 2e-6 * bar.size


def test_posed_cage_drag_in_edit_mode_is_live(bar: Rig) -> None:
    bend(bar, 1.0)
    enter_edit_mode(bar.posed)
    start = edited(bar.posed)
    for step in range(1, 6):
        before_cage, before_skin = rest(bar.cage), shown(bar.skin).copy()
        drag(bar.posed, 14, (0.0, 0.02, 0.0))
        assert np.abs(rest(bar.cage) - before_cage).max() > 1e-3, f"rest cage stands still at step {step}"
        assert np.abs(shown(bar.skin) - before_skin).max() > 1e-4, f"skin stands still at step {step}"
    wanted = start.copy()
    wanted[14, 1] += 0.1
    assert np.abs(edited(bar.posed) - wanted).max() < 1e-6
    for _ in range(5):
        drag(bar.posed, 14, (0.0, -0.02, 0.0))
    assert np.abs(edited(bar.posed) - start).max() < 1e-6
    leave_edit_mode()
    assert np.abs(rest(bar.posed) - start).max() < 2e-6 * bar.size


def test_rest_cage_drag_in_edit_mode_is_live(bar: Rig) -> None:
    bend(bar, 1.0)
    enter_edit_mode(bar.cage)
    before, posed = shown(bar.skin).copy(), rest(bar.posed)
    drag(bar.cage, 14, (0.0, 0.2, 0.0))
    assert np.abs(shown(bar.skin) - before).max() > 1e-3
    assert np.abs(rest(bar.posed) - posed).max() > 1e-2
    live = shown(bar.skin).copy()
    leave_edit_mode()
    assert np.abs(shown(bar.skin) - live).max() < 2e-6 * bar.size


def test_both_cages_in_edit_mode(bar: Rig) -> None:
    bend(bar, 1.0)
    enter_edit_mode(bar.posed, bar.cage)
    before = edited(bar.cage)
    drag(bar.posed, 14, (0.0, 0.1, 0.0))
    assert np.abs(edited(bar.cage) - before).max() > 1e-2, "the rest cage's edit mesh follows"
    posed = edited(bar.posed)
    drag(bar.cage, 10, (0.0, 0.1, 0.0))
    assert np.abs(edited(bar.posed) - posed).max() > 1e-2, "the posed cage's edit mesh follows"
    wanted_cage, wanted_posed = edited(bar.cage), edited(bar.posed)
    leave_edit_mode()
    assert np.abs(rest(bar.cage) - wanted_cage).max() < 1e-6
    assert np.abs(rest(bar.posed) - wanted_posed).max() < 2e-6 * bar.size


def test_pose_while_the_posed_cage_is_in_edit_mode(bar: Rig) -> None:
    enter_edit_mode(bar.posed)
    cage = rest(bar.cage)
    before = edited(bar.posed)
    bend(bar, 0.7)
    assert np.abs(edited(bar.posed) - before).max() > 0.1, "the posed cage follows the bones"
    assert np.array_equal(rest(bar.cage), cage), "a pose is no edit of the rest cage"
    leave_edit_mode()


def test_edit_goes_to_the_active_shape_key(bar: Rig) -> None:
    key = fat_key(bar, value=0.5)
    bar.cage.active_shape_key_index = 1
    base = rest(bar.cage)
    wanted = rest(bar.posed)
    wanted[9] += (0.0, 0.1, 0.0)
    set_mesh(bar.posed, wanted)
    points = np.empty((len(base), 3), np.float32)
    bar.cage.data.shape_keys.key_blocks["Basis"].points.foreach_get("co", points.ravel())
    assert np.array_equal(points, base), "the base stays"
    key.value = 0.0
    update()
    assert np.abs(shown(bar.skin) - rest(bar.skin)).max() < 1e-6 * bar.size


def test_edit_of_the_base_key_moves_the_mesh_too(bar: Rig) -> None:
    """A rebind reads the mesh."""
    fat_key(bar, value=0.0)
    bar.cage.active_shape_key_index = 0
    wanted = rest(bar.posed)
    wanted[9] += (0.0, 0.1, 0.0)
    set_mesh(bar.posed, wanted)
    base = np.empty_like(wanted)
    bar.cage.data.shape_keys.reference_key.points.foreach_get("co", base.ravel())
    assert np.abs(base - wanted).max() < 1e-5 and np.array_equal(rest(bar.cage), base)


@pytest.mark.parametrize("fault", ["value", "mute", "modifier", "influence"])
def test_impossible_posed_edit_is_refused_and_taken_back(bar: Rig, fault: str) -> None:
    key = fat_key(bar, value=0.0 if fault == "value" else 1.0)
    bar.cage.active_shape_key_index = 1
    word = "'Fat'"
    if fault == "mute":
        key.mute = True
    if fault == "modifier":
        bar.cage.modifiers.new("Wave it", "WAVE").show_viewport = True
        word = "'Wave it'"
    if fault == "influence":
        bar.settings.influence, word = 0.0, "influence"
    update()
    posed, cage, skin = rest(bar.posed), shown(bar.cage).copy(), shown(bar.skin).copy()
    wanted = posed.copy()
    wanted[9] += (0.0, 0.1, 0.0)
    set_mesh(bar.posed, wanted)
    assert word in bar.settings.message
    assert bar.settings.state == "LIVE"
    assert np.abs(rest(bar.posed) - posed).max() < 1e-6
    assert np.abs(shown(bar.cage) - cage).max() < 1e-6
    assert np.abs(shown(bar.skin) - skin).max() < 1e-6


def key_the_bar(rig: Rig) -> None:
    """A bend over frames 1 to 24, and cage keys of their own timing."""
    bone = rig.armature.pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (24, 1.5)):
        bone.rotation_euler = (0, 0, angle)
        bone.keyframe_insert("rotation_euler", frame=frame)
    key = fat_key(rig)
    for frame, value in ((1, 0.0), (9, 1.0), (17, 0.2)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


def test_cage_keys_and_action_play_together_in_any_order(bar: Rig) -> None:
    key_the_bar(bar)
    scene = bpy.context.scene
    frames = {}
    for frame in (1, 5, 9, 13, 17, 24):
        scene.frame_set(frame)
        frames[frame] = (shown(bar.skin).copy(), rest(bar.posed), bar.refit.pose.bones["upper"].head.copy())
    assert np.abs(frames[1][0] - rest(bar.skin)).max() < 1e-6 * bar.size
    assert np.abs(frames[9][0] - frames[24][0]).max() > 0.1
    for frame in (17, 5, 24, 1, 9, 13):
        scene.frame_set(frame)
        assert np.array_equal(shown(bar.skin), frames[frame][0]), f"frame {frame} depends on what came before"
        assert np.array_equal(rest(bar.posed), frames[frame][1])
        assert bar.refit.pose.bones["upper"].head == frames[frame][2]
    scene.frame_set(13)
    assert np.abs(fresh(bar)[0] - frames[13][0]).max() < 1e-6 * bar.size


def test_sub_frames_play(bar: Rig) -> None:
    key_the_bar(bar)
    scene = bpy.context.scene
    scene.frame_set(4)
    before = shown(bar.skin).copy()
    scene.frame_set(4, subframe=0.5)
    between = shown(bar.skin).copy()
    scene.frame_set(5)
    assert np.abs(between - before).max() > 1e-4
    assert np.abs(between - shown(bar.skin)).max() > 1e-4


def test_a_driven_cage_key_follows_its_bone(bar: Rig) -> None:
    key = fat_key(bar, value=0.0)
    curve = key.driver_add("value")
    variable = curve.driver.variables.new()
    variable.type = "TRANSFORMS"
    variable.targets[0].id, variable.targets[0].bone_target = bar.armature, "upper"
    variable.targets[0].transform_type, variable.targets[0].transform_space = "ROT_Z", "LOCAL_SPACE"
    variable.name = "bend"
    curve.driver.expression = "bend"
    update()
    bend(bar, 0.8)
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() > 1e-2 * bar.size
    bend(bar, 0.0)
    assert np.abs(shown(bar.skin) - rest(bar.skin)).max() < 1e-5 * bar.size


def test_a_lattice_on_the_cage_reaches_the_skin(bar: Rig) -> None:
    lattice = bpy.data.objects.new("Lattice", bpy.data.lattices.new("Lattice"))
    lattice.scale = (4, 2, 2)
    bpy.context.scene.collection.objects.link(lattice)
    bar.cage.modifiers.new("Lattice", "LATTICE").object = lattice
    update()
    lattice.data.points[0].co_deform.z -= 0.3
    lattice.data.update_tag()
    update()
    assert np.abs(shown(bar.skin) - rest(bar.skin)).max() > 1e-3


def hide_in_viewport(rig: Rig) -> None:
    for obj in (rig.cage, rig.armature, rig.posed, rig.refit):
        obj.hide_viewport = obj.hide_render = True


def hide_with_eye(rig: Rig) -> None:
    for obj in (rig.cage, rig.armature, rig.posed, rig.refit):
        obj.hide_set(True)
        obj.hide_render = True


def exclude_collection(rig: Rig) -> None:
    away = bpy.data.collections.new("Away")
    bpy.context.scene.collection.children.link(away)
    for obj in (rig.cage, rig.armature, rig.posed, rig.refit):
        for collection in obj.users_collection:
            collection.objects.unlink(obj)
        away.objects.link(obj)
    bpy.context.view_layer.layer_collection.children["Away"].exclude = True


def disable_collection(rig: Rig) -> None:
    exclude_collection(rig)
    bpy.context.view_layer.layer_collection.children["Away"].exclude = False
    bpy.data.collections["Away"].hide_viewport = bpy.data.collections["Away"].hide_render = True


HIDINGS = [hide_in_viewport, hide_with_eye, exclude_collection, disable_collection]


@pytest.mark.parametrize("hide", HIDINGS)
def test_hidden_participants_still_drive_the_skin(bar: Rig, hide: object, tmp_path: Path) -> None:
    key_the_bar(bar)
    scene = bpy.context.scene
    truth = {}
    for frame in (4, 5, 6, 12):
        scene.frame_set(frame)
        truth[frame] = shown(bar.skin).copy()
    hide(bar)
    update()
    for frame in (12, 4):
        scene.frame_set(frame)
        assert np.abs(shown(bar.skin) - truth[frame]).max() < 1e-6 * bar.size, "playback"
    assert_rendered(bar, truth, tmp_path)
    scene.frame_set(12)
    bend(bar, -1.0)
    assert np.abs(shown(bar.skin) - truth[12]).max() > 0.1, "a pose edit in the viewport"
    assert bar.settings.state == "LIVE", bar.settings.message


def silhouettes(folder: Path, frames: tuple[int, ...] = (4, 5, 6), *, one_by_one: bool = False) -> list[np.ndarray]:
    """Render frames with Cycles, as an animation or by F12 one by one, and return their alpha, 96 by 96."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 3.0, (0.0, 0.0, 5.0)
    scene.collection.objects.link(camera)
    scene.camera, scene.render.engine, scene.cycles.samples = camera, "CYCLES", 4
    scene.render.resolution_x = scene.render.resolution_y = 96
    scene.render.film_transparent = True
    scene.render.use_lock_interface = True
    scene.frame_start, scene.frame_end = frames[0], frames[-1]
    if one_by_one:
        for frame in frames:
            scene.frame_set(frame)
            scene.render.filepath = str(folder / f"frame_{frame:04}.png")
            bpy.ops.render.render(write_still=True)
    else:
        scene.render.filepath = str(folder / "frame_")
        bpy.ops.render.render(animation=True)
    alphas = []
    for frame in frames:
        image = bpy.data.images.load(str(folder / f"frame_{frame:04}.png"))
        alphas.append(np.array(image.pixels[:], np.float32).reshape(96, 96, 4)[:, :, 3])
        bpy.data.images.remove(image)
    bpy.data.objects.remove(camera)
    return alphas


def assert_rendered(rig: Rig, truth: dict[int, np.ndarray], folder: Path) -> None:
    """Render the rig, and then plain meshes of the true frames in its place: the pictures are the same."""
    live = silhouettes(folder)
    for still, moving in zip(silhouettes(folder, one_by_one=True), live, strict=True):
        assert np.abs(still - moving).sum() < 0.5, "F12 shows what the animation shows"
    assert min(np.abs(live[0] - live[1]).sum(), np.abs(live[1] - live[2]).sum()) > 1.0, "every frame differs"
    rig.skin.hide_render = True
    scene = bpy.context.scene
    for k, frame in enumerate((4, 5, 6)):
        mesh = rig.skin.data.copy()
        mesh.attributes["position"].data.foreach_set("vector", truth[frame].ravel())
        still = bpy.data.objects.new("Still", mesh)
        still.parent, still.matrix_local = rig.skin.parent, rig.skin.matrix_local
        scene.collection.objects.link(still)
        assert np.abs(silhouettes(folder)[k] - live[k]).sum() < 0.5, f"render of frame {frame}"
        bpy.data.objects.remove(still)
    rig.skin.hide_render = False


@pytest.mark.parametrize("hidden", [False, True])
def test_alembic_holds_the_live_frames(bar: Rig, hidden: bool, tmp_path: Path) -> None:
    key_the_bar(bar)
    scene = bpy.context.scene
    truth = {}
    for frame in (1, 8, 15):
        scene.frame_set(frame)
        truth[frame] = shown(bar.skin).copy()
    if hidden:
        hide_in_viewport(bar)
    target = tmp_path / "bar.abc"
    bpy.ops.wm.alembic_export(filepath=str(target), start=1, end=15, flatten=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.alembic_import(filepath=str(target))
    skin = bpy.data.objects["Bar"]
    for frame, points in truth.items():
        bpy.context.scene.frame_set(frame)
        back = shown(skin)
        assert np.abs(back - points).max() < 1e-5, f"Alembic at frame {frame}"


@pytest.mark.parametrize("hidden", [False, True])
def test_usd_holds_the_live_frames(bar: Rig, hidden: bool, tmp_path: Path) -> None:
    key_the_bar(bar)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 9
    truth = {}
    for frame in (1, 5, 9):
        scene.frame_set(frame)
        truth[frame] = shown(bar.skin).copy()
    if hidden:
        hide_in_viewport(bar)
    target = tmp_path / "bar.usdc"
    bpy.ops.wm.usd_export(filepath=str(target), export_animation=True, evaluation_mode="RENDER")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.usd_import(filepath=str(target))
    skin = next(obj for obj in bpy.data.objects if obj.type == "MESH" and len(obj.data.vertices) == len(truth[1]))
    for frame, points in truth.items():
        bpy.context.scene.frame_set(frame)
        assert np.abs(shown(skin) - points).max() < 1e-5, f"USD at frame {frame}"


def test_shape_keys_of_the_skin_stay_alive(bar: Rig) -> None:
    bend(bar, 0.9)
    bar.skin.shape_key_add(name="Basis", from_mix=False)
    key = bar.skin.shape_key_add(name="Smile", from_mix=False)
    moved = rest(bar.skin)
    moved[:40] += (0.0, 0.0, 0.1)
    key.points.foreach_set("co", moved.ravel())
    key.value = 0.7
    update()
    assert np.abs(shown(bar.skin) - native(bar.skin)).max() < 1e-5 * bar.size


def test_influence_fades_the_cage(bar: Rig) -> None:
    bend(bar, 0.6)
    plain = shown(bar.skin).copy()
    fat_key(bar)
    full = shown(bar.skin).copy()
    bar.settings.influence = 0.0
    update()
    assert np.abs(shown(bar.skin) - plain).max() < 1e-6 * bar.size
    bar.settings.influence = 0.5
    update()
    half = shown(bar.skin)
    assert np.abs(half - plain).max() > 1e-2 and np.abs(half - full).max() > 1e-2
    wanted = rest(bar.posed)
    wanted[9] += (0.0, 0.05, 0.0)
    bar.cage.active_shape_key_index = 1
    set_mesh(bar.posed, wanted)
    assert np.abs(rest(bar.posed) - wanted).max() < 2e-6 * bar.size
