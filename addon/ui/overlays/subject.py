# SPDX-License-Identifier: GPL-3.0-or-later
"""What the overlays are about: the rig of the active object, and what the artist has selected of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
from mathutils import Matrix

from ... import registry, sync
from ...adapters import drawing
from ...props import rig_of
from ...session import Session
from . import events
from .kept import Kept


@dataclass(frozen=True)
class Subject:
    """A live rig as it is now. Lives as long as one drawing: objects are never kept."""

    cage: bpy.types.Object
    session: Session
    depsgraph: bpy.types.Depsgraph

    @property
    def state(self) -> tuple[object, ...]:
        """Changes whenever anything that is shown of the rig may have."""
        return self.session, self.session.revision, events.count()

    def placed(self, obj: bpy.types.Object) -> Matrix:
        """The matrix of an object of the rig to the world, also where it is hidden."""
        return obj.evaluated_get(self.depsgraph).matrix_world


@dataclass(frozen=True)
class Chosen:
    """What moves the skin: vertices of the cage, or a joint."""

    label: str
    vertices: tuple[int, ...] = ()
    joint: int = -1


def find(context: bpy.types.Context) -> Subject | None:
    """The rig of the active object, where it is live and shown."""
    depsgraph = context.view_layer.depsgraph
    cage = rig_of(context.view_layer.objects.active)
    return None if depsgraph is None or cage is None else _live(cage, depsgraph)


def beside(subject: Subject) -> Iterator[Subject]:
    """All live rigs on the subject's armature, itself among them."""
    for cage in registry.rigs():
        if cage.cage_rig.armature == subject.cage.cage_rig.armature:
            other = _live(cage, subject.depsgraph)
            if other is not None:
                yield other


def _live(cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Subject | None:
    if cage.cage_rig.state != "LIVE":
        return None
    try:
        return Subject(cage, sync.session_of(cage), depsgraph)
    except KeyError:  # not evaluated yet
        return None


class Choice:
    """The artist's selection, read again only when something of the rig has changed."""

    def __init__(self) -> None:
        self._vertices: Kept[tuple[int, ...]] = Kept("selection")

    def read(self, context: bpy.types.Context, subject: Subject) -> Chosen | None:
        """Selected vertices of a cage in Edit Mode, or the active bone in Pose Mode."""
        settings, obj = subject.cage.cage_rig, context.view_layer.objects.active
        if obj in (subject.cage, settings.posed_cage) and obj.data.is_editmode:
            key = (obj.session_uid, events.count())
            vertices = self._vertices.get(key, lambda: drawing.read_edit_selection(obj.data))
            if not vertices:
                return None
            label = f"Cage vertex {vertices[0]}" if len(vertices) == 1 else f"{len(vertices)} cage vertices"
            return Chosen(label, vertices=vertices)
        if obj in (settings.armature, settings.refit_armature) and obj.mode == "POSE":
            bone = obj.data.bones.active
            joint = settings.joints.find(bone.name) if bone is not None else -1
            return Chosen(bone.name, joint=joint) if joint >= 0 else None
        return None
