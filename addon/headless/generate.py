# SPDX-License-Identifier: GPL-3.0-or-later
"""Generate a cage around the character of a .blend, along its bones, and write the file with the cage in it."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import bpy
import numpy as np

from .. import caging
from . import around
from .run import Answer, Voice

NAME = "generate-cage"
HELP = "a cage from the character and its bones"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    around.add_arguments(parser)
    parser.add_argument("--placement", choices=("automatic", "joints"), default="automatic", help="of cross sections")
    parser.add_argument("--corners", type=int, metavar="N", help="of a cross section, 3 to 8; 4, or those of --like")
    parser.add_argument("--triangles", action="store_true", help="no quads")
    parser.add_argument(
        "--detail",
        type=float,
        default=around.DEFAULT.detail,
        metavar="S",
        help="limbs thinner than this, relative to the size, get no branch",
    )
    parser.add_argument(
        "--like", metavar="NAME", help="a cage of the file that was generated: take its cross sections and faces"
    )


def run(given: argparse.Namespace, voice: Voice) -> Answer:
    around.open_to_cage(given)
    armature, skins = around.character(given)
    like = None if given.like is None else around.named(given.like, "MESH")
    begun = time.perf_counter()
    said: list[str] = []

    def work() -> bpy.types.Object:
        options = _options(given)
        if like is not None and given.corners is None:
            options = replace(options, corners=caging.corners_of(like))
        return caging.generate_cage(
            bpy.context,
            skins,
            armature,
            options,
            like=like,
            tell=said.append,
            watch=lambda job: voice.progress(job.share, f"generating, {job.stage}:"),
        )

    cage = around.caged(given.out, work)
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


def _options(given: argparse.Namespace) -> caging.Options:
    default = around.DEFAULT
    return caging.Options(
        placement=given.placement.upper(),
        corners=given.corners or default.corners,
        triangles=given.triangles,
        clearance=default.clearance if given.clearance is None else given.clearance,
        tightness=default.tightness if given.tightness is None else given.tightness,
        detail=given.detail,
        symmetry=not given.asymmetric,
        hull=given.hull,
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
