"""Bakes to files and shape keys: what plays without us equals the live rig, and a bake that ends early is none."""

from __future__ import annotations

import resource
import struct
from collections.abc import Callable
from pathlib import Path

import baked
import bpy
import numpy as np
import pytest
from baked import bake, everything, go_to, keyed_rig, untouched, worst
from scene import Rig, bend, bind, bound_bar, rest, select, shown, update

from blend_fixtures import rigs
from blend_fixtures.build import build_character
from blend_fixtures.small import two_skins

EVERY = pytest.mark.parametrize("name", rigs.RIGS)
SOME = pytest.mark.parametrize(
    "name", ["keyed_locations", "moving_armature_object", "unapplied_transforms", "mirrored_armature", "spline_ik"]
)
SUBFRAMES = (1, 6.5, 13, 13.25, 25)


@EVERY
def test_a_mesh_cache_plays_as_the_live_rig(name: str, tmp_path: Path) -> None:
    rig = keyed_rig(name)
    made = bake().to_mesh_cache(rig.cage, str(tmp_path / "cache.pc2"), 1, 25, samples=4)
    assert worst(rig, made.collection.objects, SUBFRAMES) < 1e-6
    assert sorted(tmp_path.iterdir()) == sorted(made.files)


@SOME
def test_alembic_plays_as_the_live_rig(name: str, tmp_path: Path) -> None:
    rig = keyed_rig(name)
    made = bake().to_alembic(rig.cage, str(tmp_path / "rig.abc"), 1, 25, samples=4, result=True)
    assert worst(rig, made.collection.objects, SUBFRAMES) < 1e-6
    assert list(tmp_path.iterdir()) == [made.file]


@SOME
def test_usd_plays_as_the_live_rig(name: str, tmp_path: Path) -> None:
    rig = keyed_rig(name)
    made = bake().to_usd(rig.cage, str(tmp_path / "rig.usdc"), 1, 25, result=True)
    assert worst(rig, made.collection.objects) < 1e-6
    assert list(tmp_path.iterdir()) == [made.file]


@SOME
def test_shape_keys_play_as_the_live_rig(name: str) -> None:
    rig = keyed_rig(name)
    made = bake().to_shape_keys(rig.cage, 1, 25)
    assert made.count == 25
    assert worst(rig, made.collection.objects, range(1, 26)) < 1e-6


def test_shape_keys_every_few_frames_hit_these_and_the_last() -> None:
    rig = keyed_rig()
    made = bake().to_shape_keys(rig.cage, 1, 25, step=7)
    assert made.count == 5
    assert worst(rig, made.skins, (1, 8, 15, 22, 25)) < 1e-6
    halves = []
    for time in (1, 8):
        go_to(time)
        halves.append(shown(made.skins[0]))
    go_to(4.5)
    assert np.abs(shown(made.skins[0]) - 0.5 * (halves[0] + halves[1])).max() < 1e-5, "a straight line between keys"
    for time in (-3, 40):
        go_to(time)
        assert np.isfinite(shown(made.skins[0])).all()
        assert sum(block.value for block in made.skins[0].data.shape_keys.key_blocks[1:]) == 1.0


def lattice_before(rig: Rig) -> None:
    """A keyed twist before our modifier, and a key of the skin's own."""
    twist = rig.skin.modifiers.new("Twist", "SIMPLE_DEFORM")
    rig.skin.modifiers.move(len(rig.skin.modifiers) - 1, 0)
    twist.deform_axis = "X"
    rig.skin.shape_key_add(name="Basis", from_mix=False)
    smile = rig.skin.shape_key_add(name="Smile", from_mix=False)
    smile.points.foreach_set("co", (rest(rig.skin) + np.float32([0.0, 0.1, 0.0])).ravel())
    for frame, angle, value in ((1, 0.0, 0.0), (25, 1.5, 1.0)):
        twist.angle, smile.value = angle, value
        twist.keyframe_insert("angle", frame=frame)
        smile.keyframe_insert("value", frame=frame)


def file_bake(target: str, rig: Rig, folder: Path) -> bpy.types.Collection:
    match target:
        case "mesh cache":
            return bake().to_mesh_cache(rig.cage, str(folder), 1, 25).collection
        case "alembic":
            return bake().to_alembic(rig.cage, str(folder), 1, 25, subdivide=True, result=True).collection
        case "usd":
            return bake().to_usd(rig.cage, str(folder), 1, 25, subdivide=True, result=True).collection
        case _:
            return bake().to_shape_keys(rig.cage, 1, 25).collection


