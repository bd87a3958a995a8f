"""Bakes of characters with several cages on one another, and of characters linked from another file."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from baked import bake, everything, go_to, untouched, worst
from scene import Rig, bend, bind, rest, select, set_mesh, update
from test_confined import bind_small, fatten
from test_linked import library, override
from test_sync import key_the_bar

from blend_fixtures.build import build_character
from blend_fixtures.small import two_skins


def keyed_bend(rig: Rig) -> None:
    for frame, angle in ((1, 0.0), (20, 1.4)):
        bend(rig, angle)
        rig.armature.pose.bones["upper"].keyframe_insert("rotation_euler", frame=frame)


def two_cages(bar: Rig) -> Rig:
    """A cage for the hand on that of the whole bar, both edited."""
    hand = bind_small(bar)
    fatten(hand, 1.5)
    set_mesh(bar.cage, rest(bar.cage) * np.float32([1.3, 1.2, 1.2]))
    keyed_bend(bar)
    return hand


@pytest.mark.parametrize("asked", ["upper", "lower"])
def test_cages_on_one_another_bake_as_one_character(bar: Rig, asked: str, tmp_path: Path) -> None:
    hand = two_cages(bar)
    cage = hand.cage if asked == "upper" else bar.cage
    times = (1, 7, 13, 20)
    before = everything()
    made = bake().to_mesh_cache(cage, str(tmp_path), 1, 20)
    assert worst(bar, made.collection.objects, times) < 1e-6
    assert [mod.type for mod in made.collection.objects[0].modifiers] == ["MESH_CACHE"]
    waits = made.collection.objects[0].animation_data
    assert waits is None or not waits.drivers, "what is baked waits for no rig"
    assert worst(bar, bake().to_shape_keys(cage, 1, 20).skins, times) < 1e-6
    native = bake().to_native_rig(cage, 1, 20)
    assert worst(bar, native.skins, times) < 1e-5 and native.error < 1e-5
    abc = bake().to_alembic(cage, str(tmp_path / "x.abc"), 1, 20, result=True)
    assert worst(bar, abc.collection.objects, times) < 1e-6
    assert len(everything()["objects"]) == len(before["objects"]) + 6


def test_a_second_cage_on_one_of_two_skins(tmp_path: Path) -> None:
    rig = bind(build_character(two_skins()))
    right = Rig([rig.skins[1]], rig.armature, rig.cage)
    hand = bind_small(right)
    fatten(hand, 1.5)
    keyed_bend(rig)
    made = bake().to_mesh_cache(hand.cage, str(tmp_path), 1, 20)
    assert len(made.files) == 2, "the whole character"
    assert worst(rig, made.collection.objects, (1, 13, 20)) < 1e-6
    assert worst(rig, bake().to_native_rig(rig.cage, 1, 20).skins, (1, 13, 20)) < 1e-5


def test_an_animated_cage_below_is_named(bar: Rig) -> None:
    hand = two_cages(bar)
    key_the_bar(bar)
    go_to(1)
    with untouched(), pytest.raises(bake().BakeError, match="'BarCage' is animated"):
        bake().to_native_rig(hand.cage, 1, 5)


@pytest.mark.parametrize("target", ["mesh cache", "shape keys", "native rig", "alembic", "usd"])
def test_a_linked_character_with_overrides(bar: Rig, target: str, tmp_path: Path) -> None:
    keyed_bend(bar)
    if target != "native rig":
        key_the_bar(bar)
    else:
        set_mesh(bar.cage, rest(bar.cage) * np.float32([1.3, 1.2, 1.2]))
    path = library(bar, tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = override(path)
    assert rig.settings.state == "LIVE", rig.settings.message
    folder = tmp_path / "out"
    folder.mkdir()
    if target == "native rig":
        with untouched():
            steps = bake().native_rig.steps(rig.cage, 1, 20, samples=1, keep_action=False)
            next(steps)
            steps.close()
        native = bake().to_native_rig(rig.cage, 1, 20)
        copies, local = native.skins, [native.armature, native.armature.data]
    else:
        made = {
            "mesh cache": lambda: bake().to_mesh_cache(rig.cage, str(folder), 1, 20),
            "shape keys": lambda: bake().to_shape_keys(rig.cage, 1, 20),
            "alembic": lambda: bake().to_alembic(rig.cage, str(folder), 1, 20, result=True),
            "usd": lambda: bake().to_usd(rig.cage, str(folder), 1, 20, result=True),
        }[target]()
        copies, local = list(made.collection.objects), []
    assert worst(rig, copies, (1, 7, 13, 20)) < (1e-5 if target == "native rig" else 1e-6)
    for obj in [*(obj for obj in copies if obj.type == "MESH"), *local]:
        assert obj.library is None and obj.override_library is None
    assert rig.skin.override_library is not None


def test_an_instance_without_overrides_is_refused(bar: Rig, tmp_path: Path) -> None:
    path = library(bar, tmp_path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.collections = ["Character"]
    empty = bpy.data.objects.new("Instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", bpy.data.collections["Character"]
    bpy.context.scene.collection.objects.link(empty)
    update()
    select([empty], empty)
    cage = next(obj for obj in bpy.data.objects if obj.cage_rig.state != "NONE")
    with untouched(), pytest.raises(bake().BakeError, match=r"paused.*library override"):
        bake().to_shape_keys(cage, 1, 2)
