# SPDX-License-Identifier: GPL-3.0-or-later
"""One update of one rig: read Blender, decide which edit it was, ask the session, write back.

The door for handlers and operators. Sessions live here by the session uid of their rest cage and can be dropped at
any moment; they are rebuilt from the .blend.
"""

from __future__ import annotations

import bpy

from . import (
    applied,
    binding,
    choosing,
    glance,
    health,
    layers,
    linked,
    migration,
    placing,
    playing,
    posed_edits,
    registry,
    resting,
    showing,
    skins,
)
from .adapters import armature, modifier, positions, stack
from .running import Event, Matrix, Points, Running
from .session import Below, Bones, Session, SessionCrash, SessionError

_running: dict[int, Running] = {}
_busy = False
_restoring = False
_rendering = False
_baking = False
_again: set[registry.Key] = set()  # rest cages whose rigs need one more update
_stale: set[registry.Key] = set()  # rest cages whose posed cages are hidden and not fitted


def forget() -> None:
    """Drop every session: after loading a file, which ends renders, and when the add-on goes."""
    rendering(False)
    _running.clear()
    _stale.clear()
    choosing.forget()
    registry.forget()


def drop(cage: bpy.types.Object) -> None:
    """Drop one rig's session: its snapshot changed."""
    _running.pop(cage.session_uid, None)
    choosing.drop(cage)
    registry.forget()


def edited(depsgraph: bpy.types.Depsgraph) -> None:
    """After an update of the viewport: sync the rigs that it touched."""
    if _rendering and depsgraph.mode == "VIEWPORT":
        return
    event = Event.RESTORED if _restoring else Event.EDIT
    cages = registry.touched(depsgraph)
    due = _again | {key for key in _stale if _is_back(key)}
    if due:
        cages = [cage for cage in registry.rigs() if registry.key_of(cage) in due or cage in cages]
    _again.clear()
    for cage in cages:
        update(cage, depsgraph, event)


def frame_changed(depsgraph: bpy.types.Depsgraph) -> None:
    """After a frame change, in the viewport's depsgraph or a render's: sync every rig."""
    if _rendering and depsgraph.mode == "VIEWPORT":
        return
    _again.clear()
    if depsgraph.id_type_updated("ARMATURE"):
        for running in _running.values():
            running.seen = None  # bones may be other ones
    for cage in registry.rigs():
        update(cage, depsgraph, Event.FRAME)


def rendering(under_way: bool) -> None:
    """A render begins or ends. While it lasts its frames alone are synced: it runs in a thread of its own, and both
    would write to the same meshes.
    """
    global _rendering
    _rendering = under_way
    _again.clear()


def baking(under_way: bool) -> None:
    """A bake begins or ends: what is played meanwhile goes into files."""
    global _baking
    _baking = under_way


