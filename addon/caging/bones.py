# SPDX-License-Identifier: GPL-3.0-or-later
"""The skeleton's graph: bones are edges between heads and tails, ends at one place are merged, parents linked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
SAME = 1e-4  # ends nearer than this, of the size, are one node

JOINED = 1e-3  # a child whose head is nearer to its parent's tail than this begins there
FEW = 3  # bones with one child from which nothing is concluded
AHEAD = 0.6  # of the way from the last joint but one to the last, a limb goes on beyond it


@dataclass(frozen=True)
class BoneGraph:
    """Nodes `#N by 3`; edges `#E by 2`, each the way of a bone from its head to its tail or from its parent to it."""

    nodes: Points
    edges: NDArray[np.int64]
    bones: list[str]  # of each edge
    links: NDArray[np.bool_]  # whether the edge leads from the bone's parent to its head
    ends: dict[str, tuple[int, int]]  # head and tail of each bone, as nodes

    def bone_at(self, node: int) -> str:
        """A bone that ends at a node: one that begins there, if there is one."""
        heads = [name for name, (head, _) in self.ends.items() if head == node]
        tails = [name for name, (_, tail) in self.ends.items() if tail == node]
        return next(iter(heads + tails), "")


def bone_graph(
    names: list[str], parents: NDArray[np.int32], heads: Points, tails: Points, used: list[int]
) -> BoneGraph:
    """The graph of the `used` bones. What no parent joins to the rest is joined where it is nearest to it."""
    above = _above(parents, used)
    believed = _believed(above, heads[used], tails[used])
    if not believed:
        tails = tails.copy()
        tails[used] = _tails(above, heads[used])
    ends = np.concatenate([heads[used], tails[used]])
    place = _merged(ends, SAME * float(np.linalg.norm(np.ptp(ends, axis=0))))
    kept, nodes = np.unique(place, return_inverse=True)
    head, tail = nodes[: len(used)], nodes[len(used) :]
    graph = _Edges(ends[kept])
    for k, bone in enumerate(used):
        graph.add(head[k], tail[k], names[bone], link=False)
    for k, parent in enumerate(above):
        if parent >= 0:
            ends_above = [head[parent], tail[parent]] if believed else [head[parent]]
            graph.add(graph.nearest(head[k], ends_above), head[k], names[used[k]], link=True)
    graph.join_parts(
        {int(node): names[bone] for k, bone in reversed(list(enumerate(used))) for node in (tail[k], head[k])}
    )
    found = {names[bone]: (int(head[k]), int(tail[k])) for k, bone in enumerate(used)}
    edges = np.array(graph.edges, np.int64).reshape(-1, 2)
    return BoneGraph(graph.nodes, edges, graph.bones, np.array(graph.links, bool), found)


def _above(parents: NDArray[np.int32], used: list[int]) -> list[int]:
    """For each used bone the row of the nearest used one among its ancestors, -1 without one."""
    row = {bone: k for k, bone in enumerate(used)}
    found = []
    for bone in used:
        above = int(parents[bone])
        while above >= 0 and above not in row:
            above = int(parents[above])
        found.append(row.get(above, -1))
    return found


def _children(above: list[int]) -> list[list[int]]:
    return [[child for child, parent in enumerate(above) if parent == k] for k in range(len(above))]


def _believed(above: list[int], heads: Points, tails: Points) -> bool:
    """Whether tails mean something. Formats such as glTF have joints and no tails, and importers make some up: then the
    only child of a bone seldom begins at its tail.
    """
    only = [(k, found[0]) for k, found in enumerate(_children(above)) if len(found) == 1]
    size = float(np.linalg.norm(np.ptp(heads, axis=0))) if len(heads) else 0.0
    joined = [np.linalg.norm(tails[k] - heads[child]) <= JOINED * size for k, child in only]
    return len(joined) < FEW or 2 * sum(joined) >= len(joined)


def _tails(above: list[int], heads: Points) -> Points:
    """Tails from the heads alone: at the child that leads on straightest, or ahead where a limb ends."""
    tails = heads.copy()
    for k, children in enumerate(_children(above)):
        ways = {child: _unit(heads[child] - heads[k]) for child in children}
        onward = _unit(heads[k] - heads[above[k]]) if above[k] >= 0 else sum(ways.values(), np.zeros(3))
        if ways:
            tails[k] = heads[max(ways, key=lambda child: float(ways[child] @ onward))]
        elif above[k] >= 0:
            tails[k] = heads[k] + AHEAD * (heads[k] - heads[above[k]])
    return tails


def _unit(way: Points) -> Points:
    length = float(np.linalg.norm(way))
    return way / length if length > 0.0 else way


def curve_graph(nodes: Points, edges: NDArray[np.int64]) -> BoneGraph:
    """The graph of a skeleton without bones: every edge gets a name."""
    names = [f"Curve {k}" for k in range(len(edges))]
    ends = {name: (int(start), int(end)) for name, (start, end) in zip(names, edges.tolist(), strict=True)}
    return BoneGraph(nodes, edges, names, np.zeros(len(edges), bool), ends)


def _merged(points: Points, distance: float) -> NDArray[np.int64]:
    """For each point the first one at its place."""
    place = np.arange(len(points))
    for k in range(len(points)):
        near = np.linalg.norm(points[:k] - points[k], axis=1) <= distance
        if near.any():
            place[k] = place[np.argmax(near)]
    return place


class _Edges:
    """Edges as they are added; each pair of nodes once."""

    def __init__(self, nodes: Points) -> None:
        self.nodes = nodes
        self.edges: list[tuple[int, int]] = []
        self.bones: list[str] = []
        self.links: list[bool] = []
        self._part = list(range(len(nodes)))

    def add(self, start: int, end: int, bone: str, *, link: bool) -> None:
        if start == end or (start, end) in self.edges or (end, start) in self.edges:
            return
        self.edges.append((int(start), int(end)))
        self.bones.append(bone)
        self.links.append(link)
        self._part[self._root(start)] = self._root(end)

    def nearest(self, node: int, others: list[int]) -> int:
        return min(others, key=lambda other: float(np.linalg.norm(self.nodes[other] - self.nodes[node])))

    def _root(self, node: int) -> int:
        while self._part[node] != node:
            node = self._part[node]
        return node

    def join_parts(self, heads: dict[int, str]) -> None:
        """Link the nearest head of another part to the part of the first edge, until there is one part."""
        while self.edges:
            first = self._root(self.edges[0][0])
            inside = [k for k in range(len(self.nodes)) if self._root(k) == first]
            outside = [k for k in heads if self._root(k) != first]
            if not outside:
                return
            apart = np.linalg.norm(self.nodes[outside][:, None] - self.nodes[inside], axis=2)
            row, column = np.unravel_index(int(apart.argmin()), apart.shape)
            self.add(inside[int(column)], outside[int(row)], heads[outside[int(row)]], link=True)
