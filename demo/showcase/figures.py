"""Still copies of a rig as it is now: what the picture is built from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Matrix

Array = np.ndarray


@dataclass(frozen=True)
class Figure:
    """A frozen rig in world space. `cage_vertices` #C by 3 and `bones` #J by 2 by 3 (heads and tails), or None."""

    title: str
    meshes: list[bpy.types.Mesh]
    cage_vertices: Array | None = None
    cage_faces: list[list[int]] = field(default_factory=list)
    bones: Array | None = None

    def points(self) -> Array:
        """All points, for fitting the figure into its place (#P by 3)."""
        clouds = [mesh_points(mesh) for mesh in self.meshes]
        return np.concatenate([*clouds, *([] if self.cage_vertices is None else [self.cage_vertices])])


def freeze(
    title: str,
    skins: Sequence[bpy.types.Object],
    *,
    cage: bpy.types.Object | None = None,
    armature: bpy.types.Object | None = None,
) -> Figure:
    """Copy the evaluated `skins`, the evaluated `cage` and the posed bones of `armature`."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    meshes = []
    for skin in skins:
        mesh = bpy.data.meshes.new_from_object(skin.evaluated_get(depsgraph), depsgraph=depsgraph)
        mesh.transform(skin.matrix_world)
        meshes.append(mesh)
    vertices, faces = (None, []) if cage is None else cage_geometry(cage)
    return Figure(title, meshes, vertices, faces, None if armature is None else bone_segments(armature, skins))


def cage_geometry(cage: bpy.types.Object) -> tuple[Array, list[list[int]]]:
    """Evaluated world coordinates (#C by 3) and faces of a cage object."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    mesh = cage.evaluated_get(depsgraph).data
    return to_world(mesh_points(mesh), cage.matrix_world), [list(face.vertices) for face in mesh.polygons]


def bone_segments(armature: bpy.types.Object, skins: Sequence[bpy.types.Object]) -> Array:
    """World heads and tails, as posed now, of the bones that move any of `skins` (#J by 2 by 3)."""
    used = {group.name for skin in skins for group in skin.vertex_groups}
    bones = [bone for bone in armature.pose.bones if bone.name in used]
    ends = np.array([(*bone.head, *bone.tail) for bone in bones]).reshape(-1, 3)
    return to_world(ends, armature.matrix_world).reshape(-1, 2, 3)


def mesh_points(mesh: bpy.types.Mesh) -> Array:
    """Vertex coordinates (#V by 3)."""
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", flat)
    return flat.reshape(-1, 3).astype(float)


def to_world(points: Array, matrix: Matrix) -> Array:
    """`points` (#P by 3) through a 4 by 4 matrix."""
    m = np.array(matrix)
    return points @ m[:3, :3].T + m[:3, 3]