TARGETS = pytest.mark.parametrize("target", ["mesh cache", "alembic", "usd", "shape keys"])


@TARGETS
def test_modifiers_before_and_after_ours_and_the_skins_own_keys(target: str, tmp_path: Path) -> None:
    rig = keyed_rig()
    lattice_before(rig)
    rig.skin.modifiers.new("Smooth", "SUBSURF").levels = 1
    go_to(1)
    made = file_bake(target, rig, tmp_path)
    assert len(shown(rig.skin)) > 3 * len(rest(rig.skin))
    assert worst(rig, made.objects) < 1e-6


@TARGETS
def test_several_skins(target: str, tmp_path: Path) -> None:
    rig = bind(build_character(two_skins()))
    for frame, angle in ((1, 0.0), (25, 1.4)):
        bend(rig, angle)
        rig.armature.pose.bones["upper"].keyframe_insert("rotation_euler", frame=frame)
    made = file_bake(target, rig, tmp_path)
    assert worst(rig, made.objects) < 1e-6
    if target == "mesh cache":
        assert sorted(file.name for file in tmp_path.iterdir()) == [
            "TwoSkinsCage-Left.pc2",
            "TwoSkinsCage-Right.pc2",
        ]


@TARGETS
def test_a_bake_leaves_the_rest_of_the_file_alone(target: str, tmp_path: Path) -> None:
    rig = keyed_rig()
    rig.skin.hide_set(True)
    rig.cage.hide_viewport = rig.armature.hide_viewport = rig.posed.hide_viewport = True
    go_to(7.5)
    select([], None)
    before = baked.state()
    live = shown(rig.skin).copy()
    made = file_bake(target, rig, tmp_path)
    objects = list(made.objects)
    assert not bpy.context.selected_objects
    fresh = {mesh for obj in objects if obj.type == "MESH" for mesh in [obj.data]}
    assert not fresh & {skin.data for skin in rig.skins}
    assert not any(obj.cage_rig.part != "NONE" or obj.cage_rig.owner for obj in objects)
    for obj in objects:
        bpy.data.objects.remove(obj)
    assert baked.state() == before
    update()
    assert np.array_equal(shown(rig.skin), live)


@TARGETS
def test_a_skin_that_is_hidden_in_every_way_is_baked(target: str, tmp_path: Path) -> None:
    rig = keyed_rig()
    hidden = bpy.data.collections.new("Hidden")
    bpy.context.scene.collection.children.link(hidden)
    for collection in rig.skin.users_collection:
        collection.objects.unlink(rig.skin)
    hidden.objects.link(rig.skin)
    rig.skin.hide_viewport = rig.skin.hide_select = True
    layer = bpy.context.view_layer.layer_collection.children["Hidden"]
    layer.exclude = True
    made = file_bake(target, rig, tmp_path)
    assert layer.exclude and rig.skin.hide_viewport and rig.skin.hide_select
    assert list(rig.skin.users_collection) == [hidden]
    layer.exclude = rig.skin.hide_viewport = False
    assert worst(rig, made.objects) < 1e-6


def test_a_result_outlives_the_rig_and_the_add_on(tmp_path: Path) -> None:
    rig = keyed_rig()
    made = bake().to_mesh_cache(rig.cage, str(tmp_path), 1, 25)
    copy = made.collection.objects[0]
    seen = []
    for time in (5, 20):
        go_to(time)
        seen.append(shown(rig.skin).copy())
    select([rig.cage], rig.cage)
    assert bpy.ops.cage_rig.unbind() == {"FINISHED"}
    for time, wanted in zip((5, 20), seen, strict=True):
        go_to(time)
        assert np.array_equal(shown(copy), wanted)
    assert [mod.type for mod in copy.modifiers] == ["MESH_CACHE"]
    assert not [name for name in copy.data.attributes.keys() if "cage_rig" in name]  # noqa: SIM118


