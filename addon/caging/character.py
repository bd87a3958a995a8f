# SPDX-License-Identifier: GPL-3.0-or-later
"""The character that is caged: its skins as one closed mesh, and the bones that move them, in rig space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import reading
from ..adapters import hull
from ..generator import Faces, Generator, Input, Points, Refusal, extract_skeleton
from . import alike, refusals
from .bones import BoneGraph, bone_graph, curve_graph
from .course import Course
from .options import Options


class _Kept:
    """What was used last: opened again, the same character costs nothing. May be forgotten at any moment."""

    def __init__(self) -> None:
        self._generator: Generator | None = None
        self._hull: tuple[object, tuple[Points, Faces]] | None = None
        self._skeleton: tuple[object, tuple[Points, NDArray[np.int64]]] | None = None

    def generator(self, given: Input) -> Generator:
        """With the sections that it knows."""
        if self._generator is None or self._generator.given.key != given.key:
            self._generator = Generator(given)
        return self._generator

    def hull(self, context: bpy.types.Context, points: Points, faces: Faces) -> tuple[Points, Faces]:
        """The repaired hull of a mesh."""
        key = tuple(array.tobytes() for array in (points, *faces))
        if self._hull is None or self._hull[0] != key:
            self._hull = (key, hull.repaired(context, points, faces))
        return self._hull[1]

    def skeleton(self, points: Points, faces: Faces) -> tuple[Points, NDArray[np.int64]]:
        """The skeleton of a mesh that has no bones."""
        key = tuple(array.tobytes() for array in (points, *faces))
        if self._skeleton is None or self._skeleton[0] != key:
            self._skeleton = (key, extract_skeleton(points, faces))
        return self._skeleton[1]


_kept = _Kept()


@dataclass(frozen=True)
class Character:
    """What was read, and what the core made of it."""

    scene: refusals.Scene
    generator: Generator
    course: Course
    notes: list[str]  # what was done to the skins, in sentences
    model: alike.Model | None = None  # a cage to be like

    @property
    def armature(self) -> bpy.types.Object | None:
        """Whose bones the cage follows."""
        return self.scene.armature

    @property
    def space(self) -> bpy.types.Object:
        """Whose space is rig space."""
        return self.scene.armature or self.scene.skins[0]

    @property
    def skins(self) -> list[bpy.types.Object]:
        """The skins that are caged."""
        return self.scene.skins


def read(
    context: bpy.types.Context,
    armature: bpy.types.Object | None,
    skins: list[bpy.types.Object],
    options: Options,
    like: bpy.types.Object | None = None,
) -> Character:
    """Read them as Bind does and let the core look at them. Object Mode. Raises `GenerateError`.

    Without an armature the skeleton is the core's own, and rig space the space of the first skin.
    """
    try:
        parts, graph = _with_bones(context, armature, skins) if armature else (reading.read_meshes(skins), None)
    except reading.BindError as error:
        raise refusals.GenerateError(str(error)) from error
    starts = np.concatenate([[0], np.cumsum([len(points) for points, _ in parts])])
    points = np.concatenate([points for points, _ in parts]).astype(float)
    corners = np.concatenate([faces[0] + start for (_, faces), start in zip(parts, starts, strict=False)])
    faces = (corners, np.concatenate([faces[1] for _, faces in parts]))
    scene = refusals.Scene(armature, skins, points, starts, faces, graph)
    notes: list[str] = []
    try:
        generator = None if options.hull else _look(points, faces, graph, options)
        if generator is None or generator.repairs["parts"] > 1:
            if generator is not None:
                found = generator.repairs["parts"]
                notes.append(f"The skins are {found} closed parts; their common hull was caged")
            generator = _look(*_kept.hull(context, points, faces), graph, options)
    except Refusal as refusal:
        raise refusals.explained(refusal, scene) from refusal
    notes += _repairs(generator.repairs, scene)
    graph = graph or curve_graph(generator.given.nodes, generator.given.edges)
    course = Course(generator.arcs, graph)
    model = None if like is None else alike.read(like, armature or skins[0], generator.given.points)
    if model is not None:
        alike.refuse_options(model, options.corners)
    return Character(replace(scene, graph=graph), generator, course, notes, model)


def _with_bones(
    context: bpy.types.Context, armature: bpy.types.Object, skins: list[bpy.types.Object]
) -> tuple[list[tuple[Points, Faces]], BoneGraph]:
    """The skins, and the graph of the bones that have weights on them."""
    found = reading.read(context, armature, skins)
    rest = found.rest
    used = sorted(set(np.concatenate([skin.weights[1] for skin in found.skins]).tolist()))
    graph = bone_graph(rest.names, rest.parents, rest.heads, rest.tails, used)
    return [(skin.points, skin.faces) for skin in found.skins], graph


def _look(points: Points, faces: Faces, graph: BoneGraph | None, options: Options) -> Generator:
    points = np.asarray(points, float)
    nodes, edges = _kept.skeleton(points, faces) if graph is None else (graph.nodes, graph.edges)
    return _kept.generator(Input(points, faces, nodes, edges, options.core()))


def _repairs(repairs: dict[str, object], scene: refusals.Scene) -> list[str]:
    notes, names = [], scene.names
    if repairs["inside_out"]:
        notes.append(f"{names} is inside out and was taken the other way round; flip its normals (Mesh, Normals)")
    elif repairs["turned"]:
        notes.append(f"{repairs['turned']} flipped faces of {names} were turned; recalculate its normals")
    if repairs["left_out"]:
        notes.append(f"{repairs['left_out']} duplicate or empty faces of {names} were left out")
    return notes


def left_out(character: Character, dropped: list[int]) -> list[str]:
    """A sentence on bones that the cage does not follow, or none; `dropped`: nodes that it left out."""
    bones = character.course.left_out(dropped)
    if not bones or character.armature is None:
        return []
    return [f"Without a branch of the cage, as they don't stick out of the skin: {listed(bones)}"]


def listed(names: list[str]) -> str:
    """The first of them, and how many more there are."""
    return ", ".join(f"'{name}'" for name in names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
