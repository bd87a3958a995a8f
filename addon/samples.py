# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample characters that the extension brings: bound, acting, with cage keys. One .blend each, made by the project."""

from __future__ import annotations

from pathlib import Path

import bpy
from mathutils import Vector

from . import registry

FOLDER = Path(__file__).parent / "sample_files"


class SampleError(Exception):
    """The sample can't be added; the message is a sentence for the artist. Nothing is changed."""


def names() -> list[str]:
    """Which samples there are."""
    return sorted(path.stem.title() for path in FOLDER.glob("*.blend"))


def add(context: bpy.types.Context, name: str) -> bpy.types.Object:
    """Append a sample to the scene at the 3D cursor; its rest cage object is returned."""
    path = FOLDER / f"{name.lower()}.blend"
    if not path.is_file():
        raise SampleError(f"There is no sample '{name}' in this installation; install the extension again")
    with bpy.data.libraries.load(str(path)) as (inside, loaded):
        loaded.collections = [found for found in inside.collections if found == name]
    (collection,) = loaded.collections
    if collection.asset_data:
        collection.asset_clear()
    context.scene.collection.children.link(collection)
    registry.forget()
    objects = collection.all_objects
    for obj in objects:
        if obj.parent is None:
            obj.matrix_world.translation += Vector(context.scene.cursor.location)
    return next(obj for obj in objects if registry.is_rig(obj))
