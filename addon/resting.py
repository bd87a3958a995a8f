# SPDX-License-Identifier: GPL-3.0-or-later
"""What rests otherwise than when it was bound: bones that have exchanged their names are followed. Of edits that only a
Rebind takes over, and of an Armature modifier that was shown beside ours, the artist is told.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from . import binding, health
from .adapters import armature, modifier, positions, stack
from .running import Event, Running

NEAR = 1e-4  # of the size, and of a direction


def look(cage: bpy.types.Object, running: Running, event: Event, *, bones: bool) -> str:
    """What the artist should know, or an empty string. Skins are looked at when their mode has changed, `bones` when an
    armature has.
    """
    if bones or event is Event.RESTORED:
        running.bones_note = _bones(cage)
    modes = [obj.mode for _, obj in health.live_skins(cage)]
    if modes != running.modes or event is Event.RESTORED:
        running.modes, running.edited = modes, _edited(cage)
    return _twice(cage) or running.bones_note or running.edited


def _twice(cage: bpy.types.Object) -> str:
    if cage.cage_rig.state != "LIVE":
        return ""  # the modifiers of a rig that was paused are not as it has them
    for _, obj in health.live_skins(cage):
        shown = stack.shown_suspended(obj)
        if shown and modifier.is_shown(obj):
            return f"Modifier '{shown[0]}' of '{obj.name}' deforms it a second time; hide it, or press Unbind"
    return ""


def _edited(cage: bpy.types.Object) -> str:
    for index, obj in health.live_skins(cage):
        skin = cage.cage_rig.skins[index]
        same_count = skin.snapshot is not None and len(obj.data.vertices) == len(skin.snapshot.vertices) > 0
        if not same_count or obj.data.is_editmode or stack.deformed_before(obj):
            continue  # what modifiers before ours are given is taken over at once
        rest = binding.rest_points(cage.cage_rig, skin.snapshot)
        base = positions.apply_matrix(np.array(skin.skin_to_rig, np.float64), positions.read_base(obj.data))
        if not positions.close(base, rest, NEAR * float(np.linalg.norm(np.ptp(rest, axis=0)))):
            return f"The vertices of '{obj.name}' were moved since it was bound; press Rebind to take that over"
    return ""


def _bones(cage: bpy.types.Object) -> str:
    settings = cage.cage_rig
    obj = settings.armature
    if obj is None or obj.type != "ARMATURE" or obj.mode == "EDIT" or not len(settings.joints):
        return ""
    names = [joint.name for joint in settings.joints]
    rest = armature.read_rest(obj.data)
    place = {name: k for k, name in enumerate(rest.names)}
    if any(name not in place for name in names):
        return ""  # see health.follow_renames
    order = np.array([place[name] for name in names])
    heads, ways = _joints(settings)
    size = float(np.linalg.norm(np.ptp(np.concatenate([heads, heads + ways]), axis=0))) + 1e-30
    then, now = _marks(heads, ways, size), _marks(rest.heads, rest.tails - rest.heads, size)
    off = np.abs(now[order] - then).max(1) > NEAR
    if not off.any() or _exchange(settings, np.flatnonzero(off), rest.names, (then, now)):
        return ""
    moved = [joint.name for joint, is_off in zip(settings.joints, off, strict=True) if is_off and joint.weighted]
    if not moved:
        return ""
    return f"Bone '{moved[0]}' of '{obj.name}' rests otherwise than when it was bound; press Rebind to take that over"


def _exchange(
    settings: bpy.types.PropertyGroup,
    joints: NDArray[np.int64],
    names: list[str],
    marks: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> bool:
    """Give these joints the names of the bones that are where they were; returns whether there is one for each."""
    then, now = marks
    others = {joint.name for k, joint in enumerate(settings.joints) if k not in joints}
    free = [k for k, name in enumerate(names) if name not in others]
    found = [[k for k in free if np.abs(now[k] - then[joint]).max() <= NEAR] for joint in joints]
    if any(len(same) != 1 for same in found) or len({same[0] for same in found}) < len(found):
        return False
    for joint, (bone,) in zip(joints.tolist(), found, strict=True):
        settings.joints[joint].name = names[bone]
    return True


def _joints(settings: bpy.types.PropertyGroup) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the joints were bound, or refit to, and the way to their tails, each `#J by 3`."""
    found = {}
    for name in ("head", "tail", "shift"):
        values = np.empty(3 * len(settings.joints), np.float32)
        settings.joints.foreach_get(name, values)
        found[name] = values.reshape(-1, 3).astype(np.float64)
    return found["head"] + found["shift"], found["tail"] - found["head"]


def _marks(heads: NDArray[np.float64], ways: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Where bones are and how they point, `#J by 6`, for comparing."""
    lengths = np.linalg.norm(ways, axis=1, keepdims=True)
    return np.c_[heads / size, ways / np.maximum(lengths, 1e-30)]
