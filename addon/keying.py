# SPDX-License-Identifier: GPL-3.0-or-later
"""Key Cage: keys of a rig's rest cage beside any action, for operators and scripts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from . import binding, linked, registry, sync
from .adapters import cage_keys, positions


class KeyingError(Exception):
    """There is nothing to key or delete; the message is a sentence for the artist. Nothing was changed."""


def frames(cage: bpy.types.Object) -> list[float]:
    """The frames at which the rest cage is keyed, in order."""
    return cage_keys.frames(cage)


def has_draft(cage: bpy.types.Object) -> bool:
    """Whether there is an edit that is not keyed yet."""
    return cage_keys.draft(cage) is not None


def key(context: bpy.types.Context, cage: bpy.types.Object) -> float:
    """Key the rest cage as it is now at the present frame, which is returned; an unkeyed edit becomes part of it.

    Between keys, cage vertices move linearly. Shape keys of the artist's own stay on top. Any mode.
    """
    frame = context.scene.frame_current_final
    with _editable(context, cage):
        block = cage_keys.insert(cage, frame, cage_keys.shape_at(cage, frame))
        cage_keys.remove_draft(cage)
        _show(context, cage, block)
    return frame


def key_envelope(context: bpy.types.Context, cage: bpy.types.Object) -> float:
    """Key the cage as it was bound at the present frame, which is returned; an unkeyed edit is thrown away."""
    frame = context.scene.frame_current_final
    to_rig = np.array(cage.cage_rig.cage_to_rig, np.float64)
    points = positions.apply_matrix(np.linalg.inv(to_rig), binding.rest_points(cage.cage_rig, cage.cage_rig.snapshot))
    with _editable(context, cage):
        block = cage_keys.insert_envelope(cage, frame, points)
        cage_keys.remove_draft(cage)
        _show(context, cage, block)
    return frame


def delete(context: bpy.types.Context, cage: bpy.types.Object) -> float:
    """Delete the key at the present frame, which is returned. Raises `KeyingError` where there is none."""
    frame = context.scene.frame_current_final
    if cage_keys.key_at(cage, frame) is None:
        raise KeyingError(f"'{cage.name}' has no cage key at frame {frame:g}")
    with _editable(context, cage):
        cage_keys.remove(cage, frame)
        _refresh(context, cage)
    return frame


def discard_draft(context: bpy.types.Context, cage: bpy.types.Object) -> None:
    """Throw the unkeyed edit away. Raises `KeyingError` where there is none."""
    if not has_draft(cage):
        raise KeyingError(f"'{cage.name}' has no unkeyed edit")
    with _editable(context, cage):
        cage_keys.remove_draft(cage)
        _refresh(context, cage)


def neighbour(cage: bpy.types.Object, frame: float, *, forward: bool) -> float | None:
    """The frame of the next or previous key, or None where there is none."""
    known = frames(cage)
    ahead = [key for key in known if key > frame + 1e-3] if forward else [key for key in known if key < frame - 1e-3]
    return (ahead[0] if forward else ahead[-1]) if ahead else None


@contextmanager
def _editable(context: bpy.types.Context, cage: bpy.types.Object) -> Iterator[None]:
    """The cage with a mesh of this file and out of its Edit Mode."""
    linked.own_mesh(cage)
    editing = cage.data.is_editmode
    if editing:
        _set_mode(context, cage, "OBJECT")
    try:
        yield
    finally:
        registry.forget()
        if editing:
            _set_mode(context, cage, "EDIT")


def _set_mode(context: bpy.types.Context, cage: bpy.types.Object, mode: str) -> None:
    with context.temp_override(active_object=cage, object=cage):
        bpy.ops.object.mode_set(mode=mode)


def _show(context: bpy.types.Context, cage: bpy.types.Object, block: bpy.types.ShapeKey) -> None:
    cage.active_shape_key_index = cage.data.shape_keys.key_blocks.find(block.name)
    _refresh(context, cage)


def _refresh(context: bpy.types.Context, cage: bpy.types.Object) -> None:
    """Let Blender evaluate the curves anew at this frame."""
    if cage.data.shape_keys is not None:
        cage.data.shape_keys.update_tag(refresh={"TIME"})
    cage.data.update_tag()
    context.view_layer.update()
    sync.refresh(cage, context.evaluated_depsgraph_get())
