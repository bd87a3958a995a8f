# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read of meshes only to draw over them in the viewport. Nothing is written."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
from numpy.typing import NDArray

from . import modifier, positions, stack
from .positions import Points

KEEPING = stack.HARMLESS | stack.DEFORMING | stack.GROWING  # modifiers that leave the first vertices the first


def read_triangles(mesh: bpy.types.Mesh) -> NDArray[np.int32]:
    """The mesh's triangulation as Blender draws it, `#T by 3` vertices. Not in Edit Mode."""
    mesh.calc_loop_triangles()
    triangles = np.empty((len(mesh.loop_triangles), 3), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles.ravel())
    return triangles


def edges(faces: tuple[NDArray[np.int32], NDArray[np.int32]]) -> NDArray[np.int64]:
    """Edges of polygons (corner vertices, face sizes), each once, `#E by 2`."""
    corners, sizes = (part.astype(np.int64) for part in faces)
    following = np.arange(1, len(corners) + 1)
    ends = np.cumsum(sizes)
    following[ends - 1] = ends - sizes
    edges = np.stack([corners, corners[following]], 1)
    return np.unique(np.sort(edges, 1), axis=0)


def read_shown(skin: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Points | None:
    """The skin's own vertices where its modifiers put them, `#M by 3`, in its space. Not in Edit Mode.

    None where a modifier after ours may have put others in their place, so that they can't be told.
    """
    count, index = len(skin.data.vertices), list(skin.modifiers)
    after = index[stack.first(skin) :] if modifier.ours(skin) else index
    if any(m.show_viewport and m.type not in KEEPING and m not in modifier.ours(skin) for m in after):
        return None
    mesh = skin.evaluated_get(depsgraph).data
    if len(mesh.vertices) < count:
        return None
    points = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", points.ravel())
    return points[:count]


def is_smoothed(skin: bpy.types.Object) -> bool:
    """Whether what is seen is a finer surface than the skin's own faces."""
    return any(m.show_viewport and m.type in {"SUBSURF", "MULTIRES"} for m in skin.modifiers)


def read_edit_selection(mesh: bpy.types.Mesh) -> tuple[int, ...]:
    """Selected vertices of the edit mesh. Edit Mode only; for cages, which are small."""
    return tuple(vertex.index for vertex in bmesh.from_edit_mesh(mesh).verts if vertex.select)


def read_cage(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Points:
    """A cage's vertices as they are shown, `#C by 3`, in the object's space."""
    if obj.data.is_editmode:
        return positions.read_edit_mesh(obj.data)
    return positions.read_evaluated(obj, depsgraph)
