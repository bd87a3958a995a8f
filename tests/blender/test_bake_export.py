"""Native rigs and keyed shapes through Blender's glTF and FBX exporters and back: still the live rig."""

from __future__ import annotations

from pathlib import Path

import addon_utils
import bpy
import numpy as np
import pytest
from baked import bake, extent, go_to, keyed_rig, shaped_rig, world
from mathutils.kdtree import KDTree
from scene import Rig, select

TIMES = (1, 7, 13, 20, 25)
# With Blender's own glTF add-on alone the bpy module of 4.2 crashes when the process ends.
CRASHES = pytest.mark.skipif(bpy.app.version < (4, 3), reason="bpy 4.2 crashes at exit once its glTF add-on has run")
KINDS = pytest.mark.parametrize("kind", [pytest.param("gltf", marks=CRASHES), "fbx"])


def there_and_back(kind: str, objects: list[bpy.types.Object], folder: Path) -> tuple[list[bpy.types.Object], int]:
    """Export and import the objects; returns the new meshes, and by how many frames the importer moves the action."""
    addon_utils.enable("io_scene_gltf2" if kind == "gltf" else "io_scene_fbx")
    select(objects, objects[0])
    before, file = set(bpy.data.objects), str(folder / f"x.{'glb' if kind == 'gltf' else 'fbx'}")
    if kind == "gltf":
        bpy.ops.export_scene.gltf(
            filepath=file, use_selection=True, export_all_influences=True, export_optimize_animation_size=False
        )
        bpy.ops.import_scene.gltf(filepath=file, bone_heuristic="BLENDER")
    else:
        bpy.ops.export_scene.fbx(
            filepath=file, use_selection=True, bake_anim_use_all_actions=False, bake_anim_use_nla_strips=False,
            bake_anim_simplify_factor=0.0,
        )  # fmt: skip
        bpy.ops.import_scene.fbx(filepath=file)
    new = [obj for obj in bpy.data.objects if obj not in before]
    animated = [obj for obj in new if obj.type == "MESH" and (obj.modifiers or obj.data.shape_keys)]
    return animated, 0 if kind == "gltf" else 1


def seen(rig: Rig) -> dict[float, np.ndarray]:
    found = {}
    for time in TIMES:
        go_to(time)
        found[time] = np.concatenate([world(skin) for skin in rig.skins])
    return found


def farthest(points: np.ndarray, others: np.ndarray) -> float:
    """Largest distance of a vertex of one to the nearest of the other, both ways: formats split and order vertices."""
    found = 0.0
    for here, there in ((points, others), (others, points)):
        tree = KDTree(len(here))
        for index, point in enumerate(here):
            tree.insert(point, index)
        tree.balance()
        found = max(found, max(tree.find(point)[2] for point in there))
    return found


def off(rig: Rig, wanted: dict[float, np.ndarray], meshes: list[bpy.types.Object], later: int) -> float:
    found = 0.0
    for time, points in wanted.items():
        go_to(time + later)
        found = max(found, farthest(points, np.concatenate([world(mesh) for mesh in meshes])))
    return found / extent(rig)


@KINDS
@pytest.mark.parametrize(
    "name",
    [
        "keyed_locations",
        "ik_with_pole",
        "copies_and_limits",
        "spline_ik",
        "eight_influences",
        "control_bones_between",
        "moving_armature_object",
        "armature_in_other_units",
        "two_skins_and_a_hidden_bone_collection",
    ],
)
def test_a_native_rig(name: str, kind: str, tmp_path: Path) -> None:
    rig = shaped_rig(name)
    made = bake().to_native_rig(rig.cage, 1, 25)
    wanted = seen(rig)
    meshes, later = there_and_back(kind, [made.armature, *made.skins], tmp_path)
    assert len(meshes) == len(rig.skins)
    assert off(rig, wanted, meshes, later) < 1e-5


@KINDS
def test_keyed_shapes(kind: str, tmp_path: Path) -> None:
    rig = keyed_rig("keyed_locations")
    made = bake().to_shape_keys(rig.cage, 1, 25)
    wanted = seen(rig)
    meshes, later = there_and_back(kind, list(made.skins), tmp_path)
    assert off(rig, wanted, meshes, later) < 1e-5
