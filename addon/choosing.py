# SPDX-License-Identifier: GPL-3.0-or-later
"""Methods that the artist has chosen and that are still being prepared: the rig goes on with the one that it has.

The first use of centers of rotation integrates them, which takes seconds on a large mesh. What a person chooses in a
panel is prepared in a thread of the core's; a script, a render and Blender without a window wait for it. The file
holds the choice alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

from .session import Session

PATIENCE = 0.3  # seconds in which a choice is ready as if at once
INTERVAL = 0.1  # seconds from one look at the work to the next


@dataclass
class _Choice:
    session: Session
    name: str
    job: Any  # of the core; dropped, it is cancelled
    told: bool = False  # the rig was asked to take it


_by_hand: set[int] = set()  # session uids of rest cages whose method was chosen in a panel just now
_choices: dict[int, _Choice] = {}


def chosen(cage: bpy.types.Object, context: bpy.types.Context) -> None:
    """The method of a rig was set: remember it where a person did that, by a panel."""
    area = context.area
    if can_wait() and area is not None and area.type in {"VIEW_3D", "PROPERTIES"}:
        _by_hand.add(cage.session_uid)


def can_wait() -> bool:
    """Whether anybody sees a result that comes later."""
    return not bpy.app.background


def is_by_hand(cage: bpy.types.Object) -> bool:
    """Whether the rig's method was chosen by a person, and not yet used."""
    return cage.session_uid in _by_hand


def is_due(session: Session, name: str) -> bool:
    """Whether `use` has something to do for this rig, or for any."""
    return name != session.method or bool(_by_hand or _choices)


def use(cage: bpy.types.Object, session: Session, name: str, *, later: bool) -> None:
    """Let the session skin by this method: at once, or when it is ready where that takes long and may be `later`."""
    uid = cage.session_uid
    if name == session.method:
        drop(cage)
        return
    choice = _choices.get(uid)
    if choice is None or choice.session is not session or choice.name != name:
        drop(cage)
        if not (later and can_wait()):
            session.set_method(name)
            return
        choice = _choices[uid] = _Choice(session, name, session.start_method(name))
        ready = choice.job.wait(PATIENCE)
    else:
        ready = choice.job.done or not later
    if ready:
        drop(cage)
        session.take_method(choice.job)
    elif not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=INTERVAL)


def progress(cage: bpy.types.Object) -> tuple[float, str] | None:
    """How far the method that is being prepared is, 0 to 1, and the one that the rig has meanwhile."""
    choice = _choices.get(cage.session_uid)
    return None if choice is None else (choice.job.progress, choice.session.method.upper())


def cancel(cage: bpy.types.Object) -> None:
    """Prepare no more: the rig's method is again the one that it has."""
    choice = _choices.get(cage.session_uid)
    drop(cage)
    if choice is not None:
        cage.cage_rig.method = choice.session.method.upper()


def drop(cage: bpy.types.Object) -> None:
    """What was chosen for this rig is no longer wanted, or was taken."""
    _by_hand.discard(cage.session_uid)
    _choices.pop(cage.session_uid, None)


def forget() -> None:
    """Cancel everything: after loading a file, and when the add-on goes."""
    _by_hand.clear()
    _choices.clear()
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)


def _look() -> float | None:
    """Have rigs take what is ready, forget those that are gone, and draw the panels anew."""
    there = {obj.session_uid: obj for obj in bpy.data.objects if obj.users_collection and obj.cage_rig.state != "NONE"}
    for uid, choice in list(_choices.items()):
        if uid not in there:
            del _choices[uid]
        elif choice.job.done and not choice.told:
            choice.told = True
            there[uid].update_tag()
    _redraw()
    return INTERVAL if any(not choice.told for choice in _choices.values()) else None


def _redraw() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if region.type == "UI" or area.type == "PROPERTIES":
                    region.tag_redraw()
