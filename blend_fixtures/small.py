"""Small rigs for tests: each shows one thing that the biped does not."""

from __future__ import annotations

import numpy as np

from .bar import bar, box_cage, joint_weights
from .fields import cone, ellipsoid
from .parts import Array, Bone, Cage, Character, Skin
from .surface_nets import mesh_field


def simple_bar() -> Character:
    """The bar with few vertices, for fast tests."""
    coarse = bar(segments=16, across=4)
    return Character("SimpleBar", coarse.skins, coarse.bones, coarse.cage, coarse.shape_keys)


def two_skins() -> Character:
    """One bar as two meshes, a left and a right half, under one cage: what several skins a rig must handle."""
    whole = bar(segments=24, across=6)
    skin = whole.skins[0]
    middle = skin.vertices[skin.faces].mean(axis=1)[:, 0]
    halves = [part_of(skin, "Left", middle < 0.0), part_of(skin, "Right", middle >= 0.0)]
    return Character("TwoSkins", halves, whole.bones, whole.cage)


def two_roots() -> Character:
    """A ball with two root bones, one of them far outside the cage and without weights, and a strip without weights."""
    vertices, faces = mesh_field(
        ellipsoid((0.0, 0.0, 0.0), (1.0, 0.4, 0.4)), np.full(3, -1.1), np.full(3, 1.1), cell=0.11
    )
    bones = [
        Bone("floor", (0.0, 0.0, -2.0), (0.0, 0.5, -2.0), deform=False),
        Bone("left", (-0.5, 0.0, 0.0), (0.0, 0.0, 0.0)),
        Bone("right", (0.5, 0.0, 0.0), (1.0, 0.0, 0.0), "floor"),
    ]
    weights = np.column_stack([np.zeros(len(vertices)), joint_weights(vertices[:, 0])])
    weights[vertices[:, 0] < -0.9] = 0.0
    skin = Skin("Ball", vertices, faces, weights)
    return Character("TwoRoots", [skin], bones, box_cage((-1.2, -0.4, 0.4, 1.2), half=0.55))


def capsule() -> Character:
    """A round bar with two bones in it, and a box as its cage: the simplest limb."""
    skin, faces = mesh_field(
        cone((-0.75, 0.0, 0.0), (0.75, 0.0, 0.0), 0.25),
        np.array([-1.1, -0.4, -0.4]),
        np.array([1.1, 0.4, 0.4]),
        cell=0.05,
    )
    bones = [
        Bone("lower", (-0.8, 0.0, 0.0), (0.0, 0.0, 0.0)),
        Bone("upper", (0.0, 0.0, 0.0), (0.8, 0.0, 0.0), "lower", connected=True),
    ]
    cage = box_cage((-1.15, -0.4, 0.4, 1.15), half=0.35)
    return Character("Capsule", [Skin("Capsule", skin, faces, joint_weights(skin[:, 0]))], bones, cage)


def octahedron_cage(center: Array, radius: float) -> Cage:
    """The smallest cage that tests use: six vertices, eight triangles, outward."""
    offsets = np.concatenate([np.eye(3), -np.eye(3)]) * radius
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    return Cage(np.asarray(center, float) + offsets, faces)


def part_of(skin: Skin, name: str, keep: Array) -> Skin:
    """The faces `keep` (#F booleans) of `skin` as a skin of their own."""
    used, inverse = np.unique(skin.faces[keep], return_inverse=True)
    return Skin(name, skin.vertices[used], inverse.reshape(-1, 4), skin.weights[used], skin.materials)
