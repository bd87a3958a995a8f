"""What the tests of Generate Cage share: pressing its button, and looking at what it left."""

from __future__ import annotations

from types import ModuleType

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from scene import Points, rest, update

from blend_fixtures.build import RigObjects

SECTION = "cage_rig_section"


def uncaged(rig: RigObjects) -> RigObjects:
    mesh = rig.cage.data
    bpy.data.objects.remove(rig.cage)
    bpy.data.meshes.remove(mesh)
    return RigObjects(rig.skins, rig.armature, None)


def press(**options: object) -> bpy.types.Object:
    options = options if "own_nodes" in options or is_caged() else {"placement": "JOINTS"} | options
    assert bpy.ops.cage_rig.generate_cage(**options) == {"FINISHED"}
    return bpy.context.object


def is_caged() -> bool:
    return any(obj.cage_rig_generated.skins for obj in bpy.context.selected_objects)


def refused(**options: object) -> str:
    with pytest.raises(RuntimeError) as error:
        bpy.ops.cage_rig.generate_cage(**options)
    return str(error.value)


def state() -> dict[str, object]:
    """All that a refusal must leave as it is."""
    kinds = ("objects", "meshes", "armatures", "collections", "node_groups", "images", "actions")
    meshes = {mesh.name: (rest_of(mesh).tobytes(), len(mesh.polygons), attributes(mesh)) for mesh in bpy.data.meshes}
    objects = {
        obj.name: (tuple(map(tuple, obj.matrix_world)), obj.select_get(), obj.cage_rig_generated.own_nodes)
        for obj in bpy.data.objects
    }
    poses = {armature.name: armature.pose_position for armature in bpy.data.armatures}
    return {"counts": [len(getattr(bpy.data, kind)) for kind in kinds], **meshes, **objects, **poses}


def attributes(mesh: bpy.types.Mesh) -> list[str]:
    """Without those of a selection, which shows what a refusal is about."""
    return sorted(item.name for item in mesh.attributes if not item.name.startswith(".select"))


def rest_of(mesh: bpy.types.Mesh) -> Points:
    points = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    return points


def sections(cage: bpy.types.Object) -> np.ndarray:
    found = np.empty(len(cage.data.vertices), np.int32)
    cage.data.attributes[SECTION].data.foreach_get("value", found)
    return found


def bones(cage: bpy.types.Object) -> list[str]:
    """The bone that each vertex belongs to."""
    names = [group.name for group in cage.vertex_groups]
    groups = [[(names[g.group], g.weight) for g in vertex.groups] for vertex in cage.data.vertices]
    assert all(len(found) == 1 and found[0][1] == 1.0 for found in groups)
    return [found[0][0] for found in groups]


def in_world(obj: bpy.types.Object) -> Points:
    matrix = np.array(obj.matrix_world)
    return rest(obj) @ matrix[:3, :3].T + matrix[:3, 3]


def encloses(cage: bpy.types.Object, skin: bpy.types.Object) -> bool:
    """Whether every vertex of a skin is inside: rays out of it cross the cage an odd number of times."""
    work = bmesh.new()
    work.from_mesh(cage.data)
    bmesh.ops.triangulate(work, faces=work.faces)
    work.transform(cage.matrix_world)
    tree = BVHTree.FromBMesh(work)
    work.free()

    way = Vector((0.31, 0.77, 0.56)).normalized()

    def crossings(start: Vector) -> int:
        count, found = 0, tree.ray_cast(start, way)
        while found[0] is not None:
            count += 1
            found = tree.ray_cast(found[0] + 1e-6 * way, way)
        return count

    return all(crossings(Vector(point)) % 2 for point in in_world(skin)[::5].tolist())


def at_joints(caging: ModuleType) -> object:
    return caging.Options(placement="JOINTS")


def bend(armature: bpy.types.Object, angle: float = 1.57) -> None:
    bone = armature.pose.bones["upper"]
    bone.rotation_mode = "XYZ"
    bone.rotation_euler = (0.0, 0.0, angle)
    update()
