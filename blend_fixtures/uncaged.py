"""Characters without a cage, as Generate Cage takes them: from code, or from the files that lie beside the project."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import bpy

from .build import RigObjects, build_character
from .parts import Character

SHARED = Path(os.environ.get("CAGE_RIG_SHARED") or Path(__file__).resolve().parents[2] / "shared")
FOLDER = SHARED / "data" / "characters"
Uncaged = tuple[list[bpy.types.Object], bpy.types.Object | None]  # skins, and their armature


def built(make: Callable[[], Character]) -> Callable[[], Uncaged]:
    """What puts a character of this package into the scene."""
    return without_cage(lambda: build_character(make()))


def without_cage(build: Callable[[], RigObjects]) -> Callable[[], Uncaged]:
    def uncaged() -> Uncaged:
        found = build()
        bpy.data.objects.remove(found.cage)
        return found.skins, found.armature

    return uncaged


def beside() -> dict[str, Callable[[], Uncaged]]:
    """Those that lie beside the project, by name; none where they are not there."""
    paths = [path for kind in ("*.glb", "*.obj") for path in sorted(FOLDER.glob(kind))]
    return {path.stem: imported(path) for path in paths}


def imported(path: Path) -> Callable[[], Uncaged]:
    """As Blender's importers make it, vertices welded. Into an empty scene."""

    def uncaged() -> Uncaged:
        if path.suffix == ".obj":
            bpy.ops.wm.obj_import(filepath=str(path))
            return [obj for obj in bpy.data.objects if obj.type == "MESH"], None
        bpy.ops.import_scene.gltf(filepath=str(path), merge_vertices=True)
        skins = [obj for obj in bpy.data.objects if any(mod.type == "ARMATURE" for mod in obj.modifiers)]
        return skins, next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")

    return uncaged
