# SPDX-License-Identifier: GPL-3.0-or-later
"""Refit joints and bones, the anchors, and how much each cage vertex moves a joint: as strokes."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...adapters import armature
from . import colours, shaders
from .kept import Kept
from .shaders import Ink, Pen, Strokes
from .subject import Chosen, Subject
from .surfaces import Surface, Surfaces

JOINT, ORIGINAL, BONE, APART = 8.0, 6.0, 2.5, 1.5  # widths in pixels
ANCHOR = 6.0
LARGEST, SMALLEST, HIDDEN = 20.0, 5.0, 0.02  # dots of joint weights; smaller shares than the last are left out
HOLD = 1.5  # lines from a joint to the vertices that move it


class Joints:
    """The refit joints and bones as the pose has them, and where the animation's own are."""

    def __init__(self, ink: Ink) -> None:
        self._strokes: Kept[Strokes] = Kept("joints")
        self._pen = Pen(ink)

    def strokes(self, subject: Subject) -> Strokes:
        """In the armature's space."""
        return self._strokes.get(subject.state, lambda: _joints(subject))

    def draw(self, subject: Subject, *, in_front: bool) -> None:
        shaders.over(in_front=in_front)
        matrix = shaders.to_screen(subject.placed(subject.cage.cage_rig.armature))
        self._pen.draw(self.strokes(subject), subject.state, matrix)


def _joints(subject: Subject) -> Strokes:
    settings, session = subject.cage.cage_rig, subject.session
    heads, tails = session.posed_bones()
    weighted = np.array([joint.weighted for joint in settings.joints], bool)
    above = _weighted_parents(session.snapshot.parents, weighted)
    shown = np.flatnonzero(weighted)
    child = shown[above[shown] >= 0]
    leaf = np.setdiff1d(shown, above[child])
    original = _animated_heads(subject)
    moved = shown[np.linalg.norm(original[shown] - heads[shown], axis=1) > 1e-4 * session.size]
    return (
        shaders.lines(original[above[child]], original[child], colours.ORIGINAL, APART)
        + shaders.dots(original[moved], colours.ORIGINAL, ORIGINAL)
        + shaders.lines(original[moved], heads[moved], colours.APART, APART)
        + shaders.lines(heads[above[child]], heads[child], colours.REFIT, BONE)
        + shaders.lines(heads[leaf], tails[leaf], colours.REFIT, BONE)
        + shaders.dots(heads[shown], colours.REFIT, JOINT)
    )


def _weighted_parents(parents: NDArray[np.int32], weighted: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The nearest bone above each one that moves skin, or -1."""
    found = parents.astype(np.int64)
    while True:
        skipped = (found >= 0) & ~weighted[found]
        if not skipped.any():
            return found
        found[skipped] = parents[found[skipped]]


def _animated_heads(subject: Subject) -> NDArray[np.float64]:
    """Where the animation has the bones' heads, `#J by 3`."""
    settings = subject.cage.cage_rig
    obj = settings.armature.evaluated_get(subject.depsgraph)
    place = {bone.name: k for k, bone in enumerate(obj.pose.bones)}
    return armature.read_pose_matrices(obj)[[place[joint.name] for joint in settings.joints], :3, 3]


class Anchors:
    """Dots on the skins at the vertices that the posed cage is fitted to."""

    def __init__(self, surfaces: Surfaces, ink: Ink) -> None:
        self._surfaces, self._ink = surfaces, ink
        self._anchors: Kept[list[NDArray[np.int64]]] = Kept("anchors")
        self._strokes: dict[int, Kept[Strokes]] = {}
        self._pens: dict[int, Pen] = {}

    def on(self, subject: Subject, space: bpy.types.SpaceView3D | None = None) -> list[tuple[Surface, Strokes]]:
        """In each skin's own space."""
        anchors = self._anchors.get(subject.session, subject.session.anchors)
        found = []
        for surface in self._surfaces.shown(subject, space):
            kept = self._strokes.setdefault(surface.index, Kept("anchor_dots"))
            found.append((surface, kept.get(surface.state, lambda at=surface: _anchors(at, anchors[at.index]))))
        return found

    def draw(self, subject: Subject, space: bpy.types.SpaceView3D) -> None:
        shaders.over(in_front=False)
        for surface, strokes in self.on(subject, space):
            pen = self._pens.setdefault(surface.index, Pen(self._ink))
            pen.draw(strokes, surface.state, shaders.to_screen(surface.to_world, 4.0 * surface.offset))


def _anchors(surface: Surface, vertices: NDArray[np.int64]) -> Strokes:
    return shaders.dots(surface.points[vertices], colours.ANCHOR, ANCHOR)


class JointWeights:
    """How much each vertex of the posed cage moves the active bone's joint: a dot on it, and a line from the joint."""

    def __init__(self, ink: Ink) -> None:
        self._weights: Kept[NDArray[np.float64]] = Kept("joint_coords")
        self._strokes: Kept[Strokes] = Kept("joint_weights")
        self._pen = Pen(ink)

    def weights(self, subject: Subject, chosen: Chosen) -> NDArray[np.float64]:
        """The joint's row of Ψ, `#C`."""
        return self._weights.get((subject.session, chosen), lambda: subject.session.joint_coords(chosen.joint))

    def strokes(self, subject: Subject, chosen: Chosen) -> Strokes:
        """In the armature's space."""
        return self._strokes.get((*subject.state, chosen), lambda: self._read(subject, chosen))

    def _read(self, subject: Subject, chosen: Chosen) -> Strokes:
        weights = self.weights(subject, chosen)
        largest = float(np.abs(weights).max())
        order = np.argsort(np.abs(weights))  # the largest on top
        order = order[np.abs(weights[order]) > HIDDEN * largest]
        share = np.sqrt(np.abs(weights[order]) / max(largest, 1e-12)).astype(np.float32)
        points = subject.session.posed_cage()[order]
        joint = np.broadcast_to(subject.session.posed_bones()[0][chosen.joint], points.shape)
        shades = colours.of_weights(weights[order], largest)
        shades[:, 3] = share
        lines = shaders.lines(joint, points, shades.copy(), HOLD)
        shades[:, 3] = 1.0
        return lines + shaders.dots(points, shades, SMALLEST + (LARGEST - SMALLEST) * share)

    def draw(self, subject: Subject, chosen: Chosen) -> None:
        shaders.over(in_front=True)
        matrix = shaders.to_screen(subject.placed(subject.cage.cage_rig.posed_cage))
        self._pen.draw(self.strokes(subject, chosen), (*subject.state, chosen), matrix)