def test_the_header_of_a_point_cache(tmp_path: Path) -> None:
    rig = keyed_rig()
    made = bake().to_mesh_cache(rig.cage, str(tmp_path / "x.pc2"), 3, 5, samples=2, result=False)
    assert made.collection is None
    data = made.files[0].read_bytes()
    count = len(rest(rig.skin))
    assert struct.unpack("<12siiffi", data[:32]) == (b"POINTCACHE2\0", 1, count, 3.0, 0.5, 5)
    points = np.frombuffer(data[32:], "<f4").reshape(5, count, 3)
    for index, time in enumerate((3, 3.5, 4, 4.5, 5)):
        go_to(time)
        assert np.array_equal(points[index], shown(rig.skin))


def test_paths_beside_the_blend(tmp_path: Path) -> None:
    rig = keyed_rig()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    made = bake().to_mesh_cache(rig.cage, "", 1, 2)
    assert made.files == [tmp_path / "LimbCage.pc2"]
    assert made.collection.objects[0].modifiers[0].filepath == "//LimbCage.pc2"
    assert bake().to_usd(rig.cage, "//walk", 1, 2).file == tmp_path / "walk.usdc"
    assert bake().to_alembic(rig.cage, "//walk.v2", 1, 2).file == tmp_path / "walk.v2.abc"


def test_a_file_that_is_there_is_replaced_at_the_end(tmp_path: Path) -> None:
    rig = keyed_rig()
    file = tmp_path / "x.pc2"
    file.write_text("before")
    steps = bake().mesh_cache.steps(rig.cage, str(file), 1, 25, samples=1, result=False)
    next(steps)
    assert file.read_text() == "before"
    bake().run(steps)
    assert file.read_bytes().startswith(b"POINTCACHE2") and list(tmp_path.iterdir()) == [file]


def generators(rig: Rig, folder: Path) -> dict[str, object]:
    package, cage = bake(), rig.cage
    return {
        "mesh cache": package.mesh_cache.steps(cage, str(folder / "x.pc2"), 1, 25, samples=2, result=True),
        "alembic": package.scenes.alembic_steps(
            cage, str(folder / "x.abc"), 1, 25, samples=1, subdivide=False, result=True
        ),
        "usd": package.scenes.usd_steps(cage, str(folder / "x.usdc"), 1, 25, subdivide=False, result=True),
        "shape keys": package.shape_keys.steps(cage, 1, 25, step=1),
        "native rig": package.native_rig.steps(cage, 1, 25, samples=1, keep_action=False),
    }


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("target", ["mesh cache", "alembic", "usd", "shape keys", "native rig"])
def test_closed_on_its_way_nothing_is_left(target: str, share: float, tmp_path: Path) -> None:
    rig = baked.shaped_rig("ik_with_pole")
    go_to(3.25)
    (tmp_path / "x.pc2").write_text("before")
    with untouched(folder=tmp_path):
        steps = generators(rig, tmp_path)[target]
        while next(steps) < share:
            pass
        steps.close()
    assert (tmp_path / "x.pc2").read_text() == "before"
    assert rig.settings.state == "LIVE"


def empty_range(rig: Rig, folder: Path) -> None:
    bake().to_mesh_cache(rig.cage, str(folder / "x.pc2"), 10, 9)


def empty_range_of_alembic(rig: Rig, folder: Path) -> None:
    bake().to_alembic(rig.cage, str(folder / "x.abc"), 10, 9)


def empty_range_of_keys(rig: Rig, _folder: Path) -> None:
    bake().to_shape_keys(rig.cage, 10, 9)


def no_such_folder(rig: Rig, folder: Path) -> None:
    bake().to_usd(rig.cage, str(folder / "missing" / "x.usdc"), 1, 2)


def relative_to_nothing(rig: Rig, _folder: Path) -> None:
    bake().to_mesh_cache(rig.cage, "//x.pc2", 1, 2)


def a_folder_of_that_name(rig: Rig, folder: Path) -> None:
    rig.cage.name = "Taken"
    bake().to_mesh_cache(rig.cage, str(folder), 1, 2)


def a_file_that_nobody_may_write(rig: Rig, _folder: Path) -> None:
    bake().to_alembic(rig.cage, "/proc/x.abc", 1, 2)


