"""A plain coarse cage around any skin, for rigs that come without one: closed, manifold, outward, enclosing.

The skin is thickened on a grid, its surface taken and simplified by Blender's Decimate modifier, and pushed out until
every skin vertex is inside. If no grid gives a sound cage, the convex hull does. A stand-in that knows no joints.
"""

from __future__ import annotations

from collections.abc import Iterator

import bmesh
import bpy
import numpy as np

from blend_fixtures.enclosure import check_cage, nearest_on_surface, triangulate, winding_numbers
from blend_fixtures.parts import Array, Cage
from blend_fixtures.surface_nets import mesh_field

MOST_VERTICES = 150  # about what an artist would still edit by hand
_PUSH_ROUNDS = 40


def coarse_hull(points: Array, faces: Array | None = None, *, most: int = MOST_VERTICES) -> Cage:
    """A cage of at most about `most` vertices around `points` (#P by 3); `faces` (#F by 3) fills gaps between them."""
    cloud = points if faces is None else np.concatenate([points, _samples(points, faces)])
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    most = min(most, max(40, len(points) // 6))  # more cage vertices than the skin can tell apart would be loose
    for cage in _candidates(cloud, size, most):
        pushed = _push_out(cage, points, clearance=2e-3 * size)
        if pushed is not None and check_cage(pushed, points).good:
            return pushed
    raise ValueError("no coarse cage could be made around this skin; give one with CAGE=")


def _candidates(cloud: Array, size: float, most: int) -> Iterator[Cage]:
    for share in (0.030, 0.042, 0.060, 0.085):
        yield _simplified(*_thickened(cloud, cell=share * size, radius=0.75 * share * size), most=int(0.97 * most))
    yield _simplified(*_convex(cloud, offset=0.03 * size), most=min(most, 60))


def _samples(points: Array, faces: Array) -> Array:
    """Middles of the faces and of their edges, so that large faces leave no holes."""
    corners = points[faces]
    return np.concatenate([corners.mean(axis=1), (0.5 * (corners + np.roll(corners, -1, axis=1))).reshape(-1, 3)])


def _thickened(cloud: Array, *, cell: float, radius: float) -> tuple[Array, Array]:
    """The largest piece of the surface of all balls of `radius` around `cloud` → vertices, quads."""
    thin = np.unique(np.round(cloud / (0.35 * cell)).astype(int), axis=0) * (0.35 * cell)
    margin = radius + 2.0 * cell

    def distance(p: Array) -> Array:
        return _cloud_distance(p, thin, reach=radius + 2.0 * cell) - radius - 0.25 * cell

    vertices, quads = mesh_field(distance, thin.min(axis=0) - margin, thin.max(axis=0) + margin, cell=cell, rounds=0)
    return vertices, _largest_piece(vertices, quads)


def _cloud_distance(points: Array, cloud: Array, *, reach: float) -> Array:
    """Distance to the nearest point of `cloud`, at most `reach` (#P), by way of a grid of cells of that size."""
    low = np.minimum(points.min(axis=0), cloud.min(axis=0)) - reach
    shape = np.ceil((np.maximum(points.max(axis=0), cloud.max(axis=0)) - low) / reach).astype(int) + 3
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    code = np.floor((cloud - low) / reach).astype(int) @ strides
    order = np.argsort(code, kind="stable")
    code, sorted_cloud = code[order], cloud[order]
    home = np.floor((points - low) / reach).astype(int)
    best = np.full(len(points), reach)
    for step in np.array(np.meshgrid([-1, 0, 1], [-1, 0, 1], [-1, 0, 1])).reshape(3, -1).T:
        key = (home + step) @ strides
        first, last = np.searchsorted(code, key), np.searchsorted(code, key, side="right")
        for k in range(int((last - first).max(initial=0))):
            active = np.flatnonzero(first + k < last)
            gap = np.linalg.norm(points[active] - sorted_cloud[first[active] + k], axis=1)
            best[active] = np.minimum(best[active], gap)
    return best


def _largest_piece(vertices: Array, quads: Array) -> Array:
    """The faces of the connected piece that reaches farthest; what it leaves outside is found by the final check."""
    label = np.arange(len(vertices))
    while True:
        low = label[quads].min(axis=1)
        new = label.copy()
        np.minimum.at(new, quads, low[:, None])
        new = new[new]
        if np.array_equal(new, label):
            break
        label = new
    pieces = np.unique(label[quads[:, 0]])
    extents = [np.linalg.norm(np.ptp(vertices[label == piece], axis=0)) for piece in pieces]
    return quads[label[quads[:, 0]] == pieces[int(np.argmax(extents))]]


def _simplified(vertices: Array, faces: Array, *, most: int) -> Cage:
    """Blender's Decimate modifier down to about `most` vertices, as triangles."""
    mesh = bpy.data.meshes.new("Coarse Hull")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    _keep_used(mesh)
    holder = bpy.data.objects.new("Coarse Hull", mesh)
    bpy.context.scene.collection.objects.link(holder)
    holder.modifiers.new("Triangulate", "TRIANGULATE")
    decimate = holder.modifiers.new("Decimate", "DECIMATE")
    decimate.ratio = min(1.0, most / max(len(mesh.vertices), 1))
    decimate.use_collapse_triangulate = True
    bpy.context.view_layer.update()
    evaluated = holder.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    points = np.array([vertex.co for vertex in evaluated.vertices]).reshape(-1, 3)
    triangles = [list(face.vertices) for face in evaluated.polygons]
    bpy.data.objects.remove(holder)
    bpy.data.meshes.remove(mesh)
    return Cage(points, triangles)


def _keep_used(mesh: bpy.types.Mesh) -> None:
    """Remove vertices without faces."""
    used = np.zeros(len(mesh.vertices), dtype=bool)
    corners = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    used[corners] = True
    if used.all():
        return
    points = np.array([vertex.co for vertex in mesh.vertices])
    number = np.cumsum(used) - 1
    faces = [[int(number[v]) for v in face.vertices] for face in mesh.polygons]
    mesh.clear_geometry()
    mesh.from_pydata(points[used].tolist(), [], faces)


def _convex(cloud: Array, *, offset: float) -> tuple[Array, Array]:
    """The convex hull of `cloud` grown by `offset` to every side."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * offset
    extreme = cloud[np.unique(np.concatenate([(cloud @ d).argsort()[-1:] for d in _directions(300)]))]
    build = bmesh.new()
    for point in (extreme[:, None] + corners[None]).reshape(-1, 3):
        build.verts.new(point)
    bmesh.ops.convex_hull(build, input=build.verts)
    bmesh.ops.delete(build, geom=[v for v in build.verts if not v.link_faces], context="VERTS")
    build.verts.index_update()
    vertices = np.array([vertex.co for vertex in build.verts])
    faces = np.array([[vertex.index for vertex in face.verts] for face in build.faces])
    build.free()
    return vertices, faces


def _directions(count: int) -> Array:
    """Evenly spread unit vectors (`count` by 3)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (1.0 + 5.0**0.5) * np.arange(count)
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def _push_out(cage: Cage, points: Array, *, clearance: float) -> Cage | None:
    """Move cage vertices outward until every point is inside by `clearance`; None if that does not come to an end."""
    triangles = triangulate(cage.faces)
    vertices = cage.vertices.copy()
    for _ in range(_PUSH_ROUNDS):
        winding = winding_numbers(points, vertices, triangles)
        distance, face, weights = nearest_on_surface(points, vertices, triangles)
        depth = np.where(winding > 0.5, distance, -distance)
        low = depth < clearance
        if not low.any():
            return Cage(vertices, cage.faces)
        normals = _vertex_normals(vertices, triangles)
        need = np.zeros(len(vertices))
        lack = (1.3 * clearance - depth[low])[:, None] * np.sqrt(weights[low])
        np.maximum.at(need, triangles[face[low]], lack)
        vertices = vertices + need[:, None] * normals
    return None


def _vertex_normals(vertices: Array, triangles: Array) -> Array:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], np.cross(b - a, c - a))
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
