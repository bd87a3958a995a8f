"""Characters linked from another file: with library overrides they are live, each with a cage of its own."""

from __future__ import annotations

from pathlib import Path

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
    fat_key,
    leave_edit_mode,
    native,
    rest,
    select,
    set_mesh,
    shown,
    update,
)
from test_sync import assert_rendered, key_the_bar

FRAMES = (1, 9, 20)


def library(rig: Rig, folder: Path) -> str:
    """Save the rig as a collection "Character" of its own file; returns the path."""
    return library_of([*rig.skins, rig.armature, rig.cage, rig.posed, rig.refit], folder)


def library_of(objects: list[bpy.types.Object], folder: Path) -> str:
    """The same of any objects."""
    home = bpy.data.collections.new("Character")
    bpy.context.scene.collection.children.link(home)
    for obj in objects:
        for collection in obj.users_collection:
            collection.objects.unlink(obj)
        home.objects.link(obj)
    update()
    path = str(folder / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    return path


def link(path: str) -> bpy.types.Collection:
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = ["Character"]
    return next(c for c in bpy.data.collections if c.library is not None and c.name == "Character")


def override(path: str) -> Rig:
    """One more copy of the character in the scene, linked, with library overrides of everything."""
    before = set(rigs())
    link(path).override_hierarchy_create(bpy.context.scene, bpy.context.view_layer, do_fully_editable=True)
    update()
    (cage,) = set(rigs()) - before
    return as_rig(bpy.data.objects[cage])


def rigs() -> list[str]:
    return [obj.name for obj in bpy.data.objects if obj.cage_rig.state != "NONE" and obj.library is None]


def as_rig(cage: bpy.types.Object) -> Rig:
    return Rig([skin.object for skin in cage.cage_rig.skins], cage.cage_rig.armature, cage)


def frames(rig: Rig) -> dict[int, Points]:
    found = {}
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        found[frame] = shown(rig.skin).copy()
    return found


def differ(one: dict[int, Points], other: dict[int, Points]) -> float:
    return max(float(np.abs(one[frame] - other[frame]).max()) for frame in FRAMES)


@pytest.fixture
def keyed(bar: Rig, tmp_path: Path) -> tuple[str, dict[int, Points]]:
    """The path of a library with the keyed bar, and its live frames; an empty file is open."""
    key_the_bar(bar)
    truth = frames(bar)
    path = library(bar, tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path, truth


def test_an_instance_is_paused_and_plain(bar: Rig, tmp_path: Path) -> None:
    """Without overrides nothing of a linked character can be written; the rig says so and Blender poses the skin."""
    bend(bar, 1.0)
    fat_key(bar)
    plain = native(bar.skin)
    path = library(bar, tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", link(path)
    bpy.context.scene.collection.objects.link(empty)
    update()
    cage = next(obj for obj in bpy.data.objects if obj.cage_rig.state != "NONE")
    assert cage.cage_rig.state == "PAUSED" and "library override" in cage.cage_rig.message
    update()
    assert np.abs(shown(cage.cage_rig.skins[0].object) - plain).max() < 1e-5


def test_an_overridden_character_plays_saves_and_reloads(keyed: tuple[str, dict[int, Points]], tmp_path: Path) -> None:
    path, truth = keyed
    rig = override(path)
    assert rig.settings.state == "LIVE", rig.settings.message
    assert rig.skin.data.library is not None, "the skin's mesh stays linked"
    assert differ(frames(rig), truth) < 1e-6
    shot = str(tmp_path / "shot.blend")
    for _ in range(2):  # saved again after a reload
        bpy.ops.wm.save_as_mainfile(filepath=shot)
        bpy.ops.wm.open_mainfile(filepath=shot)
        (name,) = rigs()
        rig = as_rig(bpy.data.objects[name])
        assert rig.settings.state == "LIVE", rig.settings.message
        assert differ(frames(rig), truth) < 1e-6


def test_two_of_them_have_poses_and_cages_of_their_own(keyed: tuple[str, dict[int, Points]], tmp_path: Path) -> None:
    path, truth = keyed
    one, other = override(path), override(path)
    assert one.cage != other.cage and one.skin.data == other.skin.data
    bpy.context.scene.frame_set(9)
    other.armature.animation_data_clear()
    bend(other, -1.2)
    enter_edit_mode(other.posed)
    drag(other.posed, 3, (0.4, 0.5, 0.3))
    drag(other.posed, 3, (0.0, 0.2, 0.0))
    wanted = edited(other.posed).copy()
    leave_edit_mode()
    assert other.settings.state == one.settings.state == "LIVE", other.settings.message
    assert other.cage.data.library is None and one.cage.data.library is not None
    assert np.abs(rest(other.posed) - wanted).max() < 1e-5 * other.size
    shapes = dict.fromkeys(FRAMES)
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        assert np.abs(shown(one.skin) - truth[frame]).max() < 1e-6, "the first is untouched"
        shapes[frame] = shown(other.skin).copy()
    assert differ(shapes, truth) > 0.1
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    names = one.cage.name, other.cage.name
    bpy.ops.wm.open_mainfile(filepath=shot)
    one, other = (as_rig(bpy.data.objects[name]) for name in names)
    assert differ(frames(one), truth) < 1e-6
    assert differ(frames(other), shapes) < 1e-5


def test_overridden_characters_render_the_right_frames(keyed: tuple[str, dict[int, Points]], tmp_path: Path) -> None:
    path, _ = keyed
    rig = override(path)
    live = {}
    for frame in (4, 5, 6):
        bpy.context.scene.frame_set(frame)
        live[frame] = shown(rig.skin).copy()
    assert_rendered(rig, live, tmp_path)


def test_a_modifier_before_ours_and_subdivision_after_it_on_an_override(bar: Rig, tmp_path: Path) -> None:
    bar.skin.modifiers.new("Twist", "SIMPLE_DEFORM").angle = 0.6
    bar.skin.modifiers.move(len(bar.skin.modifiers) - 1, 0)
    bar.skin.modifiers.new("Smooth", "SUBSURF").levels = 1
    bend(bar, 0.8)
    fat_key(bar)
    update()
    assert bar.settings.state == "LIVE", bar.settings.message
    truth = shown(bar.skin).copy()
    path = library(bar, tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = override(path)
    update()
    assert rig.settings.state == "LIVE", rig.settings.message
    assert np.abs(shown(rig.skin) - truth).max() < 1e-5


def test_a_change_of_the_library_reaches_the_shot(keyed: tuple[str, dict[int, Points]], tmp_path: Path) -> None:
    path, _ = keyed
    rig = override(path)
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=path)
    cage = next(obj for obj in bpy.data.objects if obj.cage_rig.state != "NONE")
    key = cage.data.shape_keys.key_blocks[1]
    key.points.foreach_set("co", (rest(cage) * np.float32([1.0, 2.0, 2.0])).ravel())
    cage.data.update_tag()
    update()
    truth = frames(as_rig(cage))
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=shot)
    (name,) = rigs()
    rig = as_rig(bpy.data.objects[name])
    assert differ(frames(rig), truth) < 1e-5


def test_the_cage_of_an_overridden_character_is_keyed_in_the_shot(
    keyed: tuple[str, dict[int, Points]], tmp_path: Path
) -> None:
    path, truth = keyed
    one, other = override(path), override(path)
    bpy.context.scene.frame_set(9)
    select([one.cage], one.cage)
    assert bpy.ops.cage_rig.key_cage() == {"FINISHED"}
    bpy.context.scene.frame_set(20)
    enter_edit_mode(one.posed)
    drag(one.posed, 3, (0.4, 0.5, 0.3))
    leave_edit_mode()
    select([one.cage], one.cage)
    assert bpy.ops.cage_rig.key_cage() == {"FINISHED"}
    shapes = frames(one)
    assert np.abs(shapes[9] - truth[9]).max() < 1e-5 and np.abs(shapes[20] - truth[20]).max() > 0.1
    assert differ(frames(other), truth) < 1e-6, "the other one plays the library's keys"
    names = one.cage.name, other.cage.name
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    one, other = (as_rig(bpy.data.objects[name]) for name in names)
    assert differ(frames(one), shapes) < 1e-5 and differ(frames(other), truth) < 1e-6


def test_what_was_bound_elsewhere_is_not_taken_apart_here(keyed: tuple[str, dict[int, Points]]) -> None:
    path, truth = keyed
    rig = override(path)
    select([rig.cage], rig.cage)
    for operator in (bpy.ops.cage_rig.rebind, bpy.ops.cage_rig.unbind, bpy.ops.cage_rig.apply_refit):
        with pytest.raises(RuntimeError, match=f"{rig.cage.name}|{rig.armature.name}"):
            operator()
    assert differ(frames(rig), truth) < 1e-6


def test_a_cage_bound_in_the_shot_to_an_overridden_character(bar: Rig, tmp_path: Path) -> None:
    bend(bar, 0.9)
    fat_key(bar)
    truth = shown(bar.skin).copy()
    cage_points, faces = rest(bar.cage), [list(face.vertices) for face in bar.cage.data.polygons]
    select([bar.cage], bar.cage)
    bpy.ops.cage_rig.unbind()
    path = library_of([bar.skin, bar.armature], tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    link(path).override_hierarchy_create(bpy.context.scene, bpy.context.view_layer, do_fully_editable=True)
    skin = next(obj for obj in bpy.data.objects if obj.library is None and obj.type == "MESH")
    armature = next(obj for obj in bpy.data.objects if obj.library is None and obj.type == "ARMATURE")
    mesh = bpy.data.meshes.new("ShotCage")
    mesh.from_pydata(cage_points.tolist(), [], faces)
    cage = bpy.data.objects.new("ShotCage", mesh)
    bpy.context.scene.collection.objects.link(cage)
    select([skin, armature, cage], cage)
    assert bpy.ops.cage_rig.bind() == {"FINISHED"}
    rig = Rig([skin], armature, cage)
    assert rig.settings.state == "LIVE", rig.settings.message
    set_mesh(cage, cage_points * np.float32([1.2, 1.6, 1.6]))
    assert np.abs(shown(skin) - truth).max() < 1e-5
    shot = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=shot)
    bpy.ops.wm.open_mainfile(filepath=shot)
    update()
    cage = bpy.data.objects["ShotCage"]
    assert cage.cage_rig.state == "LIVE", cage.cage_rig.message
    assert np.abs(shown(cage.cage_rig.skins[0].object) - truth).max() < 1e-5
    select([cage], cage)
    bpy.ops.cage_rig.unbind()
    skin = next(obj for obj in bpy.data.objects if obj.library is None and obj.type == "MESH" and obj != cage)
    assert not [m for m in skin.modifiers if m.type == "NODES"] and skin.modifiers["Armature"].show_viewport
