# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex positions and faces of meshes, as arrays. Rows are vertices; coordinates are in the object's own space."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]


def read_base(mesh: bpy.types.Mesh) -> Points:
    """Base coordinates, `#V by 3`. Any mode but Edit Mode (there they are as they were when it began)."""
    points = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.vertices.foreach_get("co", points.ravel())
    return points


def read_into(mesh: bpy.types.Mesh, points: Points) -> bool:
    """`read_base` into points that are there; false where there are more or fewer. `points` lie in one piece."""
    if len(mesh.vertices) != len(points):
        return False
    mesh.vertices.foreach_get("co", points.reshape(-1))
    return True


def read_some(mesh: bpy.types.Mesh, count: int) -> NDArray[np.float64]:
    """Base coordinates of so many vertices from the first to the last, `count by 3`. Not in Edit Mode."""
    last = len(mesh.vertices) - 1
    return np.array([mesh.vertices[k * last // (count - 1)].co for k in range(count)], np.float64)


def read_evaluated(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Points:
    """Coordinates after shape keys and modifiers in `depsgraph`, `#V by 3`. Not for objects in Edit Mode."""
    return read_base(obj.evaluated_get(depsgraph).data)


def read_edit_mesh(mesh: bpy.types.Mesh) -> Points:
    """Coordinates of the edit mesh (the active shape key alone), `#V by 3`. Edit Mode only.

    There is no bulk access to an edit mesh in Blender; cages are small, skins are never read this way.
    """
    edit = bmesh.from_edit_mesh(mesh)
    return np.array([vertex.co for vertex in edit.verts], np.float32).reshape(-1, 3)


def write_edit_mesh(mesh: bpy.types.Mesh, points: Points) -> None:
    """Move the vertices of the edit mesh. Edit Mode only; the same vertex count."""
    edit = bmesh.from_edit_mesh(mesh)
    for vertex, point in zip(edit.verts, points.tolist(), strict=True):
        vertex.co = point
    bmesh.update_edit_mesh(mesh, loop_triangles=False, destructive=False)


def add_layers(mesh: bpy.types.Mesh, names: tuple[str, ...]) -> None:
    """Add point attributes that `write_edit_layers` can fill in Edit Mode, where they are missing. Not in Edit Mode."""
    for name in set(names) - set(mesh.attributes.keys()):
        mesh.attributes.new(name, "FLOAT_VECTOR", "POINT")


def write_edit_layers(mesh: bpy.types.Mesh, values: dict[str, Points]) -> None:
    """Keep `#V by 3` arrays with the edit mesh, in point attributes that exist. An undo in Edit Mode restores them."""
    edit = bmesh.from_edit_mesh(mesh)
    for name, points in values.items():
        layer = edit.verts.layers.float_vector.get(name)
        if layer is not None:
            for vertex, point in zip(edit.verts, points.tolist(), strict=True):
                vertex[layer] = point


def read_edit_layers(mesh: bpy.types.Mesh, names: tuple[str, ...]) -> list[Points] | None:
    """What `write_edit_layers` kept, or None where nothing was."""
    edit = bmesh.from_edit_mesh(mesh)
    layers = [edit.verts.layers.float_vector.get(name) for name in names]
    if any(layer is None for layer in layers):
        return None
    found = [np.array([vertex[layer] for vertex in edit.verts], np.float32).reshape(-1, 3) for layer in layers]
    return found if all(np.any(points) for points in found) else None


def write_base(mesh: bpy.types.Mesh, points: Points) -> None:
    """Write base coordinates through the position attribute. Not in Edit Mode."""
    mesh.attributes["position"].data.foreach_set("vector", np.ascontiguousarray(points, np.float32).reshape(-1))
    mesh.update()


def move(mesh: bpy.types.Mesh, points: NDArray[np.floating]) -> None:
    """Write base coordinates as `write_base` does, slower, so that the object's bounding box follows."""
    mesh.vertices.foreach_set("co", np.ascontiguousarray(points, np.float32).ravel())
    mesh.update()


def edit_vertex_count(mesh: bpy.types.Mesh) -> int:
    """Vertices of the mesh as edited: of the edit mesh in Edit Mode, else of the mesh."""
    return len(bmesh.from_edit_mesh(mesh).verts) if mesh.is_editmode else len(mesh.vertices)


def topology(mesh: bpy.types.Mesh) -> tuple[int, int, int]:
    """Number of vertices, faces and face corners. Not in Edit Mode."""
    return len(mesh.vertices), len(mesh.polygons), len(mesh.loops)


def read_faces(mesh: bpy.types.Mesh) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Polygons as (corner vertex indices `#corners`, face sizes `#F`)."""
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    sizes = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", sizes)
    return corners, sizes


def same_faces(mesh: bpy.types.Mesh, other: bpy.types.Mesh) -> bool:
    """Whether both have faces between the same vertices, in whatever order. Not in Edit Mode."""
    return topology(mesh) == topology(other) and np.array_equal(_names(mesh), _names(other))


def _names(mesh: bpy.types.Mesh) -> NDArray[np.int64]:
    """A number for each face, sorted: that of its vertices, whichever comes first and whichever way round."""
    corners, sizes = read_faces(mesh)
    if not len(sizes):
        return sizes.astype(np.int64)
    vertices = corners.astype(np.int64) + 1
    return np.sort(np.add.reduceat(vertices**3 + 7919 * vertices, np.cumsum(sizes) - sizes))


def new_mesh(name: str, points: Points, faces: tuple[NDArray[np.int32], NDArray[np.int32]]) -> bpy.types.Mesh:
    """A new mesh datablock from `#V by 3` points and (corners, sizes) faces, corners kept in order."""
    mesh = bpy.data.meshes.new(name)
    fill(mesh, points, faces)
    return mesh


def fill(mesh: bpy.types.Mesh, points: Points, faces: tuple[NDArray[np.int32], NDArray[np.int32]]) -> None:
    """Fill an empty mesh as `new_mesh` does."""
    corners, sizes = faces
    mesh.vertices.add(len(points))
    mesh.loops.add(len(corners))
    mesh.polygons.add(len(sizes))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(points, np.float32).ravel())
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.foreach_set("loop_start", (np.cumsum(sizes) - sizes).astype(np.int32))
    mesh.update(calc_edges=True)


def same(one: Points, other: Points) -> bool:
    """Whether two arrays of one type are the same, bit for bit. On a cage several times faster than `array_equal`."""
    return one.tobytes() == other.tobytes()


def close(one: NDArray[np.floating], other: NDArray[np.floating], tolerance: float) -> bool:
    """Whether no coordinate of two arrays of one shape differs by more; what is no number differs."""
    return bool(np.abs(one - other).max() <= tolerance)


def apply_matrix(matrix: NDArray[np.float64], points: NDArray[np.floating]) -> Points:
    """`#V by 3` points through an affine 4 by 4 matrix that acts on columns."""
    linear = np.asarray(matrix[:3, :3], np.float32).T
    return np.asarray(points, np.float32) @ linear + np.asarray(matrix[:3, 3], np.float32)
