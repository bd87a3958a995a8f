# SPDX-License-Identifier: GPL-3.0-or-later
"""Bending nodes while they are edited: the skeleton, the cross sections, and what a click would do."""

from __future__ import annotations

import textwrap

import bpy
import numpy as np

from ...caging import current
from ...caging.editing import Editing
from . import legend, shaders
from .kept import Kept
from .shaders import Ink, Pen, Strokes

SKELETON, RING, SIDE = 1.5, 1.2, 2.6  # widths in pixels
CORNER, NODE, CHOSEN, FAULT = 6.0, 9.0, 14.0, 22.0
BONE = (0.86, 0.86, 0.86, 0.55)
BENDING = (1.0, 0.63, 0.20, 1.0)
LEAF = (0.36, 0.72, 1.0, 1.0)
HOVERED = (1.0, 0.93, 0.55, 1.0)
OFFERED = (0.45, 1.0, 0.55, 1.0)
WRONG = (1.0, 0.25, 0.22, 1.0)
BEHIND = 0.28  # what is left of sections behind the skin


class Sections:
    """The strokes of an editing, made when it has changed."""

    def __init__(self, ink: Ink) -> None:
        self._skeleton: Kept[Strokes] = Kept("caging_skeleton")
        self._sections: Kept[Strokes] = Kept("caging_sections")
        self._nodes: Kept[Strokes] = Kept("caging_nodes")
        self._pens = [Pen(ink) for _ in range(3)]

    def draw(self, shown: current.Shown) -> None:
        """In the scene: sections fade behind the skin, nodes are seen through it."""
        editing = shown.editing
        matrix = shaders.to_screen(shown.to_world)
        key = (editing, editing.revision)
        skeleton = self._skeleton.get((editing, editing.course), lambda: _skeleton(editing))
        sections = self._sections.get(key, lambda: _sections(editing))
        nodes = self._nodes.get(key, lambda: _nodes(editing))
        shaders.over(in_front=True)
        self._pens[0].draw(skeleton, (editing, editing.course), matrix)
        self._pens[1].draw(sections, key, matrix, alpha=BEHIND)
        shaders.over(in_front=False)
        nearer = shaders.to_screen(shown.to_world, 4e-3 * editing.course.size)
        self._pens[1].draw(sections, key, nearer)
        shaders.over(in_front=True)
        self._pens[2].draw(nodes, key, matrix)


def _skeleton(editing: Editing) -> Strokes:
    paths = editing.course.paths
    return shaders.lines(
        np.concatenate([path[:-1] for path in paths]), np.concatenate([path[1:] for path in paths]), BONE, SKELETON
    )


def _sections(editing: Editing) -> Strokes:
    found = shaders.lines(np.empty((0, 3)), np.empty((0, 3)), LEAF, RING)
    chosen = _hovered_section(editing)
    for k, section in enumerate(editing.sections):
        colour = HOVERED if k == chosen else BENDING if section.bending else LEAF
        ring = (*colour[:3], 0.5)
        found += shaders.lines(section.ring, np.roll(section.ring, -1, axis=0), ring, RING)
        found += shaders.lines(section.corners, np.roll(section.corners, -1, axis=0), colour, SIDE)
        found += shaders.dots(section.corners, colour, CORNER)
    return found


def _hovered_section(editing: Editing) -> int | None:
    if editing.hovered is None:
        return None
    point = editing.course.point(editing.places[editing.hovered])
    apart = [np.linalg.norm(s.point - point) if s.bending else np.inf for s in editing.sections]
    return int(np.argmin(apart))


def _nodes(editing: Editing) -> Strokes:
    leaves = np.array([section.point for section in editing.sections if not section.bending]).reshape(-1, 3)
    found = shaders.dots(leaves, LEAF, CORNER)
    found += shaders.dots(editing.course.points(list(editing.places)), BENDING, NODE)
    if editing.hovered is not None:
        found += shaders.dots(editing.course.points([editing.places[editing.hovered]]), HOVERED, CHOSEN)
    if editing.offered is not None:
        found += shaders.dots(editing.course.points([editing.offered]), OFFERED, NODE)
    if editing.fault is not None:
        found += shaders.dots(np.array([editing.fault]), WRONG, FAULT)
    return found


def draw_words(context: bpy.types.Context, shown: current.Shown) -> None:
    """Over the picture: how many sections there are, what is computed, what was refused."""
    editing = shown.editing
    bending = sum(section.bending for section in editing.sections)
    lines = [shown.working or f"{len(editing.sections)} cross sections, {bending} at bending nodes"]
    lines += textwrap.wrap(editing.message, 70)
    legend.words(context, lines, alarm=editing.fault is not None)
