# SPDX-License-Identifier: GPL-3.0-or-later
"""A generated cage that another one is to be like: read for the core, and refused in the artist's terms."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..adapters import positions
from ..generator import Like, Points, Refusal
from .refusals import GenerateError, Scene

SECTION = "cage_rig_section"
FEW = 3  # bones of the same names that say something
SHARED = 0.8  # of a cage's bones, where two characters may be one


@dataclass(frozen=True)
class Model:
    """A cage to be like."""

    cage: bpy.types.Object
    like: Like


def read(cage: bpy.types.Object, space: bpy.types.Object, skin: Points) -> Model:
    """A cage for the rig space of `space`, where the points of the skin are. Raises `GenerateError`."""
    corners = corners_of(cage)
    local = positions.read_base(cage.data).astype(float)
    # where it stands beside the skin, or in its own rig space: objects may have been put side by side, or turned
    to_rig = np.linalg.inv(np.array(space.matrix_world)) @ np.array(cage.matrix_world)
    points = min((positions.apply_matrix(to_rig, local), local), key=lambda points: _unlike(points, skin))
    return Model(cage, Like(points, positions.read_faces(cage.data), corners))


def corners_of(cage: bpy.types.Object) -> int:
    """How many vertices a cross section of a generated cage has. Raises `GenerateError` where it is none."""
    owners = sections_of(cage) if cage.type == "MESH" else None
    if owners is None or not len(owners):
        raise GenerateError(f"'{cage.name}' is no cage that Generate Cage made; choose one for Like, or none")
    corners = int((owners == owners[0]).sum())
    if not np.array_equal(owners, np.repeat(np.arange(len(owners) // corners), corners)):
        raise GenerateError(
            f"'{cage.name}' has other vertices than Generate Cage gave it; choose a cage for Like that has all of them"
        )
    return corners


def cages(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The scene's generated cages."""
    return [obj for obj in scene.objects if is_generated(obj)]


def is_generated(obj: bpy.types.Object) -> bool:
    """Whether the object is a generated cage, as far as its vertices know their cross sections."""
    return obj.type == "MESH" and sections_of(obj) is not None


def suggested(scene: bpy.types.Scene, cage: bpy.types.Object) -> list[bpy.types.Object]:
    """Other cages of the scene around bones of the same names, whose faces this one could have and has not."""
    own, found = _bones(cage), []
    for other in cages(scene) if is_generated(cage) else ():
        shared = own & _bones(other)
        if other != cage and len(shared) >= FEW and len(shared) >= SHARED * len(own) and not same_faces(cage, other):
            found.append(other)
    return found


def same_faces(cage: bpy.types.Object, other: bpy.types.Object) -> bool:
    """Whether two meshes have the same faces, index for index."""
    pairs = zip(positions.read_faces(cage.data), positions.read_faces(other.data), strict=True)
    return all(np.array_equal(mine, its) for mine, its in pairs)


def _bones(cage: bpy.types.Object) -> set[str]:
    return {group.name for group in cage.vertex_groups}


def sections_of(cage: bpy.types.Object) -> NDArray[np.int32] | None:
    """The cross section of each vertex, where the mesh knows them."""
    layer = cage.data.attributes.get(SECTION)
    if layer is None or len(layer.data) != len(cage.data.vertices):
        return None
    owners = np.empty(len(layer.data), np.int32)
    layer.data.foreach_get("value", owners)
    return owners


def refuse_options(model: Model, corners: int) -> None:
    """Raise `GenerateError` where the cage is to have other cross sections than its model."""
    found = model.like.corners
    if found != corners:
        raise GenerateError(
            f"'{model.cage.name}' has {found} corners in a cross section, not {corners}; set Corners to {found}"
        )


def explained(refusal: Refusal, model: Model, scene: Scene) -> GenerateError:
    """Why a cage can't be like another one."""
    name = model.cage.name
    if refusal.section is not None:
        bone = _bone(model.cage, refusal.section * model.like.corners)
        where = f" at its bone '{bone}'" if bone else ""
        return GenerateError(
            f"{scene.names} can't get a cage like '{name}'{where}: {refusal}. "
            "Both need the same limbs, and as many nodes on each: turn Keep My Nodes off, or clear Like"
        )
    error = GenerateError(
        f"The faces of '{name}' don't fit {scene.names}: {refusal}. Clear Like to get faces of its own",
        place=refusal.place,
    )
    if refusal.node is not None and scene.armature is not None and scene.graph is not None:
        error.bone = (scene.armature, scene.graph.bone_at(refusal.node))
    return error


def _bone(cage: bpy.types.Object, vertex: int) -> str:
    groups = cage.data.vertices[vertex].groups if vertex < len(cage.data.vertices) else ()
    heaviest = max(groups, key=lambda group: group.weight, default=None)
    return cage.vertex_groups[heaviest.group].name if heaviest is not None else ""


def _unlike(cage: Points, skin: Points) -> float:
    """How different the proportions of two boxes are."""
    sizes = [np.ptp(points, axis=0) for points in (cage, skin)]
    first, second = (size / max(float(np.linalg.norm(size)), 1e-30) for size in sizes)
    return float(np.round(np.linalg.norm(first - second), 4))
