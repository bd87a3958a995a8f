"""The biped: a stylised walker in two meshes (body and outfit), 47 bones, smooth weights, and its cage."""

from __future__ import annotations

from .biped_cage import biped_cage, fat_cage, short_cage
from .biped_shape import body_parts, outfit_parts
from .biped_skeleton import biped_bones
from .parts import Character, Part, Skin, join_parts
from .skin_weights import part_weights

# Against an arm; without it the arms would pull at the sides of the hoodie.
_TRUNK_GIRTH = {"hips": 2.2, "spine.001": 2.2, "spine.002": 2.2, "chest": 1.8}


def biped() -> Character:
    """The whole character, about 24,000 vertices, 1.89 tall with its pompom, facing −Y, feet on z = 0."""
    bones = biped_bones()

    def skin(name: str, parts: list[Part]) -> Skin:
        return join_parts(name, parts, [part_weights(part, bones, girth=_girth(part)) for part in parts])

    cage = biped_cage()
    skins = [skin("Body", body_parts()), skin("Outfit", outfit_parts())]
    return Character("Biped", skins, bones, cage, {"Fat": fat_cage(cage), "Short": short_cage(cage)})


def _girth(part: Part) -> dict[str, float]:
    return _TRUNK_GIRTH if part.name == "hoodie" else {}
