"""Who is in the gallery of generated cages: the project's characters, and those that lie beside it where they are."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
from stage import Cast

from blend_fixtures.arm import arm
from blend_fixtures.biped import biped
from blend_fixtures.build import build_character
from blend_fixtures.octopus import octopus
from blend_fixtures.parts import Character

ROOT = Path(__file__).parent.parent.parent
BESIDE = Path(os.environ.get("CAGE_RIG_SHARED") or ROOT.parent / "shared") / "data" / "characters"
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


def everyone() -> dict[str, Callable[[], Cast]]:
    found = {make.__name__: _built(make) for make in (arm, biped, octopus)}
    for path in sorted([*BESIDE.glob("*.glb"), *BESIDE.glob("*.obj")]):
        found[path.stem] = _imported(path)
    return found


def _built(make: Callable[[], Character]) -> Callable[[], Cast]:
    def build() -> Cast:
        rig = build_character(make())
        bpy.data.objects.remove(rig.cage)
        return rig.skins, rig.armature

    return build


def _imported(path: Path) -> Callable[[], Cast]:
    """By Blender's importers, vertices welded."""

    def build() -> Cast:
        if path.suffix == ".obj":
            bpy.ops.wm.obj_import(filepath=str(path))
            return [obj for obj in bpy.data.objects if obj.type == "MESH"], None
        bpy.ops.import_scene.gltf(filepath=str(path), merge_vertices=True)
        skins = [obj for obj in bpy.data.objects if any(mod.type == "ARMATURE" for mod in obj.modifiers)]
        for skin in skins:
            skin.data.materials.clear()
        return skins, next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")

    return build
