"""Geometry records passed between the modules: a part of a skin, a whole skin, a cage, a skeleton.

Numpy arrays, metres, z up.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Part:
    """One closed piece of a skin. `vertices` #V by 3; `faces` #F by 4 quads; `bones`: the names that may move it."""

    name: str
    vertices: Array
    faces: Array
    material: str
    bones: tuple[str, ...]


@dataclass(frozen=True)
class Skin:
    """A mesh with weights.

    `faces` #F by 4 (or 3); `face_materials` #F into `materials`; `weights` #V by #J, rows sum to 1.
    """

    name: str
    vertices: Array
    faces: Array
    weights: Array
    materials: tuple[str, ...] = ()
    face_materials: Array | None = None


@dataclass(frozen=True)
class Cage:
    """A closed cage. `vertices` #C by 3; `faces`: vertex lists (triangles and quads), outward."""

    vertices: Array
    faces: list[list[int]]


@dataclass(frozen=True)
class Bone:
    """One bone: `head` and `tail` in metres; `connected`: drawn from the parent's tail."""

    name: str
    head: tuple[float, float, float]
    tail: tuple[float, float, float]
    parent: str | None = None
    connected: bool = False
    deform: bool = True


@dataclass(frozen=True)
class Character:
    """Skins, bones and cage of one character; column j of each skin's weights belongs to `bones[j]`."""

    name: str
    skins: list[Skin]
    bones: list[Bone]
    cage: Cage
    shape_keys: dict[str, Array] = field(default_factory=dict)

    @property
    def bone_names(self) -> list[str]:
        return [bone.name for bone in self.bones]


def mirror_part(part: Part, name: str) -> Part:
    """The mirror image of `part` in x, `.L` bones turned into `.R`."""
    bones = tuple(bone[:-2] + ".R" if bone.endswith(".L") else bone for bone in part.bones)
    return Part(name, part.vertices * [-1.0, 1.0, 1.0], part.faces[:, ::-1], part.material, bones)


def join_parts(name: str, parts: list[Part], weights: list[Array]) -> Skin:
    """One skin from `parts` and the `weights` (#V by #J) of each."""
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    materials = tuple(dict.fromkeys(part.material for part in parts))
    return Skin(
        name=name,
        vertices=np.concatenate([part.vertices for part in parts]),
        faces=np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)]),
        weights=np.concatenate(weights),
        materials=materials,
        face_materials=np.concatenate([np.full(len(part.faces), materials.index(part.material)) for part in parts]),
    )
