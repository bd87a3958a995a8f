# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read of a character at rest, in rig space: its bones, its skins and their weights. Nothing is written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from . import health
from .adapters import armature, positions, stack, vertex_groups
from .session import SkinSnapshot

Matrix = NDArray[np.float64]


class BindError(Exception):
    """The selection can't be bound; the message is a sentence for the artist. Nothing was changed."""


@dataclass(frozen=True)
class Character:
    """Skins and bones at rest, in the armature's space."""

    rest: armature.RestBones
    skins: list[SkinSnapshot]
    to_rig: list[Matrix]  # of the skins, then of what was asked for beside them


def read(
    context: bpy.types.Context,
    armature_object: bpy.types.Object,
    skins: Sequence[bpy.types.Object],
    *others: bpy.types.Object,
) -> Character:
    """Read the skins' base meshes and weights and the rest bones. Object Mode.

    Raises `BindError` for what can't be bound.
    """
    rest = armature.read_rest(armature_object.data)
    if not rest.names:
        raise BindError(f"Armature '{armature_object.name}' has no bones")
    deforming = {name: k for k, name in enumerate(rest.names) if rest.deform[k]}
    with at_rest(context, armature_object):
        world = armature.to_array(armature_object.matrix_world)
        to_rig = [_to_rig(obj, world, armature_object.name) for obj in (*skins, *others)]
    parts = [_read_skin(obj, deforming, matrix) for obj, matrix in zip(skins, to_rig, strict=False)]
    _refuse_bones(armature_object, rest, parts)
    for obj in skins:
        _refuse_modifiers(obj, armature_object)
    return Character(rest, parts, to_rig)


def read_meshes(skins: list[bpy.types.Object]) -> list[tuple[positions.Points, tuple]]:
    """Base meshes without weights, in the space of the first object: points and faces. Raises `BindError`."""
    world = armature.to_array(skins[0].matrix_world)
    for obj in skins:
        if not obj.data.polygons:
            raise BindError(f"'{obj.name}' has no faces, so it can't be a skin")
    return [
        (
            positions.apply_matrix(_to_rig(obj, world, skins[0].name), positions.read_base(obj.data)),
            positions.read_faces(obj.data),
        )
        for obj in skins
    ]


def placed(context: bpy.types.Context, space: bpy.types.Object, obj: bpy.types.Object) -> Matrix:
    """What brings an object's own space to that of `space`, an armature (at rest) or a mesh. Raises `BindError`."""
    with at_rest(context, space) if space.type == "ARMATURE" else nullcontext():
        return _to_rig(obj, armature.to_array(space.matrix_world), space.name)


def _to_rig(obj: bpy.types.Object, armature_world: Matrix, armature_name: str) -> Matrix:
    world = armature.to_array(obj.matrix_world)
    for name, matrix in ((armature_name, armature_world), (obj.name, world)):
        scales = np.linalg.svd(matrix[:3, :3], compute_uv=False)
        if scales[2] <= 1e-6 * scales[0]:
            raise BindError(f"'{name}' is scaled to nothing along an axis; give it a scale")
    # through float32: what a file keeps
    return (np.linalg.inv(armature_world) @ world).astype(np.float32).astype(np.float64)


def _read_skin(obj: bpy.types.Object, deforming: dict[str, int], to_rig: Matrix) -> SkinSnapshot:
    mesh = obj.data
    if mesh.library is None and mesh.users - mesh.use_fake_user > 1:
        raise BindError(f"The mesh of '{obj.name}' is shared with another object; make it single-user first")
    if not mesh.polygons:
        raise BindError(f"'{obj.name}' has no faces, so it can't be a skin")
    indptr, joints, values = vertex_groups.read_weights(obj, deforming)
    if not len(joints):
        raise BindError(
            f"'{obj.name}' has no weights: none of its vertex groups is named as a deforming bone; "
            "parent it to the armature with automatic weights, or paint some"
        )
    values = values.astype(np.float32).astype(np.float64)
    points = positions.apply_matrix(to_rig, positions.read_base(mesh))
    return SkinSnapshot(points, positions.read_faces(mesh), (indptr, joints, values))


def _refuse_bones(obj: bpy.types.Object, rest: armature.RestBones, skins: list[SkinSnapshot]) -> None:
    used = np.unique(np.concatenate([skin.weights[1] for skin in skins]))
    for bone in used.tolist():
        if rest.segments[bone] > 1:
            raise BindError(health.bendy(obj, rest.names[bone]))
        if rest.envelopes[bone]:
            raise BindError(
                f"Bone '{rest.names[bone]}' of '{obj.name}' multiplies weights by its envelope; "
                "switch that off (Bone properties, Deform)"
            )


def _refuse_modifiers(obj: bpy.types.Object, armature_object: bpy.types.Object) -> None:
    unlike = stack.unlike_weights(obj, armature_object)
    if unlike:
        raise BindError(f"'{obj.name}' can't be bound: {unlike}")
    blocking = stack.blocking(obj, stack.place(obj, armature_object))
    if blocking:
        raise BindError(
            f"Modifier '{blocking}' of '{obj.name}' may change the vertices before the Armature modifier; "
            "apply it or move it after"
        )


@contextmanager
def at_rest(context: bpy.types.Context, armature_object: bpy.types.Object) -> Iterator[None]:
    """The armature in rest position, so that what hangs on its bones is where it was made."""
    data = armature_object.data
    before = data.pose_position
    if before == "REST":
        yield
        return
    data.pose_position = "REST"
    context.view_layer.update()
    try:
        yield
    finally:
        data.pose_position = before
        context.view_layer.update()
