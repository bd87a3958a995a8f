# SPDX-License-Identifier: GPL-3.0-or-later
"""The skeleton's graph: bones are edges between heads and tails, ends at one place are merged, parents linked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
SAME = 1e-4  # ends nearer than this, of the size, are one node


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
    ends = np.concatenate([heads[used], tails[used]])
    place = _merged(ends, SAME * float(np.linalg.norm(np.ptp(ends, axis=0))))
    kept, nodes = np.unique(place, return_inverse=True)
    head, tail = nodes[: len(used)], nodes[len(used) :]
    graph = _Edges(ends[kept])
    for k, bone in enumerate(used):
        graph.add(head[k], tail[k], names[bone], link=False)
    index = {bone: k for k, bone in enumerate(used)}
    for k, bone in enumerate(used):
        above = parents[bone]
        while above >= 0 and above not in index:
            above = parents[above]
        if above >= 0:
            graph.add(graph.nearest(head[k], [head[index[above]], tail[index[above]]]), head[k], names[bone], link=True)
    graph.join_parts({int(head[k]): names[bone] for k, bone in reversed(list(enumerate(used)))})
    found = {names[bone]: (int(head[k]), int(tail[k])) for k, bone in enumerate(used)}
    edges = np.array(graph.edges, np.int64).reshape(-1, 2)
    return BoneGraph(graph.nodes, edges, graph.bones, np.array(graph.links, bool), found)


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
