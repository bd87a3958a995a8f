"""Clean quad meshes from distance fields: naive surface nets, then relaxation along the surface.

One vertex a grid cell that the surface crosses, one quad a grid edge that it crosses. After the nets, vertices slide
toward their neighbours' mean and return to the surface along the field's gradient, which evens out the quads.
Deterministic, numpy only.
"""

from __future__ import annotations

import numpy as np

from .fields import Array, Field

_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]


def mesh_field(field: Field, low: Array, high: Array, *, cell: float, rounds: int = 6) -> tuple[Array, Array]:
    """The surface of `field` in the box `low`…`high` (3 each) → vertices (#V by 3) and quads (#F by 4), outward.

    `cell`: grid spacing, in the field's unit. The grid is symmetric about x = 0 when the box is.
    """
    axes = [_axis(lo, hi, cell) for lo, hi in zip(low, high, strict=True)]
    shape = tuple(len(axis) for axis in axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = field(points).reshape(shape)
    values = _fill_checkerboards(values, depth=1e-3 * cell)
    vertices, cell_ids = _cell_vertices(values, axes, cell)
    quads = _edge_quads(values, cell_ids)
    return _relax(field, vertices, quads, rounds=rounds, step=0.3 * cell), quads


def symmetrise(vertices: Array) -> Array:
    """Make `vertices` (#V by 3) exactly mirror-symmetric in x, given that they nearly are."""
    partner = mirror_partners(vertices)
    reflected = vertices[partner] * [-1.0, 1.0, 1.0]
    return 0.5 * (vertices + reflected)


def mirror_partners(vertices: Array) -> Array:
    """For each vertex the index of its mirror image in x (#V); raises ValueError if there is no one-to-one match."""
    partner = np.empty(len(vertices), dtype=int)
    decimals = 5
    key = np.round(vertices, decimals) + 0.0
    order = np.lexsort(key.T[::-1])
    mirror = np.round(vertices * [-1.0, 1.0, 1.0], decimals) + 0.0
    partner[np.lexsort(mirror.T[::-1])] = order
    gap = np.abs(vertices[partner] * [-1.0, 1.0, 1.0] - vertices).max()
    if gap > 10.0 ** (1 - decimals) or not np.array_equal(partner[partner], np.arange(len(vertices))):
        raise ValueError(f"the mesh is not mirror-symmetric in x (largest gap {gap:.2g})")
    return partner


def neighbour_table(faces: Array, count: int) -> Array:
    """The neighbours of each vertex, padded with the vertex itself (`count` by the largest valence)."""
    edges = np.concatenate([faces, np.roll(faces, -1, axis=1)]).reshape(2, -1).T
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    starts = np.searchsorted(edges[:, 0], np.arange(count + 1))
    valence = np.diff(starts)
    table = np.repeat(np.arange(count)[:, None], int(valence.max()), axis=1)
    table[edges[:, 0], np.arange(len(edges)) - starts[edges[:, 0]]] = edges[:, 1]
    return table


def neighbour_mean(values: Array, table: Array) -> Array:
    """The mean of `values` (#V by k) over each vertex's neighbours."""
    own = np.arange(len(values))
    padding = (table == own[:, None]).sum(axis=1)[:, None]
    return (values[table].sum(axis=1) - padding * values) / (table.shape[1] - padding)


def _axis(low: float, high: float, cell: float) -> Array:
    count = int(np.ceil((high - low) / cell)) + 3
    return 0.5 * (low + high) + (np.arange(count) - 0.5 * (count - 1)) * cell


def _fill_checkerboards(values: Array, *, depth: float) -> Array:
    """Fill grid faces whose corners alternate in sign: there two sheets would share an edge, and the mesh would
    not be manifold.
    """
    while True:
        inside, fill = values < 0.0, np.zeros(values.shape, dtype=bool)
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = [_shifted(inside, u, v, du, dv) for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1))]
            checker = (corners[0] == corners[2]) & (corners[1] == corners[3]) & (corners[0] != corners[1])
            for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                _shifted(fill, u, v, du, dv)[checker] = True
        if not (fill & ~inside).any():
            return values
        values = np.where(fill & ~inside, -depth, values)


def _shifted(grid: Array, u: int, v: int, du: int, dv: int) -> Array:
    """The view of `grid` from (du, dv) on along the axes u and v, one shorter along both."""
    window = [slice(None)] * 3
    window[u], window[v] = slice(du, grid.shape[u] - 1 + du), slice(dv, grid.shape[v] - 1 + dv)
    return grid[tuple(window)]


def _corner_views(values: Array) -> list[Array]:
    nx, ny, nz = (n - 1 for n in values.shape)
    return [values[x : x + nx, y : y + ny, z : z + nz] for x, y, z in _CORNERS]


def _cell_vertices(values: Array, axes: list[Array], cell: float) -> tuple[Array, Array]:
    """The mean of the crossings on each crossed cell's edges (#V by 3), and the vertex of each cell (-1: none)."""
    inside = np.stack([view < 0.0 for view in _corner_views(values)])
    crossed = inside.any(axis=0) & ~inside.all(axis=0)
    where = np.argwhere(crossed)
    corner = np.stack([view[crossed] for view in _corner_views(values)])
    total, count = np.zeros((len(where), 3)), np.zeros(len(where))
    for a, b in _EDGES:
        cuts = (corner[a] < 0.0) != (corner[b] < 0.0)
        t = np.where(cuts, corner[a] / np.where(cuts, corner[a] - corner[b], 1.0), 0.0)
        total += np.where(cuts[:, None], _CORNERS[a] + t[:, None] * (_CORNERS[b] - _CORNERS[a]), 0.0)
        count += cuts
    ids = np.full(crossed.shape, -1)
    ids[crossed] = np.arange(len(where))
    base = np.column_stack([axes[k][where[:, k]] for k in range(3)])
    return base + cell * total / count[:, None], ids


def _edge_quads(values: Array, ids: Array) -> Array:
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        ends = [np.take(values, range(s, values.shape[axis] - 1 + s), axis=axis) < 0.0 for s in (0, 1)]
        inner = [slice(None)] * 3
        inner[u], inner[v] = slice(1, -1), slice(1, -1)
        start, stop = ends[0][tuple(inner)], ends[1][tuple(inner)]
        where = np.argwhere(start != stop)
        outgoing = start[start != stop]
        where[:, u] += 1
        where[:, v] += 1
        ring = []
        for du, dv in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            at = where.copy()
            at[:, u] += du
            at[:, v] += dv
            ring.append(ids[at[:, 0], at[:, 1], at[:, 2]])
        quad = np.stack(ring, axis=1)
        quads.append(np.where(outgoing[:, None], quad, quad[:, ::-1]))
    return np.concatenate(quads)


def _relax(field: Field, vertices: Array, quads: Array, *, rounds: int, step: float) -> Array:
    table = neighbour_table(quads, len(vertices))
    for _ in range(rounds):
        vertices = 0.5 * (vertices + neighbour_mean(vertices, table))
        vertices = _project(field, vertices, step)
    return vertices


def _project(field: Field, points: Array, step: float) -> Array:
    """One damped Newton step onto the surface, by central differences of the length `step`."""
    offsets = np.concatenate([np.eye(3), -np.eye(3)]) * step
    samples = field((points[None] + offsets[:, None]).reshape(-1, 3)).reshape(6, -1)
    gradient = ((samples[:3] - samples[3:]) / (2.0 * step)).T
    scale = field(points) / np.maximum((gradient**2).sum(axis=1), 0.25)
    return points - np.clip(scale[:, None] * gradient, -2.0 * step, 2.0 * step)
