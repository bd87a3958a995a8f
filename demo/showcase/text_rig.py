"""A rig of text files, the format of [CTL*20]'s prototype, through the add-on's importer."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from blend_fixtures.build import RigObjects
from blend_fixtures.materials import material

from .figures import Array


def load_text_rig(path: Path) -> tuple[RigObjects, int, str]:
    """The rig with both animations keyed; a frame that shows its pose, and the shape key of its strongest cage edit.

    Raises ValueError with what the files lack.
    """
    try:
        bpy.ops.cage_rig.import_rig(filepath=str(path), bind=False)
    except RuntimeError as error:
        raise ValueError(str(error).removeprefix("Error: ").strip()) from error
    cage, scene = bpy.context.object, bpy.context.scene
    armature = cage.parent
    skin = next(child for child in armature.children if child != cage)
    skin.data.materials.append(material("Clay"))
    bpy.ops.object.select_all(action="DESELECT")
    return RigObjects([skin], armature, cage), (scene.frame_start + scene.frame_end) // 2, _strongest(cage)


def _strongest(cage: bpy.types.Object) -> str:
    """The shape key that moves the cage farthest; none: an empty name."""
    keys = cage.data.shape_keys
    if keys is None:
        return ""
    rest, *moved = (_points(block) for block in keys.key_blocks)
    reach = [float(np.abs(points - rest).max()) for points in moved]
    return keys.key_blocks[1 + int(np.argmax(reach))].name


def _points(block: bpy.types.ShapeKey) -> Array:
    points = np.empty(3 * len(block.data), np.float32)
    block.data.foreach_get("co", points)
    return points
