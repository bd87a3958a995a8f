# SPDX-License-Identifier: GPL-3.0-or-later
"""The skins of a rig as they are seen: where their own vertices are, for heat and anchors to be drawn on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ... import health, sync
from ...adapters import drawing
from .kept import Kept
from .subject import Subject

NEAR = 0.001  # how far a figure stands off the skin, in sizes of the rig


@dataclass(frozen=True)
class Surface:
    """One skin, shown. `state` changes with the points."""

    index: int
    obj: bpy.types.Object
    points: NDArray[np.float32]  # #M by 3
    to_world: Matrix
    offset: float  # how far a figure stands off it, in world units
    state: tuple[object, ...]


@dataclass(frozen=True)
class _Points:
    points: NDArray[np.float32]
    in_rig_space: bool  # and not in the skin's own
    spacing: float  # the faces' size where a finer surface is seen, else 0


class Surfaces:
    """The shown skins; read again when the rig has changed."""

    def __init__(self) -> None:
        self._points: dict[int, Kept[_Points]] = {}
        self._triangles: dict[int, Kept[NDArray[np.int32]]] = {}

    def shown(self, subject: Subject, space: bpy.types.SpaceView3D | None) -> Iterator[Surface]:
        """The rig's skins that are visible (in this view) and not in Edit Mode."""
        bones = subject.placed(subject.cage.cage_rig.armature)
        for index, obj in health.live_skins(subject.cage):
            if obj.data.is_editmode or not obj.visible_get(viewport=space):
                continue
            state = (*subject.state, obj.session_uid)
            kept = self._points.setdefault(index, Kept("points"))
            found = kept.get(state, lambda index=index, obj=obj: _read(subject, index, obj))
            to_world = bones if found.in_rig_space else subject.placed(obj)
            offset = max(NEAR * subject.session.size, 0.25 * found.spacing) * max(to_world.to_scale())
            yield Surface(index, obj, found.points, to_world, offset, state)

    def triangles(self, subject: Subject, surface: Surface) -> NDArray[np.int32]:
        """The skin's faces, `#T by 3`: they stay what they were at bind."""
        kept = self._triangles.setdefault(surface.index, Kept("triangles"))
        key = (subject.session, surface.obj.session_uid)
        return kept.get(key, lambda: drawing.read_triangles(surface.obj.data))


def _read(subject: Subject, index: int, obj: bpy.types.Object) -> _Points:
    points = drawing.read_shown(obj, subject.depsgraph)
    if points is not None:
        return _Points(points, False, _spacing(subject, index) if drawing.is_smoothed(obj) else 0.0)
    owner = obj.cage_rig.owner
    session = subject.session if owner == subject.cage else sync.session_of(owner)
    own = [skin.object for skin in owner.cage_rig.skins].index(obj)
    return _Points(session.posed_skin(own).copy(), True, _spacing(subject, index))


def _spacing(subject: Subject, index: int) -> float:
    """A typical distance between neighbours of a skin, in its rest shape."""
    skin = subject.session.snapshot.skins[index]
    corners = skin.faces[0][:4000]
    return float(np.median(np.linalg.norm(np.diff(skin.points[corners], axis=0), axis=1)))
