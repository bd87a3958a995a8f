# SPDX-License-Identifier: GPL-3.0-or-later
"""Cages that fade away from the mouse cursor.

Only cages that the artist has hidden are drawn: Blender's own drawing of a visible object can't be faded, and nothing
in the file is changed to get rid of it. Every view draws them faintly; in the one under the cursor, what is near it is
drawn over that in full.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import gpu
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...adapters import drawing
from . import colours, shaders, subject
from .kept import Kept
from .shaders import Fade, Ink, Pen, Strokes
from .subject import Subject

EDGE, VERTEX = 1.6, 6.0  # widths in pixels
Key = tuple[object, ...]


class Cages:
    """The hidden rest and posed cages of the rigs on one armature."""

    def __init__(self, ink: Ink) -> None:
        self._ink = ink
        self._edges: dict[int, Kept[NDArray[np.int64]]] = {}
        self._strokes: dict[int, Kept[Strokes]] = {}
        self._pens: dict[int, Pen] = {}

    def hidden(
        self, found: Subject, space: bpy.types.SpaceView3D | None = None
    ) -> Iterator[tuple[bpy.types.Object, Strokes, Key]]:
        """Each with its strokes, in its own space, and their key. None where no skin of the rig is visible."""
        for rig in subject.beside(found):
            settings = rig.cage.cage_rig
            if not any(skin.object is not None and skin.object.visible_get(viewport=space) for skin in settings.skins):
                continue
            for obj, colour in ((rig.cage, colours.REST_CAGE), (settings.posed_cage, colours.POSED_CAGE)):
                if not obj.visible_get(viewport=space):
                    key = (*rig.state, obj.session_uid)
                    kept = self._strokes.setdefault(obj.session_uid, Kept("cages"))
                    yield obj, kept.get(key, lambda rig=rig, obj=obj, colour=colour: self._read(rig, obj, colour)), key

    def _read(self, rig: Subject, obj: bpy.types.Object, colour: colours.Colour) -> Strokes:
        kept = self._edges.setdefault(obj.session_uid, Kept("edges"))
        edges = kept.get(rig.session, lambda: drawing.edges(rig.session.snapshot.cage_faces))
        if obj == rig.cage:
            points = drawing.read_cage(obj, rig.depsgraph)
        else:
            points = rig.session.posed_cage()
        return shaders.lines(points[edges[:, 0]], points[edges[:, 1]], colour, EDGE) + shaders.dots(
            points, colour, VERTEX
        )

    def draw_faint(self, found: Subject, space: bpy.types.SpaceView3D, alpha: float) -> None:
        """Everywhere, in the 3D View's own drawing."""
        shaders.over(in_front=True)
        for obj, strokes, key in self.hidden(found, space):
            self._pen(obj).draw(strokes, key, shaders.to_screen(found.placed(obj)), alpha=alpha)

    def draw_near(self, found: Subject, context: bpy.types.Context, cursor: tuple[int, int], radius: float) -> None:
        """Near the cursor (a place in the window), in the drawing of cursors, which is of the whole window."""
        shaders.over(in_front=True)
        left, bottom, width, height = gpu.state.viewport_get()
        region = context.region
        view = context.region_data.perspective_matrix
        scale = Matrix.Diagonal((region.width / width, region.height / height, 1.0, 1.0))
        shift = Matrix.Translation(
            (
                (2.0 * (region.x - left) + region.width) / width - 1.0,
                (2.0 * (region.y - bottom) + region.height) / height - 1.0,
                0.0,
            )
        )
        fade = Fade((cursor[0] - left - 0.5 * width, cursor[1] - bottom - 0.5 * height), radius)
        for obj, strokes, key in self.hidden(found, context.space_data):
            self._pen(obj).draw(strokes, key, shift @ scale @ view @ found.placed(obj), fade=fade)

    def _pen(self, obj: bpy.types.Object) -> Pen:
        return self._pens.setdefault(obj.session_uid, Pen(self._ink))
