"""Whether triangles meet, decided exactly: signs of determinants are certain, by fractions where floats can't tell.

Independent of the core. Closed surfaces that meet nowhere are one inside the other or apart, so that with one vertex
of each part of the skin inside, all of it is.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

# Of the float determinant, relative to the same sum without signs: (7 + 56 e) e with e = 2^-53 [Shewchuk 1997].
UNSURE = 8e-16
CHUNK = 200_000


def meeting(points, faces, others, other_faces):
    """Pairs (#P by 2) of a triangle of one mesh and one of another that share a point."""
    pairs = _near(points[faces], others[other_faces], 0.0)
    return pairs[_meet(points[faces[pairs[:, 0]]], others[other_faces[pairs[:, 1]]])]


def self_meeting(points, faces):
    """Pairs of triangles of one mesh that share more than their common vertices or edge."""
    corners = points[faces]
    pairs = _near(corners, corners, 0.0)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    shared = (faces[pairs[:, 0]][:, :, None] == faces[pairs[:, 1]][:, None, :]).sum((1, 2))
    apart = pairs[shared == 0]
    found = [apart[_meet(corners[apart[:, 0]], corners[apart[:, 1]])]]
    rest = [
        pair
        for pair, count in zip(pairs.tolist(), shared.tolist(), strict=True)
        if count and _overlap(points, faces, pair, count)
    ]
    return np.concatenate([found[0], np.array(rest, int).reshape(-1, 2)])


def nearer(points, faces, others, other_faces, distance):
    """The least distance of two meshes that don't meet, where it is below `distance`; else that."""
    a, b = points[faces], others[other_faces]
    pairs, least = _near(a, b, distance), distance
    for part in np.array_split(pairs, len(pairs) // CHUNK + 1):
        if len(part):
            least = min(least, float(_apart(a[part[:, 0]], b[part[:, 1]]).min()))
    return least


def winding(places, points, faces):
    """How often a closed mesh winds around each place, by solid angles (Van Oosterom, Strackee 1983)."""
    found = []
    for part in np.array_split(places, len(places) * len(faces) // 2_000_000 + 1):
        a, b, c = (points[faces[:, k]][None] - part[:, None] for k in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
        volume = np.einsum("pti,pti->pt", a, np.cross(b, c))
        dots = [np.einsum("pti,pti->pt", x, y) * z for x, y, z in ((a, b, lc), (b, c, la), (c, a, lb))]
        found.append(np.arctan2(volume, la * lb * lc + sum(dots)).sum(axis=1) / (2 * np.pi))
    return np.concatenate(found)


def _near(a, b, distance):
    """Pairs whose boxes are not farther apart than that."""
    low, high = b.min(1) - distance, b.max(1) + distance
    found = []
    for k, (under, over) in enumerate(zip(a.min(1), a.max(1), strict=True)):
        other = np.flatnonzero(((low <= over) & (high >= under)).all(1))
        found.append(np.column_stack([np.full(len(other), k), other]))
    return np.concatenate(found)


def _signs(a, b, c, d):
    """On which side of d's plane of a, b and c: 1, -1, or 0 where floats can't tell."""
    u, v, w = a - d, b - d, c - d
    p, q = v[:, [1, 2, 0]] * w[:, [2, 0, 1]], v[:, [2, 0, 1]] * w[:, [1, 2, 0]]
    value = (u * (p - q)).sum(1)
    size = (np.abs(u) * (np.abs(p) + np.abs(q))).sum(1)
    return np.where(np.abs(value) > UNSURE * size, np.sign(value), 0).astype(int)


def _meet(a, b):
    """Whether triangles (#P by 3 by 3) meet, pair by pair."""
    found = np.zeros(len(a), bool)
    for part in np.array_split(np.arange(len(a)), len(a) // CHUNK + 1):
        if len(part):
            found[part] = _meet_part(a[part], b[part])
    return found


def _meet_part(a, b):
    sides = [
        np.column_stack([_signs(*(x[:, k] for k in range(3)), y[:, k]) for k in range(3)]) for x, y in ((b, a), (a, b))
    ]
    beside = [(np.abs(side.sum(1)) == 3) for side in sides]
    left = np.flatnonzero(~(beside[0] | beside[1]))
    found, unsure = np.zeros(len(a), bool), np.zeros(len(a), bool)
    for x, y, side in ((a, b, sides[0]), (b, a, sides[1])):
        for k in range(3):
            at = left[~found[left]]
            start, end = x[at, k], x[at, (k + 1) % 3]
            one, other = side[at, k], side[at, (k + 1) % 3]
            turns = np.column_stack([_signs(start, end, y[at, j], y[at, (j + 1) % 3]) for j in range(3)])
            through = np.abs(turns.sum(1)) == 3
            past = (turns.max(1) > 0) & (turns.min(1) < 0)
            crossing = (one * other < 0) & through
            certain = (one * other > 0) | past | crossing
            found[at[crossing]] = True
            unsure[at[~certain]] = True
    for k in np.flatnonzero(unsure & ~found):
        found[k] = _exactly(_fractions(a[k]), _fractions(b[k]))
    return found


def _fractions(corners):
    return [tuple(Fraction(float(x)) for x in corner) for corner in corners]


def _exactly(a, b):
    return any(_segment(x[k], x[(k + 1) % 3], y) for x, y in ((a, b), (b, a)) for k in range(3))


def _sign(value):
    return (value > 0) - (value < 0)


def _side(a, b, c, d):
    u, v, w = ([x - y for x, y in zip(p, d, strict=True)] for p in (a, b, c))
    cross = (v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0])
    return _sign(sum(x * y for x, y in zip(u, cross, strict=True)))


def _segment(p, q, triangle):
    """Whether a segment and a triangle share a point."""
    one, other = _side(*triangle, p), _side(*triangle, q)
    if one * other > 0:
        return False
    if one == other == 0:
        return _flat(p, q, triangle)
    turns = [_side(p, q, triangle[k], triangle[(k + 1) % 3]) for k in range(3)]
    return min(turns) >= 0 or max(turns) <= 0


def _flat(p, q, triangle):
    """The same in one plane."""
    u, v = ([x - y for x, y in zip(triangle[k], triangle[0], strict=True)] for k in (1, 2))
    normal = [abs(u[1] * v[2] - u[2] * v[1]), abs(u[2] * v[0] - u[0] * v[2]), abs(u[0] * v[1] - u[1] * v[0])]
    keep = [k for k in range(3) if k != normal.index(max(normal))]
    p, q, *corners = ([point[k] for k in keep] for point in (p, q, *triangle))

    def turn(a, b, c):
        return _sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    def within(a, b, c):
        return all(min(a[k], b[k]) <= c[k] <= max(a[k], b[k]) for k in range(2))

    def cross(a, b, c, d):
        one, other, third, fourth = turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)
        touch = (one == 0 and within(a, b, c)) or (other == 0 and within(a, b, d))
        touch = touch or (third == 0 and within(c, d, a)) or (fourth == 0 and within(c, d, b))
        return touch or (one * other < 0 and third * fourth < 0)

    turns = [turn(corners[k], corners[(k + 1) % 3], p) for k in range(3)]
    if min(turns) >= 0 or max(turns) <= 0:
        return True
    return any(cross(p, q, corners[k], corners[(k + 1) % 3]) for k in range(3))


def _overlap(points, faces, pair, count):
    """Whether two triangles with common vertices share more than these."""
    one, other = (faces[k].tolist() for k in pair)
    if count > 2:
        return True
    common = [v for v in one if v in other]
    if count == 2:
        first, second = (next(v for v in face if v not in common) for face in (one, other))
        return _folded(points, common, first, second)
    corners = [_fractions(points[face]) for face in (one, other)]
    free = [
        [corner for v, corner in zip(face, found, strict=True) if v not in common]
        for face, found in zip((one, other), corners, strict=True)
    ]
    return _segment(*free[0], corners[1]) or _segment(*free[1], corners[0])


def _folded(points, edge, first, second):
    """Whether two triangles at an edge lie in one plane on the same side of it."""
    a, b, c, d = _fractions(points[[*edge, first, second]])
    if _side(a, b, c, d):
        return False
    u, v, w = ([x - y for x, y in zip(p, a, strict=True)] for p in (b, c, d))

    def cross(x, y):
        return (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])

    return sum(x * y for x, y in zip(cross(u, v), cross(u, w), strict=True)) > 0


def _apart(a, b):
    """Distances of triangles that don't meet: corner to face or edge to edge."""
    found = [_to_face(x[:, k], y) for x, y in ((a, b), (b, a)) for k in range(3)]
    found += [_edges(a[:, k], a[:, (k + 1) % 3], b[:, j], b[:, (j + 1) % 3]) for k in range(3) for j in range(3)]
    return np.min(found, axis=0)


def _to_face(p, triangle):
    """From points to triangles where these are straight above; else infinite, as some edge is nearer."""
    a, b, c = (triangle[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = (normal * normal).sum(1)
    inside = area > 1e-20 * ((b - a) ** 2).sum(1) ** 2
    for x, y in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(y - x, p - x) * normal).sum(1) >= 0
    return np.where(inside, np.abs(((p - a) * normal).sum(1)) / np.sqrt(np.where(inside, area, 1.0)), np.inf)


def _edges(p, q, r, s):
    """From segments to segments."""
    u, v, w = q - p, s - r, p - r
    a, b, c, d, e = ((x * y).sum(1) for x, y in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    a, c = np.maximum(a, 1e-300), np.maximum(c, 1e-300)
    spread = a * c - b * b
    one = np.clip(np.where(spread > 1e-14 * a * c, (b * e - c * d) / np.maximum(spread, 1e-300), 0), 0, 1)
    other = np.clip((b * one + e) / c, 0, 1)
    one = np.clip((b * other - d) / a, 0, 1)
    return np.linalg.norm(w + one[:, None] * u - other[:, None] * v, axis=1)
