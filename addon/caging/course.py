# SPDX-License-Identifier: GPL-3.0-or-later
"""Where bending nodes can be: the skeleton as the core uses it, and the same places in terms of bones."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..generator import Arc, Points
from .bones import BoneGraph

BEYOND = 100.0  # a node is no farther beyond a bone's tail, in lengths of the bone


class Place(NamedTuple):
    """A place on the skeleton: so far along an arc."""

    arc: int
    along: float


class OnBone(NamedTuple):
    """A place in the artist's terms: 0 at the bone's head, 1 at its tail, more beyond the last bone of a limb, and down
    to -1 on the way from its parent.
    """

    bone: str
    position: float


@dataclass(frozen=True)
class _Piece:
    """The part of an arc that an edge of the graph has become."""

    edge: int
    arc: int
    start: float  # along the arc, where the edge starts
    end: float


class Course:
    """The arcs as polylines with the bones along them."""

    def __init__(self, arcs: list[Arc], graph: BoneGraph) -> None:
        self.graph = graph
        self.paths = [arc.path for arc in arcs]
        steps = [np.linalg.norm(np.diff(path, axis=0), axis=1) for path in self.paths]
        self.along = [np.concatenate([[0.0], np.cumsum(step)]) for step in steps]
        self._pieces = [piece for k, arc in enumerate(arcs) for piece in self._cut(k, arc.nodes)]
        self.size = float(np.linalg.norm(np.ptp(np.concatenate(self.paths), axis=0)))

    def _cut(self, arc: int, nodes: NDArray[np.int64]) -> list[_Piece]:
        named = np.flatnonzero(nodes >= 0)
        found = []
        for one, other in itertools.pairwise(named.tolist()):
            edge, turned = self._edge(int(nodes[one]), int(nodes[other]), self.paths[arc][[one, other]])
            start, end = self.along[arc][[other, one] if turned else [one, other]]
            found.append(_Piece(edge, arc, float(start), float(end)))
        return found

    def _edge(self, start: int, end: int, ends: Points) -> tuple[int, bool]:
        """The edge between two nodes, and whether it goes the other way. Merged nodes have lost one end of theirs."""
        edges, nodes = self.graph.edges, self.graph.nodes
        touching = np.flatnonzero((edges == start).any(1) & (edges == end).any(1))
        if not len(touching):
            touching = np.flatnonzero(((edges == start) | (edges == end)).any(1))
        straight = np.linalg.norm(nodes[edges[touching]] - ends, axis=2).sum(1)
        turned = np.linalg.norm(nodes[edges[touching]] - ends[::-1], axis=2).sum(1)
        best = int(np.argmin(np.minimum(straight, turned)))
        return int(touching[best]), bool(turned[best] < straight[best])

    def point(self, place: Place) -> Points:
        """Where it is, in rig space."""
        path, along = self.paths[place.arc], self.along[place.arc]
        return np.array([np.interp(place.along, along, path[:, axis]) for axis in range(3)])

    def points(self, places: list[Place]) -> Points:
        """`#places by 3`."""
        return np.array([self.point(place) for place in places]).reshape(-1, 3)

    def nearest(self, point: Points, arc: int | None = None) -> Place:
        """The nearest place, on any arc or on one."""
        found = []
        for k in range(len(self.paths)) if arc is None else (arc,):
            apart, along = _nearest(self.paths[k], self.along[k], point)
            found.append((apart, Place(k, along)))
        return min(found)[1]

    def on_screen(self, project: Points, point: tuple[float, float]) -> tuple[float, Place]:
        """The place that is seen nearest to a point of the screen, and how far from it, in pixels.

        `project` (4 by 4) brings rig space to pixels.
        """
        best: tuple[float, Place] = (np.inf, Place(0, 0.0))
        for k, path in enumerate(self.paths):
            seen, depth = to_pixels(project, path)
            visible = (depth[:-1] > 0.0) & (depth[1:] > 0.0)
            start, step = seen[:-1], np.diff(seen, axis=0)
            share = ((point - start) * step).sum(1) / np.maximum((step * step).sum(1), 1e-12)
            share = np.clip(share, 0.0, 1.0)
            apart = np.where(visible, np.linalg.norm(start + share[:, None] * step - point, axis=1), np.inf)
            at = int(apart.argmin())
            if apart[at] < best[0]:
                # what is halfway on the screen is nearer to the end that is farther away
                t = share[at] * depth[at] / max(share[at] * depth[at] + (1.0 - share[at]) * depth[at + 1], 1e-12)
                best = (float(apart[at]), Place(k, float(self.along[k][at] + t * np.diff(self.along[k])[at])))
        return best

    def named(self, place: Place) -> OnBone:
        """The place in the artist's terms."""
        own = [piece for piece in self._pieces if piece.arc == place.arc]
        piece = min(own, key=lambda piece: _outside(place.along, piece.start, piece.end))
        span = piece.end - piece.start
        link = bool(self.graph.links[piece.edge])
        share = float(np.clip((place.along - piece.start) / span if span else 0.0, 0.0, 1.0 if link else BEYOND))
        return OnBone(self.graph.bones[piece.edge], share - 1.0 if link else share)

    def find(self, on_bone: OnBone) -> Place | None:
        """The place of a position on a bone; None where the skeleton has no such bone."""
        if on_bone.bone not in self.graph.ends:
            return None
        link, share = on_bone.position < 0.0, on_bone.position % 1.0 if on_bone.position < 0.0 else on_bone.position
        for piece in self._pieces:
            if self.graph.bones[piece.edge] == on_bone.bone and bool(self.graph.links[piece.edge]) == link:
                along = piece.start + share * (piece.end - piece.start)
                return Place(piece.arc, float(np.clip(along, 0.0, self.along[piece.arc][-1])))
        head, tail = self.graph.nodes[list(self.graph.ends[on_bone.bone])]
        return self.nearest(head + float(np.clip(on_bone.position, 0.0, 1.0)) * (tail - head))

    def kept(self, place: Place) -> Place:
        """The place as a file keeps it, so that opened again it is the same."""
        bone, position = self.named(place)
        return self.find(OnBone(bone, float(np.float32(position)))) or place

    def places(self, nodes: list[OnBone]) -> list[Place]:
        """The places that a file keeps; bones that are gone have none."""
        found = (self.find(node) for node in nodes)
        return [self.kept(place) for place in found if place is not None]

    def left_out(self, dropped: list[int]) -> list[str]:
        """Bones that no part of the skeleton follows, or no part of a cage that left these nodes out."""
        followed = {self.graph.bones[piece.edge] for piece in self._pieces}
        return [
            name
            for name, (head, tail) in self.graph.ends.items()
            if head != tail and (name not in followed or tail in dropped)
        ]

    def mirrored(self, place: Place) -> Place | None:
        """The place on the other side of a symmetric skeleton; None on the middle, or where there is none."""
        middle = 0.5 * (self._low + self._high)
        image = self.point(place) * [-1.0, 1.0, 1.0] + [2.0 * middle, 0.0, 0.0]
        found = self.nearest(image)
        there = self.point(found)
        near = 0.02 * self.size
        if np.linalg.norm(there - image) > near or np.linalg.norm(there - self.point(place)) < near:
            return None
        return found

    @property
    def _low(self) -> float:
        return float(min(path[:, 0].min() for path in self.paths))

    @property
    def _high(self) -> float:
        return float(max(path[:, 0].max() for path in self.paths))


def to_pixels(project: Points, points: Points) -> tuple[Points, Points]:
    """Points (`#P by 3`) on the screen (`#P by 2`), and their depths: in front of the eye where positive."""
    seen = np.column_stack([points, np.ones(len(points))]) @ project.T
    return seen[:, :2] / np.where(np.abs(seen[:, 3:]) < 1e-12, 1e-12, seen[:, 3:]), seen[:, 3]


def _nearest(path: Points, along: Points, point: Points) -> tuple[float, float]:
    start, step = path[:-1], np.diff(path, axis=0)
    share = ((point - start) * step).sum(1) / np.maximum((step * step).sum(1), 1e-300)
    share = np.clip(share, 0.0, 1.0)
    apart = np.linalg.norm(start + share[:, None] * step - point, axis=1)
    at = int(apart.argmin())
    return float(apart[at]), float(along[at] + share[at] * (along[at + 1] - along[at]))


def _outside(value: float, start: float, end: float) -> float:
    low, high = min(start, end), max(start, end)
    return max(low - value, value - high, 0.0)