def a_full_disk(rig: Rig, folder: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        bake().to_mesh_cache(rig.cage, str(folder / "x.pc2"), 1, 25)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def a_paused_rig(rig: Rig, _folder: Path) -> None:
    bake().to_shape_keys(rig.cage, 1, 2)


def no_rig(rig: Rig, _folder: Path) -> None:
    bake().to_shape_keys(rig.armature, 1, 2)


def another_mode(rig: Rig, _folder: Path) -> None:
    bake().to_shape_keys(rig.cage, 1, 2)


def pause(rig: Rig) -> None:
    rig.skin.modifiers.new("More", "MIRROR")
    rig.skin.modifiers.move(len(rig.skin.modifiers) - 1, 0)
    update()
    assert rig.settings.state == "PAUSED"


def pose(rig: Rig) -> None:
    select([rig.armature], rig.armature)
    bpy.ops.object.mode_set(mode="POSE")


@pytest.mark.parametrize(
    ("act", "words", "before"),
    [
        (empty_range, "no frame from 10 to 9", None),
        (empty_range_of_alembic, "no frame from 10 to 9", None),
        (empty_range_of_keys, "no frame from 10 to 9", None),
        (no_such_folder, "no folder '.*missing'", None),
        (relative_to_nothing, "Save the .blend first", None),
        (a_folder_of_that_name, "is a folder", None),
        (a_file_that_nobody_may_write, "can't be written", None),
        (a_full_disk, "can't be written to: File too large", None),
        (a_paused_rig, "is paused: Modifier 'More'", pause),
        (no_rig, "not the cage of a rig", None),
        (another_mode, "Object Mode", pose),
    ],
)
def test_what_can_not_be_is_said_and_leaves_nothing(
    act: Callable[[Rig, Path], None], words: str, before: Callable[[Rig], None] | None, tmp_path: Path
) -> None:
    rig = keyed_rig()
    (tmp_path / "Taken.pc2").mkdir()
    if before is not None:
        before(rig)
    if act is a_folder_of_that_name:
        rig.cage.name = "Taken"
    with untouched(folder=tmp_path), pytest.raises(bake().BakeError, match=words):
        act(rig, tmp_path)


def test_a_rig_that_pauses_on_the_way_is_no_bake(tmp_path: Path) -> None:
    rig = keyed_rig()
    more = rig.cage.modifiers.new("More", "ARRAY")
    for frame, count in ((1, 1), (9, 1), (10, 2)):
        more.count = count
        more.keyframe_insert("count", frame=frame)
    for target in ("mesh cache", "alembic", "usd", "shape keys"):
        go_to(1)
        assert rig.settings.state == "LIVE", rig.settings.message
        with untouched(folder=tmp_path), pytest.raises(bake().BakeError, match=r"paused at frame 10.*vertices"):
            file_bake(target, rig, tmp_path)


def test_the_operator_bakes_to_every_target(tmp_path: Path) -> None:
    rig = baked.shaped_rig("keyed_locations")
    bpy.context.scene.frame_end = 6
    select([rig.skin], rig.skin)
    operator = bpy.ops.cage_rig.bake
    for target, name in (("MESH_CACHE", "x.pc2"), ("ALEMBIC", "x.abc"), ("USD", "x.usdc")):
        assert operator(target=target, filepath=str(tmp_path / name)) == {"FINISHED"}
        assert (tmp_path / name).exists()
    assert operator("INVOKE_DEFAULT", target="SHAPE_KEYS", frame_start=2) == {"FINISHED"}, (
        "in background it runs through"
    )
    assert operator(target="NATIVE_RIG") == {"FINISHED"}
    made = [collection.name for collection in bpy.data.collections]
    assert made == ["LimbCage Mesh Cache", "LimbCage Native", "LimbCage Shape Keys"]
    keys = bpy.data.collections["LimbCage Shape Keys"].objects[0].data.shape_keys.key_blocks.keys()
    assert list(keys) == ["Basis", *(f"Frame {frame}" for frame in range(2, 7))]
    for target in ("MESH_CACHE", "ALEMBIC", "USD", "SHAPE_KEYS", "NATIVE_RIG"):
        with pytest.raises(RuntimeError, match="Error: There is no frame from 9 to 6"):
            operator(target=target, frame_start=9, filepath=str(tmp_path / "y"))


def test_the_operator_asks_for_a_rig() -> None:
    rig = bound_bar()
    select([], None)
    assert not bpy.ops.cage_rig.bake.poll()
    select([rig.armature], rig.armature)
    assert bpy.ops.cage_rig.bake.poll()
    assert everything()["actions"] == []
