# SPDX-License-Identifier: GPL-3.0-or-later
"""The text formats of [CTL*20]'s prototype, each with a reader that checks it. `docs/formats.md` describes them.

Readers are given how many vertices or joints there are, so that every index is checked. Indices count from 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .text import Doubles, FileError, Ints, Row, TextFile

Faces = tuple[Ints, Ints]  # corner vertex indices, face sizes
Csr = tuple[Ints, Ints, Doubles]  # indptr, columns, values
SUM_SLACK = 0.01  # how far weights of a vertex may be from a sum of 1, to which they are normalised


@dataclass(frozen=True)
class Mesh:
    """`#V by 3` vertices and polygons."""

    vertices: Doubles
    faces: Faces


@dataclass(frozen=True)
class Skeleton:
    """Joints at rest: names, fathers (-1: none) and places, `#J by 3`."""

    names: list[str]
    parents: Ints
    joints: Doubles


@dataclass(frozen=True)
class SkeletonMotion:
    """Keys at ascending `times` (`#K`, seconds): angles (degrees) and places, global, `#K by #J by 3`."""

    times: Doubles
    angles: Doubles
    places: Doubles


@dataclass(frozen=True)
class CageMotion:
    """Keys at ascending `times` (`#K`, seconds): what is added to the rest cage, `#K by #C by 3`."""

    times: Doubles
    offsets: Doubles


def read_mesh(path: Path) -> Mesh:
    """Vertices and faces of a Wavefront .obj. What else it holds is passed over."""
    file = TextFile(path)
    rows = file.marked("v")
    _, vertices = file.table([(number, words[:3]) for number, words in rows], "v x y z", width=3, whole=0)
    if not rows:
        raise file.lacking("lines 'v x y z'")
    sizes, corners = [], []
    for number, words in file.marked("f"):
        face = _face(words, len(rows))
        if face is None:
            raise file.fault(number, f"'f' and 3 or more different vertices of 1 to {len(rows)}")
        corners += face
        sizes.append(len(face))
    if not sizes:
        raise file.lacking("lines 'f a b c'")
    return Mesh(vertices, (np.array(corners, np.int64), np.array(sizes, np.int64)))


def _face(words: list[str], count: int) -> list[int] | None:
    """Vertex indices of `a b c`, `a/t/n …` or, counted from the end, negative ones; None where they are none."""
    try:
        indices = [int(word.split("/")[0]) for word in words]
    except ValueError:
        return None
    found = [index - 1 if index > 0 else count + index for index in indices]
    good = len(set(found)) == len(found) >= 3 and 0 not in indices and all(0 <= vertex < count for vertex in found)
    return found if good else None


def read_skeleton(path: Path) -> Skeleton:
    """`j index name father x y z`, one line a joint, in any order."""
    file, form = TextFile(path), "j index name father x y z"
    rows = file.marked("j")
    if not rows:
        raise file.lacking(f"lines '{form}'")
    wrong = next((number for number, words in rows if len(words) != 6), None)
    if wrong is not None:
        raise file.fault(wrong, f"'{form}'")
    bare = [(number, [words[0], words[2], *words[3:]]) for number, words in rows]
    whole, places = file.table(bare, form, width=5, whole=2)
    _require_order(file, rows, whole[:, 0])
    count, order = len(rows), np.argsort(whole[:, 0])
    rows, names = [rows[k] for k in order], [rows[k][1][1] for k in order]
    parents = whole[order, 1]
    file.require(rows, (parents >= -1) & (parents < count), f"a father of 0 to {count - 1}, or -1")
    first = [names.index(name) == k for k, name in enumerate(names)]
    file.require(rows, np.array(first), "a name that no other joint has")
    file.require(rows, _end_at_root(parents), "a father that does not descend from it")
    return Skeleton(names, parents, places[order])


def _require_order(file: TextFile, rows: list[Row], indices: Ints) -> None:
    count = len(rows)
    file.require(rows, (indices >= 0) & (indices < count), f"an index of 0 to {count - 1}, as there are {count} joints")
    first = np.zeros(count, bool)
    first[np.unique(indices, return_index=True)[1]] = True
    file.require(rows, first, "an index that no other joint has")


def _end_at_root(parents: Ints) -> np.ndarray:
    """For each joint, whether its fathers end at a root."""
    above = parents.copy()
    for _ in parents:
        above = np.where(above >= 0, parents[above], -1)
    return above == -1


def read_weights(path: Path, vertices: int, joints: int) -> Csr:
    """`joint vertex weight`: skinning weights (`#V by #J`). A vertex's weights sum to 1, nearly, or it has none."""
    file = TextFile(path)
    row, column, values = _entries(file, "joint vertex weight", {"joint": joints, "vertex": vertices})
    file.require(file.rows, (values >= 0.0) & (values <= 1.0 + SUM_SLACK), "a weight of 0 to 1")
    sums = np.bincount(row, values, minlength=vertices)
    off = np.flatnonzero((np.abs(sums - 1.0) > SUM_SLACK) & (sums != 0.0))
    if len(off):
        raise FileError(f"{path.name}: the weights of vertex {off[0]} sum to {sums[off[0]]:.4g}, expected 1")
    return _csr(row, column, values, vertices)


