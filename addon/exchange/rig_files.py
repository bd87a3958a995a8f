# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of one rig of [CTL*20]'s prototype: which belong together, and all of them read and checked."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import prototype
from .coordinate_files import ANCHORS, CAGE_WEIGHTS
from .coordinates import SIX_DIGITS, Coordinates, Rest, checked
from .prototype import CageMotion, Csr, Mesh, Skeleton, SkeletonMotion
from .text import Doubles, FileError, Ints

# What the files of a rig 'X.skt' are called, the likeliest name first.
NAMES = {
    "mesh": (".obj",),
    "weights": (".skw",),
    "cage": ("_cage.obj",),
    "skeleton_motion": ("_skelAnim.txt", ".ska"),
    "cage_motion": ("_cageAnim.txt",),
    "anchors": ("_cage" + ANCHORS, "_maxvol.txt", ANCHORS),
    "coordinates": ("_cage" + CAGE_WEIGHTS, CAGE_WEIGHTS),
    "centers": ("_corWeights.txt",),
}
NEEDED = {"mesh": "skin", "weights": "weights", "cage": "cage"}


@dataclass(frozen=True)
class PrototypeRig:
    """What the files hold, fitting together. What no file says is None."""

    name: str
    mesh: Mesh
    skeleton: Skeleton
    weights: Csr  # #M by #J
    cage: Mesh
    skeleton_motion: SkeletonMotion | None
    cage_motion: CageMotion | None
    cage_coords: Doubles | None  # Φ, #M by #C
    anchors: Ints | None
    centers: Csr | None  # #M by #M: centers of rotation as means of the skin

    @property
    def rest(self) -> Rest:
        """The rest shape, for checks."""
        vertices, joints = self.mesh.vertices, self.skeleton.joints
        return Rest([self.name], [len(vertices)], vertices, self.skeleton.names, joints, self.cage.vertices)


def find(path: Path, given: dict[str, Path]) -> tuple[Path, dict[str, Path]]:
    """The .skt of `path` (itself, or the one in that folder) and the other files by their names in `NAMES`.

    `given` goes before what lies beside. Raises `FileError` where a file that is needed is not there.
    """
    skeleton = _skeleton_of(path)
    found = {}
    for name, endings in NAMES.items():
        beside = [skeleton.with_name(skeleton.stem + ending) for ending in endings]
        chosen = given.get(name) or next((file for file in beside if file.is_file()), None)
        if chosen is None and name in NEEDED:
            raise FileError(
                f"There is no '{beside[0].name}' beside '{skeleton.name}'; choose the file of the {NEEDED[name]}"
            )
        if chosen is not None:
            found[name] = chosen
    return skeleton, found


def _skeleton_of(path: Path) -> Path:
    if not path.is_dir():
        return path
    found = sorted(path.glob("*.skt"))
    if len(found) != 1:
        names = ", ".join(file.name for file in found)
        raise FileError(f"'{path}' holds {f'several: {names}' if names else 'no .skt file'}; choose one .skt file")
    return found[0]


def read(skeleton_path: Path, files: dict[str, Path]) -> PrototypeRig:
    """Everything of a rig's files, checked as a whole. Raises `FileError`."""
    mesh, cage = prototype.read_mesh(files["mesh"]), prototype.read_mesh(files["cage"])
    skeleton = prototype.read_skeleton(skeleton_path)
    vertices, joints, columns = len(mesh.vertices), len(skeleton.names), len(cage.vertices)

    def optional(name: str, reader: Callable[..., Any], *sizes: int) -> Any:
        return reader(files[name], *sizes) if name in files else None

    rig = PrototypeRig(
        skeleton_path.stem,
        mesh,
        skeleton,
        prototype.read_weights(files["weights"], vertices, joints),
        cage,
        optional("skeleton_motion", prototype.read_skeleton_motion, joints),
        optional("cage_motion", prototype.read_cage_motion, columns),
        optional("coordinates", prototype.read_coordinates, vertices, columns),
        optional("anchors", prototype.read_anchors, vertices, min(vertices, columns)),
        optional("centers", prototype.read_centers, vertices),
    )
    if rig.cage_coords is not None:
        checked(Coordinates(rig.cage_coords), rig.rest, files["coordinates"].name, rounding=SIX_DIGITS)
    return rig


def coordinates(rig: PrototypeRig, computed: Doubles | None) -> Coordinates:
    """What the files say of the coordinates; centers need those of the skin, which may be `computed`."""
    given = Coordinates(rig.cage_coords, None, None, rig.anchors)
    if rig.cage_coords is not None:
        given = checked(given, rig.rest, rig.name, rounding=SIX_DIGITS)
    coords = given.cage_coords if given.cage_coords is not None else computed
    if rig.centers is None or coords is None:
        return given
    indptr, columns, values = rig.centers
    rows = [values[a:b] @ coords[columns[a:b]] for a, b in itertools.pairwise(indptr)]
    return Coordinates(given.cage_coords, None, np.array(rows), given.anchors)
