# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame of a rig that still is what it was when it was last looked at closely: read, play, write, nothing else.

Of a small character this takes longer than its deformation, and all that a frame asks Blender for is asked once.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from . import choosing, showing, skins
from .adapters import armature, positions
from .running import Running
from .session import Playback

Live = Sequence[tuple[int, bpy.types.Object, skins.Place]]  # skins, by their numbers, and where they are


def play(cage: bpy.types.Object, running: Running, depsgraph: bpy.types.Depsgraph, *, lasts: bool) -> None:
    """Cage, bones and settings as `depsgraph` has them, into the rig and from there into what shows it. `lasts`: what
    is shown is rendered or baked, so it waits for a method that is being prepared, and is the same in whatever order
    frames come.
    """
    settings, session = cage.cage_rig, running.session
    shown, bones = cage.evaluated_get(depsgraph), settings.armature.evaluated_get(depsgraph)
    if not (shown.is_evaluated and bones.is_evaluated):
        return  # in no view of this depsgraph: nothing of it is shown
    live = _places(cage, running, bones, depsgraph)
    _offset(running, live, cage, depsgraph)
    look = shown.cage_rig  # may be animated
    method = look.method.lower()
    if choosing.is_due(session, method):
        later = choosing.is_by_hand(cage) or choosing.progress(cage) is not None
        choosing.use(cage, session, method, later=later and not lasts)
    if settings.half_weights != session.half_weights:
        session.keep_half_weights(settings.half_weights)
    if lasts != session.reproducible:
        session.make_reproducible(lasts)
    playback = running.playback
    if playback is None:
        playback = running.playback = Playback(session, running.bones.core, running.refit_bones)
    _read_bones(running, playback, bones)
    _read_cage(running, playback, cage, shown.data)
    posed = settings.posed_cage
    fitted = showing.is_seen(posed, depsgraph)
    made = playback.play(look.influence, fitted=fitted, again=fitted and running.stale)
    running.stale = not fitted
    skins.feed(live, session, running.written)
    if fitted:
        _write_posed_cage(running, playback, posed, made=made)
    state = (session.revision, b"")
    if playback.refit_pose is not None and running.written.get(-1) != state:
        if showing.is_refit(settings.refit_armature, session):
            armature.write_refit_rows(settings.refit_armature, playback.refit_pose)
        running.written[-1] = state


def _places(cage: bpy.types.Object, running: Running, bones: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Live:
    """Skins that nobody has in Edit Mode, and where they are."""
    world, found = bones.matrix_world, []
    for index, skin in enumerate(cage.cage_rig.skins):
        obj = skin.object
        if obj.data.is_editmode:
            running.written.pop(index, None)
            continue
        place = running.places.get(index)
        if place is None or place.skin != obj.evaluated_get(depsgraph).matrix_world or place.bones != world:
            place = skins.place(cage, index, depsgraph, running.places)
        found.append((index, obj, place))
    return found


def _offset(running: Running, live: Live, cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
    """What moves the rest shape of the skins beside the cage: shape keys and their own moves."""
    session = running.session
    moved = [part for part in live if not part[2].still or part[1].data.shape_keys is not None]
    if not moved and not session.is_offset:
        return
    offsets = session.offsets
    for index, *_ in live:
        offsets[index] = None
    for index, obj, place in moved:
        offsets[index] = skins.offset(cage, index, obj, place, session, depsgraph)
    session.offset_skins(offsets)


def _read_bones(running: Running, playback: Playback, bones: bpy.types.Object) -> None:
    order = running.bones.pose_order
    if order is None:
        armature.read_pose_rows(bones, playback.bones)
    else:
        playback.bones[:] = armature.read_pose_matrices(bones)[order].transpose(0, 2, 1)


def _read_cage(running: Running, playback: Playback, cage: bpy.types.Object, shown: bpy.types.Mesh) -> None:
    """The rest cage as it is shown; or that which an edit of the posed cage wrote, where it is this to rounding."""
    editing = cage.data.is_editmode
    plain = not editing and running.cage_wanted is None and running.cage_to_rig is None
    if plain and positions.read_into(shown, playback.cage):
        running.cage = playback.cage
        return
    rest = positions.read_edit_mesh(cage.data) if editing else positions.read_base(shown)
    if running.cage_to_rig is not None:
        rest = positions.apply_matrix(running.cage_to_rig, rest)
    running.take_rest(rest)
    playback.cage[:] = running.wanted()


def _write_posed_cage(running: Running, playback: Playback, posed: bpy.types.Object, *, made: bool) -> None:
    """C′ where it was made anew, or differs from what the mesh holds."""
    mesh, fitted = posed.data, playback.posed_cage
    if mesh.is_editmode:
        running.posed = positions.read_edit_mesh(mesh)
        showing.write_posed_cage(running, posed)
        return
    if not made:
        running.posed = positions.read_base(mesh)
    if made or not positions.same(fitted, running.posed):
        positions.write_base(mesh, fitted)
        running.posed = playback.written_cage
        running.posed[:] = fitted