def read_anchors(path: Path, vertices: int, wanted: int) -> Ints:
    """`MAXVOLSELECTION n` and n different vertices: the anchors of the posed cage, as many as it has vertices."""
    file = TextFile(path)
    head = file.rows[0] if file.rows else None
    if head is None or head[1][0] != "MAXVOLSELECTION" or len(head[1]) != 2:
        raise file.fault(head[0], "'MAXVOLSELECTION n'") if head else file.lacking("'MAXVOLSELECTION n'")
    singles = [(number, [word]) for number, words in file.rows[1:] for word in words]
    whole, _ = file.table(singles, "whole numbers", width=1, whole=1)
    found = whole[:, 0]
    file.require(singles, (found >= 0) & (found < vertices), f"skin vertices of 0 to {vertices - 1}")
    if head[1][1] != str(len(found)) or len(found) != wanted or len(np.unique(found)) != wanted:
        raise file.fault(head[0], f"{wanted} different vertices ({len(np.unique(found))} are listed)")
    return found


def read_skeleton_motion(path: Path, joints: int) -> SkeletonMotion:
    """`# V3`, `k seconds` and, `joints` for each key, `s key rx ry rz tx ty tz`: Euler degrees and places, global."""
    file = TextFile(path)
    if not any(line.replace(" ", "") == "#V3" for line in file.lines):
        raise file.lacking("a line '# V3': of the prototype's skeleton animations, version 3 is the one that is known")
    times, values = _keys(file, "s", "key rx ry rz tx ty tz", joints, "joints")
    return SkeletonMotion(times, values[..., :3], values[..., 3:])


def read_cage_motion(path: Path, vertices: int) -> CageMotion:
    """`k seconds` and, `vertices` for each key, `c key dx dy dz`: offsets of the rest cage."""
    return CageMotion(*_keys(TextFile(path), "c", "key dx dy dz", vertices, "cage vertices"))


def _keys(file: TextFile, mark: str, form: str, count: int, what: str) -> tuple[Doubles, Doubles]:
    """Times (`#K`) and the values of each key (`#K by count by n`), in the order of their lines."""
    rows = file.marked("k")
    if not rows:
        raise file.lacking("lines 'k seconds'")
    _, times = file.table(rows, "k seconds", width=1, whole=0)
    file.require(rows, np.diff(times[:, 0], prepend=-np.inf) > 0.0, "a later time than the one before")
    rows = file.marked(mark)
    whole, values = file.table(rows, f"{mark} {form}", width=len(form.split()), whole=1)
    key = whole[:, 0]
    file.require(rows, (key >= 0) & (key < len(times)), f"a key of 0 to {len(times) - 1}, as {len(times)} have a time")
    found = np.bincount(key, minlength=len(times))
    wrong = np.flatnonzero(found != count)
    if len(wrong):
        raise FileError(
            f"{file.path.name}: key {wrong[0]} has {found[wrong[0]]} lines '{mark}', expected {count}, one for each of "
            f"the {what}"
        )
    return times[:, 0], values[np.argsort(key, kind="stable")].reshape(len(times), count, -1)


def read_coordinates(path: Path, rows: int, columns: int, *, what: str = "vertex") -> Doubles:
    """`cage_vertex vertex weight`: coordinates with respect to the cage, `#rows by #columns`; what is not listed is 0.

    `what` names the rows: vertices of the skin, or joints.
    """
    file = TextFile(path)
    row, column, values = _entries(file, f"cage_vertex {what} weight", {"cage vertex": columns, what: rows})
    dense = np.zeros((rows, columns))
    dense[row, column] = values
    return dense


def write_coordinates(path: Path, coords: Doubles) -> None:
    """As `read_coordinates` reads them (`#rows by #columns`), in the prototype's order, to nine digits."""
    row, column = np.nonzero(coords)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for j, i, value in zip(column.tolist(), row.tolist(), coords[row, column].tolist(), strict=True):
            file.write(f"{j} {i} {value:.9g}\n")


def write_anchors(path: Path, anchors: Ints) -> None:
    """As `read_anchors` reads them."""
    text = f"MAXVOLSELECTION {len(anchors)}\n{' '.join(map(str, anchors.tolist()))}\n"
    path.write_text(text, encoding="utf-8", newline="\n")


def read_centers(path: Path, vertices: int) -> Csr:
    """`vertex k weight`: the center of rotation of each vertex as a mean of skin vertices k (`#V by #V`)."""
    file = TextFile(path)
    column, row, values = _entries(file, "vertex k weight", {"vertex": vertices, "vertex k": vertices})
    sums = np.bincount(row, values, minlength=vertices)
    off = np.flatnonzero(np.abs(sums - 1.0) > SUM_SLACK)
    if len(off):
        raise FileError(f"{path.name}: the weights of vertex {off[0]} sum to {sums[off[0]]:.4g}, expected 1")
    return _csr(row, column, values / sums[row], vertices)


def _entries(file: TextFile, form: str, counts: dict[str, int]) -> tuple[Ints, Ints, Doubles]:
    """Entries of a matrix, `first second value` with the counts of the first two: second, first and value of each."""
    if not file.rows:
        raise file.lacking(f"lines '{form}'")
    whole, values = file.table(file.rows, form, width=3, whole=2)
    for index, (name, count) in zip(whole.T, counts.items(), strict=True):
        file.require(file.rows, (index >= 0) & (index < count), f"a {name} of 0 to {count - 1} in '{form}'")
    first, second = whole.T
    place = second * max(counts.values()) + first
    unique = np.zeros(len(place), bool)
    unique[np.unique(place, return_index=True)[1]] = True
    file.require(file.rows, unique, f"'{form}' once for a pair")
    return second, first, values[:, 0]


def _csr(row: Ints, column: Ints, values: Doubles, rows: int) -> Csr:
    order = np.lexsort((column, row))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=rows))])
    return indptr, column[order], values[order]
