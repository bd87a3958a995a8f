# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake the rigs of a .blend to files that need no add-on: one a rig, named as its cage."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import bpy

from .. import bake
from ..bake import mesh_cache, native_rig, scenes, shape_keys
from .run import Answer, Refusal, Voice, folder, frames, open_file, rigs

NAME = "bake"
HELP = "to Alembic, USD, point caches, shape keys or a native rig"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="a .blend file")
    parser.add_argument("--to", required=True, choices=TARGETS, help="what to write")
    parser.add_argument("--frames", metavar="A-B", help="both included; the scene's")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="the folder to write into")
    parser.add_argument("--rig", metavar="NAME", help="only the rig of this rest cage")
    parser.add_argument("--samples", type=int, default=1, help="times a frame, of abc, pc2 and native")


def run(given: argparse.Namespace, voice: Voice) -> Answer:
    open_file(given.file)
    start, end = frames(given.frames)
    cages = rigs(given.rig)
    out = folder(given.out).resolve()
    suffix, new_steps = TARGETS[given.to]
    made = []
    for cage in cages:
        target = out / f"{bpy.path.clean_name(cage.name)}{suffix}"
        steps = new_steps(cage, target, start, end, given.samples)
        try:
            result = bake.run(steps, lambda share, name=cage.name: voice.progress(share, f"baking '{name}'"))
        except bake.BakeError as error:
            raise Refusal(str(error)) from error
        written = _files(result, target)
        made.append({"rig": cage.name, "files": [str(file) for file in written], "frames": [start, end]})
        voice.say(f"{cage.name}: {', '.join(map(str, written))}")
    return Answer(ok=True, file=str(given.file), baked=made)


def _files(result: Any, target: Path) -> list[Path]:
    """The files of a bake; of one that makes objects, a .blend with nothing else in it."""
    if hasattr(result, "files"):
        return result.files
    if hasattr(result, "file"):
        return [result.file]
    bpy.data.libraries.write(str(target), {result.collection}, fake_user=True)
    return [target]


def _alembic(cage: bpy.types.Object, path: Path, start: int, end: int, samples: int) -> bake.Steps[Any]:
    return scenes.alembic_steps(cage, str(path), start, end, samples=samples, subdivide=False, result=False)


def _usd(cage: bpy.types.Object, path: Path, start: int, end: int, _samples: int) -> bake.Steps[Any]:
    return scenes.usd_steps(cage, str(path), start, end, subdivide=False, result=False)


def _mesh_cache(cage: bpy.types.Object, path: Path, start: int, end: int, samples: int) -> bake.Steps[Any]:
    return mesh_cache.steps(cage, str(path), start, end, samples=samples, result=False)


def _shape_keys(cage: bpy.types.Object, _path: Path, start: int, end: int, _samples: int) -> bake.Steps[Any]:
    return shape_keys.steps(cage, start, end, step=1)


def _native_rig(cage: bpy.types.Object, _path: Path, start: int, end: int, samples: int) -> bake.Steps[Any]:
    return native_rig.steps(cage, start, end, samples=samples, keep_action=False)


TARGETS = {
    "abc": (".abc", _alembic),
    "usd": (".usdc", _usd),
    "pc2": (".pc2", _mesh_cache),
    "shapekeys": (".blend", _shape_keys),
    "native": (".blend", _native_rig),
}
