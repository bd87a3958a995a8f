# SPDX-License-Identifier: GPL-3.0-or-later
"""What a rig shows, written where it differs from what is there: skins, posed cage, refit bones."""

from __future__ import annotations

import bpy

from . import binding, health, skins
from .adapters import armature, positions
from .running import Running
from .session import Session


def write(cage: bpy.types.Object, running: Running, depsgraph: bpy.types.Depsgraph) -> None:
    """After a session was played: its points into skins, posed cage and refit bones. A posed cage that nobody sees is
    not fitted, and `running` is `stale` then.
    """
    settings = cage.cage_rig
    live = health.live_skins(cage)
    skins.write(live, cage, running.session, depsgraph, running.written, running.places)
    posed = settings.posed_cage
    running.stale = not is_seen(posed, depsgraph)
    if not running.stale:
        write_posed_cage(running, posed)
    _write_refit(running, settings.refit_armature)


def is_seen(posed: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether anybody sees the posed cage, or has it in hand: a hidden one is not fitted."""
    if posed.data.is_editmode:
        return True
    if depsgraph.mode == "RENDER":
        return not posed.hide_render
    return posed.visible_get(view_layer=depsgraph.view_layer)


def write_posed_cage(running: Running, posed: bpy.types.Object) -> None:
    """Write C′ where it differs from what the mesh holds. What the artist holds in Edit Mode is left alone, and an edit
    mesh remembers.
    """
    _write_fitted(running, posed)
    _remember(running, posed)


def _write_fitted(running: Running, posed: bpy.types.Object) -> None:
    points, editing = running.session.posed_cage(), posed.data.is_editmode
    if running.posed is not None:
        tolerance = 1e-6 * running.session.size
        same = positions.close(points, running.posed, tolerance) if editing else positions.same(points, running.posed)
        if same:
            return
    write = positions.write_edit_mesh if editing else positions.write_base
    write(posed.data, points)
    running.posed = points


def _remember(running: Running, posed: bpy.types.Object) -> None:
    if not posed.data.is_editmode:
        running.memory = b""
        return
    rest = running.wanted()
    memory = rest.tobytes() + running.posed.tobytes()
    if memory != running.memory:
        positions.write_edit_layers(posed.data, dict(zip(binding.MEMORY, (rest, running.posed), strict=True)))
        running.memory = memory


def is_refit(refit: bpy.types.Object | None, session: Session) -> bool:
    """Whether the refit armature is there to be posed."""
    return refit is not None and refit.mode != "EDIT" and len(refit.data.bones) == len(session.snapshot.heads)


def _write_refit(running: Running, refit: bpy.types.Object | None) -> None:
    if not is_refit(refit, running.session):
        return
    if running.refit_bones is None:
        running.refit_bones = running.session.refit_bones(armature.read_rest_matrices(refit.data))
    state = (running.session.revision, b"")
    if running.written.get(-1) != state:
        armature.write_refit_pose(refit, running.session.refit_pose(running.refit_bones))
        running.written[-1] = state
