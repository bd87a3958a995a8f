"""A plain doll in several levels of detail: a trunk with a head, arms and legs, symmetric in x; nothing to be bound."""

from __future__ import annotations

from .fields import chain, mirrored, union
from .parts import Bone, Character, Part, Skin
from .skin_weights import part_weights
from .small import octahedron_cage
from .surface_nets import mesh_field, symmetrise

_ARM = ((0.0, 0.0, 0.72), (0.42, 0.02, 0.68), (0.80, -0.05, 0.60))
_LEG = ((0.0, 0.0, 0.14), (0.20, -0.02, -0.34), (0.24, 0.02, -0.80))
_SPINE = ((0.0, 0.0, 0.14), (0.0, 0.0, 0.72), (0.0, -0.02, 1.10))


_TAIL = ((0.0, 0.02, 0.45), (0.0, 0.30, 0.50))


def doll(*, cell: float = 0.06, legs_first: bool = False, tail: bool = False) -> Character:
    """The doll in quads of about `cell` metres, which are not flat; `legs_first`: with its bones in another order."""
    arm = chain(((0.15, 0.0, 0.71), *_ARM[1:]), (0.12, 0.10, 0.08), 0.02)
    leg = chain(((0.10, 0.0, 0.05), *_LEG[1:]), (0.16, 0.12, 0.09), 0.02)
    trunk = chain((*_SPINE[:2], (0.0, 0.0, 0.86)), (0.22, 0.20, 0.10), 0.05)
    head = chain(((0.0, -0.02, 1.0), (0.0, -0.02, 1.08)), (0.17, 0.17), 0.02)
    more = [chain(_TAIL, (0.08, 0.07))] if tail else []
    field = union([trunk, head, mirrored(arm), mirrored(leg), *more], 0.06)
    vertices, faces = mesh_field(field, (-1.0, -0.45, -1.0), (1.0, 0.45, 1.35), cell=cell)
    bones = [*_bones(legs_first), *([Bone("tail", *_TAIL, "spine")] if tail else [])]
    part = Part("doll", symmetrise(vertices), faces, "Doll", tuple(bone.name for bone in bones))
    skin = Skin("Doll", part.vertices, faces, part_weights(part, bones))
    return Character("Doll", [skin], bones, octahedron_cage((0.0, 0.0, 0.2), 3.0))


def _bones(legs_first: bool) -> list[Bone]:
    spine = [Bone("spine", _SPINE[0], _SPINE[1]), Bone("head", _SPINE[1], _SPINE[2], "spine", connected=True)]
    limbs = (("leg", _LEG), ("arm", _ARM)) if legs_first else (("arm", _ARM), ("leg", _LEG))
    sides = ((".R", -1.0), (".L", 1.0)) if legs_first else ((".L", 1.0), (".R", -1.0))
    for name, line in limbs:
        for side, sign in sides:
            root, middle, tip = [(sign * x, y, z) for x, y, z in line]
            spine.append(Bone(f"upper_{name}{side}", root, middle, "spine"))
            spine.append(Bone(f"lower_{name}{side}", middle, tip, f"upper_{name}{side}", connected=True))
    return spine
