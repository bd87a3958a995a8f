"""A small rig in the text formats of [CTL*20]'s prototype, written by the tests: the bar, bent, moved and stretched.

Not a test of Blender's: the tests without Blender use it too.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import cage_rig_core
import numpy as np

from blend_fixtures.small import simple_bar

Array = np.ndarray
BAR = simple_bar()
SKIN, CAGE = BAR.skins[0], BAR.cage
JOINTS = np.array([bone.head for bone in BAR.bones])
SECONDS = (0.0, 1.0, 2.5)
ANGLES = np.array([[[0, 0, 0], [0, 0, 0]], [[0, 0, 20], [0, 10, 80]], [[90, 0, 0], [60, 30, -45]]], float)  # degrees
ROOTS = np.array([JOINTS[0], JOINTS[0] + [0.0, 0.5, 0.25], JOINTS[0] - [0.25, 0.0, 0.0]])
STRAY = np.array([0.0, 0.0, 0.125])  # what the animation's second joint is away from its father's
STRETCH = np.array([1.5, 1.0, 1.25])
SKIN_FACES, CAGE_FACES = ((np.concatenate(faces), [len(face) for face in faces]) for faces in (SKIN.faces, CAGE.faces))
PHI = cage_rig_core.mean_value_coordinates(SKIN.vertices, CAGE.vertices, CAGE_FACES)


@functools.cache
def anchors() -> Array:
    """As many skin vertices as the cage has, well chosen: those of a bind."""
    rig = cage_rig_core.CoupledRig(
        SKIN.vertices, SKIN_FACES, SKIN.weights, JOINTS, [-1, 0], CAGE.vertices, CAGE_FACES, cage_coords=PHI
    )
    return rig.anchors


def write_rig(folder: Path) -> Path:
    """All files of the rig 'bar'; returns the .skt."""
    _write(folder / "bar.obj", _obj(SKIN.vertices, SKIN.faces))
    _write(folder / "bar_cage.obj", _obj(CAGE.vertices, CAGE.faces))
    _write(folder / "bar.skt", ["# joints", *(_joint(k) for k in (1, 0))])
    rows = [f"{j} {i} {SKIN.weights[i, j]:.6f}" for i, j in zip(*np.nonzero(SKIN.weights), strict=True)]
    _write(folder / "bar.skw", rows)
    _write(folder / "bar_skelAnim.txt", ["# V3", "# a comment", "", *_times(), *_skeleton_keys()])
    still = [np.zeros_like(CAGE.vertices), CAGE.vertices * (STRETCH - 1.0), np.zeros_like(CAGE.vertices)]
    offsets = [f"c {k} {_words(row)}" for k, rows in enumerate(still) for row in rows]
    _write(folder / "bar_cageAnim.txt", [*_times(), *offsets])
    chosen = anchors()
    _write(folder / "bar_cage.maxvol", [f"MAXVOLSELECTION {len(chosen)}", " ".join(map(str, chosen))])
    _write(folder / "bar_cage_cageWeights.txt", [f"{j} {i} {PHI[i, j]:.6f}" for i, j in np.ndindex(PHI.shape)])
    centers = [
        f"{i} {k} {weight}" for i in range(len(SKIN.vertices)) for k, weight in ((i, 0.75), (0 if i else 1, 0.25))
    ]
    _write(folder / "bar_corWeights.txt", centers)
    return folder / "bar.skt"


def transforms(key: int, *, stray: bool = False) -> Array:
    """T of both joints at a key (`2 by 4 by 4`), by hand: turns, the root's place, the second joint on its father."""
    first, second = (_turn(angles) for angles in ANGLES[key])
    root = np.eye(4)
    root[:3, :3], root[:3, 3] = first, ROOTS[key] - first @ JOINTS[0]
    place = root[:3, :3] @ JOINTS[1] + root[:3, 3] + (STRAY if stray else 0.0)
    child = np.eye(4)
    child[:3, :3], child[:3, 3] = second, place - second @ JOINTS[1]
    return np.stack([root, child])


def skinned(points: Array, moved: Array) -> Array:
    """Linear blend skinning of `points` by transforms."""
    each = np.einsum("jab,ib->jia", moved[:, :3, :3], points) + moved[:, None, :3, 3]
    return np.einsum("ij,jia->ia", SKIN.weights, each)


def edit(path: Path, change: Callable[[list[str]], list[str]]) -> None:
    """Change the lines of a file."""
    _write(path, change(path.read_text().splitlines()))


def _turn(degrees: Array) -> Array:
    """Rz Ry Rx."""
    (x, y, z) = np.radians(degrees)
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def _skeleton_keys() -> list[str]:
    places = [(ROOTS[k], _point(transforms(k, stray=True)[0], JOINTS[1]) + STRAY) for k in range(len(SECONDS))]
    return [f"s {k} {_words(ANGLES[k, j])} {_words(places[k][j])}" for k in range(len(SECONDS)) for j in range(2)]


def _point(matrix: Array, point: Array) -> Array:
    return matrix[:3, :3] @ point + matrix[:3, 3]


def _times() -> list[str]:
    return [f"k {seconds:.6f}" for seconds in SECONDS]


def _joint(index: int) -> str:
    return f"j {index} {BAR.bones[index].name} {index - 1} {_words(JOINTS[index])}"


def _obj(vertices: Array, faces: object) -> list[str]:
    corners = [" ".join(f"{k + 1}//1" for k in face) for face in faces]
    return ["# a mesh", "vn 0 0 1", *(f"v {_words(row)}" for row in vertices), *(f"f {words}" for words in corners)]


def _words(row: Array) -> str:
    return " ".join(f"{x:.9f}" for x in row)


def _write(path: Path, lines: list[str]) -> None:
    path.write_text("\n".join(lines) + "\n")
