"""Who is in the gallery of generated cages: the project's characters, and those that lie beside it where they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from blend_fixtures import uncaged
from blend_fixtures.arm import arm
from blend_fixtures.biped import biped
from blend_fixtures.octopus import octopus
from blend_fixtures.uncaged import Uncaged

ROUND = (30.0, 25.0)
LOOKS = {  # degrees around the character, and from above; from the front where nothing is said
    "octopus": ROUND,
    "proc_octopus_20k_66b": ROUND,
    "proc_airplane": (35.0, 30.0),
    "fox_576_24b": (55.0, 10.0),
    "spot_unrigged": (220.0, 10.0),
    "blub_unrigged": (240.0, 10.0),
}


@dataclass(frozen=True)
class Bend:
    """How a character shows its cage at work, in its armature's space."""

    forearms: tuple[str, ...]
    belly: tuple[str, ...]  # how the names of its bones begin
    fat: tuple[float, float, float]  # along the axes


BENDS = {  # by the picture's name
    "generate_bend": Bend(("forearm.L", "forearm.R"), ("spine", "chest", "hips"), (1.35, 1.5, 1.0)),
    "cage_human_24k_52b_at_work": Bend(
        ("mixamorig:LeftForeArm", "mixamorig:RightForeArm"), ("mixamorig:Spine", "mixamorig:Hips"), (1.3, 1.5, 1.0)
    ),
}


def everyone() -> dict[str, Callable[[], Uncaged]]:
    found = {make.__name__: uncaged.built(make) for make in (arm, biped, octopus)}
    return found | {name: _in_grey(build) for name, build in sorted(uncaged.beside().items())}


def _in_grey(build: Callable[[], Uncaged]) -> Callable[[], Uncaged]:
    """Without the materials that the file has."""

    def made() -> Uncaged:
        skins, armature = build()
        for skin in skins:
            skin.data.materials.clear()
        return skins, armature

    return made
