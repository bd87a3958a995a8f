# SPDX-License-Identifier: GPL-3.0-or-later
"""Generate a cage around the character of a .blend, along its bones, and write the file with the cage in it."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from .. import bake, caging
from ..bake.files import written
from .run import Answer, Refusal, Voice, open_file

NAME = "generate-cage"
HELP = "a cage from the character and its bones"
DEFAULT = caging.Options()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="a .blend file")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the .blend to write")
    parser.add_argument(
        "--skin", action="append", metavar="NAME", help="a mesh to enclose, once for each; all of the armature's"
    )
    parser.add_argument("--armature", metavar="NAME", help="whose bones to follow; the skins'")
    parser.add_argument("--placement", choices=("automatic", "joints"), default="automatic", help="of cross sections")
    parser.add_argument("--corners", type=int, metavar="N", help="of a cross section, 3 to 8; 4, or those of --like")
    parser.add_argument("--triangles", action="store_true", help="no quads")
    parser.add_argument(
        "--clearance",
        type=float,
        default=DEFAULT.clearance,
        metavar="S",
        help=f"the least gap, relative to the character's size; {DEFAULT.clearance}",
    )
    parser.add_argument(
        "--tightness",
        type=float,
        default=DEFAULT.tightness,
        metavar="T",
        help=f"how strongly it is pressed to the skin; {DEFAULT.tightness}",
    )
    parser.add_argument(
        "--detail",
        type=float,
        default=DEFAULT.detail,
        metavar="S",
        help="limbs thinner than this, relative to the size, get no branch",
    )
    parser.add_argument("--asymmetric", action="store_true", help="also where the character is symmetric")
    parser.add_argument(
        "--like", metavar="NAME", help="a cage of the file that was generated: take its cross sections and faces"
    )
    parser.add_argument("--hull", action="store_true", help="around the skins' repaired hull")


def run(given: argparse.Namespace, voice: Voice) -> Answer:
    if given.out.suffix.lower() != ".blend":
        raise Refusal(f"'{given.out}' is no name of a .blend; let it end in .blend")
    if given.out.resolve() == given.file.resolve():
        raise Refusal(f"'{given.out}' is the file that is read; write to another one")
    options = caging.Options(
        placement=given.placement.upper(),
        corners=given.corners or DEFAULT.corners,
        triangles=given.triangles,
        clearance=given.clearance,
        tightness=given.tightness,
        detail=given.detail,
        symmetry=not given.asymmetric,
        hull=given.hull,
    )
    open_file(given.file)
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    armature, skins = _character(given.skin or [], given.armature)
    begun = time.perf_counter()
    said: list[str] = []
    like = None if given.like is None else _named(given.like, "MESH")
    try:
        if like is not None and given.corners is None:
            options = replace(options, corners=caging.corners_of(like))
        cage = caging.generate_cage(
            bpy.context,
            skins,
            armature,
            options,
            like=like,
            tell=said.append,
            watch=lambda job: voice.progress(job.share, f"generating, {job.stage}:"),
        )
        with written([given.out]) as (draft,):
            draft.unlink()  # or Blender keeps it as an older version
            bpy.ops.wm.save_as_mainfile(filepath=str(draft.resolve()), copy=True)
    except (caging.GenerateError, bake.BakeError) as error:
        raise Refusal(str(error)) from error
    voice.say(f"{given.out}: {said[0]}")
    return Answer(
        ok=True,
        file=str(given.file),
        out=str(given.out),
        armature=None if armature is None else armature.name,
        skins=[skin.name for skin in skins],
        seconds=time.perf_counter() - begun,
        **_of_cage(cage),
        summary=said[0],
    )


def _of_cage(cage: bpy.types.Object) -> dict[str, object]:
    """The cage in numbers."""
    sizes = np.bincount([len(face.vertices) for face in cage.data.polygons], minlength=5)
    sections = {item.value for item in cage.data.attributes[caging.SECTION].data}
    return {
        "cage": cage.name,
        "vertices": len(cage.data.vertices),
        "quads": int(sizes[4]),
        "triangles": int(sizes[3]),
        "sections": len(sections),
    }


def _character(names: list[str], armature: str | None) -> tuple[bpy.types.Object | None, list[bpy.types.Object]]:
    """The armature, if there is one, and the meshes that are meant."""
    bones = None if armature is None else _named(armature, "ARMATURE")
    meshes = [obj for obj in bpy.context.scene.objects if obj.type == "MESH" and _may_be_skin(obj)]
    if names:
        skins = [_named(name, "MESH") for name in names]
    else:
        skins = [obj for obj in meshes if (bones in _armatures(obj) if bones else _armatures(obj))]
        if not skins and bones is None and len(meshes) == 1:
            skins = meshes
    if not skins:
        whose = f" of armature '{bones.name}'" if bones is not None else ""
        raise Refusal(f"no skin{whose} is known in '{bpy.data.filepath}'; name it with --skin. {_list(meshes)}")
    found = sorted({found for skin in skins for found in _armatures(skin)}, key=lambda obj: obj.name)
    if bones is None and len(found) > 1:
        named = ", ".join(f"'{obj.name}'" for obj in found)
        raise Refusal(f"the skins have several armatures: {named}; choose one with --armature")
    return bones or next(iter(found), None), skins


def _list(meshes: list[bpy.types.Object]) -> str:
    named = ", ".join(f"'{obj.name}'" for obj in meshes[:10]) + (" and more" if len(meshes) > 10 else "")
    return f"Its meshes: {named}" if meshes else "It has no mesh"


def _may_be_skin(obj: bpy.types.Object) -> bool:
    is_cage = obj.cage_rig.state != "NONE" or obj.cage_rig.part == "POSED_CAGE" or len(obj.cage_rig_generated.skins) > 0
    return not is_cage and len(obj.data.polygons) > 0


def _armatures(obj: bpy.types.Object) -> list[bpy.types.Object]:
    return [mod.object for mod in obj.modifiers if mod.type == "ARMATURE" and mod.object is not None]


def _named(name: str, kind: str) -> bpy.types.Object:
    obj = bpy.context.scene.objects.get(name)
    if obj is None or obj.type != kind:
        what = "armature" if kind == "ARMATURE" else "mesh"
        raise Refusal(f"there is no {what} '{name}' in scene '{bpy.context.scene.name}' of '{bpy.data.filepath}'")
    return obj
