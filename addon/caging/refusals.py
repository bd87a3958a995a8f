# SPDX-License-Identifier: GPL-3.0-or-later
"""Why no cage is generated: in a sentence that names object and bone, and selected so that the view can show it."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import compat
from ..adapters import picks
from ..generator import Faces, Points, Refusal
from .bones import BoneGraph


class GenerateError(Exception):
    """No cage can be generated; the message is a sentence for the artist. No object, mesh or bone was changed.

    `repairable`: the repaired hull of the skins can be caged instead. `place`: where it is, in rig space. `show`
    selects what is meant.
    """

    def __init__(self, message: str, *, repairable: bool = False, place: Points | None = None) -> None:
        super().__init__(message)
        self.repairable, self.place = repairable, place
        self.vertices: dict[bpy.types.Object, NDArray[np.bool_]] = {}
        self.bone: tuple[bpy.types.Object, str] | None = None

    def show(self) -> None:
        """Select the vertices, which Edit Mode shows, or the bone, which Pose Mode shows. Object Mode."""
        for obj, chosen in self.vertices.items():
            picks.select_vertices(obj.data, chosen)
        if self.bone is not None:
            compat.select_only_bone(*self.bone)


@dataclass(frozen=True)
class Scene:
    """What a refusal can be about."""

    armature: bpy.types.Object | None
    skins: list[bpy.types.Object]
    points: Points  # of all skins
    starts: NDArray[np.int64]
    faces: Faces
    graph: BoneGraph | None  # None before one was extracted
    names: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", " and ".join(f"'{skin.name}'" for skin in self.skins))

    def nearest_skin(self, place: Points) -> bpy.types.Object:
        """The skin with the vertex nearest to a place."""
        vertex = int(np.linalg.norm(self.points - place, axis=1).argmin())
        return self.skins[int(np.searchsorted(self.starts, vertex, side="right")) - 1]


def explained(refusal: Refusal, scene: Scene) -> GenerateError:
    """The refusal in the artist's terms."""
    if refusal.is_of_skin:
        return _of_skin(refusal, scene)
    if refusal.node is not None:
        return _of_bone(refusal, scene)
    if "skeleton" in str(refusal) and scene.armature is not None and scene.graph is not None:
        error = GenerateError(f"The bones of '{scene.armature.name}' and {scene.names} don't fit: {refusal}")
        error.bone = (scene.armature, next(iter(scene.graph.ends)))
        return error
    return GenerateError(f"{scene.names} can't be caged: {refusal}")


def _of_skin(refusal: Refusal, scene: Scene) -> GenerateError:
    assert refusal.place is not None
    obj = scene.nearest_skin(refusal.place)
    text = (
        f"'{obj.name}' can't be caged: {refusal}. "
        "Cage Repaired Hull cages a voxel-remeshed copy and leaves the skin as it is"
    )
    error = GenerateError(text, repairable=True, place=refusal.place)
    broken = picks.broken_vertices(scene.points, scene.faces)
    near = np.linalg.norm(scene.points - refusal.place, axis=1)
    chosen = broken if broken.any() else near <= near.min() * (1.0 + 1e-6)
    for skin, start, end in zip(scene.skins, scene.starts, scene.starts[1:], strict=False):
        if chosen[start:end].any():
            error.vertices[skin] = chosen[start:end]
    return error


def _of_bone(refusal: Refusal, scene: Scene) -> GenerateError:
    assert refusal.node is not None
    if scene.armature is None or scene.graph is None:
        return GenerateError(f"{scene.names} can't be caged along their own skeleton: {refusal}", place=refusal.place)
    bone = scene.graph.bone_at(refusal.node)
    error = GenerateError(f"At bone '{bone}' of '{scene.armature.name}': {refusal}", place=refusal.place)
    error.bone = (scene.armature, bone)
    return error
