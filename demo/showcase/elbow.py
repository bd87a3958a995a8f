"""Measures the arm's bent elbow against the arm at rest: its volume, and how thick it is on the outer side.

Everything in the armature's space, which is the skin's too.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from blend_fixtures.arm import ELBOW, ELBOW_BLEND, limb_radius
from blend_fixtures.bar import smooth_step
from blend_fixtures.build import RigObjects
from blend_fixtures.enclosure import signed_volume

from . import acting
from .figures import Array, mesh_points

RADIUS = float(limb_radius(np.array([ELBOW]))[0])


@dataclass(frozen=True)
class Elbow:
    """A bent elbow against the arm at rest.

    `volume`: of the part where the bones blend, over that at rest. `thickness`: distance of each vertex from the
    bones over the arm's radius there (#M); `outer`: how much it is on the elbow's outer side (#M, 0 to 1);
    `thinnest`, `thickest`: of the thickness there. `joint` 3; `outline`: where the outer side would be if the arm kept
    its radius (#O by 3).
    """

    volume: float
    thickness: Array
    outer: Array
    thinnest: float
    thickest: float
    joint: Array
    outline: Array

    def facts(self) -> tuple[str, str]:
        """What was measured, in two phrases."""
        return (
            f"elbow keeps {self.volume:.0%} of its volume",
            f"outer side at {100.0 * self.thinnest:.0f}–{self.thickest:.0%} of its thickness",
        )


def measure_elbow(rig: RigObjects) -> Elbow:
    """The elbow as it is posed now, its rest cage as bound."""
    skin = rig.skins[0]
    rest, posed = mesh_points(skin.data), acting.evaluated_points(skin)
    bare = _bare_triangles(skin)
    in_elbow = np.abs(rest[:, 0] - ELBOW) < ELBOW_BLEND
    patch = bare[in_elbow[bare].any(axis=1)]
    motions = [_motion(rig, name) for name in ("upper_arm", "forearm")]
    thickness = _thickness(posed, motions)
    depth = -rest[:, 2] / RADIUS
    outer = np.where(in_elbow, smooth_step(depth - 0.35, 0.35), 0.0)
    strip = np.intersect1d(patch, np.flatnonzero(in_elbow & (depth > 0.9)))
    return Elbow(
        volume=_capped_volume(posed, patch, rest) / _capped_volume(rest, patch, rest),
        thickness=thickness,
        outer=outer,
        thinnest=float(thickness[strip].min()),
        thickest=float(thickness[strip].max()),
        joint=_moved(motions[1], np.array([[ELBOW, 0.0, 0.0]]))[0],
        outline=_outline(motions),
    )


def _bare_triangles(skin: bpy.types.Object) -> Array:
    """The triangles of the arm without its sleeve (#T by 3)."""
    skin.data.calc_loop_triangles()
    triangles = skin.data.loop_triangles
    return np.array([triangle.vertices[:] for triangle in triangles if triangle.material_index == 0])


def _capped_volume(points: Array, patch: Array, rest: Array) -> float:
    """Volume within a tube of triangles around the elbow, each of its two open ends closed by a fan."""
    directed = np.concatenate([patch[:, [0, 1]], patch[:, [1, 2]], patch[:, [2, 0]]])
    codes, twins = directed @ [len(rest), 1], directed @ [1, len(rest)]
    border = directed[~np.isin(codes, twins)]
    vertices, triangles = [*points], [patch]
    for end in (rest[border[:, 0], 0] < ELBOW, rest[border[:, 0], 0] > ELBOW):
        fan = np.full((int(end.sum()), 3), len(vertices))
        fan[:, :2] = border[end][:, ::-1]
        triangles.append(fan)
        vertices.append(points[border[end, 0]].mean(axis=0))
    return signed_volume(np.array(vertices), np.concatenate(triangles))


def _motion(rig: RigObjects, bone_name: str) -> Array:
    """How the pose moves a bone (4 by 4, rest to posed, the armature's space)."""
    bone = rig.armature.pose.bones[bone_name]
    return np.array(bone.matrix @ bone.bone.matrix_local.inverted())


def _moved(motion: Array, points: Array) -> Array:
    """`points` (#P by 3) through a 4 by 4 matrix."""
    return points @ motion[:3, :3].T + motion[:3, 3]


def _thickness(posed: Array, motions: list[Array]) -> Array:
    """Distance from the nearer of the two posed bones over the arm's radius there (#M)."""
    shares = []
    for motion, (low, high) in zip(motions, ((-1.0, ELBOW), (ELBOW, 2.0)), strict=True):
        local = _moved(np.linalg.inv(motion), posed)
        at = np.clip(local[:, 0], low, high)
        shares.append(np.hypot(np.hypot(local[:, 0] - at, local[:, 1]), local[:, 2]) / limb_radius(at))
    return np.minimum(*shares)


def _outline(motions: list[Array]) -> Array:
    """The outer side of an arm that keeps its radius: along the upper arm, around the joint, along the forearm."""
    reach = 0.8 * ELBOW_BLEND
    before, after = np.linspace(ELBOW - reach, ELBOW, 40), np.linspace(ELBOW, ELBOW + reach, 40)
    sides = [
        _moved(motion, np.column_stack([x, np.zeros_like(x), -limb_radius(x)]))
        for motion, x in zip(motions, (before, after), strict=True)
    ]
    joint = _moved(motions[1], np.array([[ELBOW, 0.0, 0.0]]))[0]
    share = np.linspace(0.0, 1.0, 24)[1:-1, None]
    arc = (1.0 - share) * (sides[0][-1] - joint) + share * (sides[1][0] - joint)
    arc *= RADIUS / np.linalg.norm(arc, axis=1, keepdims=True)
    return np.concatenate([sides[0], joint + arc, sides[1]])
