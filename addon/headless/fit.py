# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit a rough cage of a .blend around its character, and write the file with it: its vertices move, all else stays."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import bpy

from .. import caging
from . import around
from .run import Answer, Refusal, Voice

NAME = "fit-cage"
HELP = "a rough cage drawn around the character"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    around.add_arguments(parser)
    parser.add_argument("--cage", required=True, metavar="NAME", help="the rough cage, a mesh of the file")


def run(given: argparse.Namespace, voice: Voice) -> Answer:
    around.open_to_cage(given)
    cage = around.named(given.cage, "MESH")
    armature, skins = around.character(given, cage)
    if cage in skins:
        raise Refusal(f"'{cage.name}' can't be fitted around itself; name the skins with --skin")
    begun = time.perf_counter()
    said: list[str] = []

    def work() -> bpy.types.Object:
        return caging.fit_cage(
            bpy.context,
            cage,
            skins,
            armature,
            _options(given, cage),
            tell=said.append,
            watch=lambda job: voice.progress(job.share, f"fitting, {job.stage}:"),
        )

    around.caged(given.out, work)
    voice.say(f"{given.out}: {said[0]}")
    return Answer(
        ok=True,
        file=str(given.file),
        out=str(given.out),
        cage=cage.name,
        vertices=len(cage.data.vertices),
        armature=None if armature is None else armature.name,
        skins=[skin.name for skin in skins],
        seconds=time.perf_counter() - begun,
        summary=said[0],
    )


def _options(given: argparse.Namespace, cage: bpy.types.Object) -> caging.Options:
    """What is given; else as the cage was generated."""
    before = caging.options_of(cage)
    return replace(
        before,
        clearance=before.clearance if given.clearance is None else given.clearance,
        tightness=before.tightness if given.tightness is None else given.tightness,
        symmetry=before.symmetry and not given.asymmetric,
        hull=before.hull or given.hull,
    )
