# SPDX-License-Identifier: GPL-3.0-or-later
"""The repaired hull of meshes: holes filled, everything joined and made anew on a grid, a little larger than it was."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
from numpy.typing import NDArray

from .positions import Points, new_mesh, read_base, read_faces

Faces = tuple[NDArray[np.integer], NDArray[np.integer]]
CELLS = 220.0  # of the grid along the diagonal
OUTWARD = 0.75  # cells by which the hull lies outside: remeshing cuts corners by half a cell


def repaired(context: bpy.types.Context, points: Points, faces: Faces) -> tuple[Points, Faces]:
    """Remesh a copy of (`#V by 3` points, faces) by voxels. Object Mode; what it makes in the file on its way is gone.

    Holes are closed by flat faces first. Parts that overlap become one.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    mesh = new_mesh("Hull", points, (faces[0].astype(np.int32), faces[1].astype(np.int32)))
    obj = bpy.data.objects.new(mesh.name, mesh)
    made = None
    try:
        _fill_holes(mesh)
        remesh = obj.modifiers.new("Remesh", "REMESH")
        remesh.mode, remesh.voxel_size, remesh.adaptivity = "VOXEL", size / CELLS, 0.0
        outward = obj.modifiers.new("Outward", "DISPLACE")
        outward.strength, outward.mid_level = OUTWARD * size / CELLS, 0.0
        context.scene.collection.objects.link(obj)
        depsgraph = context.evaluated_depsgraph_get()
        made = bpy.data.meshes.new_from_object(obj.evaluated_get(depsgraph), depsgraph=depsgraph)
        return _centred(read_base(made), points, 0.05 * size / CELLS), read_faces(made)
    finally:
        bpy.data.objects.remove(obj)
        for data in (mesh, made):
            if data is not None:
                bpy.data.meshes.remove(data)


def _centred(hull: Points, points: Points, reach: float) -> Points:
    """The hull with its middle in x where that of the points is, so that their mirror planes are one."""
    if not len(hull):
        return hull
    apart = 0.5 * float(points[:, 0].min() + points[:, 0].max() - hull[:, 0].min() - hull[:, 0].max())
    return hull + np.float32([apart, 0.0, 0.0]) if abs(apart) < reach else hull


def _fill_holes(mesh: bpy.types.Mesh) -> None:
    work = bmesh.new()
    work.from_mesh(mesh)
    size = max((vertex.co.length for vertex in work.verts), default=1.0)
    bmesh.ops.remove_doubles(work, verts=work.verts, dist=1e-7 * size)
    bmesh.ops.holes_fill(work, edges=[edge for edge in work.edges if edge.is_boundary], sides=0)
    bmesh.ops.triangulate(work, faces=[face for face in work.faces if len(face.verts) > 4])
    bmesh.ops.recalc_face_normals(work, faces=work.faces)
    work.to_mesh(mesh)
    work.free()
