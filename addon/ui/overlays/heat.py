# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat map: the skin in the colours of how much the selected cage vertices, or the active bone, move it."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import gpu
import numpy as np
from numpy.typing import NDArray

from ...session import Session
from . import colours, shaders
from .kept import Kept
from .subject import Chosen, Subject
from .surfaces import Surface, Surfaces

Weights = list[NDArray[np.float32]]  # #M for each skin


@dataclass(frozen=True)
class Heat:
    """What is drawn on one skin."""

    surface: Surface
    triangles: NDArray[np.int32]  # #T by 3
    weights: NDArray[np.float32]  # #M
    colours: NDArray[np.float32]  # #M by 4
    state: tuple[object, ...]  # of points and colours


@dataclass(frozen=True)
class _Column:
    weights: Weights
    masks: list[NDArray[np.float32] | None]  # held, so that their ids stay theirs

    @property
    def range(self) -> tuple[float, float]:
        """The smallest and largest weight, 0 between them."""
        lows, highs = [float(part.min()) for part in self.weights], [float(part.max()) for part in self.weights]
        return min(0.0, *lows), max(0.0, *highs)


class HeatMap:
    """Keeps what it has computed and sent to the graphics card."""

    def __init__(self, surfaces: Surfaces) -> None:
        self._surfaces = surfaces
        self._column: Kept[_Column] = Kept("weights")
        self._colours: dict[int, Kept[NDArray[np.float32]]] = {}
        self._indices: dict[int, Kept[gpu.types.GPUIndexBuf]] = {}
        self._batches: dict[int, Kept[gpu.types.GPUBatch]] = {}

    def range(self, subject: Subject, chosen: Chosen) -> tuple[float, float]:
        """The smallest and largest weight that is shown, for the legend; 0 is between them."""
        return self._weights(subject.session, chosen).range

    def on(
        self, subject: Subject, chosen: Chosen, opacity: float, space: bpy.types.SpaceView3D | None = None
    ) -> list[Heat]:
        """What is to be drawn, without drawing it."""
        column = self._weights(subject.session, chosen)
        largest = max(map(abs, column.range))
        found = []
        for surface in self._surfaces.shown(subject, space):
            weights = column.weights[surface.index]
            key = (self._column.key, opacity)
            kept = self._colours.setdefault(surface.index, Kept("colours"))
            shades = kept.get(key, lambda weights=weights: colours.of_weights(weights, largest, opacity))
            triangles = self._surfaces.triangles(subject, surface)
            found.append(Heat(surface, triangles, weights, shades, (surface.state, key)))
        return found

    def _weights(self, session: Session, chosen: Chosen) -> _Column:
        masks = session.masks if chosen.joint < 0 else []
        key = (session, chosen, tuple(id(mask) for mask in masks if mask is not None))
        return self._column.get(key, lambda: self._read(session, chosen, masks))

    def _read(self, session: Session, chosen: Chosen, masks: list[NDArray[np.float32] | None]) -> _Column:
        by_bone = chosen.joint >= 0
        column = session.skin_weights(chosen.joint) if by_bone else session.cage_influence(chosen.vertices)
        return _Column(np.split(column, session.starts[1:-1]), masks)

    def draw(self, heats: list[Heat]) -> None:
        """Draw on the skins, over what is seen of them."""
        shaders.over(in_front=False)
        shader = gpu.shader.from_builtin("SMOOTH_COLOR")
        for heat in heats:
            index = heat.surface.index
            kept = self._batches.setdefault(index, Kept("batch"))
            batch = kept.get(heat.state, lambda heat=heat: self._batch(heat))
            with shaders.placed(heat.surface.to_world, heat.surface.offset):
                batch.draw(shader)

    def _batch(self, heat: Heat) -> gpu.types.GPUBatch:
        surface = heat.surface
        kept = self._indices.setdefault(surface.index, Kept("indices"))
        key = (surface.state[0], surface.obj.session_uid)
        indices = kept.get(key, lambda: gpu.types.GPUIndexBuf(type="TRIS", seq=heat.triangles))
        return shaders.triangles({"pos": surface.points, "color": heat.colours}, indices)
