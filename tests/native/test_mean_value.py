"""Mean value coordinates against sixty digits, near faces, edges, vertices, planes and lines."""

import cage_rig_core as core
import numpy as np
import pytest

mp = pytest.importorskip("mpmath", reason="mpmath is not installed").mp

PLACES = {  # barycentric steps along two sides of a triangle
    "face": (0.3, 0.3),
    "edge": (0.3, 0.0),
    "vertex": (0.0, 0.0),
    "in the plane outside": (1.3, 1.1),
    "on the line of an edge": (1.7, 0.0),
}


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def exact_row(point, vertices, triangles):
    """Each face's mean vector taken apart along the directions to its corners."""
    toward = [[mp.mpf(float(c)) - mp.mpf(float(p)) for c, p in zip(vertex, point, strict=False)] for vertex in vertices]
    lengths = [mp.sqrt(mp.fdot(t, t)) for t in toward]
    units = [[x / length for x in t] for t, length in zip(toward, lengths, strict=False)]
    row = [mp.mpf(0)] * len(vertices)
    for triangle in triangles:
        u = [units[i] for i in triangle]
        normals = [cross(u[(k + 1) % 3], u[(k + 2) % 3]) for k in range(3)]
        mean = [mp.mpf(0)] * 3
        for k, normal in enumerate(normals):
            sine = mp.sqrt(mp.fdot(normal, normal))
            angle = mp.atan2(sine, mp.fdot(u[(k + 1) % 3], u[(k + 2) % 3]))
            mean = [m + angle / 2 * n / sine for m, n in zip(mean, normal, strict=False)]
        determinant = mp.fdot(u[0], normals[0])
        for k, corner in enumerate(triangle):
            row[corner] += mp.fdot(mean, normals[k]) / determinant / lengths[corner]
    total = mp.fsum(row)
    return np.array([float(w / total) for w in row])


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("distance", [1e-3, 1e-4, 1e-6, 1e-8, 1e-10])
def test_rows_are_right_to_1e_9(square_tube, place, distance):
    vertices, faces = square_tube([(-0.5, 0.9), (3.4, 1.1), (6.8, 1.1), (10.5, 0.9)])
    triangles = core.check_cage(vertices, faces)["triangles"]
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    random = np.random.default_rng(1)
    for a, b, c in vertices[triangles[::3]]:
        normal = np.cross(b - a, c - a)
        away = normal / np.linalg.norm(normal) + random.uniform(-0.3, 0.3, 3)
        along, across = PLACES[place]
        point = a + along * (b - a) + across * (c - a) + distance * size * away
        with mp.workdps(60):
            expected = exact_row(point, vertices, triangles)
        found = core.mean_value_coordinates(point[None], vertices, faces)[0]
        assert np.abs(found - expected).max() <= 1e-9
