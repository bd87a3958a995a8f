# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys: moving a mesh by its active key, and the offsets that the keys of a skin add."""

from __future__ import annotations

import bpy
import numpy as np

from .positions import Points, read_base, write_base
from .vertex_groups import read_group

SMALLEST_VALUE = 1e-3


class KeyRefusal(Exception):
    """The active shape key can't take the edit; the message is a sentence for the artist."""


def read_key(block: bpy.types.ShapeKey, count: int) -> Points:
    """Coordinates of a key block, `#V by 3`."""
    points = np.empty((count, 3), np.float32)
    block.points.foreach_get("co", points.ravel())
    return points


def write_key(block: bpy.types.ShapeKey, points: Points) -> None:
    """Write the coordinates of a key block."""
    block.points.foreach_set("co", np.ascontiguousarray(points, np.float32).ravel())


def key_share(obj: bpy.types.Object) -> float:
    """How much of a change of the active key reaches the mesh. Raises `KeyRefusal` where it is nothing.

    1 without keys or with the base key active; the key's value for another key.
    """
    if obj.data.shape_keys is None or obj.active_shape_key_index <= 0:
        return 1.0
    block = obj.active_shape_key
    if obj.show_only_shape_key:
        return 1.0
    if not obj.data.shape_keys.use_relative:
        raise KeyRefusal(f"'{obj.name}' has absolute shape keys; make them relative to edit the posed cage")
    if block.mute:
        raise KeyRefusal(f"Shape key '{block.name}' of '{obj.name}' is muted; unmute it or choose another")
    if block.vertex_group:
        raise KeyRefusal(
            f"Shape key '{block.name}' of '{obj.name}' is masked by vertex group '{block.vertex_group}'; "
            "clear the mask or choose another key"
        )
    if abs(block.value) < SMALLEST_VALUE:
        raise KeyRefusal(
            f"Shape key '{block.name}' of '{obj.name}' has value {block.value:.3g}, so an edit of the posed cage "
            "can't show; raise its value or choose another key"
        )
    return block.value


def move(obj: bpy.types.Object, delta: Points) -> None:
    """Move the evaluated vertices by `delta` (`#V by 3`, object space): through the active key, else the base.

    Not in Edit Mode. Raises `KeyRefusal` and changes nothing where the active key can't do it.
    """
    mesh, share = obj.data, key_share(obj)
    count = len(mesh.vertices)
    keys = mesh.shape_keys
    if keys is None:
        write_base(mesh, read_base(mesh) + delta)
        return
    if obj.active_shape_key_index > 0:
        block = obj.active_shape_key
        write_key(block, read_key(block, count) + delta / np.float32(share))
    else:
        for block in keys.key_blocks:
            write_key(block, read_key(block, count) + delta)
        write_base(mesh, read_key(keys.key_blocks[0], count))  # what a rebind reads, and Blender makes new keys of
    mesh.update()
    mesh.update_tag()


def offsets(obj: bpy.types.Object, keys: bpy.types.Key, count: int) -> Points | None:
    """What relative keys add to the base, `#V by 3` in object space; None where they add nothing.

    `keys` is the (evaluated) key datablock, so that driven and animated values count; `obj` the original object,
    whose vertex groups mask keys. With "Shape Key Lock" the active key counts alone and fully, as Blender shows it.
    """
    if not keys.use_relative:
        return None
    total: Points | None = None
    for index, block in enumerate(keys.key_blocks):
        value = (
            float(index == obj.active_shape_key_index) if obj.show_only_shape_key else block.value * (not block.mute)
        )
        if index == 0 or value == 0.0 or len(block.points) != count:
            continue
        delta = (read_key(block, count) - read_key(block.relative_key, count)) * np.float32(value)
        if block.vertex_group:
            delta *= read_group(obj, block.vertex_group)[:, None]
        total = delta if total is None else total + delta
    return total


def is_animated(obj: bpy.types.Object) -> bool:
    """Whether the mesh of `obj` changes over time: keyed or driven shape keys or mesh, or a modifier at work."""
    owners = (obj.data, obj.data.shape_keys)
    animated = [owner.animation_data for owner in owners if owner is not None and owner.animation_data is not None]
    if any(data.action is not None or len(data.drivers) or len(data.nla_tracks) for data in animated):
        return True
    return any(modifier.show_viewport or modifier.show_render for modifier in obj.modifiers)
