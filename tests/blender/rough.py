"""Rough cages, as somebody makes them before Fit Cage."""

from __future__ import annotations

import bmesh
import bpy
import numpy as np
from scene import select


def box(low: tuple[float, ...], high: tuple[float, ...], cuts: int = 2) -> bpy.types.Object:
    """A box of quads, as somebody makes it by hand."""
    work = bmesh.new()
    bmesh.ops.create_cube(work, size=1.0)
    bmesh.ops.subdivide_edges(work, edges=work.edges, cuts=cuts, use_grid_fill=True)
    low, high = np.array(low), np.array(high)
    for vertex in work.verts:
        vertex.co = (np.array(vertex.co) + 0.5) * (high - low) + low
    mesh = bpy.data.meshes.new("Rough")
    work.to_mesh(mesh)
    work.free()
    made = bpy.data.objects.new("Rough", mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def decimated(skin: bpy.types.Object, triangles: int) -> bpy.types.Object:
    """A copy of the skin with weights and modifiers and all, decimated."""
    select([skin], skin)
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    copy.name = "Rough"
    modifier = copy.modifiers.new("Decimate", "DECIMATE")
    modifier.use_collapse_triangulate = True
    modifier.ratio = triangles / sum(len(face.vertices) - 2 for face in skin.data.polygons)
    bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=0)
    bpy.ops.object.modifier_apply(modifier=modifier.name)
    return copy
