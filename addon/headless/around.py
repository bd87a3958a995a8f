# SPDX-License-Identifier: GPL-3.0-or-later
"""What commands that put a cage around the character of a .blend have in common: arguments, the character, the file."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import bpy

from .. import bake, caging
from ..bake.files import written
from .run import Refusal, open_file

DEFAULT = caging.Options()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """File, character and gap."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a .blend file")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the .blend to write")
    parser.add_argument(
        "--skin", action="append", metavar="NAME", help="a mesh to enclose, once for each; all of the armature's"
    )
    parser.add_argument("--armature", metavar="NAME", help="whose bones to follow; the skins'")
    parser.add_argument(
        "--clearance",
        type=float,
        metavar="S",
        help=f"the least gap, relative to the character's size; {DEFAULT.clearance}",
    )
    parser.add_argument(
        "--tightness", type=float, metavar="T", help=f"how strongly it is pressed to the skin; {DEFAULT.tightness}"
    )
    parser.add_argument("--asymmetric", action="store_true", help="also where the character is symmetric")
    parser.add_argument("--hull", action="store_true", help="around the skins' repaired hull")


def open_to_cage(given: argparse.Namespace) -> None:
    """Open the file in Object Mode, where another one can be written."""
    if given.out.suffix.lower() != ".blend":
        raise Refusal(f"'{given.out}' is no name of a .blend; let it end in .blend")
    if given.out.resolve() == given.file.resolve():
        raise Refusal(f"'{given.out}' is the file that is read; write to another one")
    open_file(given.file)
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


def caged(out: Path, work: Callable[[], bpy.types.Object]) -> bpy.types.Object:
    """The cage that `work` makes, and the file with it."""
    try:
        cage = work()
        with written([out]) as (draft,):
            draft.unlink()  # or Blender keeps it as an older version
            bpy.ops.wm.save_as_mainfile(filepath=str(draft.resolve()), copy=True)
    except (caging.GenerateError, bake.BakeError) as error:
        raise Refusal(str(error)) from error
    return cage


def character(
    given: argparse.Namespace, cage: bpy.types.Object | None = None
) -> tuple[bpy.types.Object | None, list[bpy.types.Object]]:
    """The armature, if there is one, and the meshes that are meant; `cage` is none of them."""
    names = given.skin or []
    bones = None if given.armature is None else named(given.armature, "ARMATURE")
    meshes = [obj for obj in bpy.context.scene.objects if obj.type == "MESH" and obj != cage and _may_be_skin(obj)]
    if names:
        skins = [named(name, "MESH") for name in names]
    else:
        skins = [obj for obj in meshes if (bones in _armatures(obj) if bones else _armatures(obj))]
        if not skins and bones is None and len(meshes) == 1:
            skins = meshes
    if not skins:
        whose = f" of armature '{bones.name}'" if bones is not None else ""
        raise Refusal(f"no skin{whose} is known in '{bpy.data.filepath}'; name it with --skin. {_list(meshes)}")
    found = sorted({found for skin in skins for found in _armatures(skin)}, key=lambda obj: obj.name)
    if bones is None and len(found) > 1:
        several = ", ".join(f"'{obj.name}'" for obj in found)
        raise Refusal(f"the skins have several armatures: {several}; choose one with --armature")
    return bones or next(iter(found), None), skins


def _list(meshes: list[bpy.types.Object]) -> str:
    several = ", ".join(f"'{obj.name}'" for obj in meshes[:10]) + (" and more" if len(meshes) > 10 else "")
    return f"Its meshes: {several}" if meshes else "It has no mesh"


def _may_be_skin(obj: bpy.types.Object) -> bool:
    is_cage = obj.cage_rig.state != "NONE" or obj.cage_rig.part == "POSED_CAGE" or len(obj.cage_rig_generated.skins) > 0
    return not is_cage and len(obj.data.polygons) > 0


def _armatures(obj: bpy.types.Object) -> list[bpy.types.Object]:
    return [mod.object for mod in obj.modifiers if mod.type == "ARMATURE" and mod.object is not None]


def named(name: str, kind: str) -> bpy.types.Object:
    """The object of the scene that is called so."""
    obj = bpy.context.scene.objects.get(name)
    if obj is None or obj.type != kind:
        what = "armature" if kind == "ARMATURE" else "mesh"
        raise Refusal(f"there is no {what} '{name}' in scene '{bpy.context.scene.name}' of '{bpy.data.filepath}'")
    return obj
