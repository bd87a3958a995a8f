# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of the posed cage: whether a change of it is one, and the move of the rest cage that it asks for."""

from __future__ import annotations

import bpy
import numpy as np

from . import linked, registry
from .adapters import cage_keys, positions, shape_keys, stack
from .running import Event, Matrix, Points, Running
from .session import SessionCrash, SessionError


def is_edit(cage: bpy.types.Object, event: Event, rest_changed: bool) -> bool:
    """Whether a changed posed cage is the artist's edit, and not what a pose, a key or an undo made of it.

    In Edit Mode its edit mesh is the truth, undo included, unless the rest cage is the one in the artist's hands. In
    Sculpt Mode an undo restores that mesh alone too.
    """
    if event is Event.FRAME:
        return False
    if not cage.cage_rig.posed_cage.data.is_editmode:
        if event is Event.RESTORED:
            return cage.cage_rig.posed_cage.mode == "SCULPT"
        return not rest_changed
    if event is Event.RESTORED:
        return True
    return not (rest_changed and cage.data.is_editmode and bpy.context.view_layer.objects.active == cage)


def take(cage: bpy.types.Object, running: Running, posed: Points) -> str:
    """The artist moved the posed cage: move the rest cage so that it goes there, or say why that can't be."""
    if positions.close(posed, running.session.posed_cage(), 1e-6 * running.session.size):
        return ""
    keyed = not cage.data.is_editmode and cage_keys.takes_edits(cage)
    try:
        if not cage.data.is_editmode:
            if not keyed:
                shape_keys.key_share(cage)
            _refuse_deformed_cage(cage)
        wanted = running.session.edit_posed_cage(posed)
    except (shape_keys.KeyRefusal, SessionError) as error:
        if isinstance(error, SessionCrash):
            raise
        running.posed = None
        return str(error)
    before = running.wanted()
    _move_rest_cage(cage, before, wanted)
    running.cage_wanted = wanted.astype(np.float32)
    return ""


def recall(cage: bpy.types.Object, running: Running, rest: Points, posed: Points) -> str:
    """After an undo in Edit Mode of the posed cage: back to the `rest` that its edit mesh remembers.

    Where the vertices are not at the remembered `posed`, the step was saved after a move and before it was synced: the
    move is made again.
    """
    move = running.posed - posed
    if not positions.close(running.posed, posed, 1e-6 * running.session.size):
        return take(cage, running, running.session.posed_cage() + move)
    if not positions.close(rest, running.cage, 1e-6 * running.session.size):
        try:
            _move_rest_cage(cage, running.cage, rest)
        except shape_keys.KeyRefusal as error:
            running.posed = None
            return str(error)
    running.cage_wanted = rest
    return ""


def _choose_key(cage: bpy.types.Object) -> None:
    """Where the rest cage is keyed, an edit belongs to the key at this frame, or waits to be keyed."""
    if cage_keys.takes_edits(cage):
        scene = bpy.context.scene
        auto = scene.tool_settings.use_keyframe_insert_auto
        cage_keys.activate(cage, scene.frame_current_final, auto=auto)


def _refuse_deformed_cage(cage: bpy.types.Object) -> None:
    suspended = stack.suspended_names(cage)
    for mod in cage.modifiers:
        if mod.show_viewport and mod.name not in suspended:
            raise shape_keys.KeyRefusal(
                f"Modifier '{mod.name}' of '{cage.name}' deforms the rest cage, so the posed cage can't be edited; "
                "switch it off in the viewport or apply it"
            )


def _move_rest_cage(cage: bpy.types.Object, before: Points, wanted: Matrix) -> None:
    if linked.own_mesh(cage):
        registry.forget()
    from_rig = np.linalg.inv(np.array(cage.cage_rig.cage_to_rig, np.float64))
    if cage.data.is_editmode:
        positions.write_edit_mesh(cage.data, positions.apply_matrix(from_rig, wanted))
    else:
        _choose_key(cage)
        delta = (wanted - before) @ from_rig[:3, :3].T
        shape_keys.move(cage, delta.astype(np.float32))