def _lasts(depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether what is shown in `depsgraph` is rendered or baked."""
    return _rendering or _baking or depsgraph.mode != "VIEWPORT"


def restoring() -> None:
    """Before undo and redo: the updates that Blender sends meanwhile are no edits."""
    global _restoring
    _restoring = True


def restored() -> None:
    """After undo, redo, load or a render: read everything again. Not while a render lasts, whose end comes here too."""
    global _restoring
    registry.forget()
    if _rendering:
        _restoring = False
        return
    depsgraph = bpy.context.evaluated_depsgraph_get()
    _restoring = False
    for cage in registry.rigs():
        update(cage, depsgraph, Event.RESTORED)


def start(cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph, session: Session) -> None:
    """After a bind: show the rig, which runs in the session that the bind computed."""
    drop(cage)
    _running[cage.session_uid] = Running.of(cage, session)
    update(cage, depsgraph, Event.RESTORED)


def refresh(cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
    """After an operator changed the rest cage: what is there is the truth, and no edit of the posed cage."""
    registry.forget()
    update(cage, depsgraph, Event.RESTORED)


def report(cage: bpy.types.Object) -> dict[str, object]:
    """What the bind of a running rig found; empty where it does not run."""
    running = _running.get(cage.session_uid)
    return {} if running is None else running.session.report


def refit_joints(cage: bpy.types.Object) -> Matrix:
    """Rest joints refit to the present rest cage, `#J by 3` in the armature's space. The rig must be live."""
    return _running[cage.session_uid].session.joints


def session_of(cage: bpy.types.Object) -> Session:
    """The session of a live rig as of its last update, for bakes to read from and not to edit."""
    return _running[cage.session_uid].session


def update(cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph, event: Event) -> None:
    """Sync one rig. Never raises: a rig that can't run is paused and says why."""
    global _busy
    if _busy:
        return
    _busy = True
    try:
        _update(cage, depsgraph, event)
    except SessionError as error:
        if isinstance(error, SessionCrash):
            _running.pop(cage.session_uid, None)
        _pause(cage, health.Problem(f"'{cage.name}': {error}", error.fix))
    except Exception as error:  # a handler must never raise, whatever the file holds
        _pause(cage, f"'{cage.name}' met an error in Cage Rig ({type(error).__name__}: {error}); please report it")
    finally:
        _busy = False


def _update(cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph, event: Event) -> None:
    running = _running.get(cage.session_uid)
    if event is Event.FRAME and running is not None and running.seen is not None and running.seen == glance.seen(cage):
        _play_on(cage, running, depsgraph)
        return
    if not _look_closely(cage, depsgraph, event):
        return
    source, bones = cage.evaluated_get(depsgraph), cage.cage_rig.armature.evaluated_get(depsgraph)
    if not (source.is_evaluated and bones.is_evaluated):
        return  # in no view of this depsgraph: nothing of it is shown
    if running is None or running.bind != binding.key(cage.cage_rig):  # an undo brings back another bind
        running = _running[cage.session_uid] = Running.of(cage, binding.bound_anew(cage))
        event = Event.RESTORED
    else:
        running.place(cage)
    if event is Event.RESTORED:
        running.written.clear()
        running.cage_wanted, running.memory = None, b""
    running.seen = running.playback = None
    if event is not Event.FRAME:
        running.note = resting.look(cage, running, event, bones=depsgraph.id_type_updated("ARMATURE"))
    note = _advance(cage, running, depsgraph, event)
    showing.write(cage, running, depsgraph)
    _note_stale(cage, running)
    _resume(cage, note, running)
    running.seen = glance.seen(cage) if glance.is_plain(cage) else None


def _play_on(cage: bpy.types.Object, running: Running, depsgraph: bpy.types.Depsgraph) -> None:
    """The next frame of a rig that is as it was."""
    was_stale = running.stale
    playing.play(cage, running, depsgraph, lasts=_lasts(depsgraph))
    if running.stale != was_stale:
        _note_stale(cage, running)
    if cage.cage_rig.message:
        _resume(cage, "", running)


def _note_stale(cage: bpy.types.Object, running: Running) -> None:
    if running.stale:
        _stale.add(registry.key_of(cage))
    else:
        _stale.discard(registry.key_of(cage))


def _look_closely(cage: bpy.types.Object, depsgraph: bpy.types.Depsgraph, event: Event) -> bool:
    """Whether the rig can run; where it can't it is paused, or nobody sees it."""
    if cage.library is not None and not cage.evaluated_get(depsgraph).is_evaluated:
        return False  # what a library override was made from
    trouble = migration.problem(cage)
    if trouble:
        _pause(cage, trouble)
        return False
    anew = cage.session_uid not in _running or cage.cage_rig.state == "PAUSED"
    if anew:
        migration.migrate(cage)
    if linked.adopt(cage):
        registry.forget()
        anew = True
    linked.own_posed_mesh(cage)
    applied.settle(cage)
    if event is not Event.FRAME and depsgraph.mode == "VIEWPORT":
        running = None if event is Event.RESTORED else _running.get(cage.session_uid)
        worlds = placing.settle(cage, depsgraph, running.worlds if running else b"")
        if running is not None:
            running.worlds = worlds
    for obj in layers.skins_of(cage):
        layers.settle(obj)
    trouble = health.problem(cage)
    if trouble:
        _pause(cage, trouble)
        return False
    if anew or depsgraph.id_type_updated("ARMATURE"):  # bones may have other parents
        layers.wait(cage)
    stack.let_suspended_rest([cage, *layers.skins_of(cage)])
    return True


def _advance(cage: bpy.types.Object, running: Running, depsgraph: bpy.types.Depsgraph, event: Event) -> str:
    """Read cage, posed cage and pose, and make the edit that they are. Returns a note for the panel."""
    session, settings = running.session, cage.cage_rig
    session.stand_on(_below(cage))
    shape = skins.read(cage, session, depsgraph, readable=registry.key_of(cage) not in _again)
    session.offset_skins(shape.offsets)
    session.mask_skins(shape.masks)
    if not shape.complete:
        _ask_again(cage)
    bones, pose = _read_pose(cage, running, depsgraph)
    shown = cage.evaluated_get(depsgraph).cage_rig  # both may be animated
    influence = float(shown.influence)
    later = event is Event.RESTORED or choosing.is_by_hand(cage) or choosing.progress(cage) is not None
    later &= not _lasts(depsgraph)
    choosing.use(cage, session, shown.method.lower(), later=later)
    session.keep_half_weights(settings.half_weights)
    session.make_reproducible(_lasts(depsgraph))
    rest = _read_rest_cage(cage, running, depsgraph)
    rest_changed = running.take_rest(rest)
    posed = _read_posed_cage(settings.posed_cage)
    if event is Event.RESTORED and settings.posed_cage.data.is_editmode:
        memory = positions.read_edit_layers(settings.posed_cage.data, binding.MEMORY)
        if memory is not None:
            running.cage, running.posed = rest, posed
            session.play_posed(memory[0], bones, pose, influence)
            return posed_edits.recall(cage, running, *memory)
    posed_changed = running.posed is None or not positions.same(posed, running.posed)
    is_edit = posed_changed and posed_edits.is_edit(cage, event, rest_changed)
    session.play_posed(running.wanted(), bones, pose, influence)
    before, running.posed = running.posed, posed
    if posed_changed and before is not None and placing.posed_has_stayed(cage, before, posed, depsgraph):
        is_edit, running.posed = False, None
    if is_edit and running.stale and before is not None:
        posed = session.posed_cage() + (posed - before)  # made on the shape of another pose
    return posed_edits.take(cage, running, posed) if is_edit else ""


def _below(cage: bpy.types.Object) -> Below | None:
    """The running rig that this one stands on, and which skins and joints they share."""
    lower = cage.cage_rig.input
    if lower is None:
        return None
    if lower.session_uid not in _running:
        raise SessionError(f"'{lower.name}', on which it stands, is not evaluated; show it in this view layer")
    return binding.below(cage, _running[lower.session_uid].session)


def _read_rest_cage(cage: bpy.types.Object, running: Running, depsgraph: bpy.types.Depsgraph) -> Points:
    if cage.data.is_editmode:
        points = positions.read_edit_mesh(cage.data)
    else:
        points = positions.read_evaluated(cage, depsgraph)
    return points if running.cage_to_rig is None else positions.apply_matrix(running.cage_to_rig, points)


def _read_posed_cage(posed: bpy.types.Object) -> Points:
    return positions.read_edit_mesh(posed.data) if posed.data.is_editmode else positions.read_base(posed.data)


def _read_pose(cage: bpy.types.Object, running: Running, depsgraph: bpy.types.Depsgraph) -> tuple[Bones, Matrix]:
    """The joints' bones at rest, and where they are in the evaluated pose (`#J by 4 by 4`)."""
    obj = cage.cage_rig.armature.evaluated_get(depsgraph)
    bones = running.bones = glance.read_bones(cage, obj, running.bones)
    posed = armature.read_pose_matrices(obj)
    if bones.pose_order is not None:
        posed = posed[bones.pose_order]
    return bones.core, posed


def _ask_again(cage: bpy.types.Object) -> None:
    """Have the rig updated once more after this evaluation: a handler can't evaluate."""
    _again.add(registry.key_of(cage))
    if not bpy.app.timers.is_registered(_tag_again):
        bpy.app.timers.register(_tag_again, first_interval=0.0)


def _tag_again() -> None:
    for key in _again:
        cage = registry.find(key)
        if cage is not None:
            cage.update_tag()


def _is_back(key: registry.Key) -> bool:
    """Whether the posed cage of this rig was hidden and is shown again."""
    cage = registry.find(key)
    posed = None if cage is None else cage.cage_rig.posed_cage
    return posed is not None and posed.visible_get()


def _pause(cage: bpy.types.Object, message: str) -> None:
    settings = cage.cage_rig
    if (settings.state, settings.message) == ("PAUSED", message):
        return
    settings.state, settings.message = "PAUSED", message
    settings.fix = getattr(message, "fix", "")
    for obj in layers.skins_of(cage):
        if obj.cage_rig.owner == cage:
            modifier.set_shown(obj, False)
            stack.show_suspended(obj, True)


def _resume(cage: bpy.types.Object, note: str, running: Running) -> None:
    settings = cage.cage_rig
    if settings.state != "LIVE":
        settings.state = "LIVE"
        for _, obj in health.live_skins(cage):
            stack.show_suspended(obj, False)
            modifier.set_shown(obj, True)
            if stack.reads_back(obj):
                _ask_again(cage)
    note = note or health.lost_skins(cage) or running.note
    if settings.message != note:
        settings.message = note
    if settings.fix:
        settings.fix = ""
