# SPDX-License-Identifier: GPL-3.0-or-later
"""Cage keys: shapes of the rest cage over time, in Blender's own shape keys and curves.

Every shape is a shape key of the cage, and every cage key is a column of keyframes at one frame on the values of all of
them: 1 for its own shape, 0 for the others, linear in between. The values sum to 1 at every frame, and between two
neighbouring columns nothing but their two shapes is seen, whatever the order of the columns; so they can be moved,
copied and deleted as the channels of a bone are. Shape keys of the artist's own stay on top. Blender plays all of it
alone.
"""

from __future__ import annotations

import re

import bpy
import numpy as np

from .. import compat
from . import shape_keys
from .positions import Points, read_base

ENVELOPE = "Cage Envelope"
DRAFT = "Cage Draft"  # an edit that is not keyed yet
GROUP = "Cage Keys"
_SHAPE = re.compile(r"Cage Key \d+|" + ENVELOPE)
_SAME_FRAME = 1e-3


def shapes(cage: bpy.types.Object) -> list[bpy.types.ShapeKey]:
    """The shapes of the cage keys."""
    keys = cage.data.shape_keys
    return [] if keys is None else [block for block in keys.key_blocks if _SHAPE.fullmatch(block.name)]


def draft(cage: bpy.types.Object) -> bpy.types.ShapeKey | None:
    """The edit that is not keyed yet, or None."""
    keys = cage.data.shape_keys
    return None if keys is None else keys.key_blocks.get(DRAFT)


def frames(cage: bpy.types.Object) -> list[float]:
    """The frames of the cage keys, in order."""
    found = sorted(point.co.x for curve in _curves(cage).values() for point in curve.keyframe_points)
    return [frame for k, frame in enumerate(found) if k == 0 or frame - found[k - 1] > _SAME_FRAME]


def key_at(cage: bpy.types.Object, frame: float) -> bpy.types.ShapeKey | None:
    """The shape of the cage key at this frame, or None where there is none."""
    if not any(abs(key - frame) <= _SAME_FRAME for key in frames(cage)):
        return None
    curves = _curves(cage)
    values = {block: curves[block.name].evaluate(frame) for block in shapes(cage) if block.name in curves}
    return max(values, key=values.__getitem__) if values else None


def shape_at(cage: bpy.types.Object, frame: float) -> Points:
    """The rest cage as the cage keys make it at a frame, and the draft now, `#C by 3` in its own space."""
    keys = cage.data.shape_keys
    count = len(cage.data.vertices)
    if keys is None:
        return read_base(cage.data)
    base = shape_keys.read_key(keys.key_blocks[0], count)
    curves = _curves(cage)
    total = base.copy()
    for block in [*shapes(cage), draft(cage)]:
        if block is None or block.mute:
            continue
        value = curves[block.name].evaluate(frame) if block.name in curves else block.value
        total += np.float32(value) * (shape_keys.read_key(block, count) - base)
    return total


def insert(cage: bpy.types.Object, frame: float, points: Points) -> bpy.types.ShapeKey:
    """Key these points (`#C by 3`, the cage's space) at a frame. A key that is there already is replaced."""
    block = own_shape(cage, frame) or _new_shape(cage, f"Cage Key {_free_number(cage)}")
    shape_keys.write_key(block, points)
    _insert_column(cage, frame, block)
    return block


def insert_envelope(cage: bpy.types.Object, frame: float, points: Points) -> bpy.types.ShapeKey:
    """Key the un-edited cage (`points`, `#C by 3`) at a frame: all such keys share one shape."""
    keys = cage.data.shape_keys
    block = (None if keys is None else keys.key_blocks.get(ENVELOPE)) or _new_shape(cage, ENVELOPE)
    shape_keys.write_key(block, points)
    _insert_column(cage, frame, block)
    remove_unused(cage)
    return block


def own_shape(cage: bpy.types.Object, frame: float) -> bpy.types.ShapeKey | None:
    """The shape of the key at this frame as one that no other key shares, or None where there is no key.

    Keys that were copied share a shape until one of them is edited, as the keys of a bone have values of their own.
    """
    block = key_at(cage, frame)
    if block is None:
        return None
    curve = _curves(cage)[block.name]
    elsewhere = [p for p in curve.keyframe_points if p.co.y > 0.5 and abs(p.co.x - frame) > _SAME_FRAME]
    if not elsewhere and block.name != ENVELOPE:
        return block
    twin = _new_shape(cage, f"Cage Key {_free_number(cage)}")
    shape_keys.write_key(twin, shape_keys.read_key(block, len(cage.data.vertices)))
    _insert_column(cage, frame, twin)
    return twin


def remove(cage: bpy.types.Object, frame: float) -> bool:
    """Delete the key at this frame; returns whether there was one."""
    found = False
    for curve in _curves(cage).values():
        for point in [p for p in curve.keyframe_points if abs(p.co.x - frame) <= _SAME_FRAME]:
            curve.keyframe_points.remove(point)
            found = True
    remove_unused(cage)
    return found


def remove_unused(cage: bpy.types.Object) -> None:
    """Forget shapes that no key shows any more."""
    curves = _curves(cage)
    for block in shapes(cage):
        curve = curves.get(block.name)
        if curve is not None and any(point.co.y > 0.0 for point in curve.keyframe_points):
            continue
        if curve is not None:
            compat.ensure_curves(cage.data.shape_keys, "").fcurves.remove(curve)
        cage.shape_key_remove(block)


def remove_draft(cage: bpy.types.Object) -> None:
    """Throw the unkeyed edit away."""
    block = draft(cage)
    if block is not None:
        cage.shape_key_remove(block)


def takes_edits(cage: bpy.types.Object) -> bool:
    """Whether edits of the cage go to cage keys: there are some, and no key of the artist's own is active."""
    if not frames(cage) or cage.show_only_shape_key:
        return False
    active = cage.active_shape_key
    return active is None or cage.active_shape_key_index == 0 or active.name == DRAFT or active in shapes(cage)


def activate(cage: bpy.types.Object, frame: float, *, auto: bool) -> None:
    """Make the shape active that an edit at this frame belongs to.

    The key's at the frame; where there is none, a new key's (`auto`), or the draft's until the artist keys it.
    """
    block = own_shape(cage, frame)
    if block is None and auto:
        block = insert(cage, frame, shape_at(cage, frame))
        remove_draft(cage)
    block = block or draft(cage) or _new_shape(cage, DRAFT, value=1.0)
    index = cage.data.shape_keys.key_blocks.find(block.name)
    if cage.active_shape_key_index != index:
        cage.active_shape_key_index = index


def _curves(cage: bpy.types.Object) -> dict[str, bpy.types.FCurve]:
    """The curves of the shapes' values, by the shapes' names."""
    blocks = shapes(cage)
    if not blocks:
        return {}
    paths = {_path(block): block.name for block in blocks}
    return {paths[c.data_path]: c for c in compat.action_curves(cage.data.shape_keys) if c.data_path in paths}


def _path(block: bpy.types.ShapeKey) -> str:
    return f'key_blocks["{bpy.utils.escape_identifier(block.name)}"].value'


def _new_shape(cage: bpy.types.Object, name: str, *, value: float = 0.0) -> bpy.types.ShapeKey:
    if cage.data.shape_keys is None:
        cage.shape_key_add(name="Basis", from_mix=False)
    block = cage.shape_key_add(name=name, from_mix=False)
    base = block.relative_key = cage.data.shape_keys.key_blocks[0]
    shape_keys.write_key(block, shape_keys.read_key(base, len(cage.data.vertices)))  # the mesh may be another
    block.value = value
    return block


def _free_number(cage: bpy.types.Object) -> int:
    taken = {block.name for block in shapes(cage)}
    return next(number for number in range(1, len(taken) + 2) if f"Cage Key {number}" not in taken)


def _insert_column(cage: bpy.types.Object, frame: float, own: bpy.types.ShapeKey) -> None:
    """Key every shape's value at the frame, and every column on curves that lack it."""
    columns = frames(cage)
    curves = _curves(cage)
    container = compat.ensure_curves(cage.data.shape_keys, f"{cage.name} Keys")
    for block in shapes(cage):
        curve = curves.get(block.name)
        if curve is None:
            curve = compat.new_curve(container, _path(block), GROUP)
            missing = columns
        else:
            there = [point.co.x for point in curve.keyframe_points]
            missing = [column for column in columns if not any(abs(column - x) <= _SAME_FRAME for x in there)]
        values = {column: curve.evaluate(column) if len(curve.keyframe_points) else 0.0 for column in missing}
        values[frame] = float(block == own)
        for column, value in values.items():
            point = curve.keyframe_points.insert(column, value, options={"FAST"})
            point.interpolation = "LINEAR"
        curve.update()
        block.value = float(block == own)
